"""What was put into a scene: it is rendered, denoised by its own maps, and not edited as if it were the photo."""

from dataclasses import replace

import numpy as np
import pytest
from made_meshes import floor_scene

from materialist.edits.core.region import body_coverage, checked_pixel
from materialist.edits.core.renderer import EditRenderer
from materialist.edits.insert.insert import insert
from materialist.edits.material.material import edit
from materialist.edits.select.select import select
from materialist.errors import InputError
from materialist.pipeline import render_scene
from materialist.types import Lamp

PLACE = (40.0, 50.0)


@pytest.fixture(scope="module")
def scenes(box):
    """A floor, and the same with a box on it."""
    scene = floor_scene(96, 72)
    return scene, insert(scene, box, PLACE, scale=2, material="#ffffff")


def test_a_scene_is_rendered_with_what_was_put_into_it(scenes):
    scene, with_box = scenes
    share = body_coverage(with_box)
    assert share.max() == 1 and body_coverage(scene).max() == 0
    before, after = (render_scene(s, spp=16) for s in scenes)
    changed = np.abs(after - before).mean(-1)
    assert changed[share == 1].mean() > 5 * changed[:20].mean()
    lit = replace(scene, lamps=(Lamp((0.0, 0.5, -3.0), (40.0, 40.0, 40.0), 0.05),))
    assert render_scene(lit, spp=16).mean() > 1.2 * before.mean()


def test_its_own_maps_guide_the_denoiser(scenes):
    _, with_box = scenes
    pattern = (np.indices(with_box.depth.shape).sum(0) % 2)[..., None] * np.ones(3, np.float32)
    striped = replace(
        with_box, materials=replace(with_box.materials, albedo=pattern.astype(np.float32))
    )
    albedo, _ = EditRenderer(striped).guides(striped)
    inside = body_coverage(striped) == 1
    assert np.ptp(albedo[inside]) < 0.01 < np.ptp(pattern[inside])
    np.testing.assert_array_equal(
        albedo[body_coverage(striped) == 0], pattern[body_coverage(striped) == 0]
    )


def test_several_clicks_cost_one_look_at_what_was_put_there(scenes, monkeypatch):
    looks = []
    monkeypatch.setattr(
        "materialist.edits.select.select.body_coverage",
        lambda scene: looks.append(1) or np.zeros(scene.depth.shape),
    )
    everything = np.ones((3, *scenes[1].depth.shape), np.float32)
    monkeypatch.setattr(
        "materialist.edits.select.objects.sam.masks", lambda *_, **__: (everything, np.ones(3))
    )
    select(scenes[1], click=[(10, 60), (12, 62)])
    assert len(looks) == 1


def test_what_was_put_there_is_not_edited_as_the_photo(scenes):
    _, with_box = scenes
    share = body_coverage(with_box)
    row, column = np.argwhere(share == 1)[len(np.argwhere(share == 1)) // 2]
    with pytest.raises(InputError, match=r"is on a thing that was put into the scene"):
        select(with_box, click=(column, row))
    with pytest.raises(InputError, match=r"What is marked is a thing that was put"):
        edit(with_box, share > 0.5, hue=90)
    wide = np.ones(share.shape, bool)  # the floor around it, of which it hides a little
    assert edit(with_box, wide, hue=90) is not with_box


def test_a_pixel_of_the_file_is_told_as_one_of_working_size():
    scene = floor_scene()
    height, width = scene.depth.shape
    large = replace(
        scene, photo=replace(scene.photo, original=np.zeros((3 * height, 3 * width, 3), np.float32))
    )
    with pytest.raises(InputError, match=f"outside the photo.* is {width - 1},4 here"):
        checked_pixel(large, (3 * width - 1, 12))
    with pytest.raises(InputError, match=r"working size\.$"):
        checked_pixel(large, (3 * width, 12))
