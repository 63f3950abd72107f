"""Environments of the benchmark: sane, different, and turned into the camera's frame."""

import numpy as np
import pytest

from materialist.color import luminance
from materialist.envmap import row_solid_angle
from materialist.metrics import sh_coefficients
from materialist_lab.procedural import lights


def test_a_tilted_camera_sees_the_sky_tilted():
    """Degree-1 harmonics are a vector: it must turn with the frame."""

    def radiance(d):
        return np.repeat(1 + d[..., 1:2], 3, axis=-1)

    angle = 0.5
    c = np.cos(angle)
    s = np.sin(angle)
    looking_down = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])  # camera -> scene: -Z goes down
    up_in_camera = looking_down.T @ [0, 1, 0]
    assert (looking_down @ [0, 0, -1])[1] < 0
    _, first, second, third = sh_coefficients(lights.envmap(radiance, looking_down))[:4, 0]
    light_axis = np.array([first, second, third]) / np.linalg.norm([first, second, third])
    assert np.allclose(light_axis, [-up_in_camera[0], up_in_camera[1], -up_in_camera[2]], atol=1e-3)


def test_skies_have_a_mean_of_one_and_are_lighter_above():
    for k in range(4):
        envmap = lights.outdoors(np.random.default_rng(k))
        assert luminance(envmap).mean(1) @ row_solid_angle(256) * 512 / (
            4 * np.pi
        ) == pytest.approx(1, rel=1e-3)
        assert (
            luminance(envmap[: len(envmap) // 2]).mean()
            > luminance(envmap[len(envmap) // 2 :]).mean()
        )
