"""Previews from cached transport against the path tracer."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest
from edit_scenes import MASK, balls, rendered_scene

from materialist.camera import unit
from materialist.edits.core.renderer import EditRenderer
from materialist.edits.light.relight import relight
from materialist.edits.material.material import edit
from materialist.edits.preview import Preview
from materialist.geometry.build import with_normals
from materialist.metrics import psnr


def prepared(*given):
    """A preview whose rays are all traced."""
    made = Preview(*given)
    while made.prepare():
        pass
    return made


@pytest.fixture(scope="module")
def preview():
    return prepared(rendered_scene())


def traced(edited):
    return EditRenderer(edited).pair(edited)[0](192, 7)


def test_material_change_agrees_with_the_path_tracer(preview):
    edited = edit(preview.scene, MASK, roughness=0.2, albedo=(0.1, 0.4, 0.2), metallic=0.5)
    assert psnr(preview.render(edited), traced(edited)) > 30


def test_the_first_picture_is_coarse_and_near(preview):
    edited = edit(preview.scene, MASK, roughness=0.2, albedo=(0.1, 0.4, 0.2), metallic=0.5)
    first = Preview(preview.scene).render(edited)
    fine = preview.render(edited)
    assert psnr(first, fine) > 30 and (first != fine).any()


def test_surfaces_pass_on_what_the_photo_shows(preview):
    scene = preview.scene
    first = Preview(scene).render(scene)
    other = replace(scene, rerender=0 * scene.rerender)
    np.testing.assert_array_equal(Preview(other).render(other), first)
    brighter = replace(scene, photo=replace(scene.photo, linear=2 * scene.photo.linear))
    assert (Preview(brighter).render(brighter) > first).any()


def test_light_change_agrees_with_the_path_tracer(preview):
    light = np.full((8, 16, 3), 0.2, np.float32)
    light[:, 3:8] = [1.5, 1.0, 0.5]
    edited = relight(preview.scene, envmap=light)
    assert psnr(preview.render(edited), traced(edited)) > 30
    # And back again: the first light's tables are not mixed up with the second's.
    assert psnr(preview.render(preview.scene), traced(preview.scene)) > 30


def turned(scene):
    """Polished copper whose normals lean to one side."""
    normal = np.where(MASK[..., None], unit(scene.normal + np.array([0.5, 0.2, 0])), scene.normal)
    copper = edit(scene, MASK, metallic=1, roughness=0.15, albedo=(0.9, 0.6, 0.4), normals="maps")
    geometry = with_normals(scene.geometry, normal, MASK)
    return replace(copper, normal=normal.astype(np.float32), geometry=geometry)


@pytest.mark.parametrize("coarse", [False, True])
def test_new_normals_agree_with_the_path_tracer(preview, coarse):
    light = np.full((8, 16, 3), 0.2, np.float32)
    light[:, 3:8] = [1.5, 1.0, 0.5]
    copper = turned(preview.scene)
    straight = replace(copper, normal=preview.scene.normal, geometry=preview.scene.geometry)
    for edited, other in ((copper, straight), *[(relight(copper, envmap=light),) * 2]):
        truth = traced(edited)[MASK]
        score = psnr(preview.render(edited, coarse=coarse)[MASK], truth)
        assert score > 27
        if other is straight:
            assert psnr(preview.render(straight, coarse=coarse)[MASK], truth) < score - 6
    # Nothing of it stays behind.
    assert psnr(preview.render(preview.scene), traced(preview.scene)) > 30


def test_new_normals_of_one_pixel_are_shaded_under_a_coarse_light(preview):
    copper = turned(preview.scene)
    one = np.zeros_like(MASK)
    one[tuple(np.argwhere(MASK)[0])] = True
    normal = np.where(one[..., None], copper.normal, preview.scene.normal)
    geometry = with_normals(preview.scene.geometry, normal, one)
    edited = relight(replace(copper, normal=normal, geometry=geometry), sun=(60.0, 40.0))
    assert np.isfinite(preview.render(edited, coarse=True)).all()


def test_new_normals_see_what_their_own_light_lets_surfaces_pass_on():
    """After a glance at another light, too, as of a slider that is taken back."""
    scene, number = balls(((-0.3, -0.2, -3), 0.4))
    around = number < 0
    normal = np.where(around[..., None], unit(scene.normal + np.array([0.8, 0, 0])), scene.normal)
    geometry = with_normals(scene.geometry, normal, around)
    copper = edit(scene, around, metallic=1, roughness=0.15, normals="maps")
    copper = replace(copper, normal=normal.astype(np.float32), geometry=geometry)
    preview = prepared(scene)
    dim, bright = (
        relight(copper, envmap=np.full((8, 16, 3), value, np.float32)) for value in (0.2, 9)
    )
    picture = preview.render(dim)
    preview.render(bright, coarse=True)
    np.testing.assert_array_equal(preview.render(dim), picture)


def test_a_coarse_light_is_near_and_leaves_nothing_behind(preview):
    one, other = (
        relight(preview.scene, sun=(azimuth, 40.0), ambient=0.5) for azimuth in (60.0, -60.0)
    )
    full = preview.render(one)
    preview.render(other)
    rough = [preview.render(one, coarse=True) for _ in range(2)][-1]
    assert psnr(rough, full) > 28 and (rough != full).any()
    np.testing.assert_array_equal(preview.render(one), full)


def test_nothing_changed_is_the_photo(preview):
    same = edit(preview.scene, MASK, hue=0.0)
    np.testing.assert_array_equal(preview.picture(same), preview.scene.photo.linear)
    changed = preview.picture(edit(preview.scene, MASK, hue=120))
    far = np.s_[:8]
    np.testing.assert_array_equal(changed[far], preview.scene.photo.linear[far])
    assert (changed[MASK] != preview.scene.photo.linear[MASK]).any(-1).all()


def test_new_metal_hides_the_photos_texture(preview):
    edited = edit(preview.scene, MASK, metallic=1.0)
    seen = preview.scene.photo
    textured = copy(preview)
    rough = np.where(
        MASK[..., None], np.random.default_rng(0).uniform(0.8, 1.2, seen.linear.shape), 1
    )
    textured.scene = replace(
        preview.scene, photo=replace(seen, linear=(seen.linear * rough).astype(np.float32))
    )
    np.testing.assert_allclose(
        textured.picture(edited)[MASK], preview.picture(edited)[MASK], atol=1e-3
    )


def test_kept_tables_are_taken_and_damaged_ones_made_again(preview, tmp_path):
    scene = preview.scene
    file = tmp_path / "preview.npz"
    edited = edit(scene, MASK, hue=120)
    made = prepared(scene, file)
    whole = file.read_bytes()
    picture = made.picture(edited)

    def traced(one):
        return "_quick" in vars(one)

    again = Preview(scene, file)
    np.testing.assert_array_equal(again.picture(edited), picture)
    assert traced(made) and not traced(again)
    assert again.prepare()
    light = relight(scene, ambient=2.0)
    np.testing.assert_array_equal(again.render(light), made.render(light))
    for content in (b"", whole[: len(whole) // 2], whole[:5000] + bytes(100) + whole[5100:]):
        file.write_bytes(content)
        assert traced(prepared(scene, file)) and file.read_bytes() == whole
    assert traced(Preview(replace(scene, envmap=2 * scene.envmap), file))
