"""Where walls end, found from the light on what the picture shows."""

import numpy as np
import pytest
import torch
from geometry_scenes import room

from materialist.envmap import texel_directions
from materialist.fit.ends import SIDES, Search, _at, farthest, searched
from materialist.fit.engine import TransportEngine
from materialist.fit.settings import DEFAULT
from materialist.geometry.build import build_geometry
from materialist.geometry.completion import walls_of
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
    (wall,) = walls_of(find_planes(depth, normal, CAMERA), depth, CAMERA)
    albedo = np.array([[0.6, 0.5, 0.4], [0.5, 0.5, 0.6], [0.3, 0.5, 0.3]])[label].astype(np.float32)
    matt = np.ones(label.shape, np.float32)
    return depth, normal, wall, Materials(albedo, matt, 0 * matt)


def pictured(maps, levels, direction) -> tuple:
    """The engine, materials and picture of the room whose wall truly ends at the levels, under a sun."""
    depth, normal, wall, materials = maps
    geometry = build_geometry(depth, normal, CAMERA, ends=[_at(wall, levels)])
    renderer = RenderScene(geometry, CAMERA, device="cpu")
    renderer.set_materials(materials)
    renderer.set_envmap(sun(direction))
    photo = renderer.render(spp=256, seed=1)
    photo = (photo * 0.7 / np.percentile(photo, 99)).astype(np.float32)
    engine = TransportEngine(
        build_geometry(depth, normal, CAMERA, ends=[farthest(wall)]), CAMERA, photo, light_height=16
    )
    return engine, materials, torch.from_numpy(photo.reshape(-1, 3))


@pytest.mark.parametrize(("up", "direction"), [(0.0, (0.1, 1.8, -1)), (1.0, (0.1, 2.2, -1))])
def test_the_height_of_a_wall_is_read_off_its_shadow(maps, up, direction):
    """The sun is behind the wall, whose shadow ends on the floor."""
    wall = maps[2]
    found = searched(*pictured(maps, {"left": 2.0, "right": 2.0, "up": up}, direction), DEFAULT, [wall])
    assert found is not None and found.error < 0.9 * found.usual
    (end,) = found.ends
    assert (end.up - wall.seen.up) / wall.size == pytest.approx(up, abs=0.01)


def test_without_a_sign_in_the_light_no_side_moves(maps):
    """The sun is behind the camera. The shadows above gain 0.004; a side that gains a tenth of that stays."""
    wall, picture = maps[2], pictured(maps, {"left": 0.5, "right": 0.5, "up": 0.5}, (0.2, 0.5, 0.9))
    assert searched(*picture, DEFAULT, [wall]) is None
    search = Search(*picture, DEFAULT.light, [wall], 16)
    usual = search.error((wall.usual,))
    even = [search.error((_at(wall, dict.fromkeys(SIDES, level)),)) for level in (0.25, 0.5, 1.0)]
    assert max(even) < 1.25 * usual


def test_the_order_of_searches_decides_nothing():
    """A wall seen straight on: where it ends changes nothing, and the last search has only the better light."""
    depth = np.full((24, 32), 2, np.float32)
    normal = np.broadcast_to(np.array([0, 0, 1], np.float32), (24, 32, 3)).copy()
    camera, rng = Camera(32, 24, 35.0), np.random.default_rng(0)
    albedo = rng.uniform(0.2, 0.8, (24, 32, 3)).astype(np.float32)
    materials = Materials(albedo, np.full((24, 32), 0.5, np.float32), np.zeros((24, 32), np.float32))
    walls = walls_of(find_planes(depth, normal, camera), depth, camera)
    geometry = build_geometry(depth, normal, camera, ends=[farthest(wall) for wall in walls])
    photo = albedo * np.float32(0.7)
    engine = TransportEngine(geometry, camera, photo, light_height=16)
    assert walls and searched(engine, materials, torch.from_numpy(photo.reshape(-1, 3)), DEFAULT, walls) is None
