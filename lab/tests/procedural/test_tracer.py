"""The path tracer of the data set against Mitsuba's own, against closed forms, and against itself."""

from dataclasses import replace

import numpy as np
import pytest
from disney_reference import diffuse_coefficients, hemisphere, specular_split
from made_worlds import X, Y, Z, plain, reference, room, still

from materialist.camera import pixel_rays
from materialist.envmap import texel_directions
from materialist.types import Camera
from materialist_lab.procedural import packing, sample, tiles, tracer
from materialist_lab.procedural.materials import Material
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.options import DataSetOptions
from materialist_lab.procedural.world import ScenePart, World, look

SIZE = 32


def tracer_of(world, size=SIZE):
    packed = packing.pack(world, np.random.default_rng(0))
    return tracer.SampleTracer(packed, Camera(size, size, world.view.fov), device="cpu")


def traced(world, spp=400):
    return tracer_of(world).render(spp=spp, seed=1)


@pytest.mark.parametrize(
    ("world", "tolerance"),
    [
        (still(), 0.01),
        pytest.param(room(window=True, lamp=False), 0.03, marks=pytest.mark.slow),
        pytest.param(room(window=False, lamp=True, sky=0.0), 0.02, marks=pytest.mark.slow),
        (room(window=True, lamp=True), 0.02),
    ],
    ids=["sky", "window", "lamp", "window and lamp"],
)
def test_equals_mitsubas_integrator(world, tolerance):
    ours, _ = traced(world)
    theirs = reference(world, SIZE, 576, tracer.MAX_DEPTH + 1)

    # Means over blocks: single pixels are too noisy to compare.
    def blocks(a):
        return a.reshape(4, 8, 4, 8, 3).mean((1, 3))

    np.testing.assert_allclose(ours.mean((0, 1)), theirs.mean((0, 1)), rtol=tolerance)
    np.testing.assert_allclose(
        blocks(ours), blocks(theirs), rtol=8 * tolerance, atol=0.02 * theirs.mean()
    )


def test_a_rough_ground_under_an_even_sky_has_the_shading_of_the_closed_form():
    """Shading = (1/pi) * integral of F_d(wi) F_d(wo) cos over the hemisphere, by quadrature, times the radiance."""
    ground = ScenePart(s.sheet((-50, 0, 50), 100 * X, -100 * Z), plain((0.5, 0.5, 0.5), 0.8))
    world = World(
        [ground], np.full((16, 32, 3), 2.0, np.float32), look((0, 1, 1e-3), (0, 0, 0), 10)
    )
    image, shading = traced(world, spp=100)
    wi = hemisphere(200)
    up = np.array([0.0, 0.0, 1.0])
    # The diffuse lobe is a polynomial of the roughness: 1, 0.8, 0.8 squared.
    c = diffuse_coefficients(up, wi, np.broadcast_to(up, wi.shape)) @ np.array([1, 0.8, 0.64])
    expected = 2.0 * (c * wi[..., 2]).mean() * 2 * np.pi / np.pi
    np.testing.assert_allclose(shading.mean((0, 1)), expected, rtol=0.01)
    # The specular lobe for a reflectance at normal incidence of 0.04.
    s0, s1 = specular_split(0.8, up, wi, np.broadcast_to(up, wi.shape))
    specular = 2.0 * ((0.04 * s0 + s1) * wi[..., 2]).mean() * 2 * np.pi
    np.testing.assert_allclose(image.mean((0, 1)), 0.5 * expected + specular, rtol=0.01)


def test_the_image_is_albedo_times_shading_plus_what_does_not_depend_on_albedo():
    """Direct light alone, on two albedos with the same random numbers: the difference is (A1 - A2) * shading."""

    def ground(value):
        part = ScenePart(s.sheet((-50, 0, 50), 100 * X, -100 * Z), plain((value,) * 3, 0.5))
        return World([part], still().envmap, look((0, 1, 1), (0, 0, 0), 30))

    bright, shading = traced(ground(0.6), spp=900)
    dark, _ = traced(ground(0.2), spp=900)
    np.testing.assert_allclose((bright - dark).mean((0, 1)), 0.4 * shading.mean((0, 1)), rtol=0.02)


def test_labels_of_a_ground_seen_from_a_known_camera():
    """Depth and normal against the plane's equation, in the camera frame."""
    colour = (0.5, 0.3, 0.1)
    ground = ScenePart(s.sheet((-50, 0, 50), 100 * X, -100 * Z), plain(colour, 0.7))
    world = World([ground], np.ones((8, 16, 3), np.float32), look((0, 2, 0), (0, 0, -3), 40))
    labels = sample.labels_of(tracer_of(world).probe())
    up = world.view.to_scene.T @ np.array([0, 1, 0])
    assert labels["mask"].all()
    np.testing.assert_allclose(labels["normal"], np.broadcast_to(up, (SIZE, SIZE, 3)), atol=1e-5)
    # The camera is 2 m above the plane: t = -2 / (ray . up), and depth is t along -Z.
    rays = pixel_rays(Camera(SIZE, SIZE, 40))
    np.testing.assert_allclose(labels["depth"], -2.0 / (rays @ up), rtol=1e-4)
    np.testing.assert_allclose(
        labels["albedo"], np.broadcast_to(colour, (SIZE, SIZE, 3)), rtol=1e-5
    )
    np.testing.assert_allclose(labels["roughness"], 0.7, rtol=1e-5)
    # Normals face the viewer even from behind.
    behind = ScenePart(s.sheet((-1, -1, -2), 2 * Y, 2 * X), plain(colour))
    labels = sample.labels_of(
        tracer_of(replace(world, parts=[behind], view=look((0, 0, 0), (0, 0, -1), 40))).probe()
    )
    np.testing.assert_allclose(
        labels["normal"][labels["mask"]], np.tile([0, 0, 1], (SIZE * SIZE, 1)), atol=1e-5
    )


def test_a_second_world_compiles_nothing():
    import drjit as dr

    # Two scenes of other shapes, materials and lamps compile what there is to compile.
    traced(still(), spp=4)
    traced(room(window=True, lamp=True), spp=4)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        traced(room(window=True, lamp=False), spp=4)
        traced(replace(still(), view=look((1, 1, 2), (0, 0, 0), 60)), spp=4)
        history = dr.kernel_history()
    # The small kernels copy buffers; the two large ones trace.
    large = [k for k in history if k.get("operation_count", 0) > 500]
    assert len(large) == 2
    assert all(k["cache_hit"] for k in large)


def test_texture_is_not_printed_into_the_shading():
    """A chequered floor under an even sky: its light is even, too."""
    tile = tiles.bank()[1]["checker"][0]
    floor = Material(
        tile,
        ((0.1, 0.1, 0.1), (0.8, 0.8, 0.8), (0.9, 0.3, 0.1)),
        0.3,
        (0.6, 0.6),
        repeat=(0.3, 0.3),
    )
    ground = ScenePart(s.sheet((-9, 0, 9), 18 * X, -18 * Z), floor)
    world = World([ground], np.ones((16, 32, 3), np.float32), look((0, 2, 1e-3), (0, 0, 0), 50))
    seen = tracer_of(world, 64)
    probe = seen.probe()
    # Denoised, where texture could leak in.
    arrays = sample._developed(
        world, probe, seen, np.random.default_rng(0), DataSetOptions(size=64, device="cpu")
    )
    texture = probe["albedo"].mean((2, 3))
    shading = arrays["shading"].astype(np.float32).mean(-1)
    assert texture.std() > 0.4 * texture.mean(), "the floor has a texture to print"
    assert abs(np.corrcoef(texture.ravel(), shading.ravel())[0, 1]) < 0.15
    assert shading.std() < 0.04 * shading.mean()


def test_the_light_around_a_ground_under_the_sky_is_the_sky():
    """Every point of the ground sees the upper half, and none the lower one, which the ground itself hides."""
    ground = ScenePart(s.sheet((-50, 0, 50), 100 * X, -100 * Z), plain((0.5, 0.5, 0.5), 0.8))
    sky = np.full((16, 32, 3), 2.0, np.float32)
    # The zenith has a colour of its own.
    sky[:4] = [4, 3, 1]
    world = World([ground], sky, look((0, 1, 1), (0, 0, 0), 40))
    traced = tracer_of(world)
    light = traced.light(traced.probe(), rows=8, spp=64, seed=0)
    # Directions of the light are in the camera frame.
    up = texel_directions(8, 16) @ (world.view.to_scene.T @ [0, 1, 0])
    np.testing.assert_allclose(light[up > 0.25, 3], 1)
    np.testing.assert_allclose(light[up < -0.25, 3], 0)
    np.testing.assert_allclose(
        light[up > 0.95, :3], np.broadcast_to([4, 3, 1], (np.sum(up > 0.95), 3)), rtol=0.02
    )
    low = (up > 0.25) & (up < 0.5)
    np.testing.assert_allclose(light[low, :3], 2, rtol=0.05)
    # With a weight for what is hidden, the sky fills in below.
    behind = traced.light(traced.probe(), rows=8, spp=64, seed=0, hidden=0.1)
    np.testing.assert_allclose(behind[up < -0.25, 3], 0.1, rtol=1e-5)
    np.testing.assert_allclose(behind[up < -0.25, :3], 2, rtol=1e-3)


def test_the_light_around_a_lit_room_has_the_lamp_but_not_what_is_seen():
    traced = tracer_of(room(window=False, lamp=True, sky=0.0), 32)
    light = traced.light(traced.probe(), rows=16, spp=256, seed=0)
    d = texel_directions(16, 32)
    assert light[..., 0].max() > 3 * np.median(
        light[..., 0]
    )  # the lamp in the ceiling, spread: it is near
    brightest = d.reshape(-1, 3)[light[..., 0].argmax()]
    assert brightest[1] > 0.5
    assert light[..., 3].min() < 0.3 < light[..., 3].max()  # what is seen is no light
