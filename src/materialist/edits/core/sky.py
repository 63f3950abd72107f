"""The photo's sky in the light that new glass refracts."""

from __future__ import annotations

import numpy as np

from materialist.camera import project
from materialist.envmap import environment, texel_directions
from materialist.types import Array, Scene

MOST_ROWS = 768
"""Rows of the largest map (derived: memory)."""
CLIPPED = 0.98
"""Channel of an ordinary photo from which its value is a lower bound (derived: 8 bits)."""


def photo_sky(scene: Scene) -> Array | None:
    """[h, 2h, 3] float32 linear: the environment map, with the photo's sky in full detail where the photo shows sky.

    A texel is about a pixel wide. A path through glass so meets what stands in the photo, clouds or the filled
    background of a removed object. None where the photo shows no sky.
    """
    camera = scene.camera
    if (scene.depth > 0).all():
        return None
    rows = int(np.clip(np.pi * camera.focal, len(scene.envmap), max(MOST_ROWS, len(scene.envmap))))
    directions = texel_directions(rows, 2 * rows).reshape(-1, 3)
    sky = environment(directions, scene.envmap).astype(np.float32)
    place, ahead = project(directions, camera)
    column, row = np.floor(place).astype(int).T
    seen = (ahead > 0) & (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    seen[seen] = scene.depth[row[seen], column[seen]] == 0
    photo = scene.photo.linear[row[seen], column[seen]]
    bound = (photo >= CLIPPED) & (not scene.photo.hdr)
    sky[seen] = np.where(bound, np.maximum(photo, sky[seen]), photo)
    return sky.reshape(rows, 2 * rows, 3)
