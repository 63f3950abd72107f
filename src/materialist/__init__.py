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

__all__ = [
    "Body", "Camera", "Drop", "FitReport", "Geometry", "Glass", "InputError", "Insertion", "InvertOptions", "Lamp",
    "MaterialEdit", "MaterialistError", "Materials", "Mesh", "OutputError", "Photo", "Prediction", "Relight",
    "Removal", "Scene", "SceneError", "SetupError", "Surface", "WeightsError", "__version__", "batch", "composite",
    "drop", "edit", "export", "glass", "insert", "invert", "lamp", "load_scene", "read_photo", "relight", "remove",
    "render_scene", "save_scene", "select", "settle",
]  # fmt: skip

if TYPE_CHECKING:
    from materialist.batches.run import batch
    from materialist.edits.composite.composite import composite
    from materialist.edits.drop.drop import drop, settle
    from materialist.edits.glass.glass import glass
    from materialist.edits.insert.insert import insert
    from materialist.edits.light.relight import lamp, relight
    from materialist.edits.material.material import edit
    from materialist.edits.remove.remove import remove
    from materialist.edits.select.select import select
    from materialist.errors import InputError, MaterialistError, OutputError, SceneError, SetupError, WeightsError
    from materialist.exporters.run import export
    from materialist.io.package import load_scene, save_scene
    from materialist.io.photo import read_photo
    from materialist.options import Drop, Glass, Insertion, InvertOptions, MaterialEdit, Relight, Removal
    from materialist.pipeline import invert, render_scene
    from materialist.types import (
        Body,
        Camera,
        FitReport,
        Geometry,
        Lamp,
        Materials,
        Mesh,
        Photo,
        Prediction,
        Scene,
        Surface,
    )  # fmt: skip


def __getattr__(name: str) -> Any:
    """Load a public name on first use (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module 'materialist' has no attribute {name!r}")
    value = getattr(import_module(f"materialist.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
