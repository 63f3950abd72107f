"""An object taken away: its options."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from materialist.option_kinds import OperationOptions, option
from materialist.options import DEVICE, SEED

if TYPE_CHECKING:
    from materialist.types import Array


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
    """Or a function (photo [H, W, 3] linear, hole [H, W] bool) -> [H, W, 3] linear; None is MI-GAN."""
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
    seed: int = option(0, "Of a diffusion model.", **SEED)
    device: str = option("auto", "Where a diffusion model runs.", **DEVICE)

    def __post_init__(self) -> None:
        super().__post_init__()
        if str(self.shadow) == "auto":
            object.__setattr__(self, "shadow", None)


class RemovalKeywords(TypedDict, total=False):
    """Fields of `Removal`, for type checkers."""

    background: Array | str | Path | None
    inpaint: str | Callable[[Array, Array], Array] | None
    shadow: float | None
    grow: float
    seed: int
    device: str
