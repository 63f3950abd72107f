"""What `invert`, `export` and `batch` take as keywords: the fields of their options, for type checkers.

`options.py` says what each means; a test compares the names. Sequences of numbers may be tuples, lists or arrays
here; the options make tuples of them. Those of edits lie beside their options.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

if TYPE_CHECKING:
    from materialist.types import Array, Prediction, Prior


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
