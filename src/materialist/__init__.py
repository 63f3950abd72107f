"""Materialist: physically based editing of a single photograph.

    import materialist as mt

    scene = mt.invert("kitchen.jpg")
    mt.save_scene(scene, "kitchen.scene")

Everything public is named here and loaded on first use, so that `import materialist` stays quick.
"""

from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

# Torch's OpenMP threads otherwise spin while they wait, and take the processors from whatever runs beside them. OpenMP
# reads this when torch is loaded; a choice of the user's own stays.
os.environ.setdefault("OMP_WAIT_POLICY", "PASSIVE")

_HOME = {
    "invert": "pipeline",
    "render_scene": "pipeline",
    "read_photo": "io.photo",
    "save_scene": "io.package",
    "load_scene": "io.package",
    "export": "exporters.run",
    "select": "edits.select.select",
    "edit": "edits.material.material",
    "relight": "edits.light.relight",
    "lamp": "edits.light.relight",
    "insert": "edits.insert.insert",
    "glass": "edits.glass.glass",
    "remove": "edits.remove.remove",
    "drop": "edits.drop.drop",
    "settle": "edits.drop.drop",
    "composite": "edits.composite.composite",
    "batch": "batches.run",
    **dict.fromkeys(["Drop", "Glass", "Insertion", "InvertOptions", "MaterialEdit", "Relight", "Removal"], "options"),
    **dict.fromkeys(["Body", "Camera", "FitReport", "Geometry", "Lamp", "Materials", "Mesh", "Photo"], "types"),
    **dict.fromkeys(["Prediction", "Scene", "Surface"], "types"),
    **dict.fromkeys(
        ["InputError", "MaterialistError", "OutputError", "SceneError", "SetupError", "WeightsError"], "errors"
    ),
}
"""Public name -> module that defines it."""

__all__ = ["__version__", *sorted(_HOME)]

if TYPE_CHECKING:
    from materialist.batches.run import batch as batch
    from materialist.edits.composite.composite import composite as composite
    from materialist.edits.drop.drop import drop as drop
    from materialist.edits.drop.drop import settle as settle
    from materialist.edits.glass.glass import glass as glass
    from materialist.edits.insert.insert import insert as insert
    from materialist.edits.light.relight import lamp as lamp
    from materialist.edits.light.relight import relight as relight
    from materialist.edits.material.material import edit as edit
    from materialist.edits.remove.remove import remove as remove
    from materialist.edits.select.select import select as select
    from materialist.errors import InputError as InputError
    from materialist.errors import MaterialistError as MaterialistError
    from materialist.errors import OutputError as OutputError
    from materialist.errors import SceneError as SceneError
    from materialist.errors import SetupError as SetupError
    from materialist.errors import WeightsError as WeightsError
    from materialist.exporters.run import export as export
    from materialist.io.package import load_scene as load_scene
    from materialist.io.package import save_scene as save_scene
    from materialist.io.photo import read_photo as read_photo
    from materialist.options import Drop as Drop
    from materialist.options import Glass as Glass
    from materialist.options import Insertion as Insertion
    from materialist.options import InvertOptions as InvertOptions
    from materialist.options import MaterialEdit as MaterialEdit
    from materialist.options import Relight as Relight
    from materialist.options import Removal as Removal
    from materialist.pipeline import invert as invert
    from materialist.pipeline import render_scene as render_scene
    from materialist.types import Body as Body
    from materialist.types import Camera as Camera
    from materialist.types import FitReport as FitReport
    from materialist.types import Geometry as Geometry
    from materialist.types import Lamp as Lamp
    from materialist.types import Materials as Materials
    from materialist.types import Mesh as Mesh
    from materialist.types import Photo as Photo
    from materialist.types import Prediction as Prediction
    from materialist.types import Scene as Scene
    from materialist.types import Surface as Surface


def __getattr__(name: str) -> Any:
    """Load a public name on first use (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module 'materialist' has no attribute {name!r}")
    value = getattr(import_module(f"materialist.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
