"""Shapes and views that RefractionNet learns from."""

from dataclasses import replace

import numpy as np
import pytest

from materialist.errors import InputError
from materialist.predict.refraction.crop import (
    ANSWERS,
    BACK_X,
    CHANNELS,
    MARGIN,
    MASK,
    MIRROR,
    NORMAL_X,
    SIDE,
)
from materialist_lab.procedural.objects import shapes as solids
from materialist_lab.procedural.objects.glassware import Shape, make_shape
from materialist_lab.procedural.thickness import dataset
from materialist_lab.procedural.thickness.ray_paths import ShapeTracer


@pytest.mark.parametrize("index", range(20))
def test_every_kind_of_shape_is_usable(index):
    shape = make_shape(index)
    vertices = shape.solid.vertices
    assert np.isfinite(vertices).all() and np.ptp(vertices, axis=0).max() == pytest.approx(1)
    np.testing.assert_allclose(vertices.min(0) + vertices.max(0), 0, atol=1e-9)
    assert shape.solid.faces.max() < len(vertices)
    # Level rays from the front meet it from outside, whatever it is, and run through material behind that.
    origin = np.stack(
        np.meshgrid(np.linspace(-0.4, 0.4, 24), np.linspace(-0.4, 0.4, 24), [2.0]), -1
    ).reshape(-1, 3)
    paths = ShapeTracer(shape.solid).trace(origin, np.broadcast_to([0.0, 0, -1], origin.shape))
    hit = np.isfinite(paths.first)
    assert hit.any() and (paths.material <= paths.solid + 1e-3).all()
    assert (paths.material[hit] > 0).mean() > 0.95
    assert not shape.hollow or paths.material[hit].sum() < 0.95 * paths.solid[hit].sum()


@pytest.fixture(scope="module")
def ball():
    return Shape(solids.moved(solids.ball(96), scale=0.5), hollow=False, upright=True)


def test_a_balls_view_is_consistent(ball):
    view = dataset.draw_view(ball, ShapeTracer(ball.solid), np.random.default_rng(1), exact=True)
    maps, target = (array.astype(float) for array in view)
    assert maps.shape == (CHANNELS, SIDE, SIDE) and target.shape == (ANSWERS, SIDE, SIDE)
    inside = maps[MASK] > 0.5
    assert np.array_equal(inside, target[0] > 0)
    assert (maps[:, ~inside] == 0).all()
    # A ball's size is the root of its disc's area: its greatest thickness is 2 r / (sqrt(pi) r), seen from afar.
    assert target[0].max() == pytest.approx(2 / np.sqrt(np.pi), rel=0.15)
    assert np.abs(maps[MIRROR] - target[0])[inside].mean() < 0.06 * target[0][inside].mean()
    np.testing.assert_allclose(target[0], target[1], atol=0.02)
    # A ball's back is its front in a mirror.
    front = maps[NORMAL_X : NORMAL_X + 3] * np.array([1, 1, -1])[:, None, None]
    inner = inside & (maps[7] > 0.35)
    assert (front * target[BACK_X:]).sum(0)[inner].mean() > 0.97
    # Seen normals look towards the viewer: n.v is positive, largest in the middle.
    assert maps[7][inside].min() > -1e-3 and maps[7].max() > 0.98


def test_frames_are_those_of_prediction_and_a_little_off(ball):
    """The network must not learn one exact frame: a window a few percent larger doubled its error."""
    sides = []
    for seed in range(16):
        maps, _ = dataset.draw_view(ball, ShapeTracer(ball.solid), np.random.default_rng(seed))
        inside = maps[MASK] > 0.5
        sides.append(max(inside.any(0).sum(), inside.any(1).sum()))
    # The exact frame leaves MARGIN on every side.
    framed = SIDE / (1 + 2 * MARGIN)
    assert np.mean(sides) == pytest.approx(framed, abs=2) and 0.6 < np.std(sides) < 5


def test_stretching_the_rays_is_stretching_the_shape(ball):
    rng = np.random.default_rng(4)
    pose = dataset.draw_pose(rng, upright=True)
    # The stretched shape itself, its normals turned outwards where the stretch mirrors.
    stretched = replace(ball.solid, vertices=ball.solid.vertices @ pose.stretch.T)
    normals = solids.smooth_normals(stretched.vertices, stretched.faces)
    stretched = replace(stretched, normals=normals * np.sign(np.linalg.det(pose.stretch)))
    plain = replace(pose, stretch=np.eye(3))
    rays = dataset.window_rays(stretched.vertices @ pose.to_camera.T + pose.centre)
    a, normal_a, back_a = dataset.look(ShapeTracer(ball.solid), pose, rays)
    b, normal_b, back_b = dataset.look(ShapeTracer(stretched), plain, rays)
    both = np.isfinite(a.first) & np.isfinite(b.first)
    assert both.mean() > 0.3 and (np.isfinite(a.first) == np.isfinite(b.first)).mean() > 0.99
    np.testing.assert_allclose(a.first[both], b.first[both], atol=2e-3)
    np.testing.assert_allclose(a.solid[both], b.solid[both], atol=6e-3)
    # Thin borders have steep normals, which the mesh's faces round off.
    inner = both & (a.solid > 0.3)
    for first, second in ((normal_a, normal_b), (back_a, back_b)):
        agreement = np.sum(first.reshape(-1, 3)[inner] * second.reshape(-1, 3)[inner], -1)
        assert np.median(agreement) > 0.999


def test_views_are_made_once_and_belong_to_their_plan(tmp_path):
    plan = dataset.ViewPlan(shapes=2, views=2)
    dataset.produce(tmp_path / "set", plan)
    first = dataset.load_views(tmp_path / "set")
    assert first["maps"].shape == (4, CHANNELS, SIDE, SIDE) and np.isfinite(first["maps"]).all()
    before = (tmp_path / "set" / "00001.npz").stat().st_mtime_ns
    # One more shape: the others stay as they are.
    dataset.produce(tmp_path / "set", replace(plan, shapes=3))
    assert (tmp_path / "set" / "00001.npz").stat().st_mtime_ns == before
    assert len(dataset.load_views(tmp_path / "set")["maps"]) == 6
    assert np.array_equal(dataset.make_views(1, plan)["maps"], first["maps"][2:])
    with pytest.raises(InputError, match="was begun with"):
        dataset.produce(tmp_path / "set", replace(plan, seed=5))
    with pytest.raises(InputError, match="no views to learn from"):
        dataset.load_views(tmp_path)
