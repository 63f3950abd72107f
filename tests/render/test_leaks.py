"""Rays along the edges of a real mesh meet it: Embree's robust mode is on, and it is what closes the mesh."""

import numpy as np

from materialist.geometry.build import build_geometry
from materialist.render.scene import RenderScene
from materialist.types import Camera

CAMERA = Camera(96, 64, 50.0)


def hills():
    """Depth [H, W] of smooth relief with one step, and normals [H, W, 3] towards the viewer."""
    row, col = np.indices((64, 96))
    depth = 4 + 0.3 * np.sin(row / 5.0) * np.cos(col / 7.0) + 0.01 * row
    depth[20:40, 30:60] -= 1.2
    return depth.astype(np.float32), np.broadcast_to(np.float32([0, 0, 1]), (64, 96, 3))


def misses(scene):
    """Rays through the middles of all horizontal and vertical mesh edges inside the picture that hit nothing."""
    mi = scene.mi
    row, col = np.indices((63, 95)).reshape(2, -1) + 1.0
    x, y = np.concatenate([col + 0.5, col]) / 96, np.concatenate([row, row + 0.5]) / 64
    film = mi.Point2f(x.astype(np.float32), y.astype(np.float32))
    ray = scene.mi_scene.sensors()[0].sample_ray(0, 0, film, mi.Point2f(0.5, 0.5))[0]
    return int((~np.array(scene.mi_scene.ray_intersect_preliminary(ray).is_valid())).sum())


def test_no_ray_passes_along_an_edge():
    scene = RenderScene(build_geometry(*hills(), CAMERA, completion="none"), CAMERA, device="cpu")
    assert misses(scene) == 0
