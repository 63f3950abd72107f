"""Surfaces of distance fields, against a ball; bodies that are whole whatever their seed."""

import numpy as np
import pytest
from shape_measures import volume

from materialist.procedural.objects.glassware import creature, level_set


def open_edges(solid):
    """Directed edges that do not run as often one way as the other."""
    faces = solid.faces.astype(np.int64)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    size = len(solid.vertices)
    number = np.unique(np.sort(edges, 1) @ [size, 1], return_inverse=True)[1]
    there = np.bincount(number, np.where(edges[:, 0] < edges[:, 1], 1, -1))
    return int((there != 0).sum())


def test_a_ball_has_its_volume_its_radius_and_its_normals():
    centre, radius = np.array([0.1, -0.2, 0.05]), 0.7
    ball = level_set(lambda p: np.linalg.norm(p - centre, axis=-1) - radius, 1.1, points=48)
    out = ball.vertices - centre
    np.testing.assert_allclose(np.linalg.norm(out, axis=-1), radius, atol=0.01)
    assert volume(ball) == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.02) and open_edges(ball) == 0
    assert (np.sum(ball.normals * out, -1) / radius).min() > 0.98  # faces and normals look outwards


def test_what_the_box_cuts_is_closed_there():
    block = level_set(lambda p: p[..., 1], 1.0, points=20)
    assert open_edges(block) == 0 and volume(block) == pytest.approx(4, rel=0.15)


@pytest.mark.parametrize("seed", range(6))
def test_creatures_are_whole_and_stand(seed):
    made = creature(np.random.default_rng(seed))
    assert np.isfinite(made.vertices).all() and open_edges(made) == 0
    assert 0.01 < volume(made) < 4
    low = made.vertices[:, 1].min()
    assert (made.vertices[:, 1] < low + 0.01 * np.ptp(made.vertices[:, 1])).sum() >= 3


def test_a_seed_is_a_creature():
    one, same, other = (creature(np.random.default_rng(s)) for s in (3, 3, 4))
    assert np.array_equal(one.vertices, same.vertices)
    assert one.vertices.shape != other.vertices.shape or not np.array_equal(one.vertices, other.vertices)
