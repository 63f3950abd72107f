"""Which pixels a removal concerns: soft outlines, pockets of the ground at a foot, crumbs of a shadow's edge."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edit_scenes import block_mask, flat_scene

from materialist.edits.remove.halo import softness
from materialist.edits.remove.hole import ISLAND, _islands, make_hole, pockets

Y, X = np.mgrid[:200, :300]
DISC = np.hypot(Y - 100, X - 150) < 50


def photo(blur):
    share = cv2.GaussianBlur(DISC.astype(np.float32), (0, 0), blur) if blur else DISC
    picture = share[..., None] * [0.7, 0.1, 0.05] + (1 - np.asarray(share)[..., None]) * [0.2, 0.3, 0.25]
    return picture.astype(np.float32)


@pytest.mark.parametrize("blur", [0, 0.5, 2, 3])
def test_outlines_are_as_soft_as_their_blur(blur):
    """A disc behind a Gaussian: in linear light a share s is left at s = 1 - Phi(distance / blur)."""
    found = softness(photo(blur), DISC)
    assert abs(found - 1.5 * blur) <= 1.5 + 0.3 * blur


def test_what_lies_on_one_side_and_what_has_the_same_colour_does_not_count():
    beside = photo(0.5)
    beside[:, 200:] = [0.7, 0.1, 0.05]  # another one of its colour, and its shadow
    beside[150:160, 120:180] *= 0.4
    assert softness(beside, DISC) <= 2
    assert softness(np.full((200, 300, 3), 0.3, np.float32), DISC) == 0
    assert softness(photo(1), np.ones_like(DISC)) == 0


def test_a_removal_takes_the_soft_outline_along_but_nothing_before_it():
    scene, mask = flat_scene(120, 160), block_mask(120, 160)
    sharp = np.where(mask[..., None], [0.8, 0.1, 0.1], [0.1, 0.3, 0.6]).astype(np.float32)
    soft = cv2.GaussianBlur(sharp, (0, 0), 2.0)
    seen = lambda linear: replace(scene, photo=replace(scene.photo, linear=linear, original=linear))  # noqa: E731
    near, wide = (make_hole(seen(linear), mask).gone for linear in (sharp, soft))
    assert (near <= wide).all() and wide.sum() > near.sum()
    right = np.flatnonzero(mask.any(0))[-1]
    depth = scene.depth.copy()
    depth[:, right + 1 :] = 0.5 * depth[mask].min()
    before = make_hole(replace(seen(soft), depth=depth), mask).gone
    assert before[:, right + 2 :].sum() < wide[:, right + 2 :].sum()


def test_a_pocket_at_the_foot_is_of_the_ground():
    plane = np.where(Y > 60, 0, 1)
    plane[DISC] = -1
    pocket = (np.abs(X - 150) < 15) & (Y >= 148) & (Y < 156)
    plane[pocket] = -1
    found = pockets(plane, plane == 0, DISC, 0.15 * DISC.sum())
    assert (found[pocket & ~DISC] == 0).all() and np.array_equal(found[~pocket], plane[~pocket])
    for other in (
        pockets(plane, plane == 1, DISC, 0.15 * DISC.sum()),  # no ground
        pockets(plane, plane == 0, DISC, 5),  # too large
        pockets(np.where((plane == 0) & (X > 150), 2, plane), plane == 0, DISC, 0.15 * DISC.sum()),  # of two planes
    ):
        assert (other[pocket & ~DISC] == -1).all()


def test_a_hole_takes_the_shadow_in_a_pocket_along(monkeypatch):
    scene, mask = flat_scene(120, 160), block_mask(120, 160)
    bottom, left = np.flatnonzero(mask.any(1))[-1], np.flatnonzero(mask.any(0))[0]
    label = np.where(mask, -1, 0).astype(scene.geometry.plane_label.dtype)
    gone = make_hole(scene, mask).gone
    pocket = np.zeros_like(mask)
    pocket[bottom - 2 : bottom + 9, left + 10 : left + 24] = True
    pocket &= ~gone
    label[pocket] = -1
    ground = replace(scene, normal=np.broadcast_to(np.float32([0, 1, 0]), scene.normal.shape))
    ground = replace(ground, geometry=replace(scene.geometry, plane_label=label))
    monkeypatch.setattr(
        "materialist.edits.remove.hole.cast", lambda linear, plane, upward, own, gone: pocket & (plane >= 0)
    )
    found = make_hole(ground, mask)
    assert pocket.any() and found.painted[pocket].all() and found.gone[pocket].all()


def test_crumbs_of_a_shadow_s_edge_are_filled_and_a_handle_s_hole_is_not():
    painted = np.zeros((60, 80), bool)
    painted[10:50, 10:70] = True
    painted[20:30, 20:30] = False  # a handle
    painted[40:42, 40:43] = painted[45, 60] = False  # crumbs
    painted[48:50, 30] = False  # a bay
    found = _islands(painted, ISLAND * 2400)
    assert found.sum() == 7 and found[40:42, 40:43].all() and found[45, 60]


def test_a_hole_has_no_crumbs(monkeypatch):
    scene, mask = flat_scene(120, 160), block_mask(120, 160)
    whole = make_hole(scene, mask).painted
    crumb = np.argwhere(whole)[whole.sum() // 2]

    def with_crumb(linear, plane, upward, own, gone):
        ring = cv2.dilate(gone.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
        ring &= ~gone
        row, column = np.argwhere(ring & (np.abs(np.indices(gone.shape)[0] - crumb[0]) < 3))[0]
        ring[row, column + 1] = False
        return ring

    monkeypatch.setattr("materialist.edits.remove.hole.cast", with_crumb)
    painted = make_hole(scene, mask).painted
    assert not _islands(painted, 1).any()
