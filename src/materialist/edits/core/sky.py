"""The photo's sky as new glass shows it.

Surfaces carry the photo's colours in their albedo. Where a path through glass leaves the scene it meets the fitted
light, which has neither the photo's detail nor the filled background of a removed object. Light is linear: the
photo's sky less the fitted light, each rendered alone with black surfaces, is added to the picture of the glass.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from materialist.camera import project
from materialist.envmap import environment, texel_directions
from materialist.types import Array, Materials, Scene


@dataclass(frozen=True)
class SkySettings:
    """Maps that stand for the photo's sky."""

    rows: int = 768
    """Most rows; a texel is about a pixel otherwise (derived: memory)."""
    clipped: float = 0.98
    """Channel of an ordinary photo from which it is a lower bound (derived: 8 bits)."""


DEFAULT = SkySettings()
LEAST = 1e-6
"""Added to both maps, since no light at all cannot be sampled; it cancels in their difference."""


def sky_maps(scene: Scene) -> tuple[Array, Array] | None:
    """(photo's sky, fitted light), [h, 2h, 3] float32 linear, where the photo shows sky; LEAST in others.

    None for a scene whose photo shows no sky.
    """
    camera = scene.camera
    if (scene.depth > 0).all():
        return None
    rows = int(np.clip(np.pi * camera.focal, len(scene.envmap), DEFAULT.rows))
    directions = texel_directions(rows, 2 * rows).reshape(-1, 3)
    place, ahead = project(directions, camera)
    column, row = np.floor(place).astype(int).T
    seen = (ahead > 0) & (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    seen[seen] = scene.depth[row[seen], column[seen]] == 0
    photo, fitted = np.zeros((2, len(directions), 3), np.float32)
    photo[seen] = scene.photo.linear[row[seen], column[seen]]
    fitted[seen] = environment(directions[seen], scene.envmap)
    if not scene.photo.hdr:
        photo = np.where((photo >= DEFAULT.clipped) & (fitted > photo), fitted, photo)
    shape = (rows, 2 * rows, 3)
    return photo.reshape(shape) + LEAST, fitted.reshape(shape) + LEAST


def only_lit_by(scene: Scene, envmap: Array) -> Scene:
    """The scene under another map: surfaces reflect nothing. Lamps shine on, and cancel in the difference of two."""
    size = scene.depth.shape
    black = Materials(np.zeros((*size, 3), np.float32), np.ones(size, np.float32), np.ones(size, np.float32))
    return replace(scene, materials=black, envmap=envmap)


def traced(
    trace: Callable[[float], Array], target: Any, scene: Scene, maps: tuple[Array, Array] | None, *, share: float = 1.0
) -> Array:
    """[h, w, 3] a picture of a `RenderScene` with the scene's materials and light, and the photo's sky in its glass.

    Args:
        trace: picture by a share of its paths.
        maps: of `sky_maps`. share: share of the paths for each of them; both follow the same paths, so that their
            difference has little noise.
    """
    picture = trace(1.0)
    if maps is None:
        return picture
    target.set_materials(only_lit_by(scene, maps[0]).materials)
    for envmap, sign in zip(maps, (1, -1)):
        target.set_envmap(envmap)
        picture = picture + sign * trace(share)
    target.set_materials(scene.materials)
    target.set_envmap(scene.envmap)
    return np.maximum(picture, 0)
