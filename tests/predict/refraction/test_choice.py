"""Which thickness is taken: that of a surface of revolution by itself, for the rest the network's."""

import importlib

import numpy as np

from materialist.camera import pixel_rays
from materialist.predict.refraction.thickness import Thickness
from materialist.types import Camera

module = importlib.import_module("materialist.predict.refraction.thickness")  # the package has a function of that name
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


def chosen(depth, normal, mask, **options):
    return module.best_thickness(np.full((64, 64, 3), 0.5, np.float32), mask, normal, depth, CAMERA, **options)


def test_a_ball_is_known_whatever_the_network_says_and_half_a_ball_is_not(monkeypatch):
    depth, normal, mask, true = ball()
    solid = (0.4 * true).astype(np.float32)
    monkeypatch.setattr(module, "thickness", lambda *_: Thickness(solid, 0.3 * solid))
    found = chosen(depth, normal, mask, up=LEVEL)
    assert found.method == "revolution" and found.revolution is not None and found.back is None
    assert np.abs(found.solid - true)[mask].sum() < 0.12 * true[mask].sum()
    assert (found.hollow <= found.solid).all() and found.hollow.max() > 0
    half = mask & (np.arange(64) > 32)
    found = chosen(depth, normal, half, up=LEVEL)
    assert found.method == "network" and found.solid is solid
