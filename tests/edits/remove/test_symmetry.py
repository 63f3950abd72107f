"""Patterns on planes go on behind what hides them, in perspective; other pictures are left alone."""

import numpy as np
import pytest

from materialist.camera import pixel_rays
from materialist.edits.remove.patches import copied, patch_sources
from materialist.edits.remove.symmetry import repeated_sources
from materialist.types import Camera

CAMERA = Camera(120, 96, 50)
SHAPE = (96, 120)
FLAT = np.zeros(SHAPE, int)
ROWS, COLUMNS = np.indices(SHAPE)
HOLE = np.hypot(ROWS - 50, COLUMNS - 62) < 19


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


def sources(paint, depth, *, hole=HOLE, shown=None, label=FLAT):
    return repeated_sources(paint, paint if shown is None else shown, hole, ~hole, label, depth, CAMERA)


@pytest.mark.parametrize("pattern", [chequers, stripes])
def test_a_pattern_goes_on_in_perspective(pattern):
    depth, picture = slanted(pattern)
    noisy = picture + np.random.default_rng(0).normal(0, 0.02, picture.shape)
    torn = np.where(HOLE[..., None], 0.9, noisy)
    found = sources(torn, depth)
    told = found >= 0
    assert not told[~HOLE].any() and told[HOLE].mean() > 0.97
    assert not HOLE.ravel()[found[told]].any()  # nothing is copied out of the hole
    # Sources are whole pixels, and noise is 0.016 of it; any other place is off by 0.2.
    assert np.abs(torn.reshape(-1, 3)[found[told]] - picture[told]).mean() < 0.03
    filled = copied(torn, patch_sources(torn, HOLE, ~HOLE, FLAT, known=found))
    np.testing.assert_array_equal(filled[~HOLE], torn[~HOLE].astype(np.float32))
    assert np.abs(filled - picture)[HOLE].mean() < 0.03


def test_what_does_not_repeat_gives_no_source():
    rng = np.random.default_rng(1)
    spots = rng.random((30, 3)) * [3, 3, 0.12] + [-1.5, -1.5, 0.03]

    def dotted(u, v):
        inside = [np.hypot(u - x, v - y) < r for x, y, r in spots]
        return np.repeat(0.3 + 0.4 * np.any(inside, 0)[..., None], 3, -1)

    for colour in (dotted, lambda u, v: np.repeat(0.5 + 0.1 * u[..., None], 3, -1), wallpaper(3, (7.0, 7.0), 900)):
        depth, picture = slanted(colour)
        noisy = picture + rng.normal(0, 0.02, picture.shape)
        assert (sources(noisy, depth) < 0).all()


def test_shadows_beside_the_hole_are_not_copied():
    depth, picture = slanted(chequers)
    shadow = np.hypot(ROWS - 50, COLUMNS - 98) < 12  # where the nearest repeats of much of the hole lie
    seen = np.where(shadow[..., None], 0.5 * picture, picture)
    found = sources(np.where(HOLE[..., None], 0.9, seen), depth)
    told = found >= 0
    assert told[HOLE].mean() > 0.97 and shadow.ravel()[found[told]].mean() < 0.03
