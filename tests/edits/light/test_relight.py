"""Other light, against closed forms; a lamp against the inverse square law, path traced."""

import re
from dataclasses import replace

import numpy as np
import pytest
from edit_scenes import flat_scene

from materialist.color import luminance
from materialist.edits.core.notes import effect_notes, mean_change
from materialist.edits.core.reach import sun_reach
from materialist.edits.core.renderer import EditRenderer
from materialist.edits.light import presets
from materialist.edits.light.relight import (
    checked_envmap,
    kelvin_colour,
    lamp,
    moving_light,
    read_envmap,
    relight,
    rotated,
    with_sun,
)
from materialist.edits.material.material import edit
from materialist.envmap import row_solid_angle, texel_directions
from materialist.errors import InputError
from materialist.io.exr import write_exr
from materialist.types import Materials

SCENE = flat_scene()


def spot(h=16, column=16):
    envmap = np.full((h, 2 * h, 3), 0.1, np.float32)
    envmap[5, column] = 5
    return envmap


def test_a_positive_turn_moves_what_is_ahead_to_the_right():
    turned = rotated(spot(), 90)
    assert turned[5, 24].max() == 5  # a quarter of 32 columns to the right of the centre
    np.testing.assert_allclose(rotated(turned, -90), spot(), atol=1e-6)
    np.testing.assert_allclose(rotated(rotated(spot(), 5), -5).sum(), spot().sum(), rtol=1e-5)
    np.testing.assert_array_equal(relight(SCENE, rotate=360).envmap, SCENE.envmap)


def test_a_suns_elevation_is_above_the_horizon_of_the_floor():
    pitch = np.radians(40)
    up = np.array([0, np.cos(pitch), np.sin(pitch)])
    # A camera that looks down at a table.
    height, width = SCENE.depth.shape
    pitched = replace(
        SCENE,
        normal=np.broadcast_to(up, (height, width, 3)).astype(np.float32),
        geometry=replace(SCENE.geometry, plane_label=np.zeros((height, width), np.int8)),
    )
    for azimuth, elevation in ((0, 90), (90, 0), (180, 20), (-60, 35)):
        added = relight(pitched, sun=(azimuth, elevation), ambient=0).envmap
        weight = luminance(added) * row_solid_angle(len(added))[:, None]
        towards = (texel_directions(*added.shape[:2]) * weight[..., None]).sum((0, 1))
        towards /= np.linalg.norm(towards)
        assert abs(np.degrees(np.arcsin(towards @ up)) - elevation) < 2
        # To the right of the camera, whose own right is level.
        right = np.cos(np.radians(elevation)) * np.sin(np.radians(azimuth))
        assert abs(towards[0] - right) < 0.03


def test_sun_stands_where_it_was_asked_for_and_has_its_irradiance():
    h = 64
    envmap = np.ones((h, 2 * h, 3), np.float32)
    calm, sun = with_sun(envmap, 90, 30, power=2)
    rows, columns = np.nonzero(sun.sum(-1))
    row = rows.mean() + 0.5
    column = columns.mean() + 0.5
    assert abs(row - (90 - 30) / 180 * h) <= 1 and abs(column - 0.75 * 2 * h) <= 1
    edges = np.cos(np.pi * np.arange(h + 1) / h)
    solid = ((edges[:-1] - edges[1:]) * np.pi / h)[:, None, None]
    irradiance = (sun * solid).sum((0, 1)) @ [0.2126, 0.7152, 0.0722]
    np.testing.assert_allclose(
        irradiance, 2 * np.pi, rtol=1e-3
    )  # twice pi, that of a sky of radiance 1
    np.testing.assert_array_equal(calm, envmap)


def irradiance(envmap, towards):
    """Luminance that a surface with that normal gets from a map, no horizon in its way."""
    solid = row_solid_angle(len(envmap))[:, None]
    cosine = np.maximum(texel_directions(*envmap.shape[:2]) @ np.asarray(towards), 0)
    return float((luminance(envmap) * cosine * solid).sum())


def test_a_sun_is_seen_without_further_options_and_keeps_the_brightness():
    even = replace(SCENE, envmap=np.ones((64, 128, 3), np.float32))
    before = irradiance(even.envmap, (0, 0, 1))
    slanting = relight(even, sun=(180, 45)).envmap  # from behind the camera, onto the wall
    shade = irradiance(np.where(slanting > 1, 1 / 2, slanting), (0, 0, 1))
    lit = irradiance(slanting, (0, 0, 1))
    assert shade == pytest.approx(before / 2, rel=1e-3), "what the sun does not reach"
    assert 2.5 < lit / shade < 3 and lit == pytest.approx(before, rel=0.45)
    weak = relight(even, sun=(180, 45), sun_power=0).envmap
    np.testing.assert_allclose(weak, even.envmap, rtol=1e-6)


def test_a_sun_that_reaches_nothing_is_named_with_one_that_does():
    front = relight(SCENE, sun=(180, 30))
    photo = SCENE.photo.original
    assert sun_reach(SCENE, 180, 30)[1] > 0.9
    assert effect_notes(SCENE, front, mean_change(SCENE, photo * np.float32(0.5))) == []
    behind = relight(SCENE, sun=(0, 30))
    (note,) = effect_notes(SCENE, behind, mean_change(SCENE, photo * np.float32(0.5)))
    assert "reaches 0%" in note and "100% of it faces away" in note
    azimuth, elevation = (float(v) for v in re.search("From (.*?),(.*?) it", note).groups())
    assert sun_reach(SCENE, azimuth, elevation)[1] > 0.6


def test_a_sun_behind_what_the_photo_shows_is_hidden_by_it():
    """From the right, the block's shadow lies on the wall on its left; both face the camera."""
    facing, lit = sun_reach(SCENE, 150, 0)
    assert facing == 1
    assert lit < facing - 0.02


def test_gain_auto_keeps_the_mean_light():
    other = spot() * 37
    lit = relight(SCENE, envmap=other, gain="auto")
    weight = np.sin(np.pi * (np.arange(16) + 0.5) / 16)[:, None, None]
    weight8 = np.sin(np.pi * (np.arange(8) + 0.5) / 8)[:, None, None]
    mean = (lit.envmap * weight).sum() / weight.sum() / 32
    np.testing.assert_allclose(mean, (SCENE.envmap * weight8).sum() / weight8.sum() / 16, rtol=0.01)
    np.testing.assert_array_equal(relight(SCENE, envmap=other).envmap, other)


@pytest.mark.parametrize(("kelvin", "ratio"), [(6504, 1.0), (2856, 2.6)])
def test_kelvin_is_white_at_daylight_and_orange_below(kelvin, ratio):
    rgb = kelvin_colour(kelvin)
    np.testing.assert_allclose(rgb @ [0.2126, 0.7152, 0.0722], 1, rtol=1e-5)
    assert abs(rgb[0] / rgb[1] - ratio) < 0.35 * ratio and (ratio < 1.1 or rgb[2] < 0.35 * rgb[0])
    if ratio == 1.0:
        np.testing.assert_allclose(rgb, 1, atol=0.06)


def test_a_lamp_of_power_one_shows_a_white_wall_as_white():
    scene = flat_scene(24, 32, block=3.0)
    flat = np.ones((24, 32), np.float32)
    white = replace(
        scene,
        materials=Materials(np.ones((24, 32, 3), np.float32), flat, 0 * flat),
        envmap=np.full((8, 16, 3), 1e-6, np.float32),
    )
    distance = 0.25 * 3.0
    lit = replace(white, lamps=(lamp(white, 16, 12, 3.0 - distance, 6504, 1.0),))
    # From the camera the lamp hides what it lights best; its foot on the wall is seen beside it.
    hidden = replace(lit.lamps[0], position=(0.4, 0.0, -(3.0 - distance)))
    picture = EditRenderer(lit).pair(replace(lit, lamps=(hidden,)))[1](256, 1)
    column = round(0.4 / 3 * lit.camera.focal + 16 - 0.5)
    np.testing.assert_allclose(
        picture[11:13, column].mean(), 1.0, rtol=0.2
    )  # R = 1: the lobes add up to 1.02-1.05


def test_edited_light_is_noted_and_warned_about():
    sunny = replace(SCENE, envmap=spot(16) * 0 + 0.01)
    sunny.envmap[5, 16] = 1000
    lit = relight(sunny, rotate=40)
    assert any("double shadows" in note for note in lit.report.warnings)
    assert lit.provenance["edits"] == [{"kind": "light", "rotate": 40}]
    assert relight(SCENE, rotate=40).report.warnings == SCENE.report.warnings
    with_sun = relight(SCENE, sun=(20, 40), sun_power=5)
    assert not relight(with_sun, ambient=0.5, fitted=SCENE).report.warnings, "it is not the photo's"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"envmap": np.ones((8, 8, 3))}, "twice as wide"),
        ({"envmap": np.ones((8, 16))}, "twice as wide"),
        ({"envmap": np.full((8, 16, 3), np.nan)}, "from nan to nan"),
        ({"envmap": -np.ones((8, 16, 3))}, "from -1 to -1"),
        ({"envmap": np.zeros((8, 16, 3))}, "black"),
        ({"envmap": np.ones((8, 16, 3)), "gain": "lots"}, "lots"),
        ({"ambient": 0}, "black"),
        ({"lamps": (100, 10, 2, 3000, 1)}, "outside"),
        ({"lamps": (10, 10, -2, 3000, 1)}, "depth is -2"),
        ({"lamps": (10, 10, 2, 100, 1)}, "100 K"),
        ({"lamps": (10, 10, 2, 3000, 0)}, "power is 0"),
    ],
)
def test_impossible_light_is_named(options, words):
    with pytest.raises(InputError) as error:
        relight(SCENE, **options)
    assert words in str(error.value) and str(error.value).endswith(".")


def test_envmap_files(tmp_path):
    write_exr(tmp_path / "sky.exr", spot(32))
    np.testing.assert_array_equal(read_envmap(tmp_path / "sky.exr"), spot(32))
    write_exr(tmp_path / "large.exr", spot(300))
    assert read_envmap(tmp_path / "large.exr").shape == (256, 512, 3)
    film = np.concatenate(
        [spot(32), np.zeros((32, 64, 1), np.float32)], -1
    )  # as renderers write a world's picture
    write_exr(tmp_path / "film.exr", film)
    np.testing.assert_array_equal(read_envmap(tmp_path / "film.exr"), spot(32))
    write_exr(tmp_path / "square.exr", np.ones((32, 32, 3), np.float32))
    with pytest.raises(InputError, match="twice as wide"):
        read_envmap(tmp_path / "square.exr")


def test_a_full_turn_is_closed_and_paths_reach_their_ends():
    turns = [s.envmap for s in moving_light(SCENE, 4)]
    for k, envmap in enumerate(turns):
        np.testing.assert_allclose(envmap, rotated(SCENE.envmap, 90 * k), atol=1e-6)
    ends = [lamp(SCENE, x, 10, 2, k, 1) for x, k in ((5, 2000), (40, 6000))]
    path = [s.lamps[0] for s in moving_light(SCENE, 3, lamps=tuple(ends))]
    np.testing.assert_allclose([path[0].position, path[2].position], [e.position for e in ends])
    np.testing.assert_allclose(path[1].power, np.mean([e.power for e in ends], 0))
    more = [s.envmap for s in moving_light(SCENE, 4, rotate=450)]
    np.testing.assert_allclose(
        more[3], rotated(SCENE.envmap, 450), atol=1e-6
    )  # by as much as was asked
    np.testing.assert_allclose(more[1], rotated(SCENE.envmap, 150), atol=1e-6)
    film = [edit(SCENE, SCENE.depth > 0, hue=k) for k in (0, 30, 60)]
    span = list(moving_light(film, 3, rotate="-30..50"))
    for k, made in enumerate(span):
        np.testing.assert_allclose(made.envmap, rotated(SCENE.envmap, 40 * k - 30), atol=1e-6)
        assert made.materials is film[k].materials
    with pytest.raises(InputError, match=r"rotation is -30\.\.50; one picture"):
        relight(SCENE, rotate=(-30, 50))
    suns = list(moving_light(SCENE, 2, suns=((0, 20), (90, 40))))
    np.testing.assert_allclose(suns[1].envmap, relight(SCENE, sun=(90, 40)).envmap, atol=1e-6)
    with pytest.raises(InputError, match="frames is 1"):
        next(moving_light(SCENE, 1))


def test_lights_are_environment_maps():
    made = {name: presets.preset_light(name, 64) for name in presets.LIGHTS}
    assert all(
        checked_envmap(light).shape == (64, 128, 3) and 0 < light.mean() < 20
        for light in made.values()
    )
    assert made["Window"][:, 64:].sum() > made["Window"][:, :64].sum()  # on the right
    assert made["Noon"][:32].sum() > made["Noon"][32:].sum()  # from above


def test_a_light_without_effect_is_named_and_nothing_else():
    dimmed = relight(SCENE, ambient=0.5)
    photo = SCENE.photo.original
    (note,) = effect_notes(SCENE, dimmed, mean_change(SCENE, photo * np.float32(0.99)))
    assert "of 255 levels" in note and "lamp" in note
    assert effect_notes(SCENE, dimmed, mean_change(SCENE, photo * np.float32(0.5))) == []
    painted = edit(SCENE, np.ones(SCENE.depth.shape, bool), hue=120)
    assert effect_notes(SCENE, painted, mean_change(SCENE, photo)) == []
