"""What `edit`, `relight`, `invert` and the others take as keywords: the fields of their options, for type checkers.

`options.py` says what each means; a test compares the names and types. Sequences of numbers may be tuples, lists or
arrays here; the options make tuples of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

if TYPE_CHECKING:
    from materialist.types import Array, Lamp, Prediction, Prior


class MaterialKeywords(TypedDict, total=False):
    """Fields of `options.MaterialEdit`."""

    hue: float
    saturation: float
    value: float
    albedo: Sequence[float] | str | None
    texture: Array | str | Path | None
    texture_scale: float
    roughness: float | str | None
    metallic: float | str | None
    grow: float
    feather: float


class RemovalKeywords(TypedDict, total=False):
    """Fields of `options.Removal`."""

    background: Array | str | Path | None
    inpaint: str | Callable[[Array, Array], Array] | None
    shadow: float | None
    grow: float
    seed: int
    device: str


class GlassKeywords(RemovalKeywords, total=False):
    """Fields of `options.Glass`."""

    ior: float
    transmission: float
    tint: Sequence[float] | str
    roughness: float
    hollow: bool | str
    model: str
    back: str
    thickness: Array | str | Path


class RelightKeywords(TypedDict, total=False):
    """Fields of `options.Relight`."""

    dim: float | None
    lights: Array | None
    envmap: Array | str | Path | None
    gain: float | str | None
    rotate: float | Sequence[float]
    sun: Sequence[float] | None
    sun_power: float
    ambient: float
    lamps: Sequence[Lamp | Sequence[float]]


class InsertionKeywords(TypedDict, total=False):
    """Fields of `options.Insertion`."""

    scale: float
    turn: float
    material: str | Sequence[float]
    size: float | None
    up: str


class DropKeywords(TypedDict, total=False):
    """Fields of `options.Drop`."""

    height: float
    spin: float
    scale: float
    material: str | Sequence[float]
    gravity: Sequence[float] | None
    metres: float
    seed: int
    up: str


class InvertKeywords(TypedDict, total=False):
    """Fields of `options.InvertOptions`."""

    predictor: str
    albedo: str | None
    roughness: str | None
    metallic: str | None
    normal: str | None
    depth: str | None
    engine: str
    preset: str
    steps: int | None
    fov: float | str
    size: int
    layer: str | None
    envmap_size: Sequence[int]
    completion: str
    tau: float
    mask: Array | str | Path | None
    strategy: str
    seed: int
    device: str
    settings: Any
    prior: Prediction | Prior | None
    spp: int | None


class ExportKeywords(TypedDict, total=False):
    """Fields of `options.ExportOptions`."""

    to: str | None
    max_triangles: int | None
    blender: str | None
    residual: bool
    shadow_catcher: bool
    fitted_material: bool


class BatchKeywords(InvertKeywords, total=False):
    """Fields of `batches.options.BatchOptions`, beside those of `InvertOptions`."""

    apply: str | Path | None
    format: str
    quality: int | None
    workers: int | None
    ray: str | None
    resume: bool
    force: bool
    function: str
