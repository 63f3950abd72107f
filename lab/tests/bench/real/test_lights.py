"""Lights of photographs under several of them."""

import numpy as np
import pytest

from materialist.camera import unit
from materialist.envmap import environment, texel_directions
from materialist_lab.bench.real.lights import ball_light, farthest_light, lamp_light, mean_direction


@pytest.mark.parametrize("direction", [[0, 0, 1], [0.5, 0.5, 0.7], [-0.3, 0.2, -0.9]])
def test_a_lamp_shines_from_its_direction(direction):
    light = lamp_light(direction)
    np.testing.assert_allclose(mean_direction(light), unit(np.array(direction, float)), atol=0.02)
    assert light.shape == (128, 256, 3) and 0 < (light > 0).mean() < 0.02


def test_a_mirror_ball_gives_back_the_light_around_it():
    """The ball's picture: what it mirrors of a light, seen from far away along -Z."""
    light = (0.5 + 0.5 * texel_directions(64, 128)).astype(np.float32)
    y, x = np.meshgrid(
        (127.5 - np.arange(256)) / 128, (np.arange(256) - 127.5) / 128, indexing="ij"
    )
    z = np.sqrt(np.maximum(1 - x**2 - y**2, 0))
    mirrored = np.stack([2 * z * x, 2 * z * y, 2 * z * z - 1], -1)
    ball = environment(mirrored.reshape(-1, 3), light).reshape(256, 256, 3).astype(np.float32)
    measured = ball_light(ball)
    directions = texel_directions(*measured.shape[:2])
    seen = directions[..., 2] > -0.9  # not what is right behind the ball
    np.testing.assert_allclose(measured[seen], (0.5 + 0.5 * directions)[seen], atol=0.05)


def test_the_farthest_light():
    lamps = [lamp_light(direction) for direction in ([1, 0, 0.1], [0, 0, 1], [-1, 0, 0.2])]
    assert [farthest_light(lamps, k) for k in range(3)] == [2, 0, 0]
