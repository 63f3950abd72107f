"""Meshes that fall: their options."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict

from materialist.edits.insert.options import PAINT, SCALE, UP
from materialist.option_kinds import OperationOptions, option
from materialist.options import SEED


@dataclass(frozen=True, kw_only=True)
class Drop(OperationOptions):
    """How meshes fall."""

    operation = "drop"
    height: float = option(1.5, "Over the ground, in longest sides.", low=0, high=100)
    spin: float = option(
        0.3, "Turns per second about an axis that the seed chooses.", low=-20, high=20
    )
    scale: float = option(
        1.0, "Factor on the size; 1 is a sixth of the picture's width there.", **SCALE
    )
    material: str = option("as-is", "as-is, glass, mirror, R,G,B (linear) or #rrggbb.", **PAINT)
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
    seed: int = option(0, "Of the axes that things spin about.", **SEED)
    up: str = option("auto", "Axis of the files that points up: y, z; auto: z for STL.", **UP)


class DropKeywords(TypedDict, total=False):
    """Fields of `Drop`, for type checkers."""

    height: float
    spin: float
    scale: float
    material: str | Sequence[float]
    gravity: Sequence[float] | None
    metres: float
    seed: int
    up: str
