"""The Mitsuba scene says what the project's conventions say: camera, maps, light, planes, seeds."""

import gc

import disney_reference as brdf
import drjit as dr
import numpy as np
import pytest
from render_scenes import empty, random_maps, uniform, wall, with_floor

from materialist.buffers import floats
from materialist.camera import pixel_rays, unit
from materialist.envmap import environment
from materialist.errors import InputError
from materialist.geometry.build import build_geometry
from materialist.render.scene import RenderScene
from materialist.types import Camera

CAMERA = Camera(13, 7, 50.0)
SIZE = (7, 13)
HILLS = Camera(96, 64, 50.0)
WHITE = np.ones((4, 8, 3), np.float32)


def scene_of(geometry, materials=None, envmap=WHITE, camera=CAMERA):
    scene = RenderScene(geometry, camera, device="cpu")
    scene.set_materials(uniform(camera) if materials is None else materials)
    scene.set_envmap(envmap)
    return scene


def camera_rays(scene, x, y):
    """Mitsuba's rays through screen positions x, y [N] in pixels."""
    mi = scene.mi
    camera = scene.camera
    film = mi.Point2f(np.float32(x / camera.width), np.float32(y / camera.height))
    return scene.mi_scene.sensors()[0].sample_ray(0, 0, film, mi.Point2f(0.5, 0.5))[0]


def inside_pixels(camera, seed=0):
    """One random position strictly inside each pixel: x [P], y [P], row-major."""
    rng = np.random.default_rng(seed)
    row, col = np.indices((camera.height, camera.width)).reshape(2, -1)
    return col + rng.uniform(0.05, 0.95, row.size), row + rng.uniform(0.05, 0.95, row.size)


@pytest.mark.parametrize("camera", [CAMERA, Camera(6, 17, 35.0)])
def test_rays_go_through_the_pixels_of_the_camera_model(camera):
    scene = RenderScene(wall(camera), camera, device="cpu")
    row, col = np.indices((camera.height, camera.width)).reshape(2, -1)
    direction = np.array(camera_rays(scene, col + 0.5, row + 0.5).d).T
    np.testing.assert_allclose(
        direction / -direction[:, 2:], pixel_rays(camera).reshape(-1, 3), atol=2e-5
    )


def test_no_garbage_is_collected_while_a_rendering_is_recorded(monkeypatch):
    """A scene that goes meanwhile would end the process."""
    scene = scene_of(wall(CAMERA), uniform(CAMERA))
    seen = []
    select = dr.select
    monkeypatch.setattr(dr, "select", lambda *a: seen.append(gc.isenabled()) or select(*a))
    scene.render(spp=1)
    assert seen and not any(seen) and gc.isenabled()


def test_every_pixel_shows_its_own_material():
    """A map that is neither square nor symmetric, read where the camera's rays land."""
    maps = random_maps(0, SIZE)
    scene = scene_of(wall(CAMERA), maps)
    for seed in range(3):
        si = scene.mi_scene.ray_intersect(camera_rays(scene, *inside_pixels(CAMERA, seed)))
        bsdf = scene.mi_scene.shapes()[0].bsdf()
        np.testing.assert_allclose(
            np.array(bsdf.base_color.eval(si)).T, maps.albedo.reshape(-1, 3), atol=1e-6
        )
        np.testing.assert_allclose(
            np.array(bsdf.roughness.eval_1(si)), maps.roughness.reshape(-1), atol=1e-6
        )
        np.testing.assert_allclose(
            np.array(bsdf.metallic.eval_1(si)), maps.metallic.reshape(-1), atol=1e-6
        )


@pytest.mark.parametrize(("rough", "metallic"), [(0.3, 0.7), (1.0, 0.0)])
def test_direct_light_is_the_integral_of_the_reference(rough, metallic):
    """A wall under constant light: L = integral of f_r cos, by quadrature of the numpy reference."""
    albedo = np.float32([0.8, 0.4, 0.1])
    scene = scene_of(wall(CAMERA), uniform(CAMERA, albedo, rough, metallic))
    image = scene.render(spp=1024, seed=5, max_depth=2)
    wi = brdf.hemisphere(400)
    for row, col in ((3, 6), (0, 0), (6, 2)):
        wo = -pixel_rays(CAMERA)[row, col] / np.linalg.norm(pixel_rays(CAMERA)[row, col])
        value = brdf.evaluate(albedo, rough, metallic, np.array([0.0, 0, 1]), wi, wo)
        expected = 2 * np.pi * (value * wi[..., 2:]).mean((0, 1))
        np.testing.assert_allclose(image[row, col], expected, rtol=0.03)


@pytest.mark.parametrize("height", [4, 16])
def test_light_is_the_bilinear_lookup_between_texel_centres(height):
    """To float precision, all around, poles and seam included."""
    rng = np.random.default_rng(height)
    envmap = rng.random((height, 2 * height, 3)).astype(np.float32)
    scene = scene_of(empty(CAMERA), envmap=envmap)
    direction = rng.normal(size=(20_000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    direction[:4] = [[0, 1, 0], [0, -1, 0], [1e-5, 0, 1], [-1e-5, 0, 1]]
    import drjit as dr

    si = dr.zeros(scene.mi.SurfaceInteraction3f, len(direction))
    si.wi = -scene.mi.Vector3f(direction.T.astype(np.float32))
    seen = np.array(scene.mi_scene.environment().eval(si)).T
    np.testing.assert_allclose(seen, environment(direction, envmap), atol=1e-4)


def test_sky_pixels_see_the_light():
    holes = np.zeros(SIZE, bool)
    holes[:3, 5:] = True
    envmap = np.random.default_rng(2).random((6, 12, 3)).astype(np.float32)
    scene = scene_of(wall(CAMERA, holes=holes), envmap=envmap)
    image = scene.render(spp=400, seed=1)
    offsets = (
        np.stack(np.meshgrid(np.arange(16), np.arange(16)), -1).reshape(-1, 2) + 0.5
    ) / 16 - 0.5
    within = [pixel_rays(CAMERA) + np.float32([u, -v, 0]) / CAMERA.focal for u, v in offsets]
    expected = np.mean(
        [environment(unit(rays).reshape(-1, 3), envmap) for rays in within], axis=0
    ).reshape(*SIZE, 3)
    np.testing.assert_allclose(image[holes], expected[holes], atol=0.01)


def test_continued_planes_carry_the_means_of_their_own_pixels():
    """Planes start alike; assigning one must not reach the other."""
    label = np.full(SIZE, -1)
    label[5:, 2:9], label[0] = 0, 1
    geometry = with_floor(wall(CAMERA), label)
    geometry.mesh.face_plane[-1] = 1  # the second triangle of the floor becomes the other plane
    maps = random_maps(4, SIZE)
    scene = scene_of(geometry, maps)
    for plane in (0, 1):
        for name, field in (
            ("base_color", maps.albedo),
            ("roughness", maps.roughness),
            ("metallic", maps.metallic),
        ):
            value = scene.params[f"plane{plane}.bsdf.{name}.data"]
            mean = field[label == plane].mean(0)
            np.testing.assert_allclose(
                value, np.broadcast_to(np.atleast_1d(mean), np.shape(value)), rtol=1e-5
            )


def test_updates_give_the_picture_of_a_fresh_scene():
    maps = random_maps(5, SIZE)
    envmap = np.random.default_rng(6).random((8, 16, 3)).astype(np.float32)
    label = np.full(SIZE, -1)
    label[4:] = 0
    geometry = with_floor(wall(CAMERA), label)
    fresh = scene_of(geometry, maps, envmap).render(spp=16, seed=9)
    used = scene_of(geometry, random_maps(7, SIZE), np.ones((5, 10, 3), np.float32))
    used.render(spp=4)
    used.set_envmap(envmap)
    used.set_materials(maps)
    np.testing.assert_array_equal(used.render(spp=16, seed=9), fresh)


def test_a_pixel_has_its_paths_whatever_else_is_traced():
    scene = scene_of(
        wall(CAMERA),
        random_maps(3, SIZE),
        np.random.default_rng(1).random((8, 16, 3)).astype(np.float32),
    )
    whole = scene.render(spp=9, seed=4)
    some = np.random.default_rng(2).random(SIZE) < 0.3
    part = scene.render(spp=9, seed=4, where=some)
    np.testing.assert_array_equal(part[some], whole[some])
    assert not part[~some].any()


def test_bad_light_maps_and_options_are_refused():
    scene = RenderScene(wall(CAMERA), CAMERA, device="cpu")
    for envmap, says in (
        (np.ones((4, 9, 3)), r"\(4, 9, 3\)"),
        (np.ones((2, 4, 3)), r"\(2, 4, 3\)"),
        (np.ones((4, 8)), r"\(4, 8\)"),
        (np.full((4, 8, 3), np.nan), "nan"),
        (np.full((4, 8, 3), -1.0), "-1"),
    ):
        with pytest.raises(InputError, match=says):
            scene.set_envmap(envmap)
    with pytest.raises(InputError, match=r"\(7, 12, 3\)"):
        scene.set_materials(random_maps(0, (7, 12)))
    with pytest.raises(InputError, match="max_depth is 0"):
        scene.render(spp=1, max_depth=0)


def test_normals_along_the_picture_s_x_are_normals_like_others():
    """Of a wall seen edge on, on facets that face the camera: u runs along them, where a shading frame needs others."""
    normal = np.zeros((*SIZE, 3), np.float32)
    normal[..., 0] = 1
    scene = scene_of(
        build_geometry(np.full(SIZE, 2, np.float32), normal, CAMERA, completion="none")
    )
    assert np.isfinite(scene.render(spp=4)).all()


def hills():
    """Depth [H, W] of smooth relief with one step, and normals [H, W, 3] towards the viewer."""
    row, col = np.indices((64, 96))
    depth = 4 + 0.3 * np.sin(row / 5.0) * np.cos(col / 7.0) + 0.01 * row
    depth[20:40, 30:60] -= 1.2
    return depth.astype(np.float32), np.broadcast_to(np.float32([0, 0, 1]), (64, 96, 3))


def misses(scene):
    """Rays through the middles of all horizontal and vertical mesh edges inside the picture that hit nothing."""
    mi = scene.mi
    row, col = np.indices((63, 95)).reshape(2, -1) + 1.0
    x = np.concatenate([col + 0.5, col]) / 96
    y = np.concatenate([row, row + 0.5]) / 64
    film = mi.Point2f(x.astype(np.float32), y.astype(np.float32))
    ray = scene.mi_scene.sensors()[0].sample_ray(0, 0, film, mi.Point2f(0.5, 0.5))[0]
    return int((~np.array(scene.mi_scene.ray_intersect_preliminary(ray).is_valid())).sum())


def test_no_ray_passes_along_an_edge():
    """Embree's robust mode is on, and it is what closes the mesh."""
    scene = RenderScene(build_geometry(*hills(), HILLS, completion="none"), HILLS, device="cpu")
    assert misses(scene) == 0


def test_a_change_of_the_original_does_not_reach_dr_jit():
    mi = RenderScene(wall(CAMERA), CAMERA, device="cpu").mi
    given = np.ones(40, np.float32)
    copy = floats(mi, given)
    given[:] = 2
    np.testing.assert_array_equal(np.array(copy), 1)


def test_another_photo_needs_no_other_kernel():
    """Its size and field of view are data: as literals they would have every photo compile the path tracer."""

    def kernels(camera):
        gc.collect()  # scenes that are left over are in kernels, too
        scene = scene_of(wall(camera), random_maps(0, (camera.height, camera.width)), camera=camera)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            scene.render(spp=4)
            return {
                k["hash"]
                for k in dr.kernel_history()
                if k.get("ir") and len(k["ir"].getvalue()) > 50_000
            }

    first = kernels(CAMERA)
    assert first and kernels(Camera(CAMERA.width + 3, CAMERA.height + 2, CAMERA.fov + 7)) == first
