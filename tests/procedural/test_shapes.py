"""Procedural shapes: closed, facing outwards, of the right volume."""

import numpy as np
import pytest
from shape_measures import volume

from materialist.procedural.objects import shapes

SOLIDS = {
    "box": (shapes.box(np.array([1.0, 2.0, 3.0])), 6.0),
    "sphere": (shapes.superquadric(np.ones(3), 1, 1), np.pi / 6),
    "ellipsoid": (shapes.superquadric(np.array([1.0, 2.0, 0.5]), 1, 1), np.pi / 6),
    "rounded box": (shapes.superquadric(np.ones(3), 0.25, 0.25), None),
    "capsule": (shapes.capsule(0.2, 0.4), np.pi * 0.04 * 0.4 + 4 / 3 * np.pi * 0.008),
    "cylinder": (shapes.lathe(np.array([(0, 0), (0.5, 0), (0.5, 2), (0, 2)])), np.pi * 0.5),
    "vase": (shapes.vessel(np.array([(0.1, 0), (0.2, 0.3), (0.1, 0.6)]), 0.02), None),
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


def test_sphere_normals_are_radial_through_seam_and_poles():
    sphere, _ = SOLIDS["sphere"]
    radial = (sphere.vertices - [0, 0.5, 0]) / 0.5
    assert np.abs(sphere.normals - radial).max() < 0.02


def test_a_vessel_is_open_and_hollow():
    vase, _ = SOLIDS["vase"]
    lathed = shapes.lathe(np.array([(0, 0), (0.1, 0), (0.2, 0.3), (0.1, 0.6), (0, 0.6)]))
    assert volume(vase) < 0.35 * volume(lathed)


def test_placing_turns_normals_with_the_shape():
    box = shapes.placed(shapes.box(np.ones(3)), scale=2, turn=np.pi / 2, at=(3, -1))
    assert np.allclose(box.vertices.mean(0), [3, 1, -1])
    outward = np.einsum("vi,vi->v", box.vertices - box.vertices.mean(0), box.normals)
    assert np.allclose(outward, 1)


def test_a_panel_faces_right_cross_up():
    panel = shapes.panel(np.zeros(3), np.array([2.0, 0, 0]), np.array([0, 0, -1.0]), (4, 2))
    assert np.allclose(panel.normals, [0, 1, 0])
    a, b, c = panel.vertices[panel.faces[0]]
    assert np.cross(b - a, c - a)[1] > 0
    assert panel.uv.max(0).tolist() == [4, 2]
