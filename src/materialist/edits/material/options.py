"""Another material inside a region: its options."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

from materialist.option_kinds import Colour, OperationOptions, option
from materialist.options import SHARE

if TYPE_CHECKING:
    from materialist.types import Array

SHIFT: dict[str, Any] = {"kind": "shift", **SHARE, "metavar": "V|±D"}


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
    texture_turn: float = option(
        0.0,
        "Turn it clockwise in its plane, degrees.",
        low=-3600,
        high=3600,
        unit="degrees",
        needs="texture",
    )
    detail: float = option(
        1.0, "How much of the photo's fine shading a new colour or texture keeps.", low=0, high=1
    )
    # The other maps.
    roughness: float | str | None = option(None, "Set to V, or shift by +D or -D.", **SHIFT)
    metallic: float | str | None = option(None, "The same for metallic.", **SHIFT)
    normals: str = option(
        "auto",
        "Of metal; auto: of a round body by its outline, else smooth where the photo is; maps: as they are.",
        kind="word",
        choices=("auto", "maps"),
    )
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


class MaterialKeywords(TypedDict, total=False):
    """Fields of `MaterialEdit`, for type checkers."""

    hue: float
    saturation: float
    value: float
    albedo: Sequence[float] | str | None
    texture: Array | str | Path | None
    texture_scale: float
    texture_turn: float
    detail: float
    roughness: float | str | None
    metallic: float | str | None
    normals: str
    grow: float
    feather: float
