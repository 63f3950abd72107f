"""Filled holes at native size: smooth outlines outside and inside, the detail of the sources, the photo elsewhere."""

from dataclasses import replace

import numpy as np

from materialist.edits.composite import upsample
from materialist.edits.remove.native import outline, with_hole
from materialist.edits.remove.patches import Plan
from materialist.types import Camera, Photo


def photo_of(large, factor):
    height, width = large.shape[0] // factor, large.shape[1] // factor
    small = large.reshape(height, factor, width, factor, 3).mean((1, 3)).astype(np.float32)
    return Photo(linear=small, original=large.astype(np.float32), camera=Camera(width, height, 45.0))


def test_the_outline_is_smooth_and_thin_holes_are_kept():
    rows, columns = np.mgrid[:40, :40] + 0.5
    share = outline(np.hypot(rows - 20, columns - 20) < 11, (320, 320))
    y, x = np.mgrid[:320, :320] + 0.5
    radius = np.hypot(y - 160, x - 160) / 8
    rim = (share > 0.3) & (share < 0.7)
    assert rim.sum() > 60 and radius[rim].std() < 0.25  # of whole pixels: 0.4
    assert (share[radius < 9.5] == 1).all() and not share[radius > 11.8].any()
    lines = np.zeros((40, 40), bool)
    lines[10], lines[20:22] = True, True
    assert outline(lines, (320, 320))[84].all() and outline(lines, (320, 320))[168].all(), "thin ones are kept"


def test_surfaces_part_along_smooth_lines_in_the_hole():
    """Two surfaces meet in a slanted line under the hole: at native size it has no stairs."""
    factor = 8
    rows, columns = np.mgrid[:48, :64]
    label = (rows > 20 + 0.3 * (columns - 32)).astype(int)
    y, x = np.mgrid[: 48 * factor, : 64 * factor]
    flat = np.where((y / factor > 20.5 + 0.3 * (x / factor - 32.5))[..., None], 0.8, 0.2) * np.ones(3)
    hole = np.hypot(rows - 24, columns - 32) < 14
    linear = np.where(label[..., None] == 1, 0.8, 0.2).astype(np.float32) * np.ones(3, np.float32)
    filled = with_hole(photo_of(flat, factor), linear, hole, None, label).original[..., 0]
    inside = np.kron(np.hypot(rows - 24, columns - 32) < 11, np.ones((factor, factor))) > 0
    edge = inside & (filled > 0.4) & (filled < 0.6)
    across = (y + 0.5) / factor - 20.5 - 0.3 * ((x + 0.5) / factor - 32.5)
    assert edge.sum() > 50 and np.abs(across[edge] - np.median(across[edge])).max() < 0.4  # of whole pixels: up to 1
    assert np.abs(np.median(across[edge])) < 0.5
    beyond = inside & (np.abs(across) > 1.5)
    np.testing.assert_allclose(filled[beyond], np.where(across > 0, 0.8, 0.2)[beyond], atol=0.01)


def test_detail_comes_from_the_sources_and_the_rest_is_the_photo():
    factor = 4
    x = np.arange(48 * factor)[None].repeat(32 * factor, 0)
    fine = 0.4 + 0.2 * ((x % 4) < 2)[..., None] * np.ones(3)  # as wide as a working pixel: gone at working size
    photo = photo_of(fine, factor)
    hole = np.zeros((32, 48), bool)
    hole[10:20, 10:20] = True
    spoiled = fine.copy()
    spoiled[40:80, 40:80] = 0
    rows, columns = np.nonzero(hole)
    plan = Plan(rows, columns, rows * 48 + columns + 20, np.ones(len(rows), np.float32), hole)
    photo = replace(photo, original=spoiled.astype(np.float32))
    found = with_hole(photo, photo.linear, hole, plan, np.zeros((32, 48), int))
    np.testing.assert_array_equal(found.original[:40], spoiled[:40].astype(np.float32))
    np.testing.assert_allclose(found.original[46:74, 46:74], fine[46:74, 46:74], atol=0.02)


def test_strips_have_no_seams(monkeypatch):
    rng = np.random.default_rng(0)
    photo = photo_of(rng.random((24 * 5, 32 * 5, 3)), 5)
    rows, columns = np.mgrid[:24, :32]
    hole, label = np.hypot(rows - 12, columns - 15) < 8, (rows > 11).astype(int) + 2 * (columns > 16)
    r, c = np.nonzero(hole)
    plan = Plan(r, c, r * 32 + (c + 9) % 32, np.ones(len(r), np.float32), hole)
    whole = with_hole(photo, photo.linear[:, ::-1], hole, plan, label).original
    monkeypatch.setattr(upsample.strips, "__defaults__", (7, 0))
    np.testing.assert_array_equal(with_hole(photo, photo.linear[:, ::-1], hole, plan, label).original, whole)
    assert (whole != photo.original).mean() > 0.2
