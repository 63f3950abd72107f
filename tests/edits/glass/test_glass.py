"""Glass: what must come out whatever the object looks like, and what cannot be used."""

from dataclasses import replace

import numpy as np
import pytest
from edit_scenes import INNER, MASK, balls, flat_scene, rendered_scene

from materialist.edits.composite.composite import composite
from materialist.edits.glass.glass import LID, NARROW, NO_ROOM, SOLID, glass
from materialist.edits.glass.glass_preview import GlassPreview
from materialist.edits.glass.thickness import object_thickness, thick_parts
from materialist.errors import InputError
from materialist.solids.parts import objects_in
from materialist.solids.revolution import Revolution

pytestmark = pytest.mark.usefixtures("filled_smoothly")

PAPER = {"model": "two-interface", "thickness": "symmetry"}


def test_glass_is_a_body_before_the_continued_wall():
    scene = flat_scene()
    edited = glass(scene, MASK, ior=1.33, tint=(0.9, 1, 0.8), thickness="symmetry")
    (body,) = edited.bodies
    assert (body.surface.ior, body.surface.transmission, body.surface.tint) == (
        1.33,
        1.0,
        (0.9, 1.0, 0.8),
    )
    np.testing.assert_allclose(edited.depth[MASK], 3, rtol=1e-3)
    depth = -body.vertices[:, 2]
    assert depth.min() > 1.9 and depth.max() < 3
    what = edited.provenance["edits"][-1]
    assert what["kind"] == "glass" and what["thickness"] == "symmetry"
    assert not scene.bodies and "edits" not in scene.provenance


def test_under_even_light_clear_glass_is_as_bright_as_the_wall_and_tint_colours_it():
    scene = rendered_scene()
    white = np.ones_like(scene.materials.albedo)
    materials = replace(scene.materials, albedo=0.8 * white)
    even = replace(scene, envmap=np.ones_like(scene.envmap), materials=materials)
    clear = glass(even, MASK, ior=1.5, thickness="symmetry")
    red = glass(even, MASK, ior=1.5, tint=(1, 0.25, 0.25), thickness="symmetry")
    seen, tinted = (
        composite(even, edited, spp=64, denoise=False, full_render=True) for edited in (clear, red)
    )
    # The wall is 0.8 of a light of 1, and so is what comes by way of any number of refractions and reflections.
    assert 0.7 < seen[INNER].mean() < 1.02
    ratio = (tinted / seen)[INNER].mean(0)
    assert ratio[1] < 0.5 and ratio[0] > 0.9, ratio


def test_hollow_glass_has_a_cavity_and_the_papers_model_no_body():
    scene = flat_scene()
    solid, hollow = (glass(scene, MASK, hollow=h, thickness="symmetry") for h in (False, True))
    assert len(hollow.bodies[0].faces) > 1.2 * len(solid.bodies[0].faces)
    paper = glass(scene, MASK, **PAPER)
    assert not paper.bodies and (paper.photo.linear[MASK] != scene.photo.linear[MASK]).any()
    outside = np.s_[:8]
    np.testing.assert_array_equal(paper.photo.original[outside], scene.photo.original[outside])
    with pytest.raises(InputError, match="picture in the photo"):
        composite(scene, paper, full_render=True)


def test_thickness_is_given_mirrored_or_predicted():
    scene = flat_scene()
    given = object_thickness(scene, MASK, np.full(MASK.shape, 0.5, np.float32))
    assert (
        given.method == "given"
        and (given.solid[MASK] == 0.5).all()
        and (given.solid[~MASK] == 0).all()
    )
    assert object_thickness(scene, MASK, "symmetry").method == "symmetry"
    assert object_thickness(scene, MASK, "network").method == "network"
    assert object_thickness(scene, MASK).method == "outline"
    forced = object_thickness(scene, MASK, "outline")
    assert forced.method == "outline" and forced.front is not None
    for wrong, message in (
        (np.ones((3, 3)), "thickness map is"),
        (-np.ones(MASK.shape), "negative"),
        (np.zeros(MASK.shape), "0 all over"),
        ("guess", "give a file, or one of"),
    ):
        with pytest.raises(InputError, match=message):
            object_thickness(scene, MASK, wrong)


def test_masks_at_the_frame_in_parts_and_over_everything():
    scene = flat_scene(sky=6)
    mask = np.zeros((36, 48), bool)
    mask[3:20, :15] = True  # partly sky, cut by the frame
    mask[24:34, 30:44] = True
    mask[27:31, 34:40] = False
    mask[22, 40:46] = True  # too thin for a body
    (body,) = glass(scene, mask, thickness="symmetry").bodies
    assert np.isfinite(body.vertices).all() and len(body.faces)
    for bad, message in (
        (np.ones((36, 48), bool), "nothing tells"),
        (np.zeros((36, 48), bool), "empty"),
        (np.arange(36)[:, None] + 0 * np.arange(48) < 6, "only sky"),
        (0.4 * mask, "above one half"),
    ):
        with pytest.raises(InputError, match=message):
            glass(scene, bad)


def test_what_a_vessel_cannot_be_is_said():
    scene = flat_scene()
    closed, told = (glass(scene, MASK, hollow=h, thickness="symmetry") for h in (True, "open"))
    np.testing.assert_array_equal(closed.bodies[0].vertices, told.bodies[0].vertices)
    assert LID in told.report.warnings and not {LID, NO_ROOM} & set(closed.report.warnings)
    assert told.provenance["edits"][-1]["hollow"] == "open"
    assert SOLID in glass(scene, MASK, hollow=True, **PAPER).report.warnings
    for hollow in (True, "open"):
        thin = glass(scene, MASK, hollow=hollow, thickness=np.full(MASK.shape, 0.01, np.float32))
        assert NO_ROOM in thin.report.warnings and LID not in thin.report.warnings


def test_two_objects_are_as_thick_together_as_alone():
    scene, number = balls(((-0.7, -0.2, -3), 0.4), ((0.75, -0.3, -3.6), 0.3))
    parts = objects_in(number >= 0)
    assert [part.sum() for part in parts] == [(number == 0).sum(), (number == 1).sum()]
    edited = glass(scene, number >= 0)
    assert edited.provenance["edits"][-1]["thickness"] == "revolution"
    vertices = edited.bodies[0].vertices
    for centre, radius in (((-0.7, -0.2, -3), 0.4), ((0.75, -0.3, -3.6), 0.3)):
        own = vertices[np.abs(vertices[:, 0] - centre[0]) < 0.6]
        away = np.linalg.norm(own - centre, axis=1)
        assert np.abs(away / radius - 1).max() < 0.05, "each is its own ball"


def test_a_ball_with_a_handle_is_a_ball_and_a_handle():
    scene, number = balls(((-0.5, -0.2, -3), 0.4))
    rows, columns = np.indices(number.shape)
    ball = number == 0
    middle = int(np.median(np.nonzero(ball)[0]))
    right = np.flatnonzero(ball[middle])[-1]
    away = np.hypot(rows - middle, columns - right)
    ring = (away > 4) & (away < 7.5) & (columns >= right - 2)
    near = np.where(ring & ~ball, np.float32(3), scene.depth)
    scene = replace(scene, depth=near)
    body, handle = thick_parts(scene, ball | ring)
    assert body.thickness.method == "revolution" and not body.is_handle
    assert handle.is_handle and (handle.mask & ball).sum() < 0.2 * handle.mask.sum()
    edited = glass(scene, ball | ring, hollow=True)
    assert edited.provenance["edits"][-1]["thickness"] == "revolution, outline"
    assert NO_ROOM not in edited.report.warnings, "a handle is solid without a note"
    # By another method it is one object.
    assert len(thick_parts(scene, ball | ring, "symmetry")) == 1


def test_a_round_body_without_room_for_an_opening_says_so(monkeypatch):
    scene, number = balls(((-0.7, -0.2, -3), 0.4))
    monkeypatch.setattr(Revolution, "vessel", lambda *_: None)
    warnings = glass(scene, number == 0, hollow="open").report.warnings
    assert NARROW in warnings and LID not in warnings


def test_the_papers_glass_without_transmission_is_the_photo():
    scene = rendered_scene()
    shown = {t: glass(scene, MASK, transmission=t, **PAPER).photo.linear for t in (0.0, 0.5, 1.0)}
    np.testing.assert_allclose(shown[0.0][MASK], scene.photo.linear[MASK], atol=1e-6)
    np.testing.assert_allclose(shown[0.5][MASK], (shown[0.0] + shown[1.0])[MASK] / 2, atol=1e-6)


def test_the_papers_glass_is_the_same_before_and_after_another_light():
    """Its picture is in the light of the photo, which the light of the scene is not any more."""
    scene = rendered_scene()
    dimmed = replace(scene, envmap=np.roll(0.2 * scene.envmap, 4, 1))
    one = glass(scene, MASK, **PAPER)
    other = glass(dimmed, MASK, fitted=scene, **PAPER)
    np.testing.assert_allclose(other.photo.linear, one.photo.linear, atol=1e-6)


def test_the_papers_back_is_the_front():
    same, found = (glass(rendered_scene(), MASK, **PAPER, back=back) for back in ("same", "found"))
    assert (same.photo.linear != found.photo.linear).any()
    assert (
        same.provenance["edits"][-1]["back"] == "same"
        and found.provenance["edits"][-1]["back"] == "found"
    )


@pytest.mark.parametrize("place", [(35, 47), np.s_[15, 12:24]])
def test_thin_masks_give_no_warnings_of_numpy(place, recwarn):
    mask = np.zeros(MASK.shape, bool)
    mask[place] = True
    glass(flat_scene(), mask, model="two-interface")
    assert not [w for w in recwarn if issubclass(w.category, RuntimeWarning)]


@pytest.fixture
def preview():
    return GlassPreview(rendered_scene(), MASK, thickness="symmetry")


def test_inside_a_preview_is_the_final_picture_and_outside_the_photo(preview):
    scene = preview.scene
    quick = preview.picture(ior=1.3, tint=(1, 0.5, 0.5), spp=64)
    final = composite(
        scene, glass(scene, MASK, ior=1.3, tint=(1, 0.5, 0.5), thickness="symmetry"), spp=128
    )
    inner = np.zeros_like(MASK)
    inner[14:22, 14:24] = MASK[14:22, 14:24]
    assert np.abs(quick - final)[inner].mean() < 0.1 * final[inner].mean()
    np.testing.assert_array_equal(quick[:6], scene.photo.linear[:6])
    assert quick.dtype == np.float32 and (quick >= 0).all()


def test_the_glass_of_a_preview_is_exchanged_and_comes_back(preview):
    clear = preview.picture(spp=16)
    red = preview.picture(tint=(1, 0.2, 0.2), spp=16)
    frosted = preview.picture(roughness=0.5, spp=16)
    coated = preview.picture(transmission=0.5, spp=16)
    ratio = (red[MASK].mean(0) + 0.01) / (clear[MASK].mean(0) + 0.01)
    assert ratio[1] < 0.75 and ratio[0] > 0.9
    for other in (frosted, coated):
        assert np.abs(other - clear)[MASK].max() > 0.01
    np.testing.assert_array_equal(preview.picture(spp=16), clear)
