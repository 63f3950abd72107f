"""Augmentation keeps labels, rays and pictures true to each other."""

from dataclasses import replace

import made_samples
import numpy as np
import pytest

from materialist.io.samples import read_sample
from materialist.train import augment


@pytest.fixture
def sample(tmp_path):
    return read_sample(made_samples.write_set(tmp_path, 1) / "samples" / "0000000.npz")


def _on_plane(sample, normal, tolerance):
    surface = sample.mask > 0
    points = np.dstack([sample.rays, -np.ones(surface.shape)]) * sample.depth[..., None]
    distance = (points @ normal)[surface]
    np.testing.assert_allclose(distance, -1.2, rtol=tolerance)
    np.testing.assert_allclose(sample.normal[surface] @ normal, 1, atol=1e-3)


def test_a_crop_keeps_its_rays(sample):
    cut = augment.window(sample, 20, 10, 24, 32)
    assert cut.depth.shape == (24, 32)
    _on_plane(cut, made_samples.NORMAL, 2e-3)


@pytest.mark.parametrize("size", [22, 96])
def test_colours_at_the_sky_are_those_of_the_surface(sample, size):
    """Next to the sky, which has no albedo, a surface of one paint keeps it; the picture itself is mixed."""
    surface = sample.mask[..., None] > 0
    painted = replace(sample, albedo=np.where(surface, np.float32([0.6, 0.4, 0.2]), 0),
                      metallic=sample.mask * np.float32(0.8))  # fmt: skip
    scaled = augment.resized(painted, size, size)
    here = scaled.mask > 0
    assert 0.2 < here.mean() < 0.95
    np.testing.assert_allclose(scaled.albedo[here], np.broadcast_to([0.6, 0.4, 0.2], (here.sum(), 3)), atol=1e-5)
    np.testing.assert_allclose(scaled.roughness[here], 0.4, atol=1e-5)
    np.testing.assert_allclose(scaled.metallic[here], 0.8, atol=1e-5)


def test_flips_mirror_the_geometry(sample):
    mirrored = augment.flip(sample)
    _on_plane(mirrored, made_samples.NORMAL * [-1, 1, 1], 2e-3)
    assert (mirrored.image[:, ::-1] == sample.image).all()
    upside_down = augment.flip(sample, axis=0)
    _on_plane(upside_down, made_samples.NORMAL * [1, -1, 1], 2e-3)
    twice = augment.flip(mirrored)
    for name in ("image", "normal", "rays", "depth"):
        np.testing.assert_array_equal(getattr(twice, name), getattr(sample, name))
