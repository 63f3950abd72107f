"""Closed objects: volumes in closed form, and a surface without a gap whatever the mask."""

import numpy as np
import pytest
import trimesh
from geometry_scenes import ball

from materialist.solids.closed import closed_proxy
from materialist.types import Camera

CAMERA = Camera(72, 60, 40.0)


def before_a_wall():
    """Depth, normal, mask and thickness of a ball before a wall at depth 5."""
    depth, normal, mask, thick = ball(CAMERA, (0.1, 0, -3), 0.6)
    return np.where(mask, depth, 5.0), normal, mask, thick


def plate(mask, camera=None):
    """Something 0.3 thick, facing the camera at depth 2, behind any mask."""
    camera = camera or Camera(mask.shape[1], mask.shape[0], 40.0)
    normal = np.tile([0.0, 0, 1], (*mask.shape, 1))
    return np.full(mask.shape, 2.0), normal, mask, np.where(mask, 0.3, 0), camera


def solid_of(shell):
    """Its mesh, whose front, back and wall are joined where they meet: every edge is run through once each way."""
    uses = np.bincount(shell.faces.ravel(), minlength=len(shell.vertices))
    assert np.isfinite(shell.vertices).all() and len(uses) == len(shell.vertices) and uses.all()
    mesh = trimesh.Trimesh(np.round(shell.vertices, 7), shell.faces)  # merges vertices
    assert mesh.is_watertight and mesh.is_winding_consistent
    return mesh


@pytest.fixture(scope="module")
def whole_ball():
    """The ball's shell and its mesh."""
    shell = closed_proxy(*before_a_wall(), CAMERA)
    return shell, solid_of(shell)


def test_a_ball_has_the_volume_and_the_normals_of_a_ball(whole_ball):
    shell, solid = whole_ball
    assert solid.euler_number == 2
    assert solid.volume == pytest.approx(4 / 3 * np.pi * 0.6**3, rel=0.02)
    out = (shell.vertices - [0.1, 0, -3]) / 0.6
    assert np.abs(np.linalg.norm(out, axis=-1) - 1).mean() < 0.02
    cosine = (shell.normals * out).sum(-1)
    assert np.mean(cosine) > 0.985 and np.quantile(cosine, 0.02) > 0.85
    assert np.quantile(cosine[np.linalg.norm(out[:, :2], axis=-1) < 0.9], 0.01) > 0.99


def test_a_back_has_the_normals_that_are_known_of_it():
    depth, normal, mask, thick = before_a_wall()
    leaning = np.tile(np.array([0.6, 0, -0.8]), (*mask.shape, 1))
    shell = closed_proxy(depth, normal, mask, thick, CAMERA, back=leaning)
    out = (shell.vertices - [0.1, 0, -3]) / 0.6
    inner = np.linalg.norm(out[:, :2], axis=-1) < 0.9
    np.testing.assert_allclose(
        shell.normals[inner & (out[:, 2] < 0)] @ [0.6, 0, -0.8], 1, atol=1e-6
    )
    assert np.quantile((shell.normals * out).sum(-1)[inner & (out[:, 2] > 0)], 0.01) > 0.99


def test_hollow_is_a_wall_around_a_cavity(whole_ball):
    solid, solid_mesh = whole_ball
    hollow = closed_proxy(*before_a_wall(), CAMERA, wall=0.1)
    hollow_mesh = solid_of(hollow)
    assert hollow_mesh.euler_number == 4
    cavity = solid_mesh.volume - hollow_mesh.volume
    assert cavity == pytest.approx(4 / 3 * np.pi * 0.5**3, rel=0.12)
    inner = np.s_[len(solid.vertices) :]
    outwards = ((hollow.vertices[inner] - [0.1, 0, -3]) * hollow.normals[inner]).sum(-1)
    assert outwards.mean() < -0.4, "the cavity's normals look into it"


def masks():
    rows, columns = np.mgrid[:36, :48]
    ring = np.hypot(rows - 18, columns - 22)
    yield "disc", ring < 12, 2
    yield "ring", (ring < 15) & (ring > 6), 0
    yield "two parts", (ring < 8) | ((rows > 29) & (columns > 38)), 4
    yield "cut by the frame", (rows > 15) & (columns < 15), 2
    yield "everything", np.ones((36, 48), bool), 2
    yield "touching corners", (rows // 8 + columns // 8) % 2 == 0, None
    yield "noise", np.random.default_rng(3).random((36, 48)) < 0.6, None
    yield "a diagonal line", np.abs(rows - columns) < 3, 2


@pytest.mark.parametrize(
    ("name", "mask", "expected"), list(masks()), ids=[name for name, _, _ in masks()]
)
def test_any_mask_gives_a_watertight_surface(name, mask, expected):
    shell = closed_proxy(*plate(mask))
    solid = solid_of(shell)
    assert solid.volume > 0 and expected in (None, solid.euler_number)
    assert ((shell.uv >= 0) & (shell.uv <= 1)).all()


def test_the_back_stays_before_what_stands_behind():
    depth, normal, mask, thick = before_a_wall()
    shell = closed_proxy(depth, normal, mask, thick, CAMERA, behind=np.full(depth.shape, 3.1))
    assert -shell.vertices[:, 2].min() < 3.105
    assert solid_of(shell).volume > 0
