"""Where walls end, found from the light on what the picture shows."""

import numpy as np
import pytest
from geometry_scenes import room

from materialist.envmap import texel_directions
from materialist.fit.plane_extents import find_extents, moved_to
from materialist.fit.settings import DEFAULT
from materialist.geometry.build import build_geometry
from materialist.geometry.completion import continued_walls
from materialist.geometry.planes import find_planes
from materialist.render.scene import RenderScene
from materialist.types import Camera, Materials, Prediction

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


def found(maps, levels, direction):
    """The extents that are found of the room whose wall truly ends at the levels, under a sun."""
    depth, normal, wall, materials = maps
    end = wall.usual
    for side, level in levels.items():
        end = moved_to(end, wall, side, level)
    renderer = RenderScene(build_geometry(depth, normal, CAMERA, extents=[end]), CAMERA, device="cpu")
    renderer.set_materials(materials)
    renderer.set_envmap(sun(direction))
    photo = renderer.render(spp=256, seed=1)
    photo = (photo * 0.7 / np.percentile(photo, 99)).astype(np.float32)
    return find_extents(photo, Prediction(materials, normal, depth.astype(np.float32)), CAMERA, DEFAULT)


def test_a_wall_that_is_higher_than_usual_goes_up(maps):
    """The sun is behind the wall, whose shadow ends on the floor."""
    wall = maps[2]
    result = found(maps, {"left": 2.0, "right": 2.0, "up": 1.0}, (0.1, 2.2, -1))
    assert result is not None and result.error < 0.95 * result.usual
    (end,) = result.ends
    assert end.up > wall.usual.up + 0.1 * wall.size


def test_without_a_sign_in_the_light_no_side_moves(maps):
    """The sun is behind the camera."""
    assert found(maps, {}, (0.2, 0.5, 0.9)) is None
