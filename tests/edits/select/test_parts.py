"""What has one material, and what one more click takes away."""

from dataclasses import replace

import numpy as np
import pytest
from edit_scenes import scene_of

from materialist.edits.select import parts
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


def test_the_pixel_that_is_clicked_counts_whatever_is_around_it():
    thin = np.zeros((H, W), bool)
    thin[40, 40] = True
    assert of_material(albedo(), thin, [(40, 40)])[40, 40]
    assert not of_material(albedo(), thin, [(90, 40)])[40, 90]


def test_an_excluded_click_takes_the_object_there(monkeypatch):
    small = LEGS.copy()
    small[:, 60:] = False
    monkeypatch.setattr(parts, "object_at_points", lambda *_, extent: small)
    kept = without(scene(), THING, (30, 70))
    assert (kept == (THING & ~small)).all()


def test_or_what_is_of_one_colour_where_the_object_is_not_meant(monkeypatch):
    made = scene()
    for whole in (THING, THING & (np.arange(W) < 75)):  # most of it; what holds a click
        monkeypatch.setattr(parts, "object_at_points", lambda *_, extent, whole=whole: whole)
        kept = without(made, THING, (30, 70), [CLOTH])
        assert (kept != (THING & ~LEGS)).mean() < 0.02

    def none(*_, extent):
        raise InputError("No object is found")

    monkeypatch.setattr(parts, "object_at_points", none)
    assert (without(made, THING, (30, 70)) != (THING & ~LEGS)).mean() < 0.02
    with pytest.raises(InputError, match="60,30 cannot be told from the rest"):
        without(made, THING & ~LEGS & ~SHADE, CLOTH)


def test_select_narrows_what_it_found(monkeypatch):
    made = scene()
    monkeypatch.setattr("materialist.edits.select.select.object_at_points", lambda *_, **__: THING)
    monkeypatch.setattr(parts, "object_at_points", lambda *_, extent: LEGS)
    cloth = select(made, click=CLOTH, same_material=True)
    assert (cloth != (THING & ~LEGS)).mean() < 0.01
    assert (select(made, click=CLOTH, exclude=[(30, 70)]) == (THING & ~LEGS)).all()
    assert (select(made, mask=THING, exclude=(30, 70)) == (THING & ~LEGS)).all()
    # The second goes with the first.
    assert (select(made, click=CLOTH, exclude=[(30, 70), (80, 70)]) == (THING & ~LEGS)).all()


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"mask": THING, "same_material": True}, "that of a click"),
        ({"click": CLOTH, "same_material": "yes"}, "give true or false"),
        ({"click": CLOTH, "exclude": [(5, 5)]}, "5,5 is not selected"),
        ({"click": CLOTH, "exclude": [(500, 5)]}, "exclude 500,5 lies outside"),
    ],
)
def test_what_cannot_be_narrowed(monkeypatch, values, text):
    monkeypatch.setattr("materialist.edits.select.select.object_at_points", lambda *_, **__: THING)
    with pytest.raises(InputError, match=text):
        select(scene(), **values)
