"""Lights that the photo shows: found, estimated, dimmed, and what the room then looks like."""

import tracemalloc
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from edit_scenes import scene_of
from geometry_scenes import plane_depth

from materialist import metrics
from materialist.edits.composite.composite import composite
from materialist.edits.composite.into_photo import in_photo, into_photo
from materialist.edits.composite.layers import Layers
from materialist.edits.composite.native_layer import NativeLayer
from materialist.edits.core.surfaces import KEY, emitting
from materialist.edits.light.emitters import _parts, _patch, dimmed, visible_lights
from materialist.edits.light.relight import relight
from materialist.edits.material.material import edit
from materialist.errors import InputError
from materialist.geometry.silhouette import window
from materialist.io.package import load_scene, save_scene
from materialist.pipeline import render_scene
from materialist.types import Camera, Scene

LIGHT = np.zeros((30, 40), bool)
LIGHT[3:12, 8:32] = True
RADIANCE = 8.0


def picture(scene: Scene, seed: int = 0, spp: int = 256) -> np.ndarray:
    return render_scene(scene, spp=spp, seed=seed)


@cache
def rooms() -> tuple[Scene, Scene]:
    """(the room with a window in its back wall, truly lit; a fit of its photo that has no light but the map's)."""
    camera = Camera(40, 30, 60.0)
    floor = plane_depth(camera, (0, 1, 0), -1.0)
    depth = np.minimum(floor, 3.5).astype(np.float32)
    normal = np.where((floor < 3.5)[..., None], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]).astype(np.float32)
    envmap = np.full((8, 16, 3), 0.15, np.float32)
    albedo = np.full((30, 40, 3), 0.5)
    bare = scene_of(camera, depth, normal, albedo, roughness=0.8, envmap=envmap, completion="none")
    true = replace(bare, bodies=(emitting(_patch(bare, LIGHT, "window"), (RADIANCE,) * 3),))
    linear = np.clip(picture(true), 0, 1)
    photo = replace(bare.photo, linear=linear, original=linear)
    rendered = picture(bare)
    factor = float(
        (linear * rendered)[~LIGHT].sum() / (rendered**2)[~LIGHT].sum()
    )  # what a fit of the map would do
    brighter = replace(
        bare,
        photo=photo,
        envmap=envmap * np.float32(factor),
        rerender=rendered * np.float32(factor),
    )
    return replace(true, photo=photo), brighter


def test_the_window_is_found_and_a_speck_is_not():
    _, fit = rooms()
    (mask,) = visible_lights(fit)
    assert (mask & LIGHT).sum() / (mask | LIGHT).sum() > 0.95
    assert not visible_lights(
        replace(fit, depth=np.where(LIGHT, 0, fit.depth))
    )  # the sky is in the map
    large = np.zeros((60, 80, 3), np.float32)
    large[3, 3:6] = 1  # a highlight: less than a thousandth
    depth = np.ones((60, 80), np.float32)
    assert not visible_lights(replace(fit, photo=replace(fit.photo, linear=large), depth=depth))


def test_a_window_is_found_with_the_trees_in_it():
    """Trees outshine a dark room, a lit wall does not; a bright room has nothing that does."""
    _, fit = rooms()
    shown = np.full((30, 40, 3), 0.05, np.float32)
    shown[LIGHT] = 1.0
    shown[9:12, 8:20] = [0.1, 0.3, 0.05]
    shown[12:14] = 0.08
    (mask,) = visible_lights(replace(fit, photo=replace(fit.photo, linear=shown)))
    np.testing.assert_array_equal(mask, LIGHT)
    (mask,) = visible_lights(replace(fit, photo=replace(fit.photo, linear=np.maximum(shown, 0.25))))
    assert not mask[9:12, 8:19].any()


def test_specks_take_no_memory():
    specks = np.zeros((256, 256), bool)
    specks[::4, ::4] = True
    specks[100:110, 100:110] = True
    tracemalloc.start()
    (part,) = _parts(specks, 9)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert part.sum() == 100 and peak < 100 * specks.nbytes


def test_its_radiance_is_found():
    _, fit = rooms()
    ambient, radiance, share = (
        dimmed(fit, 1.0).provenance[KEY][key] for key in ("ambient", "radiance", "share")
    )
    assert 6 <= radiance <= 12
    np.testing.assert_allclose(ambient * fit.envmap.mean(), 0.15, rtol=0.25)
    assert ambient + share == pytest.approx(1, abs=0.25)  # the two together are the photo


def test_switched_off_is_the_true_room_without_the_window():
    true, fit = rooms()
    lights = (emitting(_patch(true, LIGHT, "window"), (0.0,) * 3),)
    expected = picture(replace(true, bodies=lights), seed=5)
    out = composite(fit, relight(fit, dim=0.0), spp=128)
    away = ~LIGHT
    before = metrics.psnr(fit.photo.linear, expected, mask=away)
    assert metrics.psnr(out, expected, mask=away) > max(28, before + 3)
    assert out[LIGHT].mean() < 0.3


def test_bad_input_and_files(tmp_path):
    _, fit = rooms()
    for scene, options, sentence in [
        (fit, {"dim": -1.0}, "dimming"),
        (fit, {"dim": np.nan}, "dimming"),
        (fit, {"dim": 0.2, "ambient": -1}, "ambient"),
        (dimmed(fit, 0.5), {"dim": 0.2}, "already"),
        (
            replace(fit, photo=replace(fit.photo, linear=fit.photo.linear * 0.5)),
            {"dim": 0.2},
            "no light",
        ),
    ]:
        with pytest.raises(InputError, match=sentence):
            relight(scene, **options)
    edited = dimmed(fit, 0.5)
    assert any("clipped regions around 20,7" in note for note in edited.report.warnings)
    save_scene(edited, tmp_path / "a.scene")
    assert (
        load_scene(tmp_path / "a.scene").bodies[0].surface.emission
        == edited.bodies[0].surface.emission
    )
    assert min(edited.bodies[0].surface.emission) > 0


def test_edits_before_do_not_change_what_is_found():
    """The lights are those of the photo, whatever has been done to the floor."""
    _, fit = rooms()
    floor = fit.normal[..., 1] > 0.5
    after = relight(edit(fit, floor, albedo=(0.05, 0.05, 0.05)), dim=0.5, fitted=fit)
    before = edit(relight(fit, dim=0.5), floor, albedo=(0.05, 0.05, 0.05))
    # Threads add up paths in another order each time.
    one, other = ({**scene.provenance[KEY]} for scene in (after, before))
    np.testing.assert_allclose(one.pop("emission"), other.pop("emission"), rtol=1e-6)
    assert one == pytest.approx(other, rel=1e-6)
    np.testing.assert_allclose(after.envmap, before.envmap, rtol=1e-5)
    with pytest.raises(InputError, match="dim that one"):
        relight(edit(fit, floor, albedo=(0.05, 0.05, 0.05)), dim=0.5)


def test_an_hdr_photo_tells_how_bright_its_lights_are():
    _, fit = rooms()
    even = replace(fit.photo, hdr=True, linear=np.full((30, 40, 3), 1.2, np.float32))
    assert visible_lights(replace(fit, photo=even)) == [], "a wall lit evenly is no light"
    shown = np.where(LIGHT[..., None], np.float32(RADIANCE), np.minimum(fit.photo.linear, 0.9))
    scene = replace(fit, photo=replace(fit.photo, hdr=True, linear=shown))
    (mask,) = visible_lights(scene)
    np.testing.assert_array_equal(mask, LIGHT)
    assert dimmed(scene, 1.0).provenance["photo_lights"]["radiance"] == pytest.approx(RADIANCE)


def test_the_lights_that_are_meant_need_not_be_clipped():
    """Half of the window, in a photo so dark that it is grey: as bright as it is, and of its colour."""
    _, fit = rooms()
    tint = np.float32([1.0, 0.8, 0.5])
    grey = np.where(LIGHT[..., None], 0.6 * tint, 0.1 * fit.photo.linear).astype(np.float32)
    scene = replace(
        fit, photo=replace(fit.photo, linear=grey, original=grey), rerender=0.1 * fit.rerender
    )
    meant = LIGHT & (np.arange(40) < 20)
    with pytest.raises(InputError, match="no light"):
        relight(scene, dim=0.5)
    edited = relight(scene, dim=0.5, lights=meant)
    np.testing.assert_allclose(edited.bodies[0].surface.emission, 0.5 * 0.6 * tint, rtol=1e-4)
    out = composite(scene, edited, spp=16)
    inner = meant & (np.arange(40) < 17) & (np.arange(40) > 9) & (np.arange(30) > 4)[:, None]
    inner &= (np.arange(30) < 10)[:, None]
    np.testing.assert_allclose(out[inner], 0.5 * grey[inner], rtol=0.02)
    other = LIGHT & (np.arange(40) > 24)
    assert out[other].mean() > 0.8 * grey[other].mean(), "the other half stays"
    for mask, sentence in (
        (np.zeros((30, 40), bool), "mask"),
        (np.ones((9, 9), bool), "resize it"),
    ):
        with pytest.raises(InputError, match=sentence):
            relight(scene, dim=0.5, lights=mask)
    with pytest.raises(InputError, match="give dim"):
        relight(scene, lights=meant)


def test_dimmed_lights_keep_what_is_seen_in_them():
    """A tree in the window goes down with it; what is clipped is as bright as it was found to be."""
    _, fit = rooms()
    original = fit.photo.original.copy()
    original[6:9, 12:16] = [0.1, 0.3, 0.05]
    photo = replace(fit.photo, original=original)
    found = {"radiance": 8.0, "dim": 0.1}
    out = in_photo(np.full_like(original, 9), photo, LIGHT, found)
    np.testing.assert_allclose(out[7, 13:15], 0.1 * original[7, 13:15], rtol=1e-5)
    np.testing.assert_allclose(out[7, 20:28], 0.8, rtol=0.05)
    assert (out[20:] == 9).all()
    # Something that was inserted stands before it.
    before = np.zeros((30, 40), np.float32)
    before[7, 20:28] = 1
    nothing = np.zeros((30, 40), bool)
    native = NativeLayer(before, window(before >= 0), before, np.full_like(original, 0.5), ())
    layers = Layers(original, original, nothing, nothing, native=native)
    np.testing.assert_array_equal(into_photo(photo, layers, (LIGHT, found))[7, 20:28], 0.5)
