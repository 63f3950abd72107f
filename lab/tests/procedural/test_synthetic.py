"""Synthetic samples: the truth must be true of the picture."""

import numpy as np

from materialist import metrics
from materialist.camera import pixel_rays
from materialist_lab.procedural import arrangements as scenes
from materialist_lab.procedural.synthetic import make_sample


def test_the_same_numbers_give_the_same_sample(sample):
    again = make_sample(0, 0, 0, size=(40, 56), seed=0, spp=64)
    assert np.array_equal(again.photo.linear, sample.photo.linear)
    assert np.array_equal(again.truth.depth, sample.truth.depth)
    other = make_sample(0, 1, 0, size=(40, 56), seed=0, spp=4)
    assert not np.array_equal(other.truth.depth, sample.truth.depth)


def test_the_sky_of_the_photo_is_the_envmap(sample):
    """Where there is no surface the photo shows the light: this pins the frame of the envmap and the exposure."""
    rays = pixel_rays(sample.photo.camera).astype(np.float64)
    d = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    column = ((np.arctan2(d[..., 0], -d[..., 2]) / (2 * np.pi) + 0.5) * 512).astype(int) % 512
    row = np.clip((np.arccos(d[..., 1]) / np.pi * 256).astype(int), 0, 255)
    sky = sample.truth.depth == 0
    sky[:, 1:] &= sky[:, :-1]
    sky[1:] &= sky[:-1]
    sky[:-1] &= sky[1:]
    assert sky.sum() > 50
    expected = np.clip(sample.envmap[row, column], 0, 1)
    assert np.abs(expected - sample.photo.linear)[sky].mean() < 0.02


def test_render_repeats_the_photo_and_is_linear_in_the_light(sample):
    again = sample.scene.render(sample.envmap, spp=64, seed=5)
    assert metrics.psnr(again, sample.photo.linear) > 25
    twice = sample.scene.render(2 * sample.envmap, spp=64, seed=5)
    assert np.allclose(twice, 2 * again, rtol=1e-3, atol=1e-4)


def test_meshes_and_captures_of_a_data_folder_are_used(mitsuba, real_data):
    sample = make_sample(4, 4, 4, size=(24, 32), data=real_data("data"), spp=4)
    assert np.isfinite(sample.photo.linear).all() and (sample.truth.depth > 0).mean() > 0.5
    assert (
        max(len(i.solid.vertices) for i in scenes.arrangement(4, seed=0, data=real_data("data")))
        > 1000
    )
