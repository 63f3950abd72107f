"""Masks of known shapes, and what cannot be selected."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edit_scenes import scene_of
from PIL import Image

from materialist.edits.select import objects
from materialist.edits.select import select as selecting
from materialist.edits.select.objects import overlap
from materialist.edits.select.select import select
from materialist.errors import InputError
from materialist.geometry.silhouette import window
from materialist.types import Camera


@pytest.fixture(scope="module")
def table():
    """A textured ball with a handle, and a second ball, on a shaded floor; and the masks of the two."""
    h = 120
    w = 160
    rng = np.random.default_rng(3)
    y, x = np.mgrid[:h, :w]
    ball = (x - 60) ** 2 + (y - 60) ** 2 < 28**2
    ring = np.abs(np.hypot(x - 94, y - 60) - 12) < 3.5
    first = ball | (ring & (x > 85))
    second = (x - 130) ** 2 + (y - 85) ** 2 < 14**2
    colour = np.broadcast_to([0.45, 0.42, 0.38], (h, w, 3)) * (0.7 + 0.4 * y / h)[..., None]
    colour = np.where(
        first[..., None],
        np.array([0.7, 0.2, 0.05]) * (0.7 + 0.5 * (60 - x) / 60)[..., None].clip(0.4, 1.3),
        colour,
    )
    colour = np.where(second[..., None], [0.1, 0.2, 0.5], colour)
    photo = (colour * rng.uniform(0.85, 1.15, (h, w, 1))).astype(np.float32).clip(0.01, 1)
    depth = np.where(first, 2.0, np.where(second, 2.3, 3.0)).astype(np.float32)
    depth[:4] = 0
    scene = scene_of(
        Camera(w, h, 40.0), depth, np.broadcast_to([0, 0, 1], (h, w, 3)), photo, completion="none"
    )
    return scene, first, second


@pytest.mark.parametrize("click", [(50, 50), (75, 70), (45, 75)])
def test_one_click_finds_the_whole_object(table, click):
    scene, first, _ = table
    assert overlap(select(scene, click=click), first) > 0.9


def test_several_clicks_and_the_other_object(table):
    scene, first, second = table
    assert overlap(select(scene, click=(130, 85)), second) > 0.85
    assert overlap(select(scene, click=[(50, 50), (60, 80)]), first) > 0.9


def test_what_is_selected_holds_the_clicks(table, monkeypatch):
    """Whatever the networks prefer: MobileSAM's best mask of a part may lie beside the click."""
    scene, first, second = table
    masks = np.where(np.stack([first, second, first | second]), 1, -1).astype(np.float32)
    expected = np.array([0.5, 0.99, 0.1])
    monkeypatch.setattr(objects.sam, "masks", lambda *_, box=None: (masks, expected))
    assert select(scene, click=(50, 50))[50, 50]
    both = select(scene, click=[(50, 50), (130, 85)])
    assert both[50, 50] and both[85, 130]
    with pytest.raises(InputError, match="No object is found that holds the click at 5,110"):
        select(scene, click=(5, 110))


def test_an_extent_is_one_of_the_masks_by_size(table, monkeypatch):
    scene, first, second = table
    part = first.copy()
    part[:, 70:] = False
    sizes = {"small": part, "medium": first, "large": first | second}
    masks = np.where(np.stack([first, first | second, part]), 1, -1).astype(np.float32)

    def answers(*_, box=None):
        # In its box each mask is outlined as it is.
        if box is None:
            return masks, np.array([0.9, 0.5, 0.1])
        boxed = next(m for m in sizes.values() if objects.box_overlap(m, box) == 1)
        return np.where(boxed, 1, -1)[None].astype(np.float32), np.ones(1)

    monkeypatch.setattr(objects.sam, "masks", answers)
    for extent, mask in sizes.items():
        selected = select(scene, click=(50, 50), extent=extent, sharpen=False)
        # What does not touch the clicked thing is left out, as ever.
        assert overlap(selected, first if extent == "large" else mask) > 0.95, extent


@pytest.mark.parametrize(
    ("where", "match"),
    [
        ({"click": (50, 50), "extent": "huge"}, "extent is 'huge'"),
        ({"box": (30, 30, 90, 90), "extent": "small"}, "of a click"),
        ({"click": (50, 50), "method": "grabcut", "extent": "small"}, "network answers"),
        ({"click": (50, 50), "extent": ["small"]}, "choose one of auto, small"),
        ({"click": (50, 50), "method": ["network"]}, "choose one of network, grabcut"),
    ],
)
def test_extents_and_methods_that_are_refused(table, where, match):
    with pytest.raises(InputError, match=match):
        select(table[0], **where)


@pytest.mark.parametrize("legs_in_box", [True, False])
def test_a_click_takes_what_is_outlined_in_the_box_of_its_mask(table, monkeypatch, legs_in_box):
    scene, first, _ = table
    rows, columns = np.nonzero(first)
    seat = first.copy()
    seat[(rows.min() + rows.max()) // 2 :, : columns.max() - 5] = False
    # In the box either the whole thing, or something else.
    boxed = first if legs_in_box else first & ~seat
    boxes = []

    def masks(_, points=(), box=None):
        boxes.append(box)
        mask = seat if box is None else boxed
        return np.where(mask, 1, -1)[None].repeat(3, 0).astype(np.float32), np.ones(3)

    monkeypatch.setattr(objects.sam, "masks", masks)
    y, x = (int(v) for v in np.argwhere(seat)[len(np.argwhere(seat)) // 3])
    selected = select(scene, click=(x, y), sharpen=False)
    expected = first if legs_in_box else seat
    assert objects.overlap(selected, expected) > 0.95
    held = np.argwhere(objects.tidy(seat, [(x, y)]))
    assert boxes[-1] == (*held.min(0)[::-1], *(held.max(0)[::-1] + 1))


@pytest.fixture(scope="module")
def far():
    """A star that is small in a large photo, and its mask."""
    h, w, native = 300, 400, 4
    rng = np.random.default_rng(1)
    y, x = np.mgrid[: h * native, : w * native] / native
    radius = 22 + 8 * np.cos(5 * np.arctan2(y - 100, x - 260))
    star = np.hypot(y - 100, x - 260) < radius
    original = np.where(star[..., None], [0.6, 0.1, 0.05], [0.3, 0.35, 0.3])
    original = (original * rng.uniform(0.9, 1.1, star.shape)[..., None]).astype(np.float32)
    blocks = (h, native, w, native)
    photo = original.reshape(*blocks, 3).mean((1, 3)).astype(np.float32)
    normal = np.broadcast_to([0, 0, 1], (h, w, 3))
    scene = scene_of(
        Camera(w, h, 40.0),
        np.full((h, w), 2, np.float32),
        normal,
        photo,
        photo=photo,
        completion="none",
    )
    scene = replace(scene, photo=replace(scene.photo, original=original))
    return scene, star.reshape(blocks).mean((1, 3)) > 0.5


@pytest.mark.parametrize(
    "prompt",
    [
        pytest.param({"click": (260, 100)}, marks=pytest.mark.slow),
        {"box": (225, 65, 295, 135)},
    ],
)
def test_a_second_look_sharpens_the_border(far, prompt):
    scene, star = far
    once = select(scene, **prompt, sharpen=False)
    twice = select(scene, **prompt)
    assert (twice ^ star).sum() < 0.7 * (once ^ star).sum()
    assert overlap(twice, star) > 0.95


@pytest.mark.parametrize(("reach", "same"), [(1, True), (12, False)])
def test_a_second_look_at_something_else_does_not_count(far, monkeypatch, reach, same):
    scene, star = far
    first = np.where(star, 1, -1).astype(np.float32)
    seen = []

    def masks(rgb, points=(), box=None):
        if rgb.shape[:2] == star.shape:
            return first[None].repeat(3, 0), np.ones(3)
        seen.append((rgb.shape[:2], box))
        within = cv2.resize(first, (4 * 400, 4 * 300))[top:, left:][: rgb.shape[0], : rgb.shape[1]]
        other = np.where(cv2.dilate(within, np.ones((1 + 8 * reach, 1 + 8 * reach))) > 0, 9, -9)
        return other[None].repeat(3, 0).astype(np.float32), np.ones(3)

    rows, columns = window(objects.tidy(star, ()))
    margin = round(0.2 * max(rows.stop - rows.start, columns.stop - columns.start))
    top = 4 * (rows.start - margin)
    left = 4 * (columns.start - margin)
    monkeypatch.setattr(objects.sam, "masks", masks)
    selected = select(scene, box=(225, 65, 295, 135))
    (shape, box) = seen[0]
    assert shape == (
        4 * (rows.stop - rows.start + 2 * margin),
        4 * (columns.stop - columns.start + 2 * margin),
    )
    assert box[:2] == (4 * margin, 4 * margin)
    assert (selected.sum() > 1.05 * star.sum()) == same


def test_a_second_look_keeps_every_click(far, monkeypatch):
    """It sees a star without its tips: what was clicked there stays selected."""
    scene, star = far
    body = cv2.erode(star.astype(np.uint8), np.ones((9, 9))) > 0
    tips = np.argwhere(star & ~body)
    row, column = tips[np.argmax(np.abs(tips - (100, 260)).sum(1))]

    def masks(rgb, points=(), box=None):
        if rgb.shape[:2] == star.shape:
            return np.where(star, 1, -1)[None].repeat(3, 0).astype(np.float32), np.ones(3)
        rows, columns = window(objects.tidy(star, ()), margin=12)
        seen = np.where(body[rows, columns], 9, -9).astype(np.float32)
        seen = cv2.resize(seen, rgb.shape[1::-1], interpolation=cv2.INTER_NEAREST)
        return seen[None].repeat(3, 0), np.ones(3)

    monkeypatch.setattr(objects.sam, "masks", masks)
    monkeypatch.setattr(objects, "SETTINGS", replace(objects.SETTINGS, min_agreement=0.3))
    points = [(260, 100), (int(column), int(row))]
    selected = select(scene, click=points)
    assert all(selected[y, x] for x, y in points)
    assert objects._sharpened(scene, np.where(star, 1.0, -1.0), points[:1]).min() < -9


def test_what_fills_the_photo_is_looked_at_once(table, monkeypatch):
    scene, *_ = table
    everything = np.ones((3, *scene.depth.shape), np.float32)
    looks = []
    monkeypatch.setattr(
        objects.sam, "masks", lambda *_, **__: looks.append(1) or (everything, np.ones(3))
    )
    select(scene, box=(2, 2, 158, 118))
    assert len(looks) == 1


def test_a_line_that_is_clicked_stays(table):
    mask = np.zeros((60, 80), bool)
    mask[20, 10:70] = True
    mask[30:50, 10:70] = True
    assert objects.tidy(mask, [(40, 20)])[20, 40]
    assert not objects.tidy(mask, [(40, 40)])[20, 40]


def test_parts_a_little_apart_are_one_and_keep_their_outline():
    mask = np.zeros((120, 160), bool)
    mask[60:116, 20:60] = True
    mask[60:116, 64:100] = True
    mask[60:80, 30:50] = False  # a corner inwards
    far = mask.copy()
    far[10:40, 120:150] = True
    # What is far away is left out, and neither the gap nor the frame nor the corner is filled.
    kept = objects.tidy(far, [(40, 100)])
    assert not (kept & ~mask).any()
    assert (mask & ~kept).sum() < 20  # corners


def test_the_whole_photo_may_be_a_box(table):
    scene, *_ = table
    assert select(scene, box=(0, 0, 160, 120)).any()


def test_a_click_off_the_object_is_told(table, monkeypatch):
    scene, first, second = table

    def masks(_, points=(), box=None):
        one = {(50, 50): first, (130, 85): second}.get(points[0])
        mask = one if len(points) == 1 else np.ones(first.shape, bool)
        return np.where(mask, 1, -1)[None].repeat(3, 0).astype(np.float32), np.ones(3)

    monkeypatch.setattr(objects.sam, "masks", masks)
    with pytest.raises(InputError, match="100% of the photo together, and each alone at most 15%"):
        select(scene, click=[(50, 50), (130, 85)])


def test_given_masks_are_taken_as_they_are(table, tmp_path):
    scene, first, _ = table
    np.testing.assert_array_equal(select(scene, mask=first), first)
    Image.fromarray((first * 255).astype(np.uint8)).save(tmp_path / "m.png")
    np.testing.assert_array_equal(select(scene, mask=tmp_path / "m.png"), first)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "exactly one"),
        ({"click": (5, 50), "box": (0, 0, 9, 9)}, "exactly one"),
        ({"click": (5, 1)}, "sky"),
        ({"click": (500, 50)}, "160 x 120"),
        ({"click": (-1, 50)}, "outside"),
        ({"click": ("a", 2)}, "must be 2 numbers"),
        ({"click": []}, "empty"),
        ({"box": (10, 10, 11, 50)}, "3 x 3"),
        ({"box": (0, 0, 160, 120), "method": "grabcut"}, "whole photo"),
        ({"box": (1, 2, 3)}, "must be 4 numbers"),
        ({"mask": np.zeros((120, 160), bool)}, "empty"),
        ({"mask": np.ones((12, 16), bool)}, "(12, 16)"),
        ({"mask": "nothing.png"}, "nothing.png"),
        ({"click": (50, 50), "method": "magic"}, "magic"),
    ],
)
def test_what_cannot_be_selected(table, options, words):
    with pytest.raises(InputError) as error:
        select(table[0], **options)
    assert words in str(error.value)


def test_recipes_of_before_name_sam2(table):
    scene, *_ = table
    np.testing.assert_array_equal(
        select(scene, click=(50, 50), method="sam2"), select(scene, click=(50, 50))
    )


def around(mask, more):
    rows = np.flatnonzero(mask.any(1))
    columns = np.flatnonzero(mask.any(0))
    return columns[0] - more, rows[0] - more, columns[-1] + 1 + more, rows[-1] + 1 + more


@pytest.mark.parametrize("more", [0, 6])
@pytest.mark.parametrize("which", [0, 1])
def test_boxes_need_not_be_exact(table, which, more):
    scene, *things = table
    assert overlap(select(scene, box=around(things[which], more)), things[which]) > 0.85


def test_a_box_far_too_large_names_the_box_of_what_is_in_it(table, monkeypatch):
    scene, thing, _ = table
    monkeypatch.setattr(selecting, "object_in", lambda *_, **__: thing)
    with pytest.raises(InputError, match="give that box if it is meant") as error:
        select(scene, box=(1, 1, 159, 119))
    numbers = ",".join(str(edge) for edge in around(thing, 0))
    assert numbers in str(error.value)
