"""Which thickness is believed: the turned front for what looks the same from behind, the network for the rest."""

from dataclasses import replace

import numpy as np
import pytest

from materialist.camera import pixel_rays
from materialist.errors import WeightsError
from materialist.predict.refraction import choice
from materialist.predict.refraction.thickness import Thickness
from materialist.types import Camera

CAMERA = Camera(64, 64, 40.0)
LEVEL = np.array([0.0, 1, 0])


def ball(radius=0.6, distance=3.0):
    """Depth, normal, mask and thickness of a ball straight ahead."""
    rays = pixel_rays(CAMERA).astype(float)
    centre = np.array([0, 0, -distance])
    a, b = (rays**2).sum(-1), rays @ centre
    root = b * b - a * (centre @ centre - radius**2)
    mask = root > 0
    near = (b - np.sqrt(np.maximum(root, 0))) / a
    normal = np.where(mask[..., None], (rays * near[..., None] - centre) / radius, [0, 0, 1])
    thick = np.where(mask, 2 * np.sqrt(np.maximum(root, 0)) / a * np.linalg.norm(rays, axis=-1), 0)
    return np.where(mask, near, 5.0), normal, mask, thick


@pytest.fixture
def network(monkeypatch):
    """Lets RefractionNet say what a test wants."""

    def say(solid):
        monkeypatch.setattr(choice, "thickness", lambda *_: Thickness(solid, 0.3 * solid))

    return say


def chosen(depth, normal, mask, **options):
    return choice.best_thickness(np.full((64, 64, 3), 0.5, np.float32), mask, normal, depth, CAMERA, **options)


@pytest.fixture
def no_lathe(monkeypatch):
    """Nothing is taken for turned on a lathe."""
    for name in ("lathed", "outlined"):
        monkeypatch.setattr(choice, name, lambda *_, **__: None)


def test_a_ball_is_known_by_its_normals_whatever_the_network_says(network):
    depth, normal, mask, true = ball()
    network((0.4 * true).astype(np.float32))
    found = chosen(depth, normal, mask, up=LEVEL)
    assert found.method == "lathe"
    assert np.abs(found.thickness.solid - true)[mask].sum() < 0.12 * true[mask].sum()
    assert (found.thickness.hollow <= found.thickness.solid).all()


def test_a_rough_guess_becomes_the_back_of_the_ball(network, no_lathe):
    depth, normal, mask, true = ball()
    wave = 1 + 0.3 * np.sin(np.arange(64) / 2)
    network((true * wave).astype(np.float32))
    found = chosen(depth, normal, mask, up=LEVEL)
    assert found.method == "half-turn"
    error = np.abs(found.thickness.solid - true)[mask].sum() / true[mask].sum()
    assert error < 0.12 < np.abs(wave - 1).mean()
    assert (found.thickness.hollow <= found.thickness.solid).all() and found.thickness.hollow.max() > 0


def test_the_outline_is_asked_where_the_maps_are_not_exact(network, monkeypatch):
    depth, normal, mask, true = ball()
    network(true.astype(np.float32))
    asked = []
    monkeypatch.setattr(choice, "lathed", lambda *_, **__: None)
    monkeypatch.setattr(choice, "outlined", lambda *_, **__: asked.append(True))
    chosen(depth, normal, mask, up=LEVEL)
    assert not asked
    noise = np.random.default_rng(0).normal(0, 0.01, depth.shape)
    chosen(depth * (1 + noise), normal, mask, up=LEVEL)
    assert asked


def test_where_they_disagree_and_the_turn_does_not_fit_the_network_is_believed(network):
    depth, normal, mask, true = ball()
    rows, columns = np.mgrid[:64, :64]
    boot = mask & ((columns > 32) | (rows > 32))
    steep = np.where(columns > 32, 4.0, 0.25) * true * boot
    network(steep.astype(np.float32))
    found = chosen(depth, normal, boot, up=LEVEL)
    assert found.method == "network"
    np.testing.assert_array_equal(found.thickness.solid, steep.astype(np.float32))
    assert chosen(depth, normal, boot, up=LEVEL, prefer="half-turn").method == "half-turn"


def test_a_turn_that_fits_only_about_is_believed_where_the_network_says_the_same(network, no_lathe):
    """A ball without one of its quarters has it again after the turn, which says how badly that fits."""
    depth, normal, mask, true = ball()
    rows, columns = np.indices((64, 64))
    part = mask & ~((columns > 40) & (rows < 30))
    for wrong, method in ((0.0, "half-turn"), (0.25, "network")):
        guess = true * part * (1 + wrong * np.where(rows % 8 < 4, 1, -1))
        network(guess.astype(np.float32))
        found = chosen(depth, normal, part, up=LEVEL)
        assert found.method == method
    assert chosen(depth, normal, part, up=LEVEL, prefer="half-turn").thickness.back is None


def test_without_weights_the_mirror_is_the_guess(monkeypatch, no_lathe):
    def missing(*_):
        raise WeightsError("none")

    monkeypatch.setattr(choice, "thickness", missing)
    depth, normal, mask, true = ball()
    found = chosen(depth, normal, mask)
    assert found.method in ("half-turn", "symmetry")
    assert np.abs(found.thickness.solid - true)[mask].sum() < 0.12 * true[mask].sum()
    assert (found.thickness.hollow == 0).all()


def test_a_profile_of_most_of_an_object_tells_its_thickness_alone(network, monkeypatch):
    depth, normal, mask, true = ball()
    network((0.4 * true).astype(np.float32))
    whole = choice.lathed(depth, normal, mask, CAMERA, up=LEVEL)
    assert whole.whole
    monkeypatch.setattr(choice, "lathed", lambda *_, **__: replace(whole, whole=False))
    found = chosen(depth, normal, mask, up=LEVEL)
    assert found.method == "lathe, in part" and found.thickness.lathe is None and found.thickness.back is None
    np.testing.assert_array_equal(found.thickness.solid, whole.thickness)
    monkeypatch.setattr(choice, "of_one_surface", lambda *_: False)
    monkeypatch.setattr(choice, "outlined", lambda *_, **__: whole)
    assert chosen(depth, normal, mask, up=LEVEL).method == "outline"  # all of it is better than most of it
