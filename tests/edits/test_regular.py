"""Patterns on planes go on behind what hides them, in perspective; other pictures are left alone."""

import numpy as np
import pytest

from materialist.camera import pixel_rays
from materialist.edits.remove.exemplar import exemplar_plan
from materialist.edits.remove.regular import regular_sources
from materialist.types import Camera

CAMERA = Camera(120, 96, 50)
SHAPE = (96, 120)


def slanted(colour, tilt=0.6):
    """A plane at depth 2 ahead, leaning back by `tilt` radians: depth, and what `colour` says of its places."""
    normal = np.array([0.25, np.sin(tilt), np.cos(tilt)])
    normal /= np.linalg.norm(normal)
    rays = pixel_rays(CAMERA).astype(float)
    depth = -2 * normal[2] / (rays @ normal)
    point = rays * depth[..., None]
    right = np.cross(normal, [0, 1.0, 0])
    right /= np.linalg.norm(right)
    u, v = point @ right, point @ np.cross(normal, right)
    return depth, np.clip(colour(u, v), 0, 1)


def chequers(u, v):
    # Edges a pixel wide, as a camera would see them.
    wave = np.clip(4 * np.sin(u / 0.2 * np.pi) * np.sin(v / 0.2 * np.pi), -1, 1)
    return np.stack([0.5 + 0.3 * wave, 0.5 + 0.1 * wave, 0.4 + 0 * wave], -1)


def stripes(u, v):
    return np.repeat((0.5 + 0.3 * np.sin((u + 0.4 * v) * 22))[..., None], 3, -1)


@pytest.fixture
def hole():
    rows, columns = np.indices(SHAPE)
    return np.hypot(rows - 50, columns - 62) < 19


@pytest.mark.parametrize("pattern", [chequers, stripes])
def test_a_pattern_goes_on_in_perspective(hole, pattern):
    depth, picture = slanted(pattern)
    noisy = picture + np.random.default_rng(0).normal(0, 0.02, picture.shape)
    torn = np.where(hole[..., None], 0.9, noisy)
    label = np.zeros(SHAPE, int)
    found = regular_sources(torn, torn, hole, ~hole, label, depth, CAMERA)
    told = found >= 0
    assert not told[~hole].any() and told[hole].mean() > 0.97
    assert not hole.ravel()[found[told]].any()  # nothing is copied out of the hole
    error = np.abs(torn.reshape(-1, 3)[found[told]] - picture[told]).mean()
    assert error < 0.03, error  # sources are whole pixels, and noise is 0.016 of it; any other place is off by 0.2
    filled = exemplar_plan(torn, hole, ~hole, label, told=found).fill(torn)
    np.testing.assert_array_equal(filled[~hole], torn[~hole].astype(np.float32))
    np.testing.assert_array_equal(filled[told], torn.reshape(-1, 3)[found[told]].astype(np.float32))
    assert np.abs(filled - picture)[hole].mean() < 0.03


def test_patches_alone_lose_chequers_and_the_rest_of_a_hole_is_theirs(hole):
    depth, picture = slanted(chequers)
    torn, label = np.where(hole[..., None], 0.9, picture), np.zeros(SHAPE, int)
    found = regular_sources(torn, torn, hole, ~hole, label, depth, CAMERA)
    left = np.arange(SHAPE[1]) < 55
    half = np.where(left, found, -1)
    filled = exemplar_plan(torn, hole, ~hole, label, told=half).fill(torn)
    alone = exemplar_plan(torn, hole, ~hole, label).fill(torn)
    error = [np.abs(p - picture)[hole & left].mean() for p in (filled, alone)]
    assert error[0] < 0.7 * error[1]
    assert np.abs(filled - picture)[hole & ~left].mean() < 1.5 * np.abs(alone - picture)[hole & ~left].mean()
    assert np.isfinite(filled).all() and (filled[hole & ~left] < 0.89).all()  # none of it is what was in the hole


def test_what_does_not_repeat_is_not_told(hole):
    rng = np.random.default_rng(1)
    spots = rng.random((30, 3)) * [3, 3, 0.12] + [-1.5, -1.5, 0.03]

    def dotted(u, v):
        inside = [np.hypot(u - x, v - y) < r for x, y, r in spots]
        return np.repeat(0.3 + 0.4 * np.any(inside, 0)[..., None], 3, -1)

    for colour in (dotted, lambda u, v: np.repeat(0.5 + 0.1 * u[..., None], 3, -1)):
        depth, picture = slanted(colour)
        noisy = picture + rng.normal(0, 0.02, picture.shape)
        assert (regular_sources(noisy, noisy, hole, ~hole, np.zeros(SHAPE, int), depth, CAMERA) < 0).all()


def test_each_plane_has_its_own_pattern_and_loose_things_have_none(hole):
    depth, picture = slanted(chequers)
    label = np.where(np.arange(SHAPE[1]) < 62, 0, 1) * np.ones(SHAPE, int)
    found = regular_sources(picture, picture, hole, ~hole, label, depth, CAMERA)
    told = found >= 0
    assert told[hole].mean() > 0.8 and (label.ravel()[found[told]] == label[told]).all()
    assert (regular_sources(picture, picture, hole, ~hole, np.full(SHAPE, -1), depth, CAMERA) < 0).all()


@pytest.mark.parametrize("size", [(1, 1), (1, 40), (96, 3), (90, 114)])
def test_holes_of_any_shape_are_borne(size):
    depth, picture = slanted(chequers)
    hole = np.zeros(SHAPE, bool)
    hole[: size[0], : size[1]] = True
    found = regular_sources(picture, picture, hole, ~hole, np.zeros(SHAPE, int), depth, CAMERA)
    assert not hole.ravel()[found[found >= 0]].any() and (found[~hole] < 0).all()
    far = np.where(np.indices(SHAPE)[0] < 4, 1e6, depth)  # a plane that is none
    regular_sources(picture, picture, hole, ~hole, np.zeros(SHAPE, int), far, CAMERA)


def test_shadows_beside_the_hole_are_not_copied(hole):
    depth, picture = slanted(chequers)
    rows, columns = np.indices(SHAPE)
    shadow = np.hypot(rows - 50, columns - 98) < 12  # where the nearest repeats of much of the hole lie
    seen = np.where(shadow[..., None], 0.5 * picture, picture)
    torn = np.where(hole[..., None], 0.9, seen)
    found = regular_sources(torn, torn, hole, ~hole, np.zeros(SHAPE, int), depth, CAMERA)
    told = found >= 0
    assert told[hole].mean() > 0.97
    assert shadow.ravel()[found[told]].mean() < 0.03
    assert np.abs(torn.reshape(-1, 3)[found[told]] - picture[told]).mean() < 0.035


def test_a_pattern_that_blurs_with_distance_is_still_one():
    from scipy.ndimage import gaussian_filter

    depth, strong = slanted(chequers, tilt=1.0)
    sharp = 0.5 + 0.3 * (strong - 0.5)
    away = np.clip((depth - depth.min()) / (np.percentile(depth, 90) - depth.min()), 0, 1)[..., None]
    picture = sharp + (gaussian_filter(sharp, (3.0, 3.0, 0)) - sharp) * np.sqrt(away)
    rows, columns = np.indices(SHAPE)
    hole = np.hypot(rows - 50, (columns - 62) / 1.6) < 24
    noisy = picture + np.random.default_rng(0).normal(0, 0.01, picture.shape)
    torn = np.where(hole[..., None], 0.9, noisy)
    found = regular_sources(torn, torn, hole, ~hole, np.zeros(SHAPE, int), depth, CAMERA)
    told = found >= 0
    assert told[hole].mean() > 0.95
    assert np.abs(torn.reshape(-1, 3)[found[told]] - picture[told]).mean() < 0.02  # another place is off by 0.05


def test_a_pattern_that_does_not_tell_what_is_known_is_none():
    """Some dots are alike after one shift by chance; elsewhere it says nothing true."""
    rng = np.random.default_rng(18)
    spots = np.concatenate([rng.uniform(-1.2, 1.2, (26, 2)), rng.uniform(0.05, 0.1, (26, 1))], 1)

    def dotted(u, v):
        there = np.zeros(u.shape, bool)
        for x, y, r in spots:
            there |= np.hypot(u - x, v - y) < r
        return np.where(there[..., None], [0.9, 0.85, 0.4], [0.4, 0.1, 0.15])

    depth, picture = slanted(dotted)
    rows, columns = np.indices(SHAPE)
    hole = np.hypot(rows - 50, columns - 62) < 19
    torn = np.where(hole[..., None], 0.5, picture)
    assert (regular_sources(torn, torn, hole, ~hole, np.zeros(SHAPE, int), depth, CAMERA) < 0).all()


def wallpaper(seed, size=(0.66, 0.64), count=14):
    """Dots at random on a tile that repeats."""
    rng = np.random.default_rng(seed)
    spots = np.concatenate([rng.uniform(0, size, (count, 2)), rng.uniform(0.03, 0.07, (count, 1))], 1)

    def dotted(u, v):
        there = np.zeros(u.shape, bool)
        for x, y, r in spots:
            away = [(w - c + t / 2) % t - t / 2 for w, c, t in ((u, x, size[0]), (v, y, size[1]))]
            there |= np.hypot(*away) < r
        return np.where(there[..., None], [0.9, 0.85, 0.4], [0.4, 0.1, 0.15])

    return dotted


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_a_large_tile_that_is_seen_three_times_goes_on(hole, seed):
    """A hidden place has one or two repeats in the picture, a known one hardly more."""
    depth, picture = slanted(wallpaper(seed))
    torn = np.where(hole[..., None], 0.5, picture)
    found = regular_sources(torn, torn, hole, ~hole, np.zeros(SHAPE, int), depth, CAMERA)
    told = found >= 0
    assert told[hole].mean() > 0.7
    error = np.abs(torn.reshape(-1, 3)[found[told]] - picture[told]).mean()
    assert error < 0.5 * np.abs(picture[told] - np.median(picture, (0, 1))).mean()


def test_light_on_the_picture_does_not_hide_the_pattern_of_the_paint(hole):
    depth, picture = slanted(wallpaper(0))
    rows, columns = np.indices(SHAPE)
    light = (
        np.where(np.hypot(rows - 30, columns - 25) < 22, 0.3, 1.0)[..., None] * (0.5 + 0.5 * columns / 120)[..., None]
    )
    paint = np.where(hole[..., None], 0.5, picture)
    seen = np.concatenate([paint, paint * light], -1)
    found = regular_sources(paint, seen, hole, ~hole, np.zeros(SHAPE, int), depth, CAMERA)
    assert (found >= 0)[hole].mean() > 0.7
    # The paint may keep some light: a step between places that repeat is not counted.
    kept = paint * (0.55 + 0.45 * columns / SHAPE[1])[..., None]
    found = regular_sources(kept, seen, hole, ~hole, np.zeros(SHAPE, int), depth, CAMERA)
    assert (found >= 0)[hole].mean() > 0.7


def test_a_pattern_that_does_not_go_on_beside_the_hole_is_not_taken(hole):
    rows, columns = np.indices(SHAPE)
    depth, picture = slanted(chequers)
    other = slanted(wallpaper(3, (7.0, 7.0), 900))[1]
    near = np.hypot(rows - 50, columns - 62) < 19 * 1.6
    torn = np.where(near[..., None], other, picture)
    flat = np.zeros(SHAPE, int)
    assert (regular_sources(picture, picture, hole, ~hole, flat, depth, CAMERA) >= 0)[hole].mean() > 0.95
    assert (regular_sources(torn, torn, hole, ~hole, flat, depth, CAMERA) < 0).all()
