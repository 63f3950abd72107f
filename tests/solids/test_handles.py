"""The body of a jug: what is alike on both sides, without what stands out at one."""

import numpy as np
import pytest
from solid_scenes import CAMERA, UP, lines, turned, view

from materialist.solids.handles import without_handles


@pytest.fixture(scope="module")
def vase():
    """[H, W] bool."""
    height = np.linspace(0, 1, 120)
    side = np.stack([0.2 + 0.05 * np.sin(2.2 * np.pi * height), 0.9 * height], -1)
    outline = np.concatenate([lines((0, 0), side[0]), side, lines(side[-1], (0, 0.9))])
    return view(turned(outline))[1]


def with_handle(mask, side=1):
    """The mask with a ring that ends in it, and where the ring alone is."""
    rows, columns = np.indices(mask.shape)
    middle = int(np.median(np.nonzero(mask)[0]))
    edge = np.flatnonzero(mask[middle])[-1 if side > 0 else 0]
    away = np.hypot((rows - middle) / 1.2, columns - edge - side * 2)
    ring = (away > 7) & (away < 10) & ((columns - edge) * side > -2)
    return mask | ring, ring & ~mask


@pytest.mark.parametrize("side", [-1, 1])
def test_a_handle_is_no_part_of_the_body(vase, side):
    jug, handle = with_handle(vase, side)
    body = without_handles(jug, UP, CAMERA)
    assert not (body & ~jug).any()
    assert (body & handle).sum() < 0.2 * handle.sum()
    assert (body & vase).sum() > 0.99 * vase.sum()


def test_a_spout_opposite_is_no_part_of_it_either(vase):
    """Its mirror image meets the handle."""
    jug, handle = with_handle(vase)
    rows, columns = np.indices(vase.shape)
    top = np.flatnonzero(handle.any(1)).min()
    level = (rows >= top) & (rows < top + 4)
    left = np.flatnonzero(vase[top])[0]
    spout = level & (columns > left - 6) & (columns <= left)
    body = without_handles(jug | spout, UP, CAMERA)
    beyond = (spout | handle) & ~vase
    assert (body & beyond).sum() < 0.25 * beyond.sum()
    assert (body & vase).sum() > 0.99 * vase.sum()


def test_what_is_alike_on_both_sides_or_hardly_alike_has_none(vase):
    assert without_handles(vase, UP, CAMERA) is None
    # A triangle with an upright side.
    rows, columns = np.indices(vase.shape)
    lopsided = (columns > 30) & (columns < 30 + 0.8 * (rows - 20)) & (rows > 20) & (rows < 90)
    assert without_handles(lopsided, UP, CAMERA) is None


@pytest.mark.parametrize("place", [np.s_[5:6, 5:6], np.s_[:, 50:51], np.s_[50:51, :], np.s_[:]])
def test_masks_of_any_shape(vase, place):
    mask = np.zeros(vase.shape, bool)
    mask[place] = True
    body = without_handles(mask, UP, CAMERA)
    assert body is None or not (body & ~mask).any()


def test_what_is_as_thick_as_a_leg_is_no_handle(vase):
    """Another thing before the left of the foot: what it leaves of the foot stands out at one side."""
    rows, columns = np.indices(vase.shape)
    middle = int(np.median(np.nonzero(vase)[1]))
    low = rows > np.percentile(np.nonzero(vase)[0], 80)
    assert without_handles(vase & ~(low & (columns < middle)), UP, CAMERA) is None
