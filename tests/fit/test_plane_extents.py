"""Where walls end, found from the light on what the picture shows."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from geometry_scenes import room

from materialist.envmap import texel_directions
from materialist.fit.engine import TransportEngine
from materialist.fit.plane_extents import SIDES, ExtentSearch, at_levels, best_light, nonnegative, search_extents
from materialist.fit.settings import DEFAULT
from materialist.geometry.build import build_geometry
from materialist.geometry.completion import continued_walls
from materialist.geometry.planes import find_planes
from materialist.render.scene import RenderScene
from materialist.types import Camera, Materials

CAMERA = Camera(64, 48, 60.0)


def sun(direction, height: int = 32) -> np.ndarray:
    """Envmap [h, 2h, 3]: a dim sky and a small bright sun."""
    axis = np.array(direction, float) / np.linalg.norm(direction)
    near = np.exp(200 * (texel_directions(height, 2 * height) @ axis - 1))
    return (0.15 + 25 * near[..., None] * np.ones(3)).astype(np.float32)


@pytest.fixture(scope="module")
def maps():
    depth, normal, label = room(CAMERA)
    (wall,) = continued_walls(find_planes(depth, normal, CAMERA), depth, CAMERA)
    albedo = np.array([[0.6, 0.5, 0.4], [0.5, 0.5, 0.6], [0.3, 0.5, 0.3]])[label].astype(np.float32)
    matt = np.ones(label.shape, np.float32)
    return depth, normal, wall, Materials(albedo, matt, 0 * matt)


def pictured(maps, levels, direction) -> tuple:
    """The engine, materials and picture of the room whose wall truly ends at the levels, under a sun."""
    depth, normal, wall, materials = maps
    geometry = build_geometry(depth, normal, CAMERA, extents=[at_levels(wall, levels)])
    renderer = RenderScene(geometry, CAMERA, device="cpu")
    renderer.set_materials(materials)
    renderer.set_envmap(sun(direction))
    photo = renderer.render(spp=256, seed=1)
    photo = (photo * 0.7 / np.percentile(photo, 99)).astype(np.float32)
    engine = TransportEngine(
        build_geometry(depth, normal, CAMERA, extents=[at_levels(wall, dict.fromkeys(SIDES, 2.0))]),
        CAMERA,
        photo,
        light_height=16,
    )
    return engine, materials, torch.from_numpy(photo.reshape(-1, 3))


@pytest.mark.parametrize(("up", "direction"), [(0.0, (0.1, 1.8, -1)), (1.0, (0.1, 2.2, -1))])
def test_the_height_of_a_wall_is_read_off_its_shadow(maps, up, direction):
    """The sun is behind the wall, whose shadow ends on the floor."""
    wall = maps[2]
    found = search_extents(*pictured(maps, {"left": 2.0, "right": 2.0, "up": up}, direction), DEFAULT, [wall])
    assert found is not None and found.error < 0.9 * found.usual
    (end,) = found.ends
    assert (end.up - wall.seen.up) / wall.size == pytest.approx(up, abs=0.01)


def test_without_a_sign_in_the_light_no_side_moves(maps):
    """The sun is behind the camera. The shadows above gain 0.004; a side that gains a tenth of that stays."""
    wall, picture = maps[2], pictured(maps, {"left": 0.5, "right": 0.5, "up": 0.5}, (0.2, 0.5, 0.9))
    assert search_extents(*picture, DEFAULT, [wall]) is None
    search = ExtentSearch(*picture, DEFAULT, [wall], 16)
    usual = search.error((wall.usual,))
    even = [search.error((at_levels(wall, dict.fromkeys(SIDES, level)),)) for level in (0.25, 0.5, 1.0)]
    assert max(even) < 1.25 * usual


def test_the_light_is_that_of_nonnegative_least_squares():
    from scipy.optimize import nnls

    rng = np.random.default_rng(0)
    matrix = rng.random((3, 60, 12)).astype(np.float32)
    truth = np.maximum(rng.normal(0.3, 1, (3, 12)), 0)
    target = np.einsum("cqt,ct->cq", matrix, truth) + 0.05 * rng.normal(size=(3, 60))
    for a, b in zip(matrix, target.astype(np.float32), strict=True):
        found = torch.full((12,), 0.5)
        for _ in range(60):
            found = nonnegative(torch.from_numpy(a), torch.from_numpy(b), found, DEFAULT.extents)
        np.testing.assert_allclose(found, nnls(a.astype(float), b)[0], atol=0.03)


def test_a_photo_of_a_light_is_explained_by_it():
    rng = np.random.default_rng(1)
    matrix = torch.from_numpy(rng.random((3, 200, 16), np.float32) / 16)
    rest = torch.full((200, 3), 0.05)
    light = torch.from_numpy(rng.random((3, 16), np.float32))
    photo = torch.einsum("cqt,ct->qc", matrix, light) + rest
    error, found = best_light(matrix, rest, photo, replace(DEFAULT.light, clipped=False), DEFAULT.extents)
    assert error < 0.01 and found.min() >= 0
    wrong, _ = best_light(matrix, rest, photo.flip(0), replace(DEFAULT.light, clipped=False), DEFAULT.extents)
    assert wrong > 3 * error
    # A clipped channel is no error where the rendering outshines it.
    assert best_light(matrix * 40, rest, torch.ones_like(photo), DEFAULT.light, DEFAULT.extents)[0] < 1e-3
