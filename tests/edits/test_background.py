"""Objects taken away: maps, depth and photo continue, and the composite shows it."""

from dataclasses import replace

import numpy as np
import pytest
from edit_scenes import block_mask, flat_scene, rendered_scene
from scipy import ndimage

from materialist.edits.composite.composite import composite
from materialist.edits.composite.revealed import _continued
from materialist.edits.remove.background import joined, without
from materialist.edits.remove.hole import make_hole, told_shadow
from materialist.errors import InputError
from materialist.types import Photo

MASK = block_mask(36, 48)


def far_from(mask, pixels):
    import cv2

    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * pixels + 1,) * 2, np.uint8)) == 0


def test_the_wall_goes_on_behind_the_block():
    scene = flat_scene()
    removed = without(scene, MASK)
    np.testing.assert_allclose(removed.depth[MASK], 3.0, rtol=1e-3)
    wall = scene.materials.albedo[far_from(MASK, 2)]
    assert np.abs(removed.materials.albedo[MASK].mean(0) - wall.mean(0)).max() < 0.03
    assert np.abs(removed.photo.linear[MASK].mean(0) - wall.mean(0)).max() < 0.05
    outside = far_from(MASK, 2)
    for old, new in ((scene.depth, removed.depth), (scene.materials.albedo, removed.materials.albedo),
                     (scene.photo.original, removed.photo.original)):  # fmt: skip
        np.testing.assert_array_equal(new[outside], old[outside])
    assert removed.geometry.mesh.vertices[:, 2].max() < -2.9, "the block's surface is gone from the mesh"
    assert removed.provenance["edits"][-1]["kind"] == "remove"


def test_the_native_photo_is_filled_with_native_detail():
    scene = flat_scene(native=3)
    removed = without(scene, MASK)
    native = np.kron(MASK, np.ones((3, 3), bool))
    filled, wall = removed.photo.original[native], scene.photo.original[np.kron(far_from(MASK, 3), np.ones((3, 3)) > 0)]
    assert np.abs(filled.mean(0) - wall.mean(0)).max() < 0.05
    fine = removed.photo.original - np.kron(removed.photo.linear, np.ones((3, 3, 1)))
    assert fine[native].std() > 0.3 * fine[~native].std()


def test_the_composite_shows_the_wall_and_keeps_the_rest():
    scene = rendered_scene()
    removed = without(scene, MASK)
    picture = composite(scene, removed, spp=48, denoise=False)
    wall = scene.photo.linear[far_from(MASK, 4)].mean(0)
    assert np.abs(picture[MASK].mean(0) / wall - 1).max() < 0.08
    far = far_from(MASK, 8)
    same = (picture == scene.photo.original).all(-1)
    assert same[far].mean() > 0.5 and np.abs(picture - scene.photo.original)[far].max() < 0.1


@pytest.mark.parametrize("native", [1, 3])
def test_what_was_put_before_it_stays_whole(native):
    """A mask that lies on a thing before the object takes nothing of the thing away, nor copies it."""
    from test_composite import tetrahedron

    from materialist.edits.composite.composite import developed
    from materialist.edits.core.renderer import EditRenderer

    scene = rendered_scene(native)
    red = replace(scene, bodies=(tetrahedron(),))
    saved = developed(scene, red, composite(scene, red, spp=16))
    studio, size = EditRenderer(saved), saved.photo.original.shape[:2]
    here, there = studio.body_coverage(saved), studio.body_coverage_in(saved, size, (0, size[0], 0, size[1]))
    mask = block_mask(36, 48)
    mask |= (here > 0) & (np.arange(48) < np.median(np.nonzero(here)[1]))
    assert (here[mask] == 1).sum() > 10
    gone = without(saved, mask, shadow=0)
    np.testing.assert_array_equal(gone.photo.linear[here == 1], saved.photo.linear[here == 1])
    np.testing.assert_array_equal(gone.photo.original[there == 1], saved.photo.original[there == 1])
    out = composite(saved, gone, spp=16)
    assert np.abs(out - saved.photo.original)[there == 1].max() < 0.06
    red_here = lambda picture: picture[..., 0] > 2 * picture[..., 1]  # noqa: E731
    assert not (red_here(out) & ~red_here(saved.photo.original) & (there == 0)).any(), "nor is it copied"


def test_a_background_may_have_the_unit_of_the_photos_file(tmp_path):
    from materialist.io.exr import write_exr

    scene = rendered_scene()
    hdr = replace(scene, photo=replace(scene.photo, hdr=True, stops=7))
    write_exr(tmp_path / "behind.exr", scene.photo.original / 128)
    plain = without(scene, block_mask(36, 48), background=scene.photo.linear)
    told = without(hdr, block_mask(36, 48), background=tmp_path / "behind.exr")
    np.testing.assert_array_equal(told.photo.linear, plain.photo.linear)


def test_a_true_background_is_what_is_seen():
    scene = rendered_scene()
    y, x = np.mgrid[:36, :48]
    truth = np.stack([0.2 + 0.2 * (x % 6 < 3), 0.3 + 0.1 * (y % 8 < 4), 0.25 + 0 * x], -1).astype(np.float32)
    removed = without(scene, MASK, background=truth)
    np.testing.assert_allclose(removed.photo.linear[MASK], truth[MASK], rtol=1e-5)
    picture = composite(scene, removed, spp=48, denoise=False)
    assert np.sqrt(((picture - truth) ** 2)[MASK].mean()) < 0.04


def test_a_background_in_one_place_changes_no_other():
    """What is filled from its surroundings keeps their light, whatever is given elsewhere."""
    scene = rendered_scene()
    other = np.zeros((36, 48), bool)
    other[4:9, 38:44] = True
    first = without(scene, MASK)
    alone, patches, given = (
        composite(scene, edited, spp=16, denoise=False)
        for edited in (first, without(first, other), without(first, other, background=0.5 * scene.photo.linear))
    )
    near = np.abs(patches - alone)[MASK].mean()  # another scene has other noise
    assert np.abs(given - alone)[MASK].mean() < 2 * near + 1e-3
    assert np.abs(given - patches)[other].mean() > 0.05


def test_given_places_are_those_of_a_background():
    from materialist.edits.composite.revealed import _given

    scene = flat_scene()
    other = np.zeros((36, 48), bool)
    other[4:9, 38:44] = True
    edited = without(without(scene, MASK), other, background=0.5 * scene.photo.linear)
    filled = (edited.photo.linear != scene.photo.linear).any(-1) | (edited.depth != scene.depth)
    given = _given(scene, edited, filled)
    assert given[other].all() and not given[MASK].any() and filled[MASK].all()
    assert not _given(edited, edited, filled).any()


def test_what_is_odd_about_a_background_is_told(tmp_path):
    from PIL import Image

    picture = np.full((36, 48, 4), 120, np.uint8)
    picture[:, 20:, 3] = 0
    Image.fromarray(picture).save(tmp_path / "cut.png")
    (note,) = without(flat_scene(), MASK, background=tmp_path / "cut.png").report.warnings
    assert "cut.png" in note and "white" in note


@pytest.mark.parametrize(
    ("mask", "message"),
    [
        (np.zeros((36, 48), bool), "empty"),
        (np.ones((36, 48), bool), "covers 100% of what"),
        (np.ones((10, 10), bool), "the photo at working size"),
    ],
)
def test_masks_that_cannot_be_removed(mask, message):
    with pytest.raises(InputError, match=message):
        without(flat_scene(), mask)


def test_masks_cut_by_the_frame_with_holes_parts_and_sky():
    scene = flat_scene(sky=12)
    mask = np.zeros((36, 48), bool)
    mask[8:30, :14] = True
    mask[16:22, 4:8] = False
    mask[30:34, 40:46] = True
    removed = without(scene, mask)
    assert np.isfinite(removed.depth).all() and np.isfinite(removed.photo.original).all()
    assert (removed.depth[mask & (np.arange(36)[:, None] > 18)] > 1.99).all()
    only_sky_behind = replace(scene, depth=np.where(mask, scene.depth, 0))
    with pytest.raises(InputError, match="around the mask is sky"):
        without(only_sky_behind, mask)


def test_options_out_of_range_and_backgrounds_of_another_aspect():
    scene = flat_scene()
    for options, message in (
        ({"grow": -1}, "rim is -1"), ({"shadow": np.nan}, "shadow is nan"),
        ({"background": np.ones((20, 20, 3))}, "same proportions"),
        ({"background": -np.ones((36, 48, 3))}, "negative"),
        ({"background": np.ones((36, 48, 3)), "inpaint": lambda photo, hole: photo}, "not both"),
    ):  # fmt: skip
        with pytest.raises(InputError, match=message):
            without(scene, MASK, **options)


def test_the_shadow_widens_the_hole_on_the_ground_alone():
    scene = flat_scene()
    floor = np.zeros((36, 48), np.int8)
    floor[:24] = -1
    normal = np.where(floor[..., None] == 0, [0.0, 1, 0], scene.normal).astype(np.float32)
    scene = replace(scene, normal=normal, geometry=replace(scene.geometry, plane_label=floor))
    plain, wide = (make_hole(scene, MASK, shadow=shadow) for shadow in (0.0, 0.5))
    np.testing.assert_array_equal(plain.painted, plain.gone)
    more = wide.painted & ~wide.gone
    assert more[24:].any() and not more[:24].any()
    np.testing.assert_array_equal(wide.gone, plain.gone)


def test_an_inpainter_gets_the_photo_and_the_hole():
    scene, seen = flat_scene(), []

    def paint(photo, hole):
        seen.append(hole)
        return np.where(hole[..., None], 0.4, photo)

    removed = without(rendered_scene(), MASK, inpaint=paint)
    assert isinstance(removed.photo, Photo) and seen[0].shape == scene.depth.shape
    np.testing.assert_allclose(removed.photo.linear[MASK], 0.4)


def test_a_wall_ends_without_the_object_where_it_ended_with_it():
    from dataclasses import asdict

    from materialist.geometry.build import build_geometry
    from materialist.geometry.completion import walls_of
    from materialist.geometry.planes import find_planes

    scene = flat_scene()
    (wall, *_) = walls_of(find_planes(scene.depth, scene.normal, scene.camera), scene.depth, scene.camera)
    ends = replace(wall.usual, up=wall.seen.up + 4.0)
    completed = build_geometry(scene.depth, scene.normal, scene.camera, ends=[ends])
    provenance = {**scene.provenance, "completion": "planes", "ends": [asdict(ends)]}
    empty = without(replace(scene, geometry=completed, provenance=provenance), MASK)
    assert float(empty.geometry.mesh.vertices[:, 1].max()) == pytest.approx(ends.up, abs=0.2)
    usual = without(replace(scene, geometry=completed, provenance={**provenance, "ends": []}), MASK)
    assert float(usual.geometry.mesh.vertices[:, 1].max()) < ends.up - 1


def test_what_the_object_cast_goes_with_it_unless_it_is_to_stay():
    scene = flat_scene()
    floor = np.where(np.arange(36)[:, None] >= 20, 0, -1).astype(np.int8) * np.ones((1, 48), np.int8)
    normal = np.where(floor[..., None] == 0, [0.0, 1, 0], scene.normal).astype(np.float32)
    linear = np.full((36, 48, 3), 0.5, np.float32)
    linear[MASK] = 0.2
    rows, columns = np.nonzero(MASK)
    beside = np.zeros((36, 48), bool)
    beside[rows.max() - 4 : rows.max() + 1, columns.max() + 1 : columns.max() + 7] = True
    linear[beside] = 0.42
    photo = replace(scene.photo, linear=linear)
    scene = replace(scene, normal=normal, photo=photo, geometry=replace(scene.geometry, plane_label=floor))
    found, kept = make_hole(scene, MASK), make_hole(scene, MASK, shadow=0.0)
    assert found.painted[beside & ~found.gone].mean() > 0.7 and not kept.painted[beside & ~kept.gone].any()


def test_the_light_of_the_surroundings_goes_on_in_the_filled_place():
    filled = np.zeros((20, 30), bool)
    filled[5:15, 8:22] = True
    plane = np.where(np.arange(30)[None] < 15, 0, 1) * np.ones((20, 1), int)
    change = np.where((plane == 0)[..., None], 0.2, -0.1) * np.ones(3)
    change[filled] = 7.0  # what it says there itself is not read
    change[2:4] = -0.9  # and this is another surface that came to light
    found = _continued(change, filled, plane)
    np.testing.assert_allclose(found[filled & (plane == 0)], 0.2, atol=1e-6)
    np.testing.assert_allclose(found[filled & (plane == 1)], -0.1, atol=1e-6)
    assert not found[~filled].any()


def test_parts_of_a_plane_that_do_not_reach_the_hole_are_other_surfaces():
    label = np.zeros((12, 20), int)
    label[:, 12:15] = 1
    label[4:6, :3] = -1
    hole = np.zeros((12, 20), bool)
    hole[5:8, 5:8] = True
    found = joined(label, hole)
    assert (found[:, :12] == label[:, :12]).all() and (found[:, 12:15] == 1).all(), "what is joined, and other planes"
    assert len(np.unique(found[:, 15:])) == 1 and found[0, 19] not in label
    hole[:, 17] = True
    np.testing.assert_array_equal(joined(label, hole), label)


def test_how_much_of_a_shadow_goes_is_told_by_word_or_number():
    assert told_shadow("auto") is None and told_shadow("0.5") == 0.5 and told_shadow(0) == 0
    for value in ("much", None, True, [1]):
        with pytest.raises(InputError, match="give auto, or a share"):
            told_shadow(value)


def test_light_that_comes_back_outshines_nothing():
    """Where an object's guessed back hid a strong light, its neighbour must not glow when it goes."""
    from materialist.edits.composite.revealed import _too_bright

    scene = flat_scene()
    grey = np.full((36, 48, 3), 0.2, np.float32)
    grey[:, :12] = 0.8  # a quarter of it is bright
    scene = replace(scene, photo=replace(scene.photo, linear=grey))
    filled = np.zeros((36, 48), bool)
    filled[10:20, 20:30] = True
    gained = np.full((36, 48, 3), 0.9, np.float32)
    kept = gained - _too_bright(scene, gained, filled)
    np.testing.assert_allclose(kept[:, :12], 0, atol=1e-6)  # as bright as anything already
    np.testing.assert_allclose(kept[30, 40], 0.6, rtol=1e-5)  # shade may go
    np.testing.assert_array_equal(kept[filled], gained[filled])
    assert not _too_bright(scene, -gained, filled).any()


def test_changes_beside_a_filled_place_are_those_of_the_light():
    """Not what surfaces leave that do not meet there, nor what the fit misses, nor too much shade on a thing."""
    from materialist.edits.composite.revealed import MOST, RIM, _believed, _trust

    scene = rendered_scene()
    photo, filled = scene.photo.linear, block_mask(36, 48)
    rim = ~filled & (ndimage.distance_transform_edt(~filled) <= RIM)
    brighter = 1.2 * photo
    spoiled = np.where(rim[..., None], 9 * photo, brighter)
    for plane, least in ((-1, np.exp(-MOST)), (0, 0.1)):
        label = np.full(filled.shape, plane)
        trust = _trust(scene, photo, filled)
        np.testing.assert_array_equal(trust, 1)
        found = _believed(photo, spoiled, filled, label, trust)
        np.testing.assert_array_equal(found[filled], spoiled[filled])
        np.testing.assert_allclose(found[rim] + 0.02, 1.2 * (photo[rim] + 0.02), rtol=0.05)
        np.testing.assert_allclose(found[~filled & ~rim], brighter[~filled & ~rim], rtol=1e-4)
        darker = _believed(photo, 0.1 * photo, filled, label, trust)[~filled]
        assert (darker + 0.02 >= least * (photo[~filled] + 0.02) * 0.999).all() and (darker < photo[~filled]).all()
    missed = np.zeros(filled.shape, bool)
    missed[4:12, 4:12] = True
    fit = np.where(missed[..., None], 2 * photo, photo)
    found = _believed(fit, 1.2 * fit, filled, scene.geometry.plane_label, _trust(scene, fit, filled))
    np.testing.assert_allclose(found[6:10, 6:10], fit[6:10, 6:10], rtol=0.01)
    np.testing.assert_allclose(found[30:, 30:], (1.2 * fit)[30:, 30:], rtol=0.02)


@pytest.mark.parametrize("native", [1, 3])
def test_under_a_body_nothing_of_the_photo_is_left(native):
    from materialist.edits.composite.composite import into_photo
    from materialist.edits.composite.layers import Layers
    from materialist.edits.composite.revealed import _as_body

    scene = rendered_scene(native)
    body = block_mask(36, 48)
    shown = np.broadcast_to(np.float32([0.1, 0.3, 0.2]), scene.photo.linear.shape)
    photo = _as_body(scene.photo, body, shown)
    base = np.where(body[..., None], shown, scene.photo.linear)
    out = into_photo(photo, Layers(base, base, body, body, base))
    inside = np.kron(ndimage.binary_erosion(body), np.ones((native, native))) > 0
    outside = np.kron(~ndimage.binary_dilation(body, iterations=2), np.ones((native, native))) > 0
    np.testing.assert_allclose(out[inside], np.broadcast_to([0.1, 0.3, 0.2], out[inside].shape), rtol=1e-5)
    np.testing.assert_array_equal(out[outside], scene.photo.original[outside])


def test_glass_goes_on_under_the_rim_of_what_stands_before_it():
    from materialist.edits.composite.native_layer import NativeLayer
    from materialist.edits.composite.revealed import RIM, _under

    covered = np.zeros((20, 30), bool)
    covered[:, :12] = True
    inside = np.zeros(covered.shape, np.float32)
    inside[5:15, 10:25] = 1
    covered &= inside == 0
    shown = np.where(covered[..., None], 0.2, np.where(inside[..., None] > 0, 9, 0.7)).astype(np.float32)
    more, under = _under(NativeLayer(inside, inside, shown), covered, shown)
    assert more[6:14, 10:12].all() and not more[6:14, 10 + int(RIM) : 21].any()
    np.testing.assert_array_equal(under[more], np.full((more.sum(), 1), np.float32(0.2)))
    np.testing.assert_array_equal(under[~more], shown[~more])
    assert _under(None, covered, shown)[0] is covered


def test_what_is_revealed_has_glass_under_the_rim_of_what_stands_before_it():
    from types import SimpleNamespace

    from materialist.edits.composite.layers import Layers
    from materialist.edits.composite.native_layer import NativeLayer
    from materialist.edits.composite.revealed import revealed

    scene = rendered_scene()
    removed = without(scene, MASK)
    base = scene.photo.linear
    inside = np.zeros(MASK.shape, np.float32)
    inside[14:20, 20:30] = 1
    covered = MASK & (inside == 0)
    glass = np.where(covered[..., None], np.float32([0.1, 0.6, 0.2]), base).astype(np.float32)
    everywhere = np.ones(MASK.shape, bool)
    portrait = NativeLayer(inside, inside, np.zeros_like(base))
    layers = Layers(base, glass, everywhere, MASK, glass, native=portrait, covered=covered)
    studio = SimpleNamespace(scene=scene, emitter_pixels=lambda edited: ~everywhere)
    photo, found = revealed(studio, removed, layers, spp=1)
    for picture in (found.base, found.edited, photo.linear):
        np.testing.assert_allclose(picture[16, 20:22], np.full((2, 3), [0.1, 0.6, 0.2]), atol=1e-5)


def test_shade_goes_on_under_the_rim_of_a_body_where_a_replaced_surface_ends():
    """The last pixel of what was replaced lies under the foot of a body, and has none of its kind beside it."""
    from materialist.edits.composite.composite import into_photo
    from materialist.edits.composite.layers import Layers
    from materialist.edits.composite.native_layer import NativeLayer

    photo = rendered_scene(4).photo
    shape = photo.linear.shape[:2]
    grey = replace(photo, linear=np.full_like(photo.linear, 0.6), original=np.full_like(photo.original, 0.6))
    changed, inside, everywhere = np.zeros(shape, bool), np.zeros(shape, np.float32), np.ones(shape, bool)
    changed[:21] = True
    inside[10:20, 14:34] = 1
    inside[20, 14:34] = 0.25
    changed[20, :14] = changed[20, 34:] = False
    share = np.kron(inside >= 1, np.ones((4, 4))).astype(np.float32)
    base = np.full_like(grey.linear, 0.6)
    edited = np.where(inside[..., None] > 0, 5, 0.3).astype(np.float32)  # all in shade, but for the body
    layers = Layers(base, edited, everywhere, changed, edited, native=NativeLayer(inside, share, 0 * grey.original))
    out = into_photo(grey, layers)
    np.testing.assert_allclose(out[80:84, 64:128], 0.3, atol=0.02)


def test_what_was_removed_leaves_no_ghost_of_its_pattern():
    """The composite of a patterned block that goes is the filled photo."""
    scene = rendered_scene()
    mask = block_mask(36, 48)
    pattern = np.where((np.indices(mask.shape).sum(0) % 6 < 3)[..., None], 0.05, 0.9).astype(np.float32)
    albedo = np.where(mask[..., None], pattern, scene.materials.albedo).astype(np.float32)
    linear = np.where(mask[..., None], 0.6 * pattern, scene.photo.linear).astype(np.float32)
    scene = replace(
        scene, materials=replace(scene.materials, albedo=albedo),
        photo=replace(scene.photo, linear=linear, original=linear),
    )  # fmt: skip
    gone = without(scene, mask, shadow=0)
    out = composite(scene, gone, spp=32)
    inner = ndimage.binary_erosion(mask, iterations=2)
    np.testing.assert_allclose(out[inner], gone.photo.original[inner], atol=0.03)
