"""Bodies beside the depth surface, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from render_scenes import empty, wall

from materialist.geometry.silhouette import grown
from materialist.render.bodies import is_transparent
from materialist.render.pixels import coverage, first_hits, radiance
from materialist.render.scene import GLASS_DEPTH, RenderScene
from materialist.types import Body, Camera, Surface
from materialist_lab.procedural.objects import shapes

CAMERA = Camera(48, 32, 40.0)
DISTANCE = 5.0
RADIUS = 1.0


def sphere(surface: Surface) -> Body:
    """A sphere on the camera's axis."""
    solid = shapes.moved(shapes.ball(192), (0, 0, -DISTANCE), scale=RADIUS)
    vertices, normals, uv = (
        a.astype(np.float32) for a in (solid.vertices, solid.normals, solid.uv)
    )
    return Body(vertices, solid.faces.astype(np.int32), normals, uv, surface)


def surface(albedo=0.5, roughness=0.0, metallic=0.0, **glass) -> Surface:
    one = np.ones((1, 1), np.float32)
    return Surface(np.full((1, 1, 3), albedo, np.float32), roughness * one, metallic * one, **glass)


def picture(body: Body, envmap, spp: int = 16) -> np.ndarray:
    target = RenderScene(empty(CAMERA), CAMERA, bodies=(body,))
    target.set_envmap(envmap)
    depth = GLASS_DEPTH if is_transparent(body.surface) else 4
    return target.render(spp=spp, seed=1, max_depth=depth)


def disc() -> np.ndarray:
    """[H, W] bool: pixels well inside the outline of the sphere, which subtends asin(R / d)."""
    rows, columns = np.mgrid[: CAMERA.height, : CAMERA.width]
    radius = np.hypot(columns + 0.5 - CAMERA.width / 2, rows + 0.5 - CAMERA.height / 2)
    return radius < outline() - 1.5


def outline() -> float:
    """Radius of the sphere's outline, pixels."""
    return CAMERA.focal * RADIUS / np.sqrt(DISTANCE**2 - RADIUS**2)


def uniform() -> np.ndarray:
    return np.ones((8, 16, 3), np.float32)


def test_clear_glass_in_uniform_light_is_invisible():
    seen = picture(sphere(surface(transmission=1.0)), uniform(), spp=64)
    assert seen.mean() == pytest.approx(1, abs=2e-4)  # a few paths are caught in the facets
    assert np.abs(seen - 1).max() < 0.1


@pytest.mark.parametrize(
    "ior, roughness", [(1.5, 0.2), (1.5, 0.5), (1.5, 1.0), (1.0, 0.7), (2.0, 0.7)]
)
def test_rough_glass_in_uniform_light_is_invisible(ior, roughness):
    """Without the gain 0.81 at 0.5, and 0.32 at 1."""
    seen = picture(
        sphere(surface(roughness=roughness, transmission=1.0, ior=ior)), uniform(), spp=128
    )
    assert seen[disc()].mean() == pytest.approx(1, abs=0.015)


def test_tint_colours_what_passes_through_once():
    glass = surface(transmission=1.0, ior=1.0, tint=(0.25, 0.5, 1.0))
    inside = picture(sphere(glass), uniform())[disc()]
    np.testing.assert_allclose(inside.mean(0), [0.25, 0.5, 1.0], rtol=0.01)


def test_transmission_mixes_the_opaque_body_and_the_glass():
    mixed = surface(albedo=0.6, transmission=0.3, ior=1.0)
    opaque, half = (
        picture(sphere(s), uniform(), spp=256)[disc()].mean() for s in (surface(0.6), mixed)
    )
    assert half == pytest.approx(0.7 * opaque + 0.3, rel=0.01)


def test_the_share_of_a_pixel_covered_by_a_body():
    body = sphere(surface())
    target = RenderScene(empty(CAMERA), CAMERA, bodies=(body,))
    for scale in (1, 4):
        size = (scale * CAMERA.height, scale * CAMERA.width)
        share = coverage(target.mi_scene, CAMERA, ["body0"], size).share
        assert share.shape == size and ((share > 0) & (share < 1)).any()
        assert share.sum() == pytest.approx(np.pi * (scale * outline()) ** 2, rel=0.02)
    assert not coverage(target.mi_scene, CAMERA, ["body1"], size).share.any()


def test_coverage_is_that_of_the_first_hits():
    body = sphere(surface())
    scene = RenderScene(empty(CAMERA), CAMERA, bodies=(body,)).mi_scene
    hits = first_hits(scene, CAMERA, {"body0": body}, (64, 96))
    seen = coverage(scene, CAMERA, ["body0"], (64, 96))
    np.testing.assert_array_equal(seen.share, hits.share)
    np.testing.assert_allclose(seen.depth, hits.depth, rtol=1e-5)


@pytest.mark.parametrize(
    "at", [(1.9, 0.4, -5.0), (0.0, 0.0, -1.0), (0.0, 0.0, 3.0), (30.0, 0.0, -5.0)]
)
def test_looking_around_bodies_alone_sees_what_looking_everywhere_does(at, monkeypatch):
    """Beyond the frame, around the camera, behind it, and out of view."""
    body = sphere(surface())
    body = replace(
        body, vertices=body.vertices + np.array(at, np.float32) + (0, 0, np.float32(DISTANCE))
    )
    scene = RenderScene(empty(CAMERA), CAMERA, bodies=(body,)).mi_scene
    box = (slice(3, 60), slice(10, 96))
    seen = first_hits(scene, CAMERA, {"body0": body}, (64, 96), box)
    monkeypatch.setattr("materialist.render.pixels._around", lambda *given: given[-1])
    for found, slow in zip(
        vars(seen).values(),
        vars(first_hits(scene, CAMERA, {"body0": body}, (64, 96), box)).values(),
    ):
        np.testing.assert_array_equal(found, slow)
    assert seen.share.any() == (at[0] < 2 and at[2] < 0)


def test_radiance_is_that_of_the_rays_that_meet_the_body_first():
    columns = np.indices((CAMERA.height, CAMERA.width))[1]
    geometry = wall(
        CAMERA, 2.0, holes=columns >= CAMERA.width // 2
    )  # hides the left half of the sphere
    target = RenderScene(geometry, CAMERA, bodies=(sphere(surface(0.5, 1.0)),))
    target.set_envmap(uniform())
    seen = radiance(
        target, columns.shape, np.s_[:, :], spp=64, seed=1, max_depth=3, names=["body0"]
    )
    left = disc() & (columns < CAMERA.width // 2 - 1)
    right = disc() & (columns > CAMERA.width // 2)
    assert (seen[left] == 0).all() and seen[right].min() > 0.1


def test_unseen_bodies_have_no_part_in_a_pixel_but_their_shadow():
    target = RenderScene(wall(CAMERA, 2 * DISTANCE), CAMERA, bodies=(sphere(surface(0.0, 1.0)),))
    target.set_envmap(uniform())
    plain = target.render(spp=64, seed=1)
    without = target.render(spp=64, seed=1, unseen=("body0",))
    share = coverage(target.mi_scene, CAMERA, ("body0",), plain.shape[:2]).share
    # All of a pixel beside it, the wall's part of one at its rim, nothing of one that it fills.
    away = ~grown(share > 0, 1)
    np.testing.assert_array_equal(without[away], plain[away])
    assert (without[disc()] == 0).all()
    rim = (share > 0.3) & (share < 0.7)
    beside = without[away].mean()
    np.testing.assert_allclose(without[rim].mean(), beside, rtol=0.1)
    assert plain[rim].mean() < 0.8 * beside
    # The ball takes light from the wall behind it: (R / d)^2 of a point on the axis.
    bare = RenderScene(wall(CAMERA, 2 * DISTANCE), CAMERA)
    bare.set_envmap(uniform())
    assert without[rim].mean() < 0.99 * bare.render(spp=64, seed=1)[rim].mean()
