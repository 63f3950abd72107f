"""What one more click takes away."""

import numpy as np
import pytest
from part_scenes import CLOTH, LEGS, SHADE, THING, H, W, albedo, scene

from materialist.edits.select import select as selecting
from materialist.edits.select.parts import without
from materialist.edits.select.select import select
from materialist.errors import InputError


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

    def objects(scene, points, *, extent="auto", network=True, sharpen=True):
        return THING

    def part_at(scene, mask, point):
        asked.append(point)
        return LEGS if point[1] > 60 else SHADE

    def without_legs(scene, mask, points, *, network):
        assert network
        return mask & ~LEGS if (60, 70) not in points else mask

    monkeypatch.setattr(selecting, "object_at_points", objects)
    monkeypatch.setattr(selecting, "part_at", part_at)
    monkeypatch.setattr(selecting, "of_material", without_legs)
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
    def objects(scene, points, *, extent="auto", network, sharpen):
        assert not network
        return THING

    monkeypatch.setattr(selecting, "object_at_points", objects)
    cloth = select(scene(), click=CLOTH, method="grabcut", same_material=True)
    assert (cloth != (THING & ~LEGS)).mean() < 0.01
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
