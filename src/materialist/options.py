"""The options of inversions and exports, and what the options of edits share (those lie beside each edit).

A new option is one field here and its use; flags, YAML keys, types, ranges and help follow from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from materialist.option_kinds import OperationOptions, option

if TYPE_CHECKING:
    from materialist.types import Array, Prediction, Prior

SHARE: dict[str, Any] = {"low": 0, "high": 1}
SEED: dict[str, Any] = {"kind": "whole", "low": 0, "high": 2**31 - 1, "flag": None}
DEVICE: dict[str, Any] = {
    "kind": "word",
    "choices": ("auto", "cpu", "cuda"),
    "flag": None,
    "written": False,
}
_PREDICTOR: dict[str, Any] = {"kind": "name", "metavar": "PREDICTOR"}

TAU = 6.0
"""Grazing angle below which the surface is cut, degrees (paper, tau)."""
PATHS = 16
"""Paths a pixel of final pictures, denoised; twice as many score the same (`bench photo-alone`)."""


@dataclass(frozen=True, kw_only=True)
class InvertOptions(OperationOptions):
    """How a photo is decomposed into geometry, materials and light."""

    operation = "invert"
    predictor: str = option(
        "auto",
        "auto, bundled[:FILE], matnet[:FILE], marigold, maps:DIR or constant; for every map not named below.",
        kind="name",
        flag="--predictor --rest",
    )
    albedo: str | None = option(None, "Where the albedo comes from.", **_PREDICTOR)
    roughness: str | None = option(None, "Where the roughness comes from.", **_PREDICTOR)
    metallic: str | None = option(None, "Where the metallic comes from.", **_PREDICTOR)
    normal: str | None = option(None, "Where the normals come from (also moge:DIR).", **_PREDICTOR)
    depth: str | None = option(
        None, "Where the depth comes from (also depth-anything, moge:DIR).", **_PREDICTOR
    )
    # How it is fitted.
    engine: str = option(
        "transport",
        "Cached light transport, or the paper's path tracing.",
        kind="word",
        choices=("transport", "path"),
    )
    preset: str = option(
        "default",
        "Our schedule, or the paper's.",
        kind="word",
        choices=("default", "paper"),
    )
    """The path engine always follows the paper."""
    steps: int | None = option(
        None, "At most this many steps in each stage of the fit.", kind="whole", low=1, metavar="N"
    )
    # How the photo is read.
    fov: float | str = option(
        "auto",
        "Horizontal field of view in degrees, or auto: EXIF, else 35.",
        low=1,
        high=170,
        ends="()",
        unit="degrees",
        choices=("auto",),
        called="field of view",
        metavar="TEXT",
    )
    """`auto`: from the predictor of the depth where it knows one (MoGe), else from EXIF, else 35."""
    size: int = option(
        512,
        "Working size: longer side, pixels.",
        kind="whole",
        low=8,
        high=8192,
        called="working size",
        unit="pixels",
    )
    """Of the working picture; a Photo keeps the size that it was read at."""
    layer: str | None = option(
        None,
        "Which layer or part of an EXR is the photo; else chosen by their names.",
        kind="name",
        metavar="NAME",
    )
    """A Photo keeps the layer that it was read with."""
    # The scene around.
    envmap_size: tuple[int, int] = option(
        (512, 256), "Size of the environment map.", kind="size", metavar="WxH"
    )
    """(width, height), with width = 2 * height."""
    completion: str = option(
        "auto",
        "Continue planes beyond what is seen: floors, walls as well (planes), or none; auto: floors, with "
        "the paper's preset none.",
        kind="word",
        choices=("auto", "planes", "floors", "none"),
    )
    """`floors` continues planes behind what the photo shows, and floors and table tops beyond the frame; `planes` walls
    and ceilings as well, `none` adds nothing."""
    tau: float = option(
        TAU,
        "Grazing angle below which the surface is cut, degrees.",
        low=0,
        high=90,
        ends="()",
        unit="degrees",
    )
    mask: Array | str | Path | None = option(
        None, "Region with one roughness and metallic.", kind="file", metavar="PNG"
    )
    """[H, W] bool at working size, or a file."""
    strategy: str = option(
        "default",
        "The paper's per-image strategies.",
        kind="word",
        choices=("default", "white-light-first"),
    )
    seed: int = option(0, "Equal seeds give equal scenes on one machine.", **SEED)
    device: str = option("auto", "Where to compute.", **DEVICE)
    # In Python alone.
    settings: Any = option(None, "FitSettings in place of the preset.", kind="any", flag=None)
    prior: Prediction | Prior | None = option(
        None,
        "Maps that are known: a Prior of some, the predictor gives the others; or a whole Prediction.",
        kind="any",
        flag=None,
    )
    spp: int | None = option(
        None, "Paths a pixel of the final re-rendering.", kind="whole", low=1, flag=None
    )


@dataclass(frozen=True, kw_only=True)
class ExportOptions(OperationOptions):
    """How a scene is written for another program."""

    operation = "export"
    to: str | None = option(
        None,
        "Format; else that of the suffix.",
        kind="word",
        choices=("glb", "blend", "usd", "mitsuba", "html"),
        called="format",
    )
    max_triangles: int | None = option(
        None,
        "Coarser mesh of at most N triangles; html: 60000 unless given.",
        kind="whole",
        low=100,
        called="number of triangles",
        metavar="N",
    )
    blender: str | None = option(
        None,
        "blend: the blender program, or a Python that has bpy; else it is looked for.",
        kind="name",
        metavar="PROGRAM",
    )
    residual: bool = option(
        True,
        "Put what the fit leaves of the photo into base colour and metallic, so that renders look like it.",
        kind="switch",
        flag="--residual/--no-residual",
    )
    """Without it the maps are the fitted ones. The page of HTML has those anyway."""
    shadow_catcher: bool = option(
        False, "blend: show the photo, with the scene to catch shadows on it.", kind="switch"
    )
    fitted_material: bool = option(
        False, "blend: the material model of the fit, not Blender's Principled.", kind="switch"
    )
