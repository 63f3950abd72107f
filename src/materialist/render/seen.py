"""Which shapes of a Mitsuba scene the camera sees where."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from materialist.types import Array, Camera

GRID = 4
"""Rays along each side of a pixel."""


def bodies_seen(scene, camera: Camera, names: Sequence[str], *, size: tuple[int, int] | None = None) -> Array:
    """[H, W] float32 in [0, 1]: share of each pixel in which the first thing seen is one of the named shapes.

    Args:
        scene: a Mitsuba scene (`RenderScene.mi_scene`).
        size: (H, W) of the picture, of any resolution; the camera's own by default.
    """
    import drjit as dr
    import mitsuba as mi

    height, width = size or (camera.height, camera.width)
    wanted = mi.Bool(False)
    share = np.zeros(height * width, np.float32)
    shapes = [shape for shape in scene.shapes() if shape.id() in names]
    half = float(np.tan(np.radians(camera.fov) / 2))
    pixel = dr.arange(mi.UInt32, height * width)
    column, row = mi.Float(pixel % width), mi.Float(pixel // width)
    for k in range(GRID * GRID):
        x = (column + dr.opaque(mi.Float, (k % GRID + 0.5) / GRID)) / width * 2 - 1
        y = 1 - (row + dr.opaque(mi.Float, (k // GRID + 0.5) / GRID)) / height * 2
        direction = mi.Vector3f(x * half, y * (half * camera.height / camera.width), -1)
        hit = scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(0), dr.normalize(direction)))
        wanted = mi.Bool(False)
        for shape in shapes:
            wanted |= hit.is_valid() & (hit.shape == mi.ShapePtr(shape))
        share += np.array(dr.select(wanted, mi.Float(1), mi.Float(0)))
    return (share / GRID**2).reshape(height, width)
