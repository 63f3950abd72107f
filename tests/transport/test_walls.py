"""The light matrix for any ends of walls equals the one that is traced on a mesh with those ends."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from geometry_scenes import room

from materialist.geometry.build import build_geometry
from materialist.geometry.completion import continued_walls
from materialist.geometry.planes import find_planes
from materialist.transport.cache import TransportCache
from materialist.transport.light import light_matrix
from materialist.transport.walls import SPECULAR_SAMPLES, SPHERE_SAMPLES, WallMatrix
from materialist.types import Camera, Materials

CAMERA = Camera(40, 30, 60.0)


@pytest.fixture(scope="module")
def scene():
    """Depth, normals, the wall, materials, and what each pixel sends out."""
    depth, normal, _ = room(CAMERA)
    (wall,) = continued_walls(find_planes(depth, normal, CAMERA), depth, CAMERA)
    rng = np.random.default_rng(0)
    shape = depth.shape
    materials = Materials(
        rng.random((*shape, 3), np.float32), np.full(shape, 0.5, np.float32), rng.random(shape, np.float32)
    )
    return depth, normal, wall, materials, rng.random((*shape, 3), np.float32)


def cache_with(scene, ends) -> TransportCache:
    depth, normal, *_ = scene
    return TransportCache(build_geometry(depth, normal, CAMERA, extents=[ends]), CAMERA)


@pytest.mark.parametrize("move", [{"right": 3.0}, {"up": 2.0, "right": 1.0}, {"right": -4.0, "up": -3.0}])
def test_ends_are_as_if_traced(scene, move):
    _, _, wall, materials, radiance = scene
    whole = replace(wall.seen, left=-9.0, right=9.0, down=-3.0, up=9.0)
    ends = replace(whole, **{"left": -4.0, "right": 4.0, "up": 3.0, **move})
    far = cache_with(scene, whole)
    rows = np.arange(0, len(far.pixels), 7)
    normal = np.array(wall.usual.normal)
    asked = WallMatrix(far, materials, rows, 8, [(normal, wall.index)], far.slot_radiance(radiance))
    found, indirect = asked.ended((ends,))

    near = cache_with(scene, ends)
    np.testing.assert_array_equal(near.pixels, far.pixels)
    samples = {"sphere_samples": SPHERE_SAMPLES, "specular_samples": SPECULAR_SAMPLES}
    true = light_matrix(near, materials, rows, 8, **samples)
    light = true.indirect(torch.from_numpy(near.slot_radiance(radiance)))
    # A few rays pass within a rounding of the wall's sides, and the colours of its triangles are those of the mesh.
    assert float((found.parts - true.parts).abs().sum() / true.parts.abs().sum()) < 0.01
    assert float((found.open - true.open).abs().mean()) < 0.01
    assert float((indirect - light).abs().mean() / light.abs().mean()) < 0.05
    moved = light_matrix(far, materials, rows, 8, **samples)
    assert float((moved.parts - true.parts).abs().sum() / true.parts.abs().sum()) > 0.01
