"""What has one material, and what one more click takes away."""

from dataclasses import replace

import numpy as np
import pytest
from edit_scenes import scene_of

from materialist.edits.select import select as selecting
from materialist.edits.select.parts import of_material, without
from materialist.edits.select.select import select
from materialist.errors import InputError
from materialist.types import Camera

H, W = 90, 120
THING = np.zeros((H, W), bool)
THING[10:80, 20:100] = True
LEGS = np.zeros((H, W), bool)
LEGS[60:80, 20:100] = True
SHADE = np.zeros((H, W), bool)
SHADE[10:60, 70:100] = True
CLOTH = (60, 30)


def albedo(shade=0.6):
    """Red cloth, part of it darker, on brown legs; grey beyond."""
    rng = np.random.default_rng(2)
    colour = np.full((H, W, 3), 0.5)
    colour[THING] = (0.5, 0.1, 0.1)
    colour[SHADE] *= shade
    colour[LEGS] = (0.25, 0.18, 0.1)
    return (colour * rng.uniform(0.95, 1.05, (H, W, 1))).astype(np.float32)


def scene():
    made = scene_of(
        Camera(W, H, 40.0),
        np.full((H, W), 2, np.float32),
        np.broadcast_to([0, 0, 1], (H, W, 3)),
        albedo(),
        completion="none",
    )
    return replace(made, materials=replace(made.materials, albedo=albedo()))


def test_a_material_is_all_of_its_colour_in_the_selection_and_shade_is_none():
    part = of_material(albedo(), THING, [CLOTH])
    assert (part != (THING & ~LEGS)).mean() < 0.01
    assert not part[~THING].any()


def test_each_click_names_a_material():
    both = of_material(albedo(), THING, [CLOTH, (60, 70)])
    assert (both != THING).mean() < 0.01
    assert (of_material(albedo(), THING, [(60, 70)]) != LEGS).mean() < 0.01


def test_what_is_around_a_click_stays_whatever_colour_it_has():
    colour = albedo()
    colour[40:43, 40:43] = (0.1, 0.1, 0.6)
    part = of_material(colour, THING, [(41, 41)])
    assert part[40:43, 40:43].all() and (part != (THING & ~LEGS)).mean() < 0.01


def test_highlights_and_seams_stay_and_specks_go():
    colour = albedo(shade=1)
    colour[20:26, 30:36] = (0.8, 0.7, 0.7)  # 36 of 4000 pixels
    colour[30:32, 20:100] = (0.02, 0.02, 0.02)
    colour[70, 30:33] = (0.5, 0.1, 0.1)  # on a leg
    part = of_material(colour, THING, [CLOTH])
    assert part[20:26, 30:36].all() and part[30:32, 20:100].all() and not part[70, 30:33].any()
    colour[12:28, 25:50] = (0.8, 0.7, 0.7)  # a tenth is another material
    assert not of_material(colour, THING, [CLOTH])[14:26, 27:48].any()


def test_black_parts_of_a_white_thing_are_another_material():
    colour = np.where(LEGS[..., None], 0.02, np.full((H, W, 3), 0.7)).astype(np.float32)
    assert (of_material(colour, THING, [CLOTH]) != (THING & ~LEGS)).mean() < 0.01


def test_an_excluded_click_takes_the_thing_there():
    small = LEGS & (np.arange(W) < 60)
    kept = without(albedo(), THING, (30, 70), small)
    assert kept is not None and (kept != (THING & ~small)).mean() < 0.002


def test_or_what_is_of_one_colour_where_no_thing_is_meant():
    half = THING & (np.arange(W) < 75)
    # None, one beside the click, most of it, and what holds a click.
    for thing in (None, LEGS & (np.arange(W) > 50), THING, half):
        kept = without(albedo(shade=1), THING, (30, 70), thing, [CLOTH])
        assert kept is not None and (kept != (THING & ~LEGS)).mean() < 0.02
    # By the albedo: shade ends no piece, another colour does.
    assert without(albedo(shade=0.8), THING & ~LEGS, CLOTH, None) is None
    assert without(albedo(), THING, (30, 70), None, [(90, 70)]) is None


def test_what_is_left_has_no_slivers():
    ring = LEGS & ~(np.indices((H, W))[0] > 78)  # a line of legs would be left below
    kept = without(albedo(), THING, (30, 70), ring)
    assert kept is not None and not kept[LEGS].any() and kept[THING & ~LEGS].all()
    held = without(albedo(), THING, (30, 70), ring, [(50, 79)])
    assert held is not None and held[79, 50]
    # Pieces beside it are crumbs; what is thin or small elsewhere is no sliver of it.
    crumb = ring.copy()
    crumb[66:69, 50:53] = False
    pole = THING.copy()
    pole[5:10, 40:42] = True
    pole[2:5, 110:113] = True
    kept = without(albedo(), pole, (30, 70), crumb)
    assert kept is not None and not kept[66:69, 50:53].any()
    assert kept[5:10, 40:42].all() and kept[2:5, 110:113].all()


def test_select_narrows_what_it_found(monkeypatch):
    made = scene()
    asked = []

    def objects(scene, points, *, extent="auto", network=True):
        if extent == "small":
            asked.append(points[0])
            return LEGS if points[0][1] > 60 else SHADE
        return THING

    monkeypatch.setattr(selecting, "object_at_points", objects)
    cloth = select(made, click=CLOTH, same_material=True)
    assert (cloth != (THING & ~LEGS)).mean() < 0.01
    both = select(made, click=[CLOTH, (60, 70)], same_material=True)
    assert (both != THING).mean() < 0.01
    first = select(made, click=CLOTH, exclude=[(30, 70)])
    assert (first != (THING & ~LEGS)).mean() < 0.002
    assert (select(made, mask=THING, exclude=(30, 70)) == first).all()
    # The third goes with the first.
    asked.clear()
    rest = select(made, click=CLOTH, exclude=np.array([(30, 70), (90, 30), (80, 70)]))
    assert (rest != (THING & ~LEGS & ~SHADE)).mean() < 0.002
    assert asked == [(30, 70), (90, 30)]
    assert (select(made, click=CLOTH, exclude=[]) == THING).all()


def test_grabcut_goes_by_colour_alone(monkeypatch):
    def objects(scene, points, *, extent="auto", network):
        assert not network
        return THING

    monkeypatch.setattr(selecting, "object_at_points", objects)
    kept = select(scene(), click=CLOTH, method="grabcut", exclude=(30, 70))
    assert (kept != (THING & ~LEGS)).mean() < 0.02


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"mask": THING, "same_material": True}, "that of a click"),
        ({"click": CLOTH, "exclude": [(5, 5)]}, "5,5 is not selected"),
        ({"click": CLOTH, "exclude": [CLOTH]}, "60,30 is most of the selection, or holds one"),
        ({"click": CLOTH, "exclude": [(500, 5)]}, "excluded pixel 500,5 lies outside"),
    ],
)
def test_what_cannot_be_narrowed(monkeypatch, values, text):
    monkeypatch.setattr(selecting, "object_at_points", lambda *_, **__: THING)
    with pytest.raises(InputError, match=text):
        select(scene(), **values)
