"""Paths where the edit is noisy: how many they are, that the mean stays, and what the photo keeps."""

import numpy as np
import pytest
from edit_scenes import block_mask, rendered_scene

from materialist.color import linear_to_srgb
from materialist.edits.composite import layers, sparing
from materialist.edits.composite.composite import composite, into_photo
from materialist.edits.composite.sparing import FEWEST, LEVELS, noisy, spared
from materialist.edits.light.lights import Studio
from materialist.edits.light.relight import lamp, relight
from materialist.edits.material.material import edit
from materialist.metrics import psnr

SHAPE = (40, 48)
MASK = block_mask(36, 48)
still = lambda *_: None  # noqa: E731


class Made:
    """A pair of made-up pictures: base 0.2, edited 0.2 and a noisy difference of known mean; counts rays."""

    def __init__(self, mean, noise):
        self.mean, self.noise = mean, noise
        self.rays = np.zeros((2, *SHAPE), int)

    def base(self, spp, seed, share):
        return self._picture(0, spp, share, 0.0), share.rays(spp)

    def edited(self, spp, seed, share):
        rays = share.rays(spp)
        rng = np.random.default_rng((seed, share.rest))
        luck = rng.normal(0, 1, SHAPE) / np.sqrt(max(rays, 1))
        return self._picture(1, spp, share, self.mean + self.noise * luck), rays

    def _picture(self, j, spp, share, more):
        traced = np.ones(SHAPE, bool)
        if share.pixels is not None:
            traced = np.isin(np.arange(traced.size).reshape(SHAPE), share.pixels)
        self.rays[j] += traced * share.rays(spp)
        picture = np.broadcast_to((0.2 + np.broadcast_to(more, SHAPE))[..., None], (*SHAPE, 3)).astype(np.float32)
        return np.where(traced[..., None], picture, 0)


def test_quiet_pixels_get_a_quarter_and_the_edited_surface_all():
    changed = np.zeros(SHAPE, bool)
    changed[:5, :5] = True
    noise = np.zeros(SHAPE)
    noise[:, 30:] = 0.5
    made = Made(np.full(SHAPE, 0.05), noise)
    halves, needed = spared((made.base, made.edited), changed, spp=80, seed=2, tick=still)
    assert needed[changed].all() and needed[:, 34:].all() and not needed[10:, :25].any()
    for count in made.rays:
        assert (count[needed] == 80).all() and (count[~needed] == 20).all()
    for base, edited in halves:
        np.testing.assert_allclose((edited - base)[~needed & (noise == 0)], 0.05, atol=1e-6)
        assert (edited - base)[needed].mean() == pytest.approx(0.05, abs=0.02)


def test_the_mean_stays_what_it_was():
    """Where noise is at the threshold, so that luck decides: over many seeds nothing is gained or lost."""
    noise = np.full(SHAPE, _threshold(0.2) * np.sqrt(20))
    means, shares = [], []
    for seed in range(60):
        made = Made(np.full(SHAPE, 0.03), noise)
        halves, needed = spared((made.base, made.edited), np.zeros(SHAPE, bool), spp=80, seed=seed, tick=still)
        means.append(np.mean([edited - base for base, edited in halves]))
        shares.append(needed.mean())
    assert 0.1 < np.mean(shares) < 0.95
    assert np.mean(means) == pytest.approx(0.03, abs=4 * np.std(means) / np.sqrt(len(means)))


def test_noise_is_measured_in_levels_of_the_screen():
    rng = np.random.default_rng(1)
    for tone in (0.001, 0.2, 0.9):
        d0, d1 = rng.normal(0, _threshold(tone) * np.sqrt(2), (2, *SHAPE, 3))  # their mean has the threshold's noise
        flat = np.full((*SHAPE, 3), tone)
        assert noisy(1.4 * d0, 1.4 * d1, flat).mean() > 0.95 and noisy(0.6 * d0, 0.6 * d1, flat).mean() < 0.05


def _threshold(tone: float) -> float:
    """The linear noise that is LEVELS on the screen, by finite differences of the sRGB curve."""
    step = 1e-4
    slope = (linear_to_srgb(np.float64(tone + step)) - linear_to_srgb(np.float64(tone))) / step
    return LEVELS / 255 / float(slope)


def test_nothing_to_see_is_traced_once():
    made = Made(0.0, 0.0)
    halves, needed = spared((made.base, made.edited), np.ones(SHAPE, bool), spp=80, seed=0, tick=still)
    assert not needed.any() and (made.rays == 20).all()
    assert all(np.array_equal(base, edited) for base, edited in halves)


def test_the_composite_is_the_same_picture_from_fewer_rays(monkeypatch):
    scene = rendered_scene(2)
    edited, studio = edit(scene, MASK, hue=150), Studio(scene)
    shares = []
    monkeypatch.setattr(layers, "spared", lambda *a, **k: shares.append(sparing.spared(*a, **k)) or shares[-1])
    sparing_picture, whole, best = (
        linear_to_srgb(into_photo(scene.photo, layers.render_layers(studio, edited, spp=spp, seed=seed, sparing=fewer)))
        for spp, seed, fewer in ((192, 1, True), (192, 1, False), (1000, 5, False))
    )
    ((_, needed),) = shares
    assert MASK.mean() <= needed.mean() < 0.5
    assert psnr(whole, best) > psnr(sparing_picture, best) > 60  # a quarter of a level
    photo = linear_to_srgb(scene.photo.original)
    kept = (sparing_picture == photo).all(-1)
    assert kept.mean() > 0.02 and not kept[np.kron(MASK, np.ones((2, 2), bool))].any()


def test_an_edit_without_effect_gives_the_photo():
    scene = rendered_scene(2)
    np.testing.assert_array_equal(composite(scene, edit(scene, MASK, hue=0.0), spp=FEWEST), scene.photo.original)


def test_other_tracers_know_no_shares():
    scene = rendered_scene()
    assert Studio(scene).begun(relight(scene, lamps=[lamp(scene, 30, 10, 2.5, 3000, 1.0)])) is None
    assert Studio(scene).begun(edit(scene, MASK, hue=40)) is not None
