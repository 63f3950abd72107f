"""What of a selection has the material of a click."""

import numpy as np
import pytest
from part_scenes import CLOTH, LEGS, SHADE, THING, H, W, albedo, scene

from materialist.edits.select import material
from materialist.edits.select.material import of_material, part_at, parts_of
from materialist.predict.sam import masks as sam

LEG = (60, 70)


def outlining(monkeypatch, *parts, expected=0.95):
    """The network outlines the smallest of these parts at a click on it."""

    def masks(rgb, clicks):
        ((x, y),) = clicks
        there = sorted((part for part in parts if part[y, x]), key=np.sum)
        outline = there[0] if there else np.zeros((H, W), bool)
        return np.where(outline, 1.0, -1.0)[None], np.array([expected if there else 0.0])

    monkeypatch.setattr(sam, "masks", masks)


def test_a_material_is_all_of_its_colour_in_the_selection_and_shade_is_none():
    part = of_material(scene(), THING, [CLOTH], network=False)
    assert (part != (THING & ~LEGS)).mean() < 0.01
    assert not part[~THING].any()


def test_each_click_names_a_material():
    both = of_material(scene(), THING, [CLOTH, LEG], network=False)
    assert (both != THING).mean() < 0.01
    legs = of_material(scene(), THING, [LEG], network=False)
    assert (legs != LEGS).mean() < 0.01


def test_what_is_around_a_click_stays_whatever_colour_it_has():
    colour = albedo()
    colour[40:43, 40:43] = (0.1, 0.1, 0.6)
    part = of_material(scene(colour), THING, [(41, 41)], network=False)
    assert part[40:43, 40:43].all() and (part != (THING & ~LEGS)).mean() < 0.01


def test_seams_stay_and_specks_go():
    colour = albedo(shade=1)
    colour[20:26, 30:36] = (0.8, 0.7, 0.7)  # 36 of 4000 pixels
    colour[30:32, 20:100] = (0.02, 0.02, 0.02)
    colour[70, 30:33] = (0.5, 0.1, 0.1)  # on a leg
    part = of_material(scene(colour), THING, [CLOTH], network=False)
    assert part[20:26, 30:36].all() and part[30:32, 20:100].all() and not part[70, 30:33].any()
    colour[12:28, 25:50] = (0.8, 0.7, 0.7)  # a tenth is another material
    part = of_material(scene(colour), THING, [CLOTH], network=False)
    assert not part[14:26, 27:48].any()


def test_black_parts_of_a_white_thing_are_another_material():
    colour = np.where(LEGS[..., None], 0.02, np.full((H, W, 3), 0.7)).astype(np.float32)
    part = of_material(scene(colour), THING, [CLOTH], network=False)
    assert (part != (THING & ~LEGS)).mean() < 0.01


def test_a_highlight_stays_with_its_part_and_a_patch_does_not(monkeypatch):
    colour = albedo()
    bright = np.zeros((H, W), bool)
    bright[12:28, 25:50] = True
    colour[bright] = (0.6, 0.3, 0.25)
    patch = np.zeros((H, W), bool)
    patch[40:56, 25:50] = True
    colour[patch] = (0.1, 0.2, 0.7)
    alone = of_material(scene(colour), THING, [CLOTH], network=False)
    assert not alone[14:26, 27:48].any()
    outlining(monkeypatch, THING & ~LEGS, LEGS)
    part = of_material(scene(colour), THING, [CLOTH])
    assert (part != (THING & ~LEGS & ~patch)).mean() < 0.015


def test_a_part_goes_whole_with_what_of_it_is_like_the_material(monkeypatch):
    colour = albedo()
    red = np.zeros((H, W), bool)
    red[64:76, 30:50] = True  # a reflection on the legs
    colour[red] = (0.45, 0.11, 0.1)
    assert of_material(scene(colour), THING, [CLOTH], network=False)[66:74, 32:48].all()
    outlining(monkeypatch, THING & ~LEGS, LEGS)
    part = of_material(scene(colour), THING, [CLOTH])
    assert (part != (THING & ~LEGS)).mean() < 0.01


def test_a_click_on_a_seam_means_what_is_around_it(monkeypatch):
    colour = albedo(shade=1)
    seam = np.zeros((H, W), bool)
    seam[20:40, 59] = True
    colour[seam] = (0.25, 0.18, 0.1)
    outlining(monkeypatch, THING & ~LEGS, LEGS, seam)
    part = of_material(scene(colour), THING, [(59, 30)])
    assert part[(THING & ~LEGS)].mean() > 0.95


def test_the_smallest_outline_around_a_pixel_is_its_part(monkeypatch):
    outlining(monkeypatch, THING, LEGS, SHADE)
    labels = parts_of(scene(), THING, [CLOTH])
    assert labels[0, 0] == 0
    assert len({int(labels[y, x]) for x, y in (CLOTH, LEG, (90, 30))}) == 3
    assert all(len(np.unique(labels[part])) == 1 for part in (LEGS, SHADE, THING & ~LEGS & ~SHADE))


def test_the_part_at_a_point_of_a_selection(monkeypatch):
    outlining(monkeypatch, THING, LEGS)
    assert (part_at(scene(), THING, LEG) == LEGS).all()
    # Of a selection without the legs they are no part.
    assert part_at(scene(), THING & ~LEGS, CLOTH) is None


@pytest.mark.parametrize("unsure", [True, False])
def test_what_is_no_part(monkeypatch, unsure):
    beyond = np.ones((H, W), bool)
    outlining(monkeypatch, LEGS if unsure else beyond, expected=0.5 if unsure else 1)
    labels = parts_of(scene(), THING, [CLOTH, LEG])
    assert (labels == np.where(THING, material.IN_NO_PART, material.OUTSIDE)).all()
