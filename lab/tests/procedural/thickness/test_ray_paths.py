"""Lengths of straight rays through meshes, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from materialist_lab.procedural.objects import shapes
from materialist_lab.procedural.thickness.ray_paths import ShapeTracer

RADIUS = 0.5


def ball(radius=RADIUS, n=160):
    return shapes.moved(shapes.ball(n), scale=radius)


def inside_out(solid):
    return replace(solid, faces=solid.faces[:, ::-1], normals=-solid.normals)


def straight(x, y=0.0):
    """Rays along -Z at places x, from z = 3."""
    x = np.asarray(x, float)
    origin = np.stack([x, 0 * x + y, 0 * x + 3], -1)
    return origin, np.broadcast_to([0.0, 0, -1], origin.shape)


def test_chords_of_a_ball():
    x = np.array([0.003, 0.1, 0.3, 0.45, 0.6])
    paths = ShapeTracer(ball()).trace(*straight(x))
    # Pythagoras: half a chord is sqrt(r^2 - x^2).
    chord = 2 * np.sqrt(np.maximum(RADIUS**2 - x**2, 0))
    np.testing.assert_allclose(paths.solid, chord, atol=5e-3)
    np.testing.assert_allclose(paths.material, chord, atol=5e-3)
    assert np.isinf(paths.first[-1]) and paths.solid[-1] == 0
    np.testing.assert_allclose(paths.first[:4], 3 - chord[:4] / 2, atol=3e-3)
    normal = paths.normal[:4] / np.linalg.norm(paths.normal[:4], axis=-1, keepdims=True)
    np.testing.assert_allclose(normal[:, 0], x[:4] / RADIUS, atol=5e-3)
    # The ray leaves at the mirror image of where it enters.
    leaving = paths.exit_normal[:4] / np.linalg.norm(paths.exit_normal[:4], axis=-1, keepdims=True)
    np.testing.assert_allclose(leaving, normal * [1, 1, -1], atol=1e-2)


def test_a_hollow_ball_has_walls():
    shell = shapes.joined([ball(), inside_out(ball(0.4))])
    x = np.array([0.05, 0.35, 0.45])
    paths = ShapeTracer(shell).trace(*straight(x))
    outer, inner = (2 * np.sqrt(np.maximum(r * r - x * x, 0)) for r in (0.5, 0.4))
    np.testing.assert_allclose(paths.solid, outer, atol=6e-3)
    np.testing.assert_allclose(
        paths.material, outer - inner, atol=1e-2
    )  # the paper's sum of both walls


@pytest.mark.parametrize(
    ("radius", "at", "solid", "material"), [(0.2, 0.4, 1.2, 0.8), (0.3, 0.1, 0.8, 0.8)]
)
def test_gaps_count_as_solid_alone_and_overlaps_once(radius, at, solid, material):
    pair = shapes.joined([shapes.moved(ball(radius), at=(0, 0, z)) for z in (-at, at)])
    paths = ShapeTracer(pair).trace(*straight([0.01]))
    assert paths.solid[0] == pytest.approx(solid, abs=5e-3)
    assert paths.material[0] == pytest.approx(material, abs=1e-2)


def test_slanting_rays_through_a_box():
    box = shapes.box(np.array([1.0, 2.0, 0.5]))
    angle = 0.4
    direction = np.array([[np.sin(angle), 0, -np.cos(angle)]])
    paths = ShapeTracer(box).trace(np.array([[0.0, 1.0, 0.0]]) - 3 * direction, direction)
    # A slab of thickness d is d / cos long along a slanting ray.
    assert paths.solid[0] == pytest.approx(0.5 / np.cos(angle), rel=1e-4)
