"""A body inflated from its outline: of a circle it is a ball."""

import numpy as np
import pytest

from materialist.camera import pixel_rays
from materialist.errors import InputError
from materialist.solids.inflated import inflated
from materialist.types import Camera

CAMERA = Camera(120, 120, 14)  # a narrow view: the outline of a ball is nearly a circle


def ball(centre, radius):
    """Depth, normal, mask and thickness along the rays of a ball."""
    rays = pixel_rays(CAMERA).astype(float)
    centre = np.array(centre, float)
    a = (rays**2).sum(-1)
    b = rays @ centre
    root = b**2 - a * (centre @ centre - radius**2)
    mask = root > 0
    root = np.sqrt(np.maximum(root, 0))
    depth = np.where(mask, (b - root) / a, 0)
    normal = (rays * depth[..., None] - centre) / radius
    normal = np.where(mask[..., None], normal, [0, 0, 1])
    return depth, normal, mask, np.where(mask, 2 * root / np.sqrt(a), 0)


def test_a_circle_gives_a_ball_whatever_its_maps_say():
    depth, normal, mask, thickness = ball((0.1, -0.05, -6), 0.5)
    flat = np.tile([0.0, 0, 1], (*mask.shape, 1))
    body = inflated(depth, flat, mask, CAMERA)
    # Pixels round the outline: within some percent of the radius.
    assert np.abs(body.thickness - thickness)[mask].mean() < 0.03
    assert np.abs(body.depth - depth)[mask].mean() < 0.03
    cosine = (body.normal * normal).sum(-1)[mask]
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 4
    # The back is the front's mirror image, and outside the mask nothing changed.
    ahead = np.array([0.1, -0.05, -6]) / np.linalg.norm([0.1, -0.05, -6])
    mirrored = normal - 2 * (normal @ ahead)[..., None] * ahead
    assert (body.back * mirrored).sum(-1)[mask].mean() > 0.98
    assert (body.thickness[~mask] == 0).all() and (body.normal[~mask] == flat[~mask]).all()


def test_scale_is_that_of_the_depth_and_a_leaning_object_leans():
    depth, normal, mask, _ = ball((0, 0, -6), 0.4)
    once = inflated(depth, normal, mask, CAMERA)
    twice = inflated(2 * depth, normal, mask, CAMERA)
    np.testing.assert_allclose(twice.thickness, 2 * once.thickness, rtol=1e-5)
    np.testing.assert_allclose(twice.depth[mask], 2 * once.depth[mask], rtol=1e-5)
    rows = np.arange(120)[:, None]
    leaning = inflated(np.where(mask, depth + 0.01 * rows, 0), normal, mask, CAMERA)
    change = leaning.depth - once.depth
    column = change[:, 60][mask[:, 60]]
    assert np.polyfit(np.arange(len(column)), column, 1)[0] == pytest.approx(0.01, rel=0.15)


def test_what_the_frame_cuts_goes_on_beyond_it():
    depth = np.full((120, 120), 3.0)
    normal = np.tile([0.0, 0, 1], (120, 120, 1))
    mask = np.zeros((120, 120), bool)
    mask[:, 40:80] = True
    body = inflated(depth, normal, mask, CAMERA)
    # A strip from edge to edge: its section is the same in every row, and widest in its middle.
    np.testing.assert_allclose(body.thickness[:1], body.thickness[50:51], rtol=1e-3)
    assert body.thickness[50].argmax() in (59, 60)
    everything = inflated(depth, normal, np.ones((120, 120), bool), CAMERA)
    assert np.isfinite(everything.thickness).all() and np.isfinite(everything.normal).all()
    with pytest.raises(InputError, match="covers no surface"):
        inflated(depth, normal, np.zeros((120, 120), bool), CAMERA)
