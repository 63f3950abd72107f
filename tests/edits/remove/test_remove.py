"""Objects taken away: maps, depth and photo continue, and the composite shows it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edit_scenes import MASK, flat_scene, rendered_scene, tetrahedron

from materialist.edits.composite.composite import composite
from materialist.edits.core.region import body_coverage
from materialist.edits.remove.filling import remembered
from materialist.edits.remove.hole import make_hole
from materialist.edits.remove.remove import remove
from materialist.errors import InputError
from materialist.geometry.build import build_geometry
from materialist.pipeline import render_scene

pytestmark = pytest.mark.usefixtures("filled_once")


@pytest.fixture(scope="module")
def filled_once(tmp_path_factory):
    """Equal holes are filled once: the network takes seconds."""
    with remembered(tmp_path_factory.mktemp("filled")):
        yield


def far_from(mask, pixels):
    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * pixels + 1,) * 2, np.uint8)) == 0


def without_the_block(scene):
    """[H, W, 3] the true picture of the flat scene's wall alone."""
    wall = np.full_like(scene.depth, 3.0)
    bare = replace(
        scene,
        depth=wall,
        geometry=build_geometry(wall, scene.normal, scene.camera, completion="none"),
    )
    return np.clip(render_scene(bare, spp=256, seed=11), 0, 1)


def test_the_wall_goes_on_behind_the_block(one_answer):
    scene = flat_scene(native=3)  # whose hole another test fills, too
    removed = remove(scene, MASK)
    np.testing.assert_allclose(removed.depth[MASK], 3.0, rtol=1e-3)
    wall = scene.materials.albedo[far_from(MASK, 2)]
    assert np.abs(removed.materials.albedo[MASK].mean(0) - wall.mean(0)).max() < 0.03
    assert np.abs(removed.photo.linear[MASK].mean(0) - wall.mean(0)).max() < 0.05
    outside = far_from(MASK, 2)
    for old, new in (
        (scene.depth, removed.depth),
        (scene.materials.albedo, removed.materials.albedo),
        (scene.photo.linear, removed.photo.linear),
    ):
        np.testing.assert_array_equal(new[outside], old[outside])
    native = np.kron(outside, np.ones((3, 3), bool))
    np.testing.assert_array_equal(removed.photo.original[native], scene.photo.original[native])
    assert removed.geometry.mesh.vertices[:, 2].max() < -2.9, (
        "the block's surface is gone from the mesh"
    )
    assert removed.provenance["edits"][-1]["kind"] == "remove"


def test_the_native_photo_is_filled_with_native_detail():
    scene = flat_scene(native=3)
    removed = remove(scene, MASK)
    native = np.kron(MASK, np.ones((3, 3), bool))
    filled = removed.photo.original[native]
    wall = scene.photo.original[np.kron(far_from(MASK, 3), np.ones((3, 3)) > 0)]
    assert np.abs(filled.mean(0) - wall.mean(0)).max() < 0.05
    fine = removed.photo.original - np.kron(removed.photo.linear, np.ones((3, 3, 1)))
    assert fine[native].std() > 0.3 * fine[~native].std()


def test_the_composite_shows_the_wall_and_keeps_the_rest(filled_smoothly):
    scene = rendered_scene()
    removed = remove(scene, MASK)
    picture = composite(scene, removed, spp=48, denoise=False)
    wall = scene.photo.linear[far_from(MASK, 4)].mean(0)
    assert np.abs(picture[MASK].mean(0) / wall - 1).max() < 0.08
    change = np.abs(without_the_block(scene) - render_scene(scene, spp=256, seed=11)).max(-1)
    still = far_from(MASK, 8) & (change < 1 / 255)
    assert still.sum() > 150 and (picture == scene.photo.original)[still].mean() > 0.95


def test_its_shadow_on_the_wall_goes_with_it(filled_smoothly):
    scene = flat_scene()
    envmap = np.full((8, 16, 3), 0.2, np.float32)
    envmap[3, 1] = 20  # behind the camera, to the left: the shadow falls to the right of the block
    scene = replace(scene, envmap=envmap)
    before = np.clip(render_scene(scene, spp=256, seed=11), 0, 1)
    scene = replace(
        scene, photo=replace(scene.photo, linear=before, original=before), rerender=before
    )
    after = without_the_block(scene)
    shadow = far_from(MASK, 4) & ((after - before).max(-1) > 0.1 * after.max(-1))
    assert shadow.sum() > 20
    told = []
    picture = composite(
        scene, remove(scene, MASK), spp=64, progress=lambda *event: told.append(event)
    )
    assert told[0][:2] == ("shadow", 0) and told[-1][1] == told[-1][2]
    assert np.abs(picture - after)[shadow].mean() < 0.3 * np.abs(before - after)[shadow].mean()
    still = far_from(MASK, 4) & (np.abs(after - before).max(-1) < 0.005 * after.max(-1))
    assert np.abs(picture - before)[still].mean() < 0.004


def test_a_clipped_photo_stays_outside_the_hole(filled_smoothly):
    """The hole is filled with what was there, too."""
    scene = rendered_scene(native=2)
    lit = np.maximum(scene.photo.linear, np.where(MASK, 0, 1)[..., None]).astype(np.float32)
    lit[14:18, 14:20] = 1
    original = np.kron(lit, np.ones((2, 2, 1), np.float32))
    scene = replace(scene, photo=replace(scene.photo, linear=lit, original=original))
    removed = remove(scene, MASK, shadow=0)
    picture = composite(scene, removed, spp=8)
    far = np.kron(far_from(MASK, 3), np.ones((2, 2), bool))
    np.testing.assert_allclose(np.minimum(picture, 1)[far], scene.photo.original[far], atol=1 / 255)


def test_a_hole_that_little_is_known_of_is_told(filled_smoothly):
    scene = flat_scene()
    assert not remove(scene, MASK).report.warnings
    large = np.zeros((36, 48), bool)
    cut = np.zeros((36, 48), bool)
    large[6:30, 8:40] = True
    cut[30:, 10:20] = True
    for mask, words in ((large, "of the photo. What"), (cut, "of its outline lies on the frame")):
        (note,) = remove(scene, mask).report.warnings
        assert words in note and "give it as the background" in note
    assert not remove(scene, large, background=scene.photo.linear).report.warnings


def test_what_was_put_before_it_stays_whole(filled_smoothly):
    """A mask that lies on a thing before the object takes nothing of the thing away, nor copies it."""
    scene = rendered_scene()
    red = replace(scene, bodies=(tetrahedron(),))
    picture = composite(scene, red, spp=16)
    saved = replace(
        red, photo=replace(scene.photo, linear=picture, original=picture), rerender=picture
    )
    here = body_coverage(saved) > 0
    mask = MASK.copy()
    mask |= here & (np.arange(48) < np.median(np.nonzero(here)[1]))
    assert (here & mask).sum() > 10
    gone = remove(saved, mask, shadow=0).photo.original
    np.testing.assert_array_equal(gone[here], picture[here])

    def red_there(seen):
        return seen[..., 0] > 2 * seen[..., 1]

    assert not (red_there(gone) & ~here).any(), "nor is it copied"


def test_masks_cut_by_the_frame_with_holes_parts_and_sky(filled_smoothly):
    scene = flat_scene(sky=12)
    mask = np.zeros((36, 48), bool)
    mask[8:30, :14] = True
    mask[16:22, 4:8] = False
    mask[30:34, 40:46] = True
    removed = remove(scene, mask)
    assert np.isfinite(removed.depth).all() and np.isfinite(removed.photo.original).all()
    assert (removed.depth[mask & (np.arange(36)[:, None] > 18)] > 1.99).all()
    only_sky_behind = replace(scene, depth=np.where(mask, scene.depth, 0))
    for nothing_left, covering in ((only_sky_behind, mask), (scene, np.ones((36, 48), bool))):
        with pytest.raises(InputError, match="covers 100% of the photo's surfaces"):
            remove(nothing_left, covering)


def on_floor():
    """The flat scene, its lower half a floor."""
    scene = flat_scene()
    floor = np.where(np.arange(36)[:, None] >= 20, 0, -1).astype(np.int8) * np.ones(
        (1, 48), np.int8
    )
    normal = np.where(floor[..., None] == 0, [0.0, 1, 0], scene.normal).astype(np.float32)
    return replace(scene, normal=normal, geometry=replace(scene.geometry, plane_label=floor))


def test_a_given_shadow_widens_the_hole_on_the_ground_alone():
    plain, wide = (
        make_hole(on_floor(), MASK, grow=0.006, shadow=shadow, bodies=np.zeros_like(MASK))
        for shadow in (0.0, 0.5)
    )
    np.testing.assert_array_equal(plain.painted, plain.gone)
    more = wide.painted & ~wide.gone
    assert more[20:].any() and not more[:20].any()
    np.testing.assert_array_equal(wide.gone, plain.gone)
    floor = on_floor()
    floor = replace(
        floor,
        depth=np.where(np.arange(36)[:, None] >= 12, floor.depth, 0),
        normal=0 * floor.normal + [0, 1, 0],
    )
    floor = replace(
        floor, geometry=replace(floor.geometry, plane_label=np.zeros((36, 48), np.int8))
    )
    with pytest.raises(InputError, match=r"shadow of 5, .* smaller shadow"):
        make_hole(floor, MASK, grow=0.006, shadow=5.0, bodies=np.zeros_like(MASK))
