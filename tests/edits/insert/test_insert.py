"""Where a mesh stands, how large it is, and what the photo looks like around it."""

from dataclasses import replace

import numpy as np
import pytest
from made_meshes import floor_scene
from scipy.spatial import ConvexHull

from materialist.camera import project
from materialist.edits.composite.composite import composite
from materialist.edits.composite.layers import render_layers
from materialist.edits.composite.native_layer import native_layer
from materialist.edits.core.renderer import EditRenderer, RenderOptions
from materialist.edits.insert.insert import insert, picture_width, put, support_at
from materialist.errors import InputError
from materialist.geometry.build import build_geometry

UP = np.array([0, np.cos(np.radians(30)), np.sin(np.radians(30))])


def test_a_box_stands_upright_on_the_floor_at_the_click(box):
    scene = floor_scene(96, 72)
    edited = insert(scene, box, (40.0, 50.0))
    (body,) = edited.bodies
    above = body.vertices.astype(np.float64) @ UP + 2
    longest = picture_width(scene, support_at(scene, (40.0, 50.0)).depth) / 6
    np.testing.assert_allclose([above.min(), above.max()], [0, longest], atol=2e-3 * longest)
    base = body.vertices[above < 0.1 * longest].astype(np.float64)
    place, _ = project((base.min(0) + base.max(0)) / 2, scene.camera)
    np.testing.assert_allclose(place, [40, 50], atol=0.3)
    assert edited.provenance["edits"][-1]["kind"] == "insert" and scene.bodies == ()
    assert edited.materials is scene.materials and edited.geometry is scene.geometry
    (glass,) = insert(scene, box, (40.0, 50.0), material="glass").bodies
    gap = (glass.vertices.astype(np.float64) - body.vertices) @ UP
    np.testing.assert_allclose(
        gap, 0.005 * longest, rtol=0.01
    )  # air, which keeps light in the glass


def test_scale_size_and_turn(box):
    scene = floor_scene(96, 72)
    (one,), support, _ = put(scene, box, (40.0, 50.0))
    (two,), *_ = put(scene, box, (40.0, 50.0), scale=2)
    (sized,), *_ = put(scene, box, (40.0, 50.0), size=0.5)

    def height(b):
        return np.ptp(b.vertices @ UP)

    np.testing.assert_allclose(height(two) / height(one), 2, rtol=1e-3)
    np.testing.assert_allclose(height(sized), 0.5, rtol=1e-3)
    (one,), support, _ = put(scene, box, (48.0, 50.0))
    (turned,), *_ = put(scene, box, (48.0, 50.0), turn=90)

    def wide(b):
        return np.ptp(b.vertices[:, 0])

    np.testing.assert_allclose(
        wide(turned) / wide(one), 0.5, rtol=0.01
    )  # the box is 1 wide and 0.5 deep
    front = one.normals[np.argmax(one.normals @ -support.point)]
    assert front @ UP < 0.01 and front @ -support.point > 0


def test_bad_places_and_numbers(box):
    scene = floor_scene(96, 72)
    scene = replace(scene, depth=np.where(np.arange(72)[:, None] < 10, 0, scene.depth))
    for place, options, sentence in [
        ((40, 3), {}, "sky"),
        ((400, 30), {}, "outside the photo"),
        ((40, -1), {}, "outside the photo"),
        ((40, 50), {"scale": 0.0}, "scale"),
        ((40, 50), {"scale": 100.0}, "behind the camera"),
        ((40, 50), {"turn": np.nan}, "turn"),
        ((40, 50), {"size": -1.0}, "size"),
        ("here", {}, "must be 2 numbers"),
    ]:
        with pytest.raises(InputError, match=sentence):
            insert(scene, box, place, **options)


def whole(layer, values, size):
    """What a native layer has in its box, in the whole picture."""
    out = np.zeros((*size, *values.shape[2:]), np.float32)
    out[layer.box] = values
    return out


@pytest.mark.parametrize("native", [pytest.param(1, marks=pytest.mark.slow), 4])
def test_the_photo_is_kept_where_no_path_meets_the_body(box, native):
    scene = floor_scene(native=native)
    edited = insert(scene, box, (24.0, 26.0), material="0.1,0.1,0.6")
    out = composite(scene, edited, spp=8)
    assert out.shape == (36 * native, 48 * native, 3)
    body = native_layer(EditRenderer(scene), edited, RenderOptions(8, denoise=False))
    share = whole(body, body.share, out.shape[:2])
    alone = share > 0.999
    assert alone.any()
    blue = out[alone]
    assert (blue[:, 2] > 1.5 * blue[:, 0]).mean() > 0.95
    np.testing.assert_array_equal(
        out[: 5 * native], scene.photo.original[: 5 * native]
    )  # far up the floor
    before = np.s_[
        26 * native : 28 * native, 20 * native : 28 * native
    ]  # the floor around its base
    shadow = out[before].mean(-1)[share[before] == 0]
    assert shadow.size and shadow.mean() < 0.495


@pytest.mark.parametrize("bump", [0, 0.002])
def test_the_matte_is_the_bodys_outline_at_native_size(box, bump):
    """The ground that it stands on does not cut its foot."""
    scene = floor_scene(native=4)
    bodies = insert(scene, box, (24.0, 25.5)).bodies
    depth = scene.depth * (1 - bump * np.exp(-(((np.arange(36) - 27) / 4) ** 2)))[:, None].astype(
        np.float32
    )
    geometry = build_geometry(depth, scene.normal, scene.camera, completion="none")
    scene = replace(scene, depth=depth, geometry=geometry)
    edited = replace(scene, bodies=bodies)
    share = native_layer(EditRenderer(scene), edited, RenderOptions(2, denoise=False)).share
    place, _ = project(edited.bodies[0].vertices.astype(np.float64), scene.camera)
    area = ConvexHull(place * 4).volume  # native pixels; a box is convex
    np.testing.assert_allclose(share.sum(), area, rtol=0.02)
    soft = (share > 0) & (share < 1)
    assert soft.sum() < 2.2 * ConvexHull(place * 4).area  # one native pixel wide


def test_what_was_rendered_before_changes_nothing(box):
    scene = floor_scene(64, 48)
    first = insert(scene, box, (20.0, 30.0))
    edited = insert(scene, box, (36.0, 30.0))
    options = RenderOptions(16, denoise=False)
    fresh = render_layers(EditRenderer(scene), edited, options)
    used = EditRenderer(scene)
    render_layers(used, first, options)
    again = render_layers(used, edited, options)
    np.testing.assert_array_equal(again.reached, fresh.reached)
    np.testing.assert_array_equal(again.edited - again.base, fresh.edited - fresh.base)


@pytest.mark.parametrize("grey", [0.05, pytest.param(0.9, marks=pytest.mark.slow)])
def test_the_shadow_goes_on_to_the_foot(box, grey):
    """What a body leaves of its rim's pixels is the ground in its shadow: neither the body nor the ground beside."""
    scene = floor_scene(96, 72)
    edited = insert(scene, box, (48.0, 50.0), material=f"{grey},{grey},{grey}")
    renderer = EditRenderer(scene)
    body = native_layer(renderer, edited, RenderOptions(64, denoise=False))
    share = whole(body, body.share, scene.depth.shape)
    rows, columns = np.nonzero(share > 0)
    foot = np.zeros(share.shape, bool)
    foot[rows.max() : rows.max() + 2, columns.min() : columns.max() + 1] = True
    # Under the body its surroundings go on.
    layers = render_layers(renderer, edited, RenderOptions(64, denoise=False))
    assert layers.edited[body.inside == 1].min() > 0.05
    out = composite(scene, edited, spp=64, denoise=False)
    base, plain = (picture(64, 3) for picture in renderer.pair(edited))
    expected = scene.photo.original * plain / base
    np.testing.assert_allclose(out[foot].mean(), expected[foot].mean(), rtol=0.03)


def test_a_body_looks_as_in_the_plain_rendering(box):
    """Its radiance at native size is that of the scene's own light and surfaces."""
    scene = floor_scene()
    red = np.broadcast_to(np.float32([2.0, 0.4, 0.1]), (8, 16, 3)).copy()
    scene = replace(scene, envmap=red)
    edited = insert(scene, box, (24.0, 26.0), material="0.5,0.5,0.5")
    studio = EditRenderer(scene)
    body = native_layer(
        studio, edited, RenderOptions(64, denoise=False)
    )  # before anything else is rendered
    plain = studio.pair(edited)[1](256, 3)
    inside = whole(body, body.share, plain.shape[:2]) > 0.999
    shown = whole(body, body.picture, plain.shape[:2])
    np.testing.assert_allclose(shown[inside].mean(0), plain[inside].mean(0), rtol=0.05)
