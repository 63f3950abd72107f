"""Procedural shapes: closed, facing outwards, of the right volume."""

import numpy as np
import pytest
from solid_scenes import volume

from materialist_lab.bench.glass_scenes import is_closed
from materialist_lab.procedural.objects import shapes
from materialist_lab.procedural.objects.glassware import creature, level_set

SOLIDS = {
    "box": (shapes.box(np.array([1.0, 2.0, 3.0])), 6.0),
    "slab": (shapes.slab((1.0, 0.6, 2.0)), 1.2),
    "rounded slab": (shapes.slab((1.0, 0.6, 2.0), 0.1), None),
    "sphere": (shapes.superquadric(np.ones(3), 1, 1), np.pi / 6),
    "ellipsoid": (shapes.superquadric(np.array([1.0, 2.0, 0.5]), 1, 1), np.pi / 6),
    "rounded box": (shapes.superquadric(np.ones(3), 0.25, 0.25), None),
    "capsule": (shapes.capsule(0.2, 0.4), np.pi * 0.04 * 0.4 + 4 / 3 * np.pi * 0.008),
    "cylinder": (shapes.lathe(np.array([(0, 0), (0.5, 0), (0.5, 2), (0, 2)])), np.pi * 0.5),
    "vase": (shapes.vessel(np.array([(0.1, 0), (0.2, 0.3), (0.1, 0.6)]), 0.02), None),
    "torus": (shapes.grounded(shapes.torus(1.0, 0.2, 60)), 2 * np.pi**2 * 0.04),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_face_outwards_and_stand_on_the_ground(name):
    solid, expected = SOLIDS[name]
    a, b, c = (solid.vertices[solid.faces[:, k]] for k in range(3))
    outwards = np.einsum("fi,fi->f", np.cross(b - a, c - a), solid.normals[solid.faces].mean(1))
    assert (outwards > 0).mean() > 0.99
    assert np.allclose(np.linalg.norm(solid.normals, axis=-1), 1)
    assert solid.vertices[:, 1].min() == pytest.approx(0, abs=1e-9)
    assert volume(solid) == pytest.approx(expected, rel=0.01) if expected else volume(solid) > 0


def test_a_level_set_has_the_volume_the_radius_and_the_normals_of_a_ball():
    centre = np.array([0.1, -0.2, 0.05])
    radius = 0.7
    ball = level_set(lambda p: np.linalg.norm(p - centre, axis=-1) - radius, 1.1, points=48)
    out = ball.vertices - centre
    np.testing.assert_allclose(np.linalg.norm(out, axis=-1), radius, atol=0.01)
    assert volume(ball) == pytest.approx(4 / 3 * np.pi * radius**3, rel=0.02) and is_closed(ball)
    assert (np.sum(ball.normals * out, -1) / radius).min() > 0.98  # faces and normals look outwards


@pytest.mark.parametrize("seed", range(6))
def test_creatures_are_whole_and_stand(seed):
    body = creature(np.random.default_rng(seed))
    assert np.isfinite(body.vertices).all() and is_closed(body)
    assert 0.01 < volume(body) < 4
    low = body.vertices[:, 1].min()
    assert (body.vertices[:, 1] < low + 0.01 * np.ptp(body.vertices[:, 1])).sum() >= 3
