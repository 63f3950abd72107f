"""Directions towards the light that reaches a scene: a proper density, that sees what is open, and leaves no bias."""

import numpy as np
import pytest
from render_scenes import uniform, wall, with_floor

from materialist.envmap import row_solid_angle, texel_directions
from materialist.render.envmap import is_peaked, is_sunny
from materialist.render.light_sampling import ROWS, LightSampler, openness
from materialist.render.scene import RenderScene
from materialist.types import Camera

CAMERA = Camera(8, 6, 60.0)


@pytest.fixture(scope="module")
def corner() -> RenderScene:
    """A wall on a floor."""
    scene = RenderScene(with_floor(wall(CAMERA), np.zeros((6, 8), int), height=-0.8), CAMERA, device="cpu")
    scene.set_materials(uniform(CAMERA, albedo=0.6, roughness=0.4, metallic=0.3))
    return scene


def lamp(rows: int = 64) -> np.ndarray:
    """A dim map with one bright patch above and behind the camera."""
    envmap = np.full((rows, 2 * rows, 3), 0.1, np.float32)
    envmap[rows // 6 : rows // 3, : rows // 4] = 10.0
    return envmap


def directions(mi, rows: int):
    return mi.Vector3f(*(mi.Float(np.ascontiguousarray(c)) for c in texel_directions(rows, 2 * rows).reshape(-1, 3).T))


@pytest.mark.parametrize("rows", [4, 30, 512])
def test_density_integrates_to_one_and_is_that_of_samples(corner, rows):
    sampler = LightSampler(np.random.default_rng(1).uniform(0, 3, (rows, 2 * rows, 3)) ** 4, np.ones((ROWS, 2 * ROWS)))
    told = np.array(sampler.pdf(directions(corner.mi, sampler.rows))).reshape(sampler.rows, -1)
    told = told * row_solid_angle(sampler.rows)[:, None]
    assert told.sum() == pytest.approx(1, abs=1e-4)
    u = np.random.default_rng(3).random((2, 200_000)).astype(np.float32)
    direction, density = sampler.sample(corner.mi.Point2f(corner.mi.Float(u[0]), corner.mi.Float(u[1])))
    d, rows = np.array(direction).T, sampler.rows
    assert np.mean(np.abs(np.array(sampler.pdf(direction)) - np.array(density)) > 1e-4) < 2e-3  # but at borders
    row = np.minimum((np.arccos(np.clip(d[:, 1], -1, 1)) / np.pi * rows).astype(int), rows - 1)
    column = ((np.arctan2(d[:, 0], -d[:, 2]) / (2 * np.pi) + 0.5) * 2 * rows).astype(int) % (2 * rows)
    counted = np.bincount(row * 2 * rows + column, minlength=2 * rows * rows).reshape(rows, -1) / len(d)
    assert counted == pytest.approx(told, abs=5 * np.sqrt(told.max() / len(d)))


def test_spread_points_are_spread_over_a_lamp(corner):
    """Whatever its rows: 16 points of a lattice have 16 heights, and 16 azimuths, on a lamp of 4 by 8 texels."""
    from materialist.transport.sampling import point

    mi, rows = corner.mi, 32
    envmap = np.zeros((rows, 2 * rows, 3), np.float32)
    envmap[12:16, 20:28] = 1
    sampler = LightSampler(np.kron(envmap, np.ones((2, 2, 1), np.float32)), np.ones((ROWS, 2 * ROWS)))
    index = mi.UInt32(np.arange(16, dtype=np.uint32))
    d = np.array(sampler.sample(point(index, mi.UInt32(16), mi.Point2f(0.1, 0.2)))[0]).T
    for place in (d[:, 1], np.arctan2(d[:, 0], -d[:, 2])):
        gaps = np.diff(np.sort(place))
        assert gaps.min() > np.ptp(place) / 80 and gaps.max() < np.ptp(place) / 5


def test_hard_light_is_aimed_at_and_a_sun_left_to_mitsuba(corner):
    """A patch of k texels in 1 has an unevenness of about 1 / its share: one of a few degrees, or one texel."""
    patch, sun = lamp(), np.full((64, 128, 3), 0.01, np.float32)
    sun[20, 3] = 1e4
    assert is_peaked(patch) and not is_sunny(patch) and is_sunny(sun)
    for envmap, paths in ((patch, 4), (sun, 1), (np.ones((8, 16, 3), np.float32), 3)):
        corner.set_envmap(envmap)
        assert corner.paths == paths


def test_aims_at_the_lamp_alone(corner):
    envmap = lamp()
    sampler = LightSampler(envmap, np.ones((ROWS, 2 * ROWS)))
    density = np.array(sampler.pdf(directions(corner.mi, 64))).reshape(64, 128)
    assert density[20, 100] == 0 and density[15, 5] > 1
    assert sampler.worth
    assert not LightSampler(np.ones((8, 16, 3), np.float32), np.ones((ROWS, 2 * ROWS))).worth
    assert not LightSampler(np.zeros((8, 16, 3), np.float32), np.ones((ROWS, 2 * ROWS))).worth


def test_nothing_arrives_through_the_wall_or_the_floor(corner):
    share = openness(corner.mi_scene, CAMERA)
    forward, up, behind = (ROWS // 2, ROWS), (2, 0), (ROWS // 2 - 4, 0)
    assert share[forward] == 0
    assert share[ROWS - 1].max() < 0.05 < share[up]
    assert share[behind] > 1
    assert share.mean() == pytest.approx(1)


def test_the_picture_is_the_path_tracers(corner):
    corner.set_envmap(lamp())
    assert corner.paths == 4, "three of its own, and one towards the light"
    expected, found = corner.render_path(spp=8192, seed=1), corner.render(spp=4096, seed=2)
    assert found == pytest.approx(expected, rel=0.03, abs=3e-3)
    assert found.mean() == pytest.approx(float(expected.mean()), rel=3e-3)


def test_aiming_removes_noise(corner, monkeypatch):
    """At fewer rays: 13 for each camera ray that aims, 10 for each that does not."""
    corner.set_envmap(lamp())

    def noise(spp: int) -> float:
        return np.stack([corner.render(spp=spp, seed=k) for k in range(40)]).var(0).mean()

    aimed = noise(4)
    monkeypatch.setattr(RenderScene, "_lights", lambda self: None)
    assert aimed < 0.5 * noise(6)


def test_a_peak_that_is_hidden_from_most_is_aimed_at(corner):
    """Behind the wall: what stands out hardly arrives, but is all the light of the rest of the floor."""
    envmap = np.full((64, 128, 3), 0.1, np.float32)
    envmap[24:30, 60:68] = 20.0
    corner.set_envmap(envmap)
    assert not LightSampler(envmap, corner._openness_seen()).worth
    assert corner._lights() is not None


def test_scenes_that_are_compared_aim_alike(corner):
    """Another geometry has another openness, and with it other directions everywhere, unless told."""
    other = RenderScene(wall(CAMERA), CAMERA, device="cpu")
    other.set_materials(uniform(CAMERA, albedo=0.6, roughness=0.4, metallic=0.3))
    for scene in (corner, other):
        scene.set_envmap(lamp())
    density = [np.array(scene._lights()._density) for scene in (corner, other)]
    assert not np.array_equal(*density)
    other.sample_lights_as(corner)
    assert np.array_equal(density[0], np.array(other._lights()._density))
