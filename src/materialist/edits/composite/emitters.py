"""In-photo emitters in the composite."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.edits.composite.upsample import matte, window
from materialist.types import Array, Photo


@dataclass(frozen=True)
class DimmingSettings:
    """Where the photo is a lower bound of an emitter's radiance."""

    clipped: float = 0.97
    """Least channel of a linear photo from which a pixel is clipped (derived: 8 bits)."""
    nearly: float = 0.9
    """Least channel from which a pixel may be brighter than it looks (tuned by eye)."""


DEFAULT = DimmingSettings()


def in_photo(picture: Array, photo: Photo, seen: Array, found: dict, before: Array | None = None) -> Array:
    """[H0, W0, 3] a composite in which emitters show the photo itself, dimmed: with the trees in the window.

    Clipped pixels have the estimated radiance of the emitters.

    Args:
        seen: [H, W] bool: where lights are seen. found: `core.emitters.KEY` of the provenance.
        before: [H0, W0] share of new bodies, which stand before the lights.
    """
    dim = float(found["dim"])
    if dim == 1 or not seen.any():
        return picture
    share, picture = matte(seen, photo.original), picture.copy()
    box = window(seen, picture.shape[:2], 4)
    share, seen_so, here = share[box][..., None], photo.original[box], picture[box]
    if before is not None:
        share = share * (1 - before[box])[..., None]
    white = seen_so.min(-1, keepdims=True)
    own = dim * seen_so
    if not photo.hdr:
        lifted = own * (
            1
            + max(found["radiance"] - 1, 0)
            * np.clip((white - DEFAULT.nearly) / (DEFAULT.clipped - DEFAULT.nearly), 0, 1)
        )
        # What is not clipped is as bright as it is, and dimming brightens nothing.
        own = np.where((white < DEFAULT.clipped) & (dim < 1), np.minimum(lifted, seen_so), lifted)
    picture[box] = np.where(share > 0, share * own + (1 - share) * here, here)
    return picture
