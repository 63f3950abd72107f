"""The shadow of a small board over a floor, whose place a line through the light gives."""

from types import SimpleNamespace

import numpy as np
import pytest

from materialist.camera import project, unproject
from materialist.types import Camera
from materialist_lab.bench.screen_space import shadowed, strongest


@pytest.mark.slow
def test_a_shadow_lies_where_the_line_through_the_body_and_the_light_meets_the_floor():
    camera = Camera(64, 64, 60.0)
    rays = unproject(np.ones((64, 64), np.float32), camera)
    depth = np.where(rays[..., 1] < -0.1, -1 / np.minimum(rays[..., 1], -0.1), 0)  # floor at y = -1
    envmap = np.zeros((32, 64, 3), np.float32)
    envmap[8, 40] = 1.0
    to_light, _ = strongest(envmap, 1)
    body = np.array([0.0, -0.7, -3.0])
    spot, _ = project(body - to_light[0] * (0.3 / to_light[0, 1]), camera)
    buffer = np.zeros((64, 64))
    (x, y), z = project(body, camera)
    buffer[int(y) - 1 : int(y) + 2, int(x) - 1 : int(x) + 2] = z
    scene = SimpleNamespace(
        camera=camera, depth=depth, envmap=envmap, normal=np.tile([0.0, 1.0, 0.0], (64, 64, 1))
    )
    shadow = shadowed(scene, buffer, 0.3)[..., 0]
    rows, columns = np.nonzero(shadow < 0.5)
    assert 0 < len(rows) < 40
    assert abs(columns.mean() + 0.5 - spot[0]) < 2 and abs(rows.mean() + 0.5 - spot[1]) < 2
    assert (shadow[depth == 0] == 1).all()


def test_beams_carry_the_light_of_the_map():
    envmap = np.random.default_rng(3).exponential(size=(16, 32, 3)).astype(np.float32) ** 3
    directions, beams = strongest(envmap, 4000)
    assert np.linalg.norm(directions, axis=-1) == pytest.approx(1, abs=1e-5)
    angle = np.pi / 16 * np.pi / 16 * np.sin((np.arange(16) + 0.5) / 16 * np.pi)
    assert beams.sum(0) == pytest.approx((envmap * angle[:, None, None]).sum((0, 1)), rel=0.03)
