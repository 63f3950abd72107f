"""Other light: its options."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from materialist.option_kinds import OperationOptions, option

if TYPE_CHECKING:
    from materialist.types import Array, Lamp


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


class RelightKeywords(TypedDict, total=False):
    """Fields of `Relight`, for type checkers."""

    dim: float | None
    lights: Array | None
    envmap: Array | str | Path | None
    gain: float | str | None
    rotate: float | Sequence[float]
    sun: Sequence[float] | None
    sun_power: float
    ambient: float
    lamps: Sequence[Lamp | Sequence[float]]
