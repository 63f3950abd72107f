"""The options of each operation, declared once for Python, the command line, `edits.yaml` and the studio.

A new option is one field here and its use in the operation; flags, YAML keys, types, ranges and help follow from it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from materialist.errors import InputError
from materialist.option_kinds import Colour, OperationOptions, option

if TYPE_CHECKING:
    from materialist.types import Array, Lamp, Prediction, Prior

_SHARE: dict[str, Any] = {"low": 0, "high": 1}
_SEED: dict[str, Any] = {"kind": "whole", "low": 0, "high": 2**31 - 1, "flag": None}
_DEVICE: dict[str, Any] = {
    "kind": "word",
    "choices": ("auto", "cpu", "cuda"),
    "flag": None,
    "written": False,
}
_SHIFT: dict[str, Any] = {"kind": "shift", **_SHARE, "metavar": "V|±D"}
_PAINT: dict[str, Any] = {"kind": "paint", "choices": ("as-is", "glass", "mirror")}
_UP: dict[str, Any] = {
    "kind": "word",
    "choices": ("auto", "y", "z"),
    "called": "axis that points up",
}
_SCALE: dict[str, Any] = {"low": 0, "high": 1e3, "ends": "(]"}
_PREDICTOR: dict[str, Any] = {"kind": "name", "metavar": "PREDICTOR"}

PATHS = 16
"""Paths a pixel of final pictures, denoised; twice as many score the same (`bench photo-alone`)."""


@dataclass(frozen=True, kw_only=True)
class MaterialEdit(OperationOptions):
    """Another material inside a region."""

    operation = "edit"
    # The colour: moved, or replaced by one colour or a texture.
    hue: float = option(
        0.0, "Turn the albedo's hue, degrees.", low=-3600, high=3600, unit="degrees"
    )
    saturation: float = option(0.0, "-1 (grey) to 1.", low=-1, high=1)
    value: float = option(0.0, "-1 (black) to 1 (white).", low=-1, high=1)
    albedo: Colour | str | None = option(
        None, "One linear colour, or #rrggbb in sRGB.", kind="colour", metavar="R,G,B"
    )
    texture: Array | str | Path | None = option(
        None, "A picture laid on the surface.", kind="file", metavar="PNG"
    )
    """[h, w, 3] linear, or a file."""
    texture_scale: float = option(
        1.0, "Its size; 1 covers the region once.", low=0, high=100, ends="(]", needs="texture"
    )
    # The other maps.
    roughness: float | str | None = option(None, "Set to V, or shift by +D or -D.", **_SHIFT)
    metallic: float | str | None = option(None, "The same for metallic.", **_SHIFT)
    # The region.
    grow: float = option(
        0.0,
        "Grow the region, or shrink it (below 0), by this share of the picture's longer side.",
        low=-0.2,
        high=0.2,
    )
    feather: float = option(
        0.0, "Width of its soft border, share of the longer side.", low=0, high=0.2
    )


@dataclass(frozen=True, kw_only=True)
class Removal(OperationOptions):
    """An object taken away, and what fills its place."""

    operation = "remove"
    # What fills the place.
    background: Array | str | Path | None = option(
        None,
        "The same view without the object, in place of inpainting.",
        kind="file",
        metavar="PNG",
    )
    """[h, w, 3] linear at working or native size and the exposure of the photo, or a file of the photo's aspect."""
    inpaint: str | Callable[[Array, Array], Array] | None = option(
        None, "A diffusion model: a folder, or owner/name.", kind="name", metavar="sd:MODEL"
    )
    """Or a function (photo [H, W, 3] linear, hole [H, W] bool) -> [H, W, 3] linear; None copies patches."""
    # How far around the object.
    shadow: float | None = option(
        None,
        "How far its shadow and reflection on the ground are filled, too, share of its size; auto: 0.15.",
        low=0,
        high=2,
        choices=("auto",),
        metavar="auto|S",
    )
    """None and `auto` are 0.15."""
    grow: float = option(
        0.01,
        "Rim of the object that is filled as well, share of the picture's longer side.",
        low=0,
        high=0.2,
        called="rim",
        flag=None,
    )
    seed: int = option(0, "Of the patch search.", **_SEED)
    device: str = option("auto", "Where a diffusion model runs.", **_DEVICE)

    def __post_init__(self) -> None:
        super().__post_init__()
        if str(self.shadow) == "auto":
            object.__setattr__(self, "shadow", None)


@dataclass(frozen=True, kw_only=True)
class Glass(Removal):
    """An object turned to glass, before what it hid."""

    operation = "glass"
    # The material.
    ior: float = option(
        1.5,
        "Index of refraction, 1 to 3: water 1.33, glass 1.5.",
        low=1,
        high=3,
        called="index of refraction",
        hint="(water 1.33, glass 1.5, diamond 2.4)",
    )
    transmission: float = option(
        1.0, "Share of light that enters; the rest is the old surface.", **_SHARE
    )
    tint: Colour = option(
        (1.0, 1.0, 1.0), "Its colour, linear, or #rrggbb.", kind="colour", metavar="R,G,B"
    )
    """Of white light after a way in and a way out."""
    roughness: float = option(0.0, "0 is clear, 0.3 frosted.", **_SHARE)
    # The body.
    hollow: bool | str = option(False, "A wall around air.", kind="switch", choices=("open",))
    """`open`: and without a lid, for what is a surface of revolution."""
    # How it is rendered.
    model: str = option(
        "closed",
        "closed: path-traced; two-interface: as in the paper.",
        kind="word",
        choices=("closed", "two-interface"),
    )
    back: str = option(
        "found",
        "two-interface: the normals of the back that was found, or the same as the front's, as in the paper.",
        kind="word",
        choices=("found", "same"),
    )
    thickness: Array | str | Path = option(
        "auto",
        "How thick it is; a file has scene units.",
        kind="file",
        choices=("auto", "network", "symmetry"),
        metavar="auto|network|symmetry|FILE",
    )
    """One of the methods, or [H, W] along the camera rays, or a file of that."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.back == "same" and self.model == "closed":
            raise InputError(
                "The back is 'same', which only the two-interface model knows; take that model, too."
            )


@dataclass(frozen=True, kw_only=True)
class Relight(OperationOptions):
    """Other light; the changes happen in the order of the fields."""

    operation = "relight"
    dim: float | None = option(
        None,
        "Factor on windows and lamps that the photo shows; they stay put.",
        low=0,
        high=10,
        called="dimming",
        hint="(1 for as it is, 0 for off)",
    )
    lights: Array | None = option(
        None, "The lights that `dim` means.", kind="any", flag=None, written=False
    )
    """[H, W] bool at working size; None takes those that are found."""
    # The light from around.
    envmap: Array | str | Path | None = option(
        None, "Another light: EXR or HDR, 2:1.", kind="file", metavar="FILE"
    )
    """[h, 2h, 3] linear radiance >= 0 in the project's convention, or a file."""
    gain: float | str | None = option(
        None,
        "Factor on it; auto keeps the photo's mean light.",
        low=0,
        high=1e6,
        ends="(]",
        choices=("auto",),
        needs="envmap",
        metavar="auto|G",
    )
    """None: `auto` for a file, whose exposure is not known, and 1 for an array."""
    rotate: float | tuple[float, float] = option(
        0.0,
        "Turn the light to the right; a film's from A to B.",
        kind="span",
        called="rotation",
        unit="degrees",
        metavar="DEG|A..B",
    )
    # Lights that are added.
    sun: tuple[float, float] | None = option(
        None,
        "A sun: degrees right of ahead, and above the horizon.",
        kind="numbers",
        count=2,
        metavar="AZ,EL",
    )
    sun_power: float = option(
        1.0,
        "Its strength; 1 shows clear shadows and keeps the brightness.",
        low=0,
        high=1e4,
        needs="sun",
    )
    ambient: float = option(1.0, "Factor on the light that was there.", low=0, high=1e4)
    lamps: tuple[Lamp | tuple[float, float, float, float, float], ...] = option(
        (),
        "A lamp at a pixel and depth.",
        kind="lamp",
        many=True,
        called="lamp",
        flag="--lamp",
        metavar="X,Y,DEPTH,KELVIN,POWER",
    )
    """What `materialist.lamp` makes, or its arguments."""


@dataclass(frozen=True, kw_only=True)
class Insertion(OperationOptions):
    """How a mesh is put into the photo."""

    operation = "insert"
    scale: float = option(
        1.0, "Factor on its size; 1 is a sixth of the picture's width there.", **_SCALE
    )
    turn: float = option(0.0, "Turn about its up axis.", unit="degrees", metavar="DEG")
    material: str = option("as-is", "as-is, glass, mirror, R,G,B (linear) or #rrggbb.", **_PAINT)
    size: float | None = option(
        None, "Its longest side in scene units, in place of the sixth.", low=0, high=1e9, ends="(]"
    )
    up: str = option("auto", "Axis of the file that points up: y, z; auto: z for STL.", **_UP)


@dataclass(frozen=True, kw_only=True)
class Drop(OperationOptions):
    """How meshes fall."""

    operation = "drop"
    height: float = option(1.5, "Over the ground, in longest sides.", low=0, high=100)
    spin: float = option(
        0.3, "Turns per second about an axis that the seed chooses.", low=-20, high=20
    )
    scale: float = option(
        1.0, "Factor on the size; 1 is a sixth of the picture's width there.", **_SCALE
    )
    material: str = option("as-is", "as-is, glass, mirror, R,G,B (linear) or #rrggbb.", **_PAINT)
    gravity: tuple[float, float, float] | None = option(
        None,
        "Its direction in the camera frame: X right, Y up, Z back.",
        kind="numbers",
        count=3,
        metavar="X,Y,Z",
    )
    metres: float = option(
        0.2, "What the longest side is taken for; small things fall fast.", low=1e-3, high=100
    )
    seed: int = option(0, "Of the axes that things spin about.", **_SEED)
    up: str = option("auto", "Axis of the files that points up: y, z; auto: z for STL.", **_UP)


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
        6.0,
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
    seed: int = option(0, "Equal seeds give equal scenes on one machine.", **_SEED)
    device: str = option("auto", "Where to compute.", **_DEVICE)
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
