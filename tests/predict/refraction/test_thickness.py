"""From maps of a photo to thickness."""

import numpy as np
import pytest
from geometry_scenes import ball

from materialist.camera import pixel_rays
from materialist.predict.refraction.network import MIN_THICKNESS
from materialist.predict.refraction.thickness import WEIGHTS, best_thickness, thickness
from materialist.solids.symmetry import symmetric_thickness
from materialist.types import Camera


def seen(camera, centre=(0.2, -0.1, -3.0), radius=0.7):
    """Photo, mask, normal, depth and true thickness of a ball."""
    depth, normal, mask, thick = ball(camera, centre, radius)
    photo = np.clip(np.where(mask, 0.3 + 0.4 * normal[..., 1], 0.2), 0, 1)[..., None] * np.ones(3)
    return photo, mask, normal, np.where(mask, depth, 5.0), thick


@pytest.mark.parametrize("size", [(70, 64), (260, 300)])
def test_an_untrained_network_gives_the_symmetry_prior(untrained, size):
    camera = Camera(size[1], size[0], 45)
    photo, mask, normal, depth, _ = seen(camera)
    found = thickness(photo, mask, normal, depth, camera, weights=untrained)
    mirror = symmetric_thickness(depth, normal, mask, camera)
    step = MIN_THICKNESS * np.sqrt(mask.sum()) * np.median(depth[mask]) / camera.focal
    assert np.abs(found.solid - mirror - step)[mask].mean() < 0.12 * mirror[mask].mean()
    np.testing.assert_allclose(found.hollow[mask], found.solid[mask] / 2, rtol=1e-4)
    assert found.solid.shape == mask.shape and found.solid.dtype == np.float32
    assert (found.solid[~mask] == 0).all() and (found.hollow[~mask] == 0).all()
    # Its back is the front mirrored at the plane across the ray to the object's middle.
    ahead = pixel_rays(camera)[mask].mean(0)
    ahead /= np.linalg.norm(ahead)
    back = normal - 2 * (normal @ ahead)[..., None] * ahead
    assert (found.back[~mask] == 0).all()
    np.testing.assert_allclose(np.linalg.norm(found.back[mask], axis=-1), 1, rtol=1e-5)
    assert np.quantile((found.back * back).sum(-1)[mask], 0.1) > 0.97


@pytest.mark.skipif(not WEIGHTS.is_file(), reason="this checkout has no weights of RefractionNet")
def test_the_shipped_weights_know_a_ball():
    camera = Camera(160, 160, 40)
    photo, mask, normal, depth, true = seen(camera)
    found = thickness(photo, mask, normal, depth, camera)
    assert np.abs(found.solid - true)[mask].sum() < 0.25 * true[mask].sum()
    assert WEIGHTS.stat().st_size < 15e6


def test_a_ball_is_a_surface_of_revolution_and_half_a_ball_is_inflated():
    camera = Camera(64, 64, 40)
    photo, mask, normal, depth, true = seen(camera, (0, 0, -3.0), 0.6)
    guess = thickness(photo, mask, normal, depth, camera)
    best = best_thickness(photo, mask, normal, depth, camera, up=np.array([0.0, 1, 0]))
    assert best.method == "revolution" and best.revolution is not None and best.back is None
    assert np.abs(best.solid - true)[mask].sum() < 0.12 * true[mask].sum()
    assert (
        (best.hollow <= best.solid).all()
        and (best.hollow <= guess.hollow).all()
        and best.hollow.max() > 0
    )
    half = mask & (np.arange(64) > 32)
    best = best_thickness(photo, half, normal, depth, camera, up=np.array([0.0, 1, 0]))
    assert best.method == "outline" and best.front is not None and best.back is not None
    assert (best.hollow <= best.solid).all() and best.hollow.max() > 0
