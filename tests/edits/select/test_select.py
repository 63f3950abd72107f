"""Masks of known shapes, and what cannot be selected."""

import numpy as np
import pytest
from edit_scenes import flat_scene
from PIL import Image
from table_top import overlap, table_top

from materialist.edits.select.objects import borne_out, contrast, convexity, edge_map
from materialist.edits.select.select import Features, select
from materialist.errors import InputError, MaterialistError


@pytest.fixture(scope="module")
def table():
    return table_top()


@pytest.mark.parametrize("click", [(50, 50), (75, 70), (45, 75)])
def test_one_click_finds_the_whole_object(table, click):
    scene, first, _ = table
    assert overlap(select(scene, click=click), first) > 0.9


def test_several_clicks_and_the_other_object(table):
    scene, first, second = table
    assert overlap(select(scene, click=(130, 85)), second) > 0.85
    assert overlap(select(scene, click=[(50, 50), (60, 80)]), first) > 0.9


def test_box(table):
    scene, _, second = table
    found = select(scene, box=(110, 65, 150, 105))
    assert overlap(found, second) > 0.85 and not found[:60].any()


def test_equal_calls_give_equal_masks(table):
    scene, *_ = table
    np.testing.assert_array_equal(select(scene, click=(50, 50)), select(scene, click=(50, 50)))


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
        ({"click": ("a", 2)}, "two numbers"),
        ({"click": []}, "empty"),
        ({"box": (10, 10, 11, 50)}, "3 x 3"),
        ({"box": (0, 0, 160, 120)}, "whole photo"),
        ({"box": (1, 2, 3)}, "x0, y0, x1, y1"),
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


def test_sam2_without_weights_says_what_to_do(table, monkeypatch, tmp_path):
    monkeypatch.setenv("MATERIALIST_MODELS", str(tmp_path))
    with pytest.raises(MaterialistError, match="leave --with sam2 out"):
        select(table[0], click=(50, 50), method="sam2")


def test_a_guessed_relief_is_not_believed():
    rng = np.random.default_rng(0)
    colour = rng.random((60, 80)).astype(np.float32) * 0.1
    colour[:, 40] = 3
    shape = np.zeros((60, 80), np.float32)
    shape[30] = 2  # a horizon that the photo does not show
    assert borne_out(shape, colour) < 0.3
    shape = np.zeros((60, 80), np.float32)
    shape[:, 40] = 2
    assert borne_out(shape, colour) > 0.8


def test_contrast_sees_colour_through_texture():
    y, x = np.mgrid[:40, :60]
    checks = np.where((x + y) % 2 == 0, 20.0, -20.0)
    lab = np.stack([50 + checks, np.where(x < 30, 40.0, 0.0), 0 * checks], -1).astype(np.float32)
    right = contrast(x < 30, lab)
    wrong = contrast(x < 15, lab)
    assert right[20, 28:32].min() > 0.8 and wrong[20, 13:17].max() < 0.2


def test_the_edge_of_a_box_is_inside_it_and_its_foot_is_not():
    """One turn of the surface, seen as an edge of a thing and as the corner between a thing and the ground."""
    rows = np.arange(48)[:, None] + 0 * np.arange(40)
    up, ahead = np.array([0.0, 1, 0]), np.array([0.0, 0, 1])
    strength = {}
    for name, above, below in (("convex", up, ahead), ("concave", ahead, up)):
        normal = np.where((rows < 24)[..., None], above, below).astype(np.float32)
        turns = convexity(normal)
        # A right angle turns as much towards the viewer as upwards.
        assert turns[22:26].max() == pytest.approx(0.5**0.5 * (name == "convex"), abs=1e-5) and turns[:20].max() == 0
        # The photo has an edge there, too, so that the shape's is believed.
        linear = np.where((rows < 24)[..., None], 0.5, 0.2).repeat(3, -1).astype(np.float32)
        features = Features(linear, np.full(rows.shape, 2.0, np.float32), normal)
        strength[name] = edge_map(features)[22:26].max()
    assert strength["concave"] > 1.5 * strength["convex"]


def test_a_click_on_the_last_row_of_an_odd_size():
    """Half of 341 rows is 170, and half of row 340 as well."""
    scene = flat_scene(341, 512)
    assert select(scene, click=(60, 340), method="grabcut").any()
    assert select(scene, click=(511, 340), method="grabcut").any()


def test_a_likelihood_counts_only_where_it_is_sure():
    """A disc on a plate: a map that is sure gets the plate, one that says "perhaps" does not outdo the disc's edge."""
    from materialist.edits.select.objects import certainty, object_around
    from materialist.edits.select.select import Features

    y, x = np.mgrid[:96, :96] - 47.5
    disc, plate = np.hypot(x, y) < 14, np.hypot(x, y) < 36
    colour = np.where(disc[..., None], [0.7, 0.2, 0.1], np.where(plate[..., None], [0.5, 0.45, 0.4], [0.4, 0.45, 0.5]))
    normal = np.broadcast_to(np.float32([0, 0, 1]), (96, 96, 3)).copy()
    features = Features(colour.astype(np.float32), np.full((96, 96), 2, np.float32), normal)

    def found(likely):
        return object_around(features, [(48, 48)], likely.astype(np.float32))

    iou = lambda a, b: (a & b).sum() / (a | b).sum()  # noqa: E731
    sure, perhaps = np.where(plate, 0.98, 0.02), np.where(plate, 0.6, 0.35)
    assert certainty(sure) > 0.9 and certainty(perhaps) < 0.6
    assert iou(found(sure), plate) > 0.85
    assert iou(found(perhaps), disc) > 0.85
