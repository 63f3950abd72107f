"""Rays of pictures brought to another size."""

import numpy as np
import pytest

from materialist.camera import pixel_rays, rays_at
from materialist.types import Camera


@pytest.mark.parametrize("width, height", [(40, 30), (160, 120), (7, 120), (1, 1)])
def test_rays_at_another_size_are_those_of_a_camera_of_that_size(width, height):
    rays = pixel_rays(Camera(80, 60, 50.0))[..., :2]
    x = np.tan(np.radians(25)) * (2 * (np.arange(width) + 0.5) / width - 1)
    y = np.tan(np.radians(25)) * 0.75 * (1 - 2 * (np.arange(height) + 0.5) / height)
    found = rays_at(rays, height, width)
    np.testing.assert_allclose(found[..., 0], np.broadcast_to(x, (height, width)), atol=1e-6)
    np.testing.assert_allclose(
        found[..., 1], np.broadcast_to(y[:, None], (height, width)), atol=1e-6
    )


def test_rays_of_a_part_stay_those_of_the_part():
    rays = pixel_rays(Camera(80, 60, 50.0))[10:30, 40:80, :2]
    found = rays_at(rays, 40, 80)
    np.testing.assert_allclose(found[0, :, 0].reshape(40, 2).mean(1), rays[0, :, 0], atol=1e-6)
    np.testing.assert_allclose(found[:, 0, 1].reshape(20, 2).mean(1), rays[:, 0, 1], atol=1e-6)
