"""What the composite keeps, to the bit, and what it shows, against closed forms."""

import gc
import weakref
from dataclasses import replace

import cv2
import numpy as np
import pytest
from edit_scenes import MASK, flat_scene, rendered_scene
from PIL import Image
from scipy.ndimage import binary_erosion

from materialist.camera import project
from materialist.edits.composite import into_photo as into_photo_module
from materialist.edits.composite.composite import (
    NARROWED,
    composite,
    composite_in_place,
    developed,
    is_deep,
    pictures,
)
from materialist.edits.composite.into_photo import SETTINGS, into_photo, onto_working
from materialist.edits.composite.layers import Layers, _gain, significance, without_fireflies
from materialist.edits.composite.matte import matte
from materialist.edits.composite.native_layer import NativeLayer
from materialist.edits.core.renderer import EditRenderer, RenderOptions
from materialist.edits.light.relight import lamp, relight
from materialist.edits.material.material import edit
from materialist.edits.remove.remove import remove
from materialist.errors import InputError
from materialist.geometry.membrane import nearest
from materialist.geometry.silhouette import window
from materialist.io.colour_space import DISPLAY_P3, space, srgb_curve
from materialist.io.decode import decode
from materialist.io.out.encode import save_image
from materialist.io.out.icc import profile_of
from materialist.io.package import load_scene, save_scene
from materialist.types import Camera, Photo

pytestmark = pytest.mark.usefixtures("filled_smoothly")

FLAT = flat_scene()


def layers_of(base, edited, changed, relit=False):
    reached = (base != edited).any(-1)
    return Layers(base, edited, reached, changed & reached, relit)


def test_an_edit_that_changes_nothing_gives_the_photo():
    scene = rendered_scene(2)
    same = edit(scene, MASK, roughness="+0")
    np.testing.assert_array_equal(composite(scene, same, spp=6), scene.photo.original)
    np.testing.assert_array_equal(
        composite(scene, relight(scene, rotate=0), spp=6), scene.photo.original
    )


def test_a_photo_that_is_given_up_becomes_the_same_picture():
    """Commands write over the photo of a removal: the picture is the same bit for bit, the first photo stays."""
    scene = rendered_scene(2)
    before = scene.photo.original.copy()
    options = RenderOptions(spp=6)
    pictures = []
    removed = remove(scene, MASK)
    filled = removed.photo.original.copy()
    pictures.append(composite(scene, removed, spp=6))
    np.testing.assert_array_equal(removed.photo.original, filled)
    pictures.append(composite_in_place(scene, removed, options))
    assert pictures[1] is removed.photo.original
    np.testing.assert_array_equal(*pictures)
    painted = edit(scene, MASK, albedo=(0.1, 0.2, 0.05))
    np.testing.assert_array_equal(
        composite_in_place(scene, painted, options), composite(scene, painted, spp=6)
    )
    np.testing.assert_array_equal(scene.photo.original, before)


def test_pixels_out_of_reach_keep_their_bits():
    native = 2
    scene = rendered_scene(native, block=3.0)  # one flat wall, whose parts do not see each other
    edited = edit(scene, MASK, albedo=(0.05, 0.3, 0.6))
    out = composite(scene, edited, spp=12)
    assert out.shape == scene.photo.original.shape
    # At the border the photo's pixels are mixed.
    far = np.ones((36, 48), bool)
    rows, columns = np.nonzero(MASK)
    far[rows.min() - 3 : rows.max() + 4, columns.min() - 3 : columns.max() + 4] = False
    far = np.kron(far, np.ones((native, native), bool))
    np.testing.assert_array_equal(out[far], scene.photo.original[far])
    inner = np.kron(MASK, np.ones((native, native), bool))
    assert (out[inner] != scene.photo.original[inner]).any(-1).all()


def test_the_edit_is_the_rendering_where_the_fit_is_the_photo():
    scene = rendered_scene()
    edited = edit(scene, MASK, albedo=(0.1, 0.2, 0.05))
    out = composite(scene, edited, spp=96, seed=4, denoise=False)
    expected = EditRenderer(edited).pair(edited)[0](384, 9)
    inner = binary_erosion(MASK)
    assert np.abs(out - expected)[inner].mean() < 0.01


def test_texture_beyond_the_fit_dims_with_the_surface():
    scene = flat_scene()
    base = np.full((36, 48, 3), 0.5, np.float32)
    grain = 1 + 0.2 * np.sin(np.arange(36 * 48).reshape(36, 48, 1)).astype(np.float32)
    photo = replace(scene.photo, linear=base * grain, original=base * grain)
    edited = np.where(MASK[..., None], 0.2, base).astype(np.float32)
    out = into_photo(photo, layers_of(base, edited, MASK))
    factor = (0.2 + SETTINGS.floor) / (0.5 + SETTINGS.floor)
    inner = binary_erosion(MASK, iterations=2)  # at the border the photo's pixels are mixed
    np.testing.assert_allclose(
        out[inner], (0.2 + factor * 0.5 * (grain - 1))[inner].repeat(3, -1), atol=0.02
    )
    np.testing.assert_array_equal(out[~MASK][:100], photo.original[~MASK][:100])


GREEN = np.array([0.1, 0.4, 0.15], np.float32)
RED = np.array([0.8, 0.2, 0.15], np.float32)


def row_of(old, new, gloss=(0, 0, 0, 0)):
    """Layers of four pixels under white light, where `old` paint becomes `new` and `gloss` is mirrored."""
    mirrored = np.array(gloss, np.float32)[None, :, None]
    first, second = (np.tile(np.array(paint, np.float32), (1, 4, 1)) for paint in (old, new))
    everywhere = np.ones((1, 4), bool)
    return Layers(
        first + mirrored, second + mirrored, everywhere, everywhere, albedos=(first, second)
    )


def test_a_shade_that_the_fit_lacks_stays():
    layers = row_of(GREEN, RED)
    photo = layers.base * np.array([1, 0.25, 0.5, 2], np.float32)[:, None]
    seen = replace(FLAT.photo, linear=photo, original=photo)
    out = onto_working(seen, layers)
    np.testing.assert_allclose(out[0, 0], RED, atol=1e-6)
    np.testing.assert_allclose(out[0, 1], 0.25 * RED, rtol=0.1)
    np.testing.assert_allclose(out[0, 2], 0.5 * RED, rtol=0.1)
    # More light than the fit has is no shade; nor is anything where the surface is the photo's own.
    additive = onto_working(seen, replace(layers, albedos=None))
    assert (additive[0, 1] > 2 * 0.25 * RED)[0]
    np.testing.assert_allclose(out[0, 3], additive[0, 3], rtol=1e-6)
    passed_on = replace(layers, edited=layers.base + 0.1, changed=~layers.changed)
    np.testing.assert_allclose(onto_working(seen, passed_on), photo + 0.1, atol=1e-6)


@pytest.mark.parametrize("new", [(0.8, 0.8, 0.8), (0.5, 0.1, 0.1)])
def test_a_highlight_that_photo_or_fit_lacks_is_no_shade(new):
    """A black tyre, most of whose light in the fit is mirrored, is white after the edit."""
    black = (0.03, 0.03, 0.03)
    layers = row_of(black, new, gloss=(0, 0.05, 0.1, 0.3))
    photo = np.tile(np.array(black, np.float32), (1, 4, 1))
    out = onto_working(replace(FLAT.photo, linear=photo, original=photo), layers)
    # The highlight itself is the fit's, and is taken back.
    np.testing.assert_allclose(out, np.tile(new, (1, 4, 1)), atol=0.02)


def test_a_clipped_channel_is_no_shade():
    """The fit knows that white paper is twice as bright as the photo can show."""
    white = (0.9, 0.9, 0.9)
    layers = row_of(white, (0.9, 0.1, 0.1))
    brighter = replace(layers, base=2 * layers.base, edited=2 * layers.edited)
    photo = np.ones((1, 4, 3), np.float32)
    out = onto_working(replace(FLAT.photo, linear=photo, original=photo), brighter)
    np.testing.assert_allclose(out, brighter.edited, rtol=1e-3)


def test_another_roughness_shades_nothing():
    layers = row_of(GREEN, GREEN)
    smoother = replace(layers, edited=layers.base + 0.05)
    photo = 0.5 * layers.base
    out = onto_working(replace(FLAT.photo, linear=photo, original=photo), smoother)
    np.testing.assert_allclose(out, photo + 0.05, atol=1e-6)


def test_no_fringe_of_the_old_colour_is_left_at_a_border():
    """Red paint before a grey wall becomes blue: pixels of both show blue and grey, as if it had been so."""
    red, blue, grey = ((0.6, 0.05, 0.05), (0.05, 0.1, 0.6), (0.4, 0.4, 0.4))
    share = np.clip((48 - np.arange(96) * 1.0) / 4 + 0.5, 0, 1)[None, :, None]

    def taken(paint):
        row = share * np.array(paint) + (1 - share) * np.array(grey)
        return np.repeat(row, 96, 0).astype(np.float32)

    large = taken(red)
    small = np.asarray(cv2.resize(large, (24, 24), interpolation=cv2.INTER_AREA))
    changed = np.zeros((24, 24), bool)
    changed[:, :12] = True
    edited = np.where(changed[..., None], np.array(blue, np.float32), small).astype(np.float32)
    photo = Photo(small, Camera(24, 24, 45.0), large)
    out = into_photo(photo, layers_of(small, edited, changed))
    assert np.abs(out - taken(blue))[20:76].max() < 0.09


def test_the_rim_of_a_glaring_surface_is_mixed_with_white():
    """A hundred times white in a tenth of a pixel would fill it, and the outline would be stairs."""
    small, large = (np.full((n, n, 3), 0.2, np.float32) for n in (24, 96))
    photo = Photo(small, Camera(24, 24, 45.0), large)
    base = np.full((24, 24, 3), 0.2, np.float32)
    changed = np.zeros((24, 24), bool)
    changed[6:18, 6:18] = True
    edited = np.where(changed[..., None], np.float32(20), base)
    share = matte(changed, photo.original)
    mixed = (share > 0) & (share < 1)
    out = into_photo(photo, layers_of(base, edited, changed))
    assert mixed.any()
    np.testing.assert_allclose(
        out[mixed], (0.2 + 0.8 * share[mixed])[:, None] * np.ones(3), atol=0.02
    )
    assert out[48, 48] == pytest.approx(20, rel=1e-3)


def test_new_metal_hides_the_texture_that_the_fit_lacks():
    texture = np.random.default_rng(1).uniform(0.1, 0.3, (24, 24, 3)).astype(np.float32)
    photo = Photo(texture, Camera(24, 24, 45.0), texture)
    base, edited = (np.full(texture.shape, v, np.float32) for v in (0.2, 0.4))
    layers = layers_of(base, edited, np.ones((24, 24), bool))
    np.testing.assert_allclose(into_photo(photo, layers) - edited, texture - base, atol=1e-5)
    metal = into_photo(photo, replace(layers, diffuse=np.full((24, 24), 0.1)))
    np.testing.assert_allclose(metal - edited, 0.1 * (texture - base), atol=1e-5)


def test_hdr_stays_hdr():
    scene = rendered_scene()
    bright = scene.photo.original * 20
    photo = replace(scene.photo, original=bright, linear=bright, hdr=True)
    base = bright.copy()
    edited = np.where(MASK[..., None], base * 0.5, base)
    out = into_photo(photo, layers_of(base, edited, MASK))
    assert out[~MASK].max() > 5
    np.testing.assert_allclose(out[14:20, 15:21], 0.5 * bright[14:20, 15:21], rtol=0.05)


@pytest.mark.parametrize(
    "change", [(0.1, 0.1, 0.1), (-0.1, 0.0, 0.1)], ids=["brightness", "hue alone"]
)
def test_noise_alone_is_no_edit_and_a_change_is_one(change):
    quiet = np.random.default_rng(0).normal(0, 0.05, (2, 40, 50, 3))
    assert (significance(*quiet) > 0).mean() < 0.02
    assert (significance(*(quiet[..., :1] + np.array(change))) > 0.5).mean() > 0.99


def test_a_shadow_with_sparkles_in_it_is_seen():
    """Under glass single paths bring much light: they must not make its shadow look like chance."""
    rng = np.random.default_rng(0)
    shadow = np.zeros((40, 50, 1))
    shadow[10:30, 15:35] = 0.2
    base = [0.5 + rng.normal(0, 0.05, (40, 50, 3)) for _ in range(2)]
    edited = [picture - shadow for picture in base]
    for picture in edited:
        picture[rng.random((40, 50)) < 0.01] = 20
    gain = _gain(base[0], edited[0], base[1], edited[1])
    assert gain[10:30, 15:35].min() > 0.5
    assert not gain[:, :5].any()


def test_a_lamp_in_the_picture_is_a_disc_at_native_size():
    """However bright it is: no pixel around it holds a share of its radiance."""
    scene = rendered_scene(native=4)
    lit = relight(scene, lamps=[lamp(scene, 36, 18, 2.0, 6500, 0.3)])
    (one,) = lit.lamps
    out = composite(scene, lit, spp=8)
    place, _ = project(np.array([one.position]), scene.camera)
    radius = 4 * one.radius / 2.0 * scene.camera.focal  # pixels; it is small, and 2 away
    y, x = np.mgrid[: out.shape[0], : out.shape[1]] + 0.5
    away = np.hypot(x - 4 * place[0, 0], y - 4 * place[0, 1])
    assert radius > 3 and one.radiance[1] > 20
    assert (out[away < radius - 1] > 1).all() and (out[(away > radius + 1.5)] < 1.5).all()
    assert ((out[..., 1] > 0.99) & (away < 3 * radius)).sum() < 1.4 * np.pi * radius**2
    ring = (away > radius) & (away < radius + 8)
    assert (out[ring] > 1.05 * scene.photo.original[ring]).all(), "it is lit up to the lamp's rim"


def test_many_edits_are_those_made_one_by_one():
    scene = rendered_scene()
    edits = [edit(scene, MASK, roughness=r) for r in (0.2, 0.8)]
    shown = list(pictures(scene, [edits[0], *edits], spp=6))
    assert shown[0] is shown[1], "what stands still is rendered once"
    for edited, out in zip(edits, shown[1:], strict=True):
        np.testing.assert_array_equal(out, composite(scene, edited, spp=6))


def test_developed_scenes_start_from_the_composite(tmp_path):
    scene = rendered_scene(2)
    edited = relight(edit(scene, MASK, roughness=0.2), lamps=[lamp(scene, 30, 10, 2.5, 3000, 1.0)])
    picture = scene.photo.original * 0.5
    save_scene(developed(scene, edited, picture), tmp_path / "b.scene")
    back = load_scene(tmp_path / "b.scene")
    np.testing.assert_array_equal(back.photo.original, picture)
    assert back.photo.linear.shape == scene.photo.linear.shape
    assert back.lamps == edited.lamps and back.materials.roughness[MASK].max() < 0.21
    assert [e["kind"] for e in back.provenance["edits"]] == ["material", "light"]
    assert back.report.stages[-1]["edits"] == back.provenance["edits"]


def test_the_plain_rendering_goes_through_a_super_resolution():
    scene = rendered_scene()
    edited = relight(scene, ambient=0.5)

    def double(picture):
        return np.kron(picture, np.ones((2, 2, 1)))

    plain = composite(scene, edited, spp=4, full_render=True, denoise=False)
    np.testing.assert_array_equal(plain, EditRenderer(scene).pair(edited)[1](4, 0))
    large = composite(scene, edited, spp=4, full_render=True, denoise=False, upscale=double)
    np.testing.assert_allclose(large, np.kron(plain, np.ones((2, 2, 1))), rtol=1e-6)
    for options, words in (
        ({"upscale": double}, "full_render"),
        ({"upscale": lambda picture: picture[1:], "full_render": True}, "return a larger picture"),
        (
            {"upscale": lambda picture: 1 / 0, "full_render": True},
            "upscale failed: ZeroDivisionError",
        ),
        ({"spp": 1}, "spp is 1"),
    ):
        with pytest.raises(InputError, match=words):
            composite(scene, edited, **{"spp": 4, **options})


def test_a_super_resolution_of_a_composite_is_refused_before_anything_is_rendered(monkeypatch):
    monkeypatch.setattr("materialist.edits.composite.composite.EditRenderer", None)
    for made in (composite, lambda scene, edited, **how: next(pictures(scene, [edited], **how))):
        with pytest.raises(InputError, match="full_render"):
            made(FLAT, FLAT, upscale=lambda picture: picture)


def test_a_photo_of_the_working_size_is_searched_once_for_each_side(monkeypatch):
    searched = []
    monkeypatch.setattr(
        into_photo_module, "nearest", lambda members: searched.append(1) or nearest(members)
    )
    texture = np.random.default_rng(1).uniform(0.1, 0.3, (400, 8, 3)).astype(np.float32)
    base, edited = (np.full(texture.shape, v, np.float32) for v in (0.2, 0.4))
    layers = layers_of(base, edited, np.broadcast_to(np.arange(8) < 4, (400, 8)))
    into_photo(Photo(texture, Camera(8, 400, 45.0), texture), layers)
    assert len(searched) == 2


def test_shade_goes_on_under_the_rim_of_a_body_where_a_replaced_surface_ends():
    """The last pixel of what was replaced lies under the foot of a body, and has none of its kind beside it."""
    photo = rendered_scene(4).photo
    shape = photo.linear.shape[:2]
    grey = replace(
        photo, linear=np.full_like(photo.linear, 0.6), original=np.full_like(photo.original, 0.6)
    )
    changed = np.zeros(shape, bool)
    inside = np.zeros(shape, np.float32)
    everywhere = np.ones(shape, bool)
    changed[:21] = True
    inside[10:20, 14:34] = 1
    inside[20, 14:34] = 0.25
    changed[20, :14] = changed[20, 34:] = False
    share = np.kron(inside >= 1, np.ones((4, 4))).astype(np.float32)
    base = np.full_like(grey.linear, 0.6)
    edited = np.full_like(base, 0.3)  # all in shade
    edited[inside == 1] = 5  # nothing is known under the body
    layers = Layers(
        base,
        edited,
        everywhere,
        changed,
        native=NativeLayer(inside, window(share >= 0), share, 0 * grey.original, ()),
    )
    out = into_photo(grey, layers)
    np.testing.assert_allclose(out[80:84, 64:128], 0.3, atol=0.02)


def test_a_lone_bright_pixel_is_brought_down_and_a_highlight_stays():
    picture = np.full((9, 9, 3), 0.5, np.float32)
    picture[2, 2] = (40, 20, 10)
    picture[6, 5:7] = 30
    clean = without_fireflies(picture)
    assert clean[2, 2].max() < 3 and clean[2, 2, 0] / clean[2, 2, 2] == pytest.approx(4, rel=1e-5)
    assert (clean[6, 5:7] > 1.4).all() and (clean <= picture + 1e-6).all()
    highlight = np.full((9, 9, 3), 0.5, np.float32)
    highlight[5:7, 5:7] = 30
    np.testing.assert_array_equal(without_fireflies(highlight), highlight)


def photo_from(path):
    linear = decode(path).linear
    return replace(
        FLAT.photo, linear=linear, original=linear, path=str(path), source=path.read_bytes()
    )


@pytest.mark.parametrize("suffix", ["png", "tiff"])
@pytest.mark.parametrize(("dtype", "side"), [(np.uint8, 16), (np.uint16, 256)])
def test_every_value_comes_back(tmp_path, dtype, side, suffix):
    pixels = np.arange(side**2).astype(dtype).reshape(side, side)[..., None].repeat(3, -1)
    cv2.imwrite(str(tmp_path / f"a.{suffix}"), pixels)
    photo = photo_from(tmp_path / f"a.{suffix}")
    save_image(tmp_path / "b.png", photo.original, photo)
    back = cv2.imread(str(tmp_path / "b.png"), cv2.IMREAD_UNCHANGED)
    assert back.dtype == dtype and is_deep(photo) == (dtype == np.uint16)
    np.testing.assert_array_equal(back, pixels)
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"a.{suffix}", "b.png"]


def test_a_saved_edit_of_a_16_bit_photo_stays_one(tmp_path):
    data = cv2.imencode(".png", np.full((36, 48, 3), 30000, np.uint16))[1].tobytes()
    scene = replace(FLAT, photo=replace(FLAT.photo, source=data, path="a.png"))
    save_scene(developed(scene, scene, scene.photo.original), tmp_path / "b.scene")
    again = load_scene(tmp_path / "b.scene")
    assert again.photo.source is None and is_deep(again.photo)
    save_scene(developed(FLAT, FLAT, FLAT.photo.original), tmp_path / "c.scene")
    assert not is_deep(load_scene(tmp_path / "c.scene").photo)


def test_a_saved_edit_keeps_the_exif_of_the_photo(tmp_path):
    exif = Image.Exif()
    exif[0x010F], exif[0x0112] = "Canon", 1
    exif.get_ifd(0x8769)[0xA405] = 28
    Image.new("RGB", (48, 36), "grey").save(tmp_path / "a.jpg", exif=exif)
    scene = replace(FLAT, photo=photo_from(tmp_path / "a.jpg"))
    once = developed(scene, scene, scene.photo.original)
    save_scene(once, tmp_path / "b.scene")
    again = load_scene(tmp_path / "b.scene")
    assert again.photo.exif == once.photo.exif and again.photo.source is None
    for saved in (again, developed(again, again, again.photo.original)):
        save_image(tmp_path / "o.jpg", saved.photo.original, saved.photo, force=True)
        found = Image.open(tmp_path / "o.jpg").getexif()
        assert found[0x010F] == "Canon" and found.get_ifd(0x8769)[0xA405] == 28


def test_a_saved_edit_of_a_wide_photo_says_that_it_is_one_no_more(tmp_path):
    profile = profile_of(space("Display P3", DISPLAY_P3, srgb_curve))
    for name, settings, notes in (("p3", {"icc_profile": profile}, (NARROWED,)), ("srgb", {}, ())):
        Image.new("RGB", (48, 36), "grey").save(tmp_path / f"{name}.png", **settings)
        scene = replace(FLAT, photo=photo_from(tmp_path / f"{name}.png"))
        assert developed(scene, scene, scene.photo.original).report.warnings == notes


def test_a_renderer_goes_with_its_last_user():
    """Mitsuba would compile the materials of scenes that are left over for every new rendering."""
    renderer = EditRenderer(flat_scene())
    base, _ = renderer.pair(renderer.scene)
    base(1, 0)
    there = weakref.ref(renderer)
    gc.disable()
    del renderer, base, _
    gone = there() is None
    gc.enable()
    assert gone
