"""An object turned to glass: its options."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from materialist.edits.remove.options import Removal, RemovalKeywords
from materialist.errors import InputError
from materialist.option_kinds import Colour, option
from materialist.options import SHARE

if TYPE_CHECKING:
    from materialist.types import Array


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
        1.0, "Share of light that enters; the rest is the old surface.", **SHARE
    )
    tint: Colour = option(
        (1.0, 1.0, 1.0), "Its colour, linear, or #rrggbb.", kind="colour", metavar="R,G,B"
    )
    """Of white light after a way in and a way out."""
    roughness: float = option(0.0, "0 is clear, 0.3 frosted.", **SHARE)
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
        choices=("auto", "outline", "network", "symmetry"),
        metavar="auto|outline|network|symmetry|FILE",
    )
    """One of the methods, or [H, W] along the camera rays, or a file of that."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.back == "same" and self.model == "closed":
            raise InputError(
                "The back is 'same', which only the two-interface model knows; take that model, too."
            )

    @property
    def only_in_photo(self) -> bool:
        return self.model == "two-interface"


class GlassKeywords(RemovalKeywords, total=False):
    """Fields of `Glass`, for type checkers."""

    ior: float
    transmission: float
    tint: Sequence[float] | str
    roughness: float
    hollow: bool | str
    model: str
    back: str
    thickness: Array | str | Path
