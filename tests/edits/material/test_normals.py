"""Normals of polished things that are not round: smooth where the photo is, creased where it is."""

import numpy as np

from materialist.camera import unit
from materialist.edits.material import normals
from materialist.edits.material.normals import guided_normals

MASK = np.zeros((64, 96), bool)
MASK[8:56, 8:88] = True


def degrees(a, b):
    return np.degrees(np.arccos(np.clip((a * b).sum(-1), -1, 1)))


def bumpy(normal):
    """The normals with waves of about ten degrees, as networks predict them."""
    rows, columns = np.indices(normal.shape[:2])
    waves = 0.17 * np.stack([np.sin(1.3 * rows), np.cos(1.1 * columns), 0 * rows], -1)
    return unit(normal + waves).astype(np.float32)


def test_an_even_thing_becomes_smooth_and_the_rest_stays():
    truth = np.broadcast_to(np.float32([0, 0, 1]), (*MASK.shape, 3))
    normal = bumpy(truth)
    result = guided_normals(normal, np.full_like(normal, 0.3), MASK)
    inner = np.s_[16:48, 16:80]
    assert np.median(degrees(result, truth)[inner]) < np.median(degrees(normal, truth)[inner]) / 2
    np.testing.assert_array_equal(result[~MASK], normal[~MASK])
    np.testing.assert_allclose(np.linalg.norm(result, axis=-1), 1, atol=1e-5)


def halves(lean):
    """[H, W, 3] normals that lean to either side of the middle."""
    left = np.arange(96)[:, None] < 48
    normal = unit(np.where(left, [-lean, 0, 1], [lean, 0, 1])).astype(np.float32)
    return np.broadcast_to(normal, (*MASK.shape, 3))


BESIDE = np.s_[16:48, 46:50]
"""Two pixels on either side of the middle."""


def test_a_crease_stays():
    truth = halves(0.8)
    result = guided_normals(bumpy(truth), np.full_like(truth, 0.3), MASK)
    assert np.median(degrees(result, truth)[BESIDE]) < 10


def test_a_gentle_bend_stays_where_the_photo_shows_it():
    truth = halves(0.1)
    left = np.arange(96)[:, None] < 48
    shown = np.broadcast_to(np.where(left, 0.1, 0.5), truth.shape).astype(np.float32)
    off = [
        degrees(guided_normals(truth, photo, MASK), truth)[BESIDE].mean()
        for photo in (shown, np.full_like(truth, 0.3))
    ]
    assert off[0] < 1 < 3 < off[1]


def test_a_pixel_alone_and_a_photo_brighter_than_white():
    normal = bumpy(np.broadcast_to(np.float32([0, 0, 1]), (8, 8, 3)))
    mask = np.zeros((8, 8), bool)
    mask[4, 4] = True
    result = guided_normals(normal, np.full_like(normal, 300.0), mask)
    assert degrees(result, normal)[4, 4] < 0.1


def test_a_small_thing_in_a_large_photo_is_looked_at_alone(monkeypatch):
    """A mask of two hundred leaves took a minute."""
    normal = bumpy(np.broadcast_to(np.float32([0, 0, 1]), (*MASK.shape, 3)))
    photo = np.random.default_rng(0).random(normal.shape, np.float32)
    mask = np.zeros_like(MASK)
    mask[20:30, 40:55] = True
    result = guided_normals(normal, photo, mask)
    blurred = []
    whole = normals._blurred
    monkeypatch.setattr(
        normals,
        "_blurred",
        lambda values, sigma: blurred.append(values.shape) or whole(values, sigma),
    )
    # What lies around it says nothing.
    other = np.where(mask[..., None], photo, 0)
    np.testing.assert_array_equal(guided_normals(normal, other, mask)[mask], result[mask])
    assert {shape[:2] for shape in blurred} == {(10, 15)}
