"""Meshes put into the photo: their options."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypedDict

from materialist.option_kinds import OperationOptions, option

PAINT: dict[str, Any] = {"kind": "paint", "choices": ("as-is", "glass", "mirror")}
UP: dict[str, Any] = {
    "kind": "word",
    "choices": ("auto", "y", "z"),
    "called": "axis that points up",
}
SCALE: dict[str, Any] = {"low": 0, "high": 1e3, "ends": "(]"}


@dataclass(frozen=True, kw_only=True)
class Insertion(OperationOptions):
    """How a mesh is put into the photo."""

    operation = "insert"
    scale: float = option(
        1.0, "Factor on its size; 1 is a sixth of the picture's width there.", **SCALE
    )
    turn: float = option(0.0, "Turn about its up axis.", unit="degrees", metavar="DEG")
    material: str = option("as-is", "as-is, glass, mirror, R,G,B (linear) or #rrggbb.", **PAINT)
    size: float | None = option(
        None, "Its longest side in scene units, in place of the sixth.", low=0, high=1e9, ends="(]"
    )
    up: str = option("auto", "Axis of the file that points up: y, z; auto: z for STL.", **UP)


class InsertionKeywords(TypedDict, total=False):
    """Fields of `Insertion`, for type checkers."""

    scale: float
    turn: float
    material: str | Sequence[float]
    size: float | None
    up: str
