"""Material edits against closed forms, and what they refuse."""

from dataclasses import replace

import numpy as np
import pytest
from edit_scenes import MASK, balls, flat_scene
from made_meshes import floor_scene

from materialist.camera import unit
from materialist.color import linear_to_srgb
from materialist.edits.composite.base import base_scene
from materialist.edits.material import normals
from materialist.edits.material.detail import white_share
from materialist.edits.material.material import edit, projected, shifted_hsv
from materialist.errors import InputError
from materialist.geometry.build import rebuilt, with_normals

SCENE = flat_scene()


def test_hue_by_a_third_of_a_turn_exchanges_the_channels():
    albedo = np.random.default_rng(0).random((5, 7, 3), np.float32)
    turned = shifted_hsv(albedo, 120, 0, 0)
    np.testing.assert_allclose(turned, albedo[..., [2, 0, 1]], atol=2e-6)
    np.testing.assert_allclose(shifted_hsv(turned, 240, 0, 0), albedo, atol=2e-6)


def test_ends_of_saturation_and_value():
    albedo = np.random.default_rng(1).random((5, 7, 3), np.float32)
    grey = shifted_hsv(albedo, 0, -1, 0)
    np.testing.assert_allclose(grey, np.repeat(albedo.max(-1, keepdims=True), 3, -1), atol=2e-6)
    assert (shifted_hsv(albedo, 0, 0, -1) == 0).all()
    np.testing.assert_allclose(shifted_hsv(albedo, 0, 0, 1).max(-1), 1, atol=2e-6)


@pytest.mark.parametrize("value", [-0.6, 0.6])
def test_value_keeps_the_order_of_a_texture(value):
    ramp = np.repeat(np.linspace(0.02, 0.98, 40, dtype=np.float32)[:, None, None], 3, -1)
    moved = linear_to_srgb(shifted_hsv(ramp, 0, 0, value))[:, 0, 0]
    old = linear_to_srgb(ramp)[:, 0, 0]
    expected = old + value * (1 - old) if value > 0 else old * (1 + value)
    np.testing.assert_allclose(moved, expected, atol=1e-5)
    assert (np.diff(moved) > 0).all()


def test_only_the_mask_changes_and_the_rest_is_shared():
    edited = edit(SCENE, MASK, hue=90, roughness=0.1, metallic="+0.25")
    new = edited.materials
    old = SCENE.materials
    for name in ("albedo", "roughness", "metallic"):
        np.testing.assert_array_equal(getattr(new, name)[~MASK], getattr(old, name)[~MASK])
    assert (new.roughness[MASK] == np.float32(0.1)).all() and (new.metallic[MASK] == 0.25).all()
    assert edited.geometry is SCENE.geometry and edited.photo is SCENE.photo
    assert (SCENE.materials.roughness == 0.5).all()
    assert edited.provenance["edits"] == [
        {
            "kind": "material",
            "hue": 90,
            "roughness": 0.1,
            "metallic": "+0.25",
            "pixels": int(MASK.sum()),
        }
    ]


def test_a_region_grows_shrinks_and_is_feathered():
    def reached(**values):
        return edit(SCENE, MASK, roughness=1.0, **values).materials.roughness

    rows, columns = MASK.nonzero()
    for grow in (2 / 48, -2 / 48):
        row, column = (reached(grow=grow) > 0.5).nonzero()
        assert row.min() == rows.min() - 48 * grow and column.max() == columns.max() + 48 * grow
    soft = reached(feather=8 / 48)[(rows.min() + rows.max()) // 2]
    border = columns.min()
    assert (np.diff(soft[: border + 3]) >= 0).all() and 0.5 < soft[border - 2] < soft[
        border + 1
    ] < 1
    assert (
        abs(soft[border - 1] + soft[border] - 1.5) < 0.02
    )  # half of the change where the border was
    with pytest.raises(InputError, match="shrink it less"):
        edit(SCENE, MASK, grow=-0.2, hue=1)


def test_shift_and_set_differ_by_the_sign():
    for wanted, expected in (
        ("+0.3", 0.8),
        ("-0.3", 0.2),
        ("0.3", 0.3),
        ("+0.9", 1.0),
        ("-0.9", 0.0),
    ):
        got = edit(SCENE, MASK, roughness=wanted).materials.roughness[MASK]
        np.testing.assert_allclose(got, expected, atol=1e-6)


def test_texture_lies_upright_on_a_wall():
    scene = flat_scene()
    wall = np.zeros((36, 48), bool)
    wall[4:10, 8:40] = True  # above the block: one flat wall of 6 x 32 pixels
    picture = np.zeros((6, 32, 3), np.float32)
    picture[..., 0] = np.linspace(0.1, 0.9, 32)
    picture[..., 1] = np.linspace(0.2, 0.8, 6)[:, None]
    new = edit(scene, wall, texture=picture, detail=0)
    albedo = new.materials.albedo[4:10, 8:40]
    np.testing.assert_allclose(albedo[..., 0][:, 2:-2], picture[..., 0][:, 2:-2], atol=0.03)
    np.testing.assert_allclose(albedo[..., 1][1:-1], picture[..., 1][1:-1], atol=0.11)
    assert (np.diff(albedo[..., 1][1:-1], axis=0) > 0).all()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"texture": np.zeros((4, 4))}, "texture is (4, 4)"),
        ({"texture": np.full((4, 4, 3), 2.0)}, "0 to 1"),
        ({"texture": np.zeros((4, 4, 3)), "albedo": (0, 0, 0)}, "not both"),
    ],
)
def test_impossible_values_are_named(options, words):
    with pytest.raises(InputError) as error:
        edit(SCENE, MASK, **options)
    assert words in str(error.value) and str(error.value).endswith(".")


def test_a_texture_keeps_its_detail_before_a_wall_far_away():
    scene = flat_scene()
    far = replace(scene, depth=np.where(MASK, scene.depth, 60).astype(np.float32))
    picture = np.random.default_rng(0).random((12, 12, 3), np.float32)
    near, before_far = (
        edit(one, MASK, texture=picture).materials.albedo[MASK] for one in (scene, far)
    )
    np.testing.assert_allclose(before_far, near, atol=1e-5)


def test_a_texture_lies_on_a_floor_with_its_top_in_the_depth():
    scene = floor_scene(tilt=80.0)
    ramp = np.linspace(0.9, 0.1, 16, dtype=np.float32)
    picture = np.stack(np.broadcast_arrays(ramp[:, None], ramp[None], 0.5), -1)
    albedo = edit(scene, scene.depth > 0, texture=picture).materials.albedo[4:-4, 4:-4]
    assert (np.diff(albedo[..., 0], axis=0) < 0).mean() > 0.9 and (
        np.diff(albedo[..., 1], axis=1) < 0
    ).mean() > 0.9


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_a_texture_of_one_pixel_has_the_shape_of_the_photo(scale):
    pixel = np.float32([[[0.25, 0.5, 0.75]]])
    albedo = projected(SCENE, MASK, pixel, scale)
    assert albedo.shape == SCENE.materials.albedo.shape
    np.testing.assert_allclose(albedo, np.broadcast_to(pixel, albedo.shape), atol=1e-6)


def test_a_texture_is_turned_clockwise_in_its_plane():
    scene = floor_scene(tilt=30.0)
    ramp = np.linspace(0.9, 0.1, 16, dtype=np.float32)
    bright_left = np.broadcast_to(ramp[None, :, None], (16, 16, 3))

    def laid(turn):
        changes = {"texture": bright_left, "texture_scale": 3, "texture_turn": turn}
        return edit(scene, scene.depth > 0, **changes).materials.albedo[-14:-4, 4:-4, 0]

    # Left goes up, then right; where the picture repeats it jumps.
    assert (np.diff(laid(0), axis=1) < 0).mean() > 0.9
    assert (np.diff(laid(90), axis=0) < 0).mean() > 0.9
    assert (np.diff(laid(180), axis=1) > 0).mean() > 0.9


def shaded_scene(factor, *, predicted: bool = False):
    """Brown paint times a factor [H, W] in the fitted albedo, and in the predicted one, or not."""
    paint = np.broadcast_to(np.float32([0.3, 0.12, 0.05]), SCENE.materials.albedo.shape)
    fitted = (paint * factor[..., None]).astype(np.float32)
    prior = replace(SCENE.prior.materials, albedo=(fitted if predicted else paint).copy())
    materials = replace(SCENE.materials, albedo=fitted)
    return replace(SCENE, materials=materials, prior=replace(SCENE.prior, materials=prior))


def grooves():
    """[H, W] factors: dark on every fourth column."""
    groove = np.ones(MASK.shape, np.float32)
    groove[:, ::4] = 0.6
    return groove


def test_a_new_colour_keeps_the_fine_shading_that_the_fit_put_into_the_albedo():
    groove = grooves()
    scene = shaded_scene(groove)
    gold = (1.0, 0.56, 0.08)
    new = edit(scene, MASK, albedo=gold, metallic=1).materials.albedo
    # Dark grooves stay dark, in the hue of the new colour.
    ridges = new[MASK & (groove == 1)]
    np.testing.assert_allclose(ridges, np.broadcast_to(gold, ridges.shape), atol=1e-6)
    deep = new[MASK & (groove < 1)]
    np.testing.assert_allclose(deep / deep[:, :1], np.broadcast_to(gold, deep.shape), rtol=1e-5)
    assert ((deep[:, 0] > 0.55) & (deep[:, 0] < 0.7)).all()
    # Without it the colour is flat; half of it is the square root.
    flat = edit(scene, MASK, albedo=gold, detail=0).materials.albedo
    np.testing.assert_allclose(flat[MASK], np.broadcast_to(gold, flat[MASK].shape), atol=1e-6)
    half = edit(scene, MASK, albedo=gold, detail=0.5).materials.albedo[MASK & (groove < 1)]
    np.testing.assert_allclose(half[:, 0] ** 2, deep[:, 0], rtol=1e-4)


def test_shades_that_the_network_left_in_its_albedo_stay_on_a_new_colour():
    groove = grooves()
    scene = shaded_scene(groove, predicted=True)
    blue = (0.05, 0.1, 0.4)
    new = edit(scene, MASK, albedo=blue).materials.albedo
    assert (
        (new[MASK & (groove < 1)] / blue > 0.55) & (new[MASK & (groove < 1)] / blue < 0.7)
    ).all()
    # Metal has reflections, and no shades.
    metal = edit(scene, MASK, albedo=blue, metallic=1).materials.albedo[MASK]
    np.testing.assert_allclose(metal, np.broadcast_to(blue, metal.shape), atol=1e-6)
    # What is of another hue is a pattern, and goes.
    green = np.float32([0.05, 0.3, 0.1]) * 0.6
    for maps in (scene.materials, scene.prior.materials):
        maps.albedo[groove < 1] = green
    flat = edit(scene, MASK, albedo=blue).materials.albedo[MASK]
    np.testing.assert_allclose(flat, np.broadcast_to(blue, flat.shape), rtol=0.02)


def glossy_scene(*, predicted: bool):
    """Red paint with white stripes on a quarter of it, which the network calls paint or not; and where they are."""
    paint = np.broadcast_to(np.float32([0.5, 0.1, 0.05]), SCENE.materials.albedo.shape)
    stripes = np.zeros(MASK.shape, bool)
    stripes[:, ::4] = True
    fitted = np.where(stripes[..., None], paint + 0.3, paint).astype(np.float32)
    prior = replace(SCENE.prior.materials, albedo=(fitted if predicted else paint).copy())
    materials = replace(SCENE.materials, albedo=fitted)
    scene = replace(SCENE, materials=materials, prior=replace(SCENE.prior, materials=prior))
    return scene, stripes


def test_white_gloss_stays_white_on_a_new_colour():
    blue = (0.05, 0.1, 0.4)
    scene, stripes = glossy_scene(predicted=False)
    new = edit(scene, MASK, albedo=blue).materials.albedo
    np.testing.assert_allclose(
        new[MASK & ~stripes], np.broadcast_to(blue, new[MASK & ~stripes].shape), rtol=0.02
    )
    # Nearly as much white as the old albedo had, laid over the paint.
    white = (new - np.array(blue))[MASK & stripes] / (1 - np.array(blue))
    np.testing.assert_allclose(white, 0.3, atol=0.08)
    assert np.ptp(white, axis=-1).max() < 0.1
    # Again, in another colour, and not at all.
    again = edit(edit(scene, MASK, albedo=blue), MASK, albedo=(0.1, 0.3, 0.1)).materials.albedo
    np.testing.assert_allclose(again[MASK & stripes].min(), 0.1 + 0.3 * 0.9, atol=0.1)
    flat = edit(scene, MASK, albedo=blue, detail=0).materials.albedo[MASK]
    np.testing.assert_allclose(flat, np.broadcast_to(blue, flat.shape), atol=1e-6)


def test_paint_of_an_earlier_edit_is_no_gloss():
    scene, stripes = glossy_scene(predicted=True)
    white = edit(scene, MASK & stripes, albedo=(0.9, 0.9, 0.9))
    grey = edit(scene, MASK & stripes, saturation=-1.0)
    blue = (0.05, 0.1, 0.4)
    for earlier in (white, grey):
        new = edit(earlier, MASK, albedo=blue).materials.albedo[MASK]
        np.testing.assert_allclose(new, np.broadcast_to(blue, new.shape), rtol=0.02)


def test_another_hue_that_the_fit_brightened_is_no_gloss():
    scene, stripes = glossy_scene(predicted=True)
    scene.prior.materials.albedo[stripes] = (0.05, 0.06, 0.4)
    scene.materials.albedo[stripes] = (0.11, 0.13, 0.9)
    new = edit(scene, MASK, albedo=(0.1, 0.4, 0.1)).materials.albedo[MASK & stripes]
    np.testing.assert_allclose(
        new / new[:, 1:2], np.broadcast_to((0.25, 1, 0.25), new.shape), atol=0.1
    )


@pytest.mark.parametrize("predicted, values", [(True, {}), (False, {"metallic": 1.0})])
def test_white_paint_and_metal_take_the_whole_new_colour(predicted, values):
    blue = np.array([0.05, 0.1, 0.4])
    scene, stripes = glossy_scene(predicted=predicted)
    new = edit(scene, MASK, albedo=tuple(blue), **values).materials.albedo[MASK & stripes]
    np.testing.assert_allclose(new / new[:, 2:], np.broadcast_to(blue / 0.4, new.shape), rtol=1e-4)


def test_a_bright_colour_is_darkened_until_the_fine_shading_has_room():
    shading = np.ones(MASK.shape)
    shading[:, ::3] = 1.6
    scene = shaded_scene(shading)
    new = edit(scene, MASK, albedo=(0.9, 0.45, 0.0)).materials.albedo
    light = new[MASK & (shading > 1)]
    dark = new[MASK & (shading == 1)]
    # The floor of the ratio moves it by less than 1 %.
    np.testing.assert_allclose(light[:, 0], 1, rtol=0.01)
    assert 1.4 < light[0, 0] / dark[0, 0] <= 1.61
    np.testing.assert_allclose(new[MASK][:, 1], new[MASK][:, 0] / 2, rtol=1e-5)
    # A darker one has room.
    grey = edit(scene, MASK, albedo=(0.4, 0.4, 0.4)).materials.albedo
    np.testing.assert_allclose(grey[MASK & (shading == 1)], 0.4, rtol=0.01)


def uneven_ball():
    """(scene with a ball whose normals are uneven, its mask [H, W], its true normals [H, W, 3])."""
    scene, number = balls(((-0.3, -0.2, -3), 0.4))
    ball = number == 0
    rows, columns = np.indices(ball.shape)
    waves = 0.3 * np.stack([np.sin(rows), np.cos(columns), 0 * rows], -1)
    normal = unit(scene.normal + np.where(ball[..., None], waves, 0)).astype(np.float32)
    uneven = replace(scene, normal=normal, geometry=with_normals(scene.geometry, normal, ball))
    return uneven, ball, scene.normal


def test_metal_has_the_normals_of_a_round_body():
    scene, ball, truth = uneven_ball()
    gold = edit(scene, ball, metallic=1, roughness=0.1)
    np.testing.assert_array_equal(gold.normal[~ball], scene.normal[~ball])
    off = [
        np.degrees(np.arccos((n * truth)[ball].sum(-1).clip(-1, 1)))
        for n in (scene.normal, gold.normal)
    ]
    assert np.median(off[1]) < 4 < 10 < np.median(off[0])
    # The surfaces stay where they are; their normals are the map's.
    mesh = gold.geometry.mesh
    assert mesh.vertices is scene.geometry.mesh.vertices
    inside = ball.ravel()[mesh.face_pixel]
    turned = (
        mesh.normals[mesh.faces[inside]] != scene.geometry.mesh.normals[mesh.faces[inside]]
    ).any()
    assert turned
    np.testing.assert_array_equal(
        mesh.normals[mesh.faces[~inside]], scene.geometry.mesh.normals[mesh.faces[~inside]]
    )
    assert gold.provenance["edits"][-1]["normals"] == "metal"


@pytest.mark.parametrize(
    "change", [{"roughness": 0.1}, {"metallic": 0.3}, {"metallic": 1, "normals": "maps"}]
)
def test_other_edits_leave_its_normals(change):
    scene, ball, _ = uneven_ball()
    edited = edit(scene, ball, **change)
    assert edited.normal is scene.normal and edited.geometry is scene.geometry
    assert "normals" not in edited.provenance["edits"][-1]


def test_metal_that_is_not_round_is_smooth_where_the_photo_is():
    """A block under uneven normals: its own are one direction."""
    rows, columns = np.indices(MASK.shape)
    waves = 0.2 * np.stack([np.sin(1.3 * rows), np.cos(1.1 * columns), 0 * rows], -1)
    uneven = unit(SCENE.normal + np.where(MASK[..., None], waves, 0)).astype(np.float32)
    geometry = with_normals(SCENE.geometry, uneven, MASK)
    scene = replace(SCENE, normal=uneven, geometry=geometry)
    edited = edit(scene, MASK, metallic=1)
    off = [
        np.degrees(np.arccos((n * SCENE.normal).sum(-1)[MASK].clip(-1, 1))).mean()
        for n in (uneven, edited.normal)
    ]
    assert off[1] < 0.8 * off[0]
    np.testing.assert_array_equal(edited.normal[~MASK], uneven[~MASK])
    assert edited.geometry.mesh.vertices is scene.geometry.mesh.vertices


def test_normals_of_metal_are_not_shared_with_the_next_edit():
    scene, ball, _ = uneven_ball()
    first = edit(scene, ball, metallic=1).normal
    kept = first.copy()
    first[:] = 0
    np.testing.assert_array_equal(edit(scene, ball, metallic=0.9).normal, kept)


def test_normals_of_metal_are_there_though_another_thread_throws_them_away(monkeypatch):
    class Emptied(dict):
        def __setitem__(self, key, value):
            """As if others had kept many in the meantime."""

    scene, ball, _ = uneven_ball()
    monkeypatch.setattr(normals, "_KEPT", Emptied())
    assert (edit(scene, ball, metallic=1).normal != scene.normal).any()


def test_a_removal_beside_metal_is_compared_with_the_normals_of_the_photo():
    """Else the photo of the round thing changes as if a shadow had gone from it."""
    scene, ball, _ = uneven_ball()
    hole = np.zeros_like(ball)
    hole[-12:-4, -20:-8] = True
    gold = edit(scene, ball, metallic=1)
    photo = replace(scene.photo, linear=np.where(hole[..., None], 0.1, scene.photo.linear))

    def removed(other):
        depth = np.where(hole, 1.1 * scene.depth, scene.depth).astype(np.float32)
        geometry = rebuilt(scene, depth, other.normal, scene.camera)
        return replace(other, photo=photo, depth=depth, geometry=geometry)

    def shading(base):
        """[P, 3] mean normal of the corners of each pixel with a surface."""
        mesh = base.geometry.mesh
        corners = mesh.faces[: 2 * int((base.depth > 0).sum())].reshape(-1, 6)
        return mesh.normals[corners].mean(1)

    plain = base_scene(scene, removed(scene))
    base = base_scene(scene, removed(gold))
    np.testing.assert_array_equal(base.normal, plain.normal)
    np.testing.assert_array_equal(base.materials.metallic, plain.materials.metallic)
    off = [np.abs(shading(one) - shading(plain)).max() for one in (base, removed(gold))]
    assert off[0] < 0.1 < 0.2 < off[1]


def test_white_is_told_from_paint():
    paint = np.array([0.1, 0.4, 0.15])
    albedo = 2 * paint + np.array([[0.3], [0.1]])
    np.testing.assert_allclose(white_share(albedo, paint), [0.3, 0.1], rtol=0.25)
    np.testing.assert_allclose(white_share(albedo, 7 * paint), white_share(albedo, paint))
    # Grey paint has the direction of white, and no channel gives more than it has.
    grey = np.full(3, 0.5)
    assert white_share(1.5 * grey, grey) < 1e-6
    assert white_share(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])) == 0
