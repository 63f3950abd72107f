"""Objects taken away: maps, depth and photo continue, and the composite shows it."""

from dataclasses import replace

import numpy as np
import pytest
from edit_scenes import block_mask, flat_scene, rendered_scene, tetrahedron
from scipy import ndimage

from materialist.edits.composite.composite import composite
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
    from materialist.geometry.completion import continued_walls
    from materialist.geometry.planes import find_planes

    scene = flat_scene()
    (wall, *_) = continued_walls(find_planes(scene.depth, scene.normal, scene.camera), scene.depth, scene.camera)
    ends = replace(wall.usual, up=wall.seen.up + 4.0)
    completed = build_geometry(scene.depth, scene.normal, scene.camera, extents=[ends])
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


def test_shade_goes_on_under_the_rim_of_a_body_where_a_replaced_surface_ends():
    """The last pixel of what was replaced lies under the foot of a body, and has none of its kind beside it."""
    from materialist.edits.composite.into_photo import into_photo
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
    layers = Layers(base, edited, everywhere, changed, native=NativeLayer(inside, share, 0 * grey.original))
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
