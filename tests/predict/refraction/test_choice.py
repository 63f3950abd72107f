"""Which thickness is taken: that of a surface of revolution by itself, for the rest the network's, or the mirror's."""

import numpy as np

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


def chosen(depth, normal, mask, **options):
    return choice.best_thickness(np.full((64, 64, 3), 0.5, np.float32), mask, normal, depth, CAMERA, **options)


def test_a_ball_is_known_whatever_the_network_says_and_half_a_ball_is_not(monkeypatch):
    depth, normal, mask, true = ball()
    solid = (0.4 * true).astype(np.float32)
    monkeypatch.setattr(choice, "thickness", lambda *_: Thickness(solid, 0.3 * solid))
    found = chosen(depth, normal, mask, up=LEVEL)
    assert found.method == "revolution" and found.thickness.revolution is not None and found.thickness.back is None
    assert np.abs(found.thickness.solid - true)[mask].sum() < 0.12 * true[mask].sum()
    assert (found.thickness.hollow <= found.thickness.solid).all() and found.thickness.hollow.max() > 0
    half = mask & (np.arange(64) > 32)
    found = chosen(depth, normal, half, up=LEVEL)
    assert found.method == "network" and found.thickness.solid is solid


def test_without_weights_the_mirror_is_taken(monkeypatch):
    def missing(*_):
        raise WeightsError("none")

    monkeypatch.setattr(choice, "thickness", missing)
    monkeypatch.setattr(choice, "surface_of_revolution", lambda *_, **__: None)
    depth, normal, mask, true = ball()
    found = chosen(depth, normal, mask)
    assert found.method == "symmetry" and (found.thickness.hollow == 0).all()
    assert np.abs(found.thickness.solid - true)[mask].sum() < 0.12 * true[mask].sum()
