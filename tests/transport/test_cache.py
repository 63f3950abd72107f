"""The transport tables against numerical integrals of the paper's BRDF, with and without occluders."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from disney_reference import diffuse_coefficients, specular_split

from materialist.edits.light.relight import with_sun
from materialist.envmap import texel_directions
from materialist.transport.cache import ROUGHNESS_LEVELS, CacheSettings, TransportCache, point
from materialist.types import Camera, Geometry, Mesh

CAMERA = Camera(12, 9, 60.0)
WALL_DISTANCE = 6.0
WALL_HEIGHT = 3.0
WALL_PIXEL = 5
UP = np.array([0.0, 1.0, 0.0])


def quads(*corners, pixels, planes) -> Geometry:
    """One quad for each [4, 3] of corners, counter-clockwise seen from its bright side."""
    corners = np.asarray(corners, np.float32)  # [Q, 4, 3]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    faces = np.concatenate(
        [
            [[4 * q, 4 * q + 1, 4 * q + 2], [4 * q, 4 * q + 2, 4 * q + 3]]
            for q in range(len(corners))
        ]
    )
    mesh = Mesh(
        vertices=corners.reshape(-1, 3),
        faces=faces.astype(np.int32),
        normals=np.repeat(normal, 4, 0).astype(np.float32),
        uv=np.zeros((4 * len(corners), 2), np.float32),
        face_pixel=np.repeat(pixels, 2).astype(np.int32),
        face_plane=np.repeat(planes, 2).astype(np.int16),
    )
    return Geometry(mesh, np.full((CAMERA.height, CAMERA.width), -1, np.int8))


def floor(size: float = 400.0):
    """Corners of the plane y = -1."""
    return [[-size, -1, size], [size, -1, size], [size, -1, -size], [-size, -1, -size]]


def wall(size: float = 400.0):
    """Corners of a long wall that stands on the floor, before the camera."""
    low = -1.0
    high = WALL_HEIGHT - 1
    z = -WALL_DISTANCE
    return [[-size, low, z], [size, low, z], [size, high, z], [-size, high, z]]


@pytest.fixture(scope="module")
def open_floor():
    return TransportCache(
        quads(floor(), pixels=[0], planes=[-1]), CAMERA, CacheSettings(1024, 1024)
    )


@pytest.fixture(scope="module")
def walled_floor():
    geometry = quads(floor(), wall(), pixels=[0, WALL_PIXEL], planes=[-1, -1])
    return TransportCache(geometry, CAMERA, CacheSettings(4096, 16))


def hemisphere(rows: int = 400):
    """Midpoint directions of the hemisphere above +Y [N, 3], and their cosine-weighted solid angles [N]."""
    theta, phi = np.meshgrid(
        (np.arange(rows) + 0.5) / rows * np.pi / 2, (np.arange(2 * rows) + 0.5) / rows * np.pi
    )
    d = np.stack(
        [np.sin(theta) * np.cos(phi), np.cos(theta), np.sin(theta) * np.sin(phi)], -1
    ).reshape(-1, 3)
    weight = np.cos(theta) * np.sin(theta) * (np.pi / 2 / rows) * (np.pi / rows)
    return d, weight.ravel()


def floor_rows(cache):
    """Some rows of the tables, on the floor: index, position [3], direction to the camera [3]."""
    position = np.array(cache.position).T
    on_floor = np.flatnonzero(
        (np.abs(position[:, 1] + 1) < 1e-3) & (position[:, 2] > -WALL_DISTANCE + 0.3)
    )
    for row in on_floor[:: max(1, len(on_floor) // 5)]:
        p = position[row].astype(np.float64)
        yield row, p, -p / np.linalg.norm(p)


def constant(value: float, height: int = 16):
    return np.full((height, 2 * height, 3), value, np.float32)


def test_open_plane_under_constant_light_has_the_analytic_diffuse_lobe(open_floor):
    tables = open_floor.gather(constant(2.0), None)
    d, weight = hemisphere()
    for row, _, wo in floor_rows(open_floor):
        expected = 2 * (diffuse_coefficients(UP, d, wo) * weight[:, None]).sum(0) / np.pi
        np.testing.assert_allclose(
            tables.diffuse[row].reshape(3, 3)[:, 1], expected, rtol=2e-3, atol=2e-3
        )


def test_a_small_sun_is_neither_missed_nor_met_twice():
    """The whole floor sees it through the same directions: an error is that of the picture."""
    cache = TransportCache(quads(floor(), pixels=[0], planes=[-1]), CAMERA)
    ratio = []
    for azimuth, elevation in np.random.default_rng(2).uniform((-180, 35), (180, 80), (24, 2)):
        _, light = with_sun(constant(1.0, 256), azimuth, elevation)
        d = texel_directions(256, 512)
        solid = (
            2
            * np.pi
            / 512
            * (np.cos(np.arange(256) / 256 * np.pi) - np.cos(np.arange(1, 257) / 256 * np.pi))
        )
        truth = (light[..., 0] * np.maximum(d[..., 1], 0) * solid[:, None]).sum() / np.pi
        ratio.append(cache.gather(light, None).diffuse[:, 0].numpy().mean() / truth)
    assert np.std(ratio) < 0.12, ratio


@pytest.mark.parametrize(
    "level",
    [2, pytest.param(4, marks=pytest.mark.slow), pytest.param(6, marks=pytest.mark.slow), 7],
)
def test_open_plane_under_constant_light_has_the_analytic_specular_lobe(open_floor, level):
    tables = open_floor.gather(constant(1.0), None)
    d, weight = hemisphere(500)
    for row, _, wo in floor_rows(open_floor):
        if wo[1] < 0.15:
            continue  # the grid of the reference is too coarse at grazing angles
        s0, s1 = specular_split(np.full(len(d), ROUGHNESS_LEVELS[level]), UP, d, wo)
        measured = tables.specular[level, row].reshape(2, 3)[:, 0].numpy()
        np.testing.assert_allclose(measured, [(s0 * weight).sum(), (s1 * weight).sum()], atol=6e-3)
        assert measured.sum() <= 1 + 1e-3


def test_sharpest_level_is_a_mirror(open_floor):
    """S0 + S1 of the smallest roughness is the light from the mirrored direction."""
    height = 64
    envmap = (texel_directions(height, 2 * height) + 1.5).astype(np.float32)
    tables = open_floor.gather(envmap, None)
    for row, _, wo in floor_rows(open_floor):
        mirrored = 2 * wo[1] * UP - wo
        both = tables.specular[0, row].reshape(2, 3).sum(0)
        np.testing.assert_allclose(both, mirrored + 1.5, atol=0.02)


def test_wall_hides_the_light_behind_it(walled_floor):
    """Light from the side of the wall alone; what the wall leaves of it is a form factor in closed form."""
    height = 128
    directions = texel_directions(height, 2 * height)
    envmap = np.repeat(directions[..., 2:] < 0, 3, -1).astype(np.float32)
    tables = walled_floor.gather(envmap, None)
    d, weight = hemisphere()
    for row, p, wo in floor_rows(walled_floor):
        seen = (d[:, 2] < 0) & ~_meets_wall(p, d)
        gap = WALL_DISTANCE + p[2]
        # strip of infinite length beside a horizontal element
        closed_form = 0.5 * gap / np.hypot(gap, WALL_HEIGHT)
        assert (seen * weight).sum() / np.pi == pytest.approx(closed_form, abs=2e-3)
        expected = (diffuse_coefficients(UP, d, wo) * (seen * weight)[:, None]).sum(0) / np.pi
        np.testing.assert_allclose(tables.diffuse[row].reshape(3, 3)[:, 0], expected, atol=6e-3)


@pytest.mark.parametrize("plane", [-1, 0], ids=["seen", "continued"])
def test_wall_sends_the_radiance_of_its_pixel(plane):
    geometry = quads(floor(), wall(), pixels=[0, WALL_PIXEL], planes=[-1, plane])
    cache = TransportCache(geometry, CAMERA, CacheSettings(4096, 16))
    radiance = np.zeros((CAMERA.height, CAMERA.width, 3), np.float32)
    radiance.reshape(-1, 3)[WALL_PIXEL] = (3.0, 2.0, 1.0)
    tables = cache.gather(constant(0.0), radiance)
    d, weight = hemisphere()
    for row, p, wo in floor_rows(cache):
        expected = (diffuse_coefficients(UP, d, wo) * (_meets_wall(p, d) * weight)[:, None]).sum(
            0
        ) / np.pi
        measured = tables.diffuse[row].reshape(3, 3).numpy()
        np.testing.assert_allclose(measured, expected[:, None] * [3, 2, 1], atol=1.5e-2)


def _meets_wall(p, d):
    """Whether rays from p [3] along d [N, 3] meet the wall, taken as endless."""
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (-WALL_DISTANCE - p[2]) / d[:, 2]
        y = p[1] + t * d[:, 1]
    return (d[:, 2] < 0) & (y < WALL_HEIGHT - 1)


def test_equal_seeds_give_equal_tables():
    geometry = quads(floor(), wall(), pixels=[0, WALL_PIXEL], planes=[-1, -1])
    rng = np.random.default_rng(1)
    envmap = rng.random((16, 32, 3))
    radiance = rng.random((CAMERA.height, CAMERA.width, 3))
    first, again, other = (
        TransportCache(geometry, CAMERA, seed=s).gather(envmap, radiance) for s in (4, 4, 5)
    )
    assert first.diffuse.equal(again.diffuse) and first.specular.equal(again.specular)
    assert not first.diffuse.equal(other.diffuse)


def test_points_fill_the_square():
    """Every cell of a 64 x 64 grid holds 4 points, give or take one a side: far more even than random."""
    count = 1 << 14
    x, y = np.array(
        point(dr.arange(mi.UInt32, count), dr.opaque(mi.UInt32, count), mi.Point2f(0.2, 0.7))
    )
    assert x.min() >= 0 and y.min() >= 0 and x.max() < 1 and y.max() < 1
    counts, _, _ = np.histogram2d(x, y, bins=64, range=[[0, 1], [0, 1]])
    assert counts.min() >= 2 and counts.max() <= 6


def test_a_large_picture_has_no_more_rays_than_one_of_a_megapixel():
    settings = CacheSettings()
    assert settings.at_size(1024 * 1024) == settings
    large = settings.at_size(2048 * 2048)
    assert (large.diffuse_samples, large.specular_samples) == (16, 4)
    assert settings.at_size(2**40).specular_samples == 1
