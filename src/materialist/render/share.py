"""A share of the camera rays of a picture, for a rendering in two rounds (`split.trace`)."""

from __future__ import annotations

from dataclasses import dataclass

from materialist.types import Array


@dataclass(frozen=True)
class Share:
    """A share of a picture's camera rays; shares of one `every` together are all of them, stratified as ever."""

    every: int
    """The 0th, every-th, ... ray of each pixel, at least 2."""
    rest: bool = False
    """The others instead."""
    pixels: Array | None = None
    """[n] row-major indices of the pixels that are traced; None for all."""

    def rays(self, spp: int) -> int:
        """How many of `spp` rays of a pixel that is."""
        first = -(-spp // self.every)
        return spp - first if self.rest else first
