"""The two-interface model, against slabs, balls and energy in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest
from geometry_scenes import ball

from materialist.bsdf.dielectric import fresnel_dielectric, masking
from materialist.camera import pixel_rays
from materialist.edits.glass import two_interface as ti
from materialist.edits.glass.options import Glass
from materialist.types import Camera

CAMERA = Camera(48, 40, 40)
SHAPE = (40, 48)
RADIUS = 0.6
CENTRE = (0, 0, -3)
*MAPS, THICK = ball(CAMERA, CENTRE, RADIUS)


def back_of_ball(camera):
    """[H, W, 3] outward normals where camera rays leave the ball."""
    depth, _, _, thick = ball(camera, CENTRE, RADIUS)
    rays = pixel_rays(camera).astype(float)
    far = rays * (depth + thick / np.linalg.norm(rays, axis=-1))[..., None] - CENTRE
    return far / np.linalg.norm(far, axis=-1, keepdims=True)


def shown(maps, thickness, away, picture, sky=0.0, back=None, camera=CAMERA, **options):
    """The model before a wall at depth `away` under an even sky; maps: depth, normal, mask."""
    options |= {"model": "two-interface", "back": "same" if back is None else "found"}
    depth, normal, mask = maps
    behind = ti.Backdrop(picture, np.full(mask.shape, away), np.full((8, 16, 3), sky))
    return ti.two_interface(camera, normal, depth, mask, thickness, behind, Glass(**options), back)


def gradient(camera):
    """A background that tells where it was looked up: x and y in the picture, in [0, 1]."""
    h = camera.height
    w = camera.width
    x, y = np.meshgrid((np.arange(w) + 0.5) / w, (np.arange(h) + 0.5) / h)
    return np.stack([x, y, 0 * x + 0.5], -1).astype(np.float32)


def pane(camera, thickness, tilt=0.0):
    """A wide parallel pane at depth 2, leaning by `tilt` radians about the vertical."""
    n = np.array([np.sin(tilt), 0, np.cos(tilt)])
    rays = pixel_rays(camera).astype(float)
    depth = -2 * n[2] / (rays @ n)
    mask = np.ones(depth.shape, bool)
    return depth, np.broadcast_to(n, rays.shape).copy(), mask, np.full(depth.shape, thickness)


@pytest.mark.parametrize("tilt", [0.0, 0.5])
def test_a_pane_moves_rays_aside_and_keeps_their_direction(tilt):
    depth, normal, mask, _ = pane(CAMERA, 0, tilt)
    front = ti.Front(CAMERA, normal, depth, mask)
    cosine = -np.sum(front.direction * front.normal, -1)
    inner = np.sqrt(1 - (1 - cosine**2) / 1.5**2)
    crossing = ti.cross(front, 0.3 / inner, ior=1.5)
    np.testing.assert_allclose(crossing.direction, front.direction, atol=1e-9)
    # Closed form: a pane of thickness t moves a ray aside by t sin(i) (1 - cos(i) / (n cos(r))).
    offset = np.linalg.norm(np.cross(crossing.exit - front.point, front.direction), axis=-1)
    expected = 0.3 * np.sqrt(1 - cosine**2) * (1 - cosine / (1.5 * inner))
    np.testing.assert_allclose(offset, expected, atol=1e-9)


def test_a_ball_bends_rays_twice_by_the_difference_of_angles():
    camera = Camera(160, 160, 30)
    depth, normal, mask, thick = ball(camera, CENTRE, RADIUS)
    mask &= thick > 0.48  # at the border the depth map of the back ends
    front = ti.Front(camera, normal, depth, mask, back_of_ball(camera), thick)
    ci = thick[mask] / (2 * RADIUS)
    cr = np.sqrt(1 - (1 - ci**2) / 1.5**2)
    crossing = ti.cross(front, thick[mask], ior=1.5)
    # The exit lies on the ball, and the deviation is 2 (i - r), as for every ball lens.
    np.testing.assert_allclose(
        np.linalg.norm(crossing.exit - np.array([0, 0, -3.0]), axis=-1), 0.6, atol=0.01
    )
    deviation = np.arccos(np.clip(np.sum(crossing.direction * front.direction, -1), -1, 1))
    core = ci > 0.5  # at the rim a pixel sees many normals
    np.testing.assert_allclose(
        deviation[core], 2 * (np.arccos(ci) - np.arccos(cr))[core], atol=0.03
    )


def test_a_back_of_its_own_bends_rays_as_that_back_does():
    """A wedge: flat in front, its back leaning; the mirrored front would let rays through as a pane does."""
    depth, normal, mask, thick = pane(CAMERA, 0.3)
    lean = np.radians(10)
    back = np.tile([np.sin(lean), 0, -np.cos(lean)], (*mask.shape, 1))
    front = ti.Front(CAMERA, normal, depth, mask, back)
    crossing = ti.cross(front, thick[mask], ior=1.5)
    middle = np.argmax(front.direction @ [0, 0, -1.0])
    # Snell's law at the back of a prism for a ray along the axis: sin(out) = n sin(lean).
    found = np.arcsin(crossing.direction[middle, 0])
    assert abs(front.direction[middle, 0]) < 0.02
    assert found == pytest.approx(lean - np.arcsin(1.5 * np.sin(lean)), abs=0.03)


def test_without_refraction_the_background_is_seen_unchanged():
    out = shown(MAPS, THICK, 6.0, gradient(CAMERA), 1.0, ior=1.0)
    picture = gradient(CAMERA)
    inner = MAPS[2] & (
        THICK > 0.36
    )  # next to the silhouette some rays of a pixel pass beside the ball
    np.testing.assert_allclose(out[inner], picture[inner], atol=1e-3)
    assert (out[~MAPS[2]] == 0).all()


def test_a_pixel_is_the_mean_of_finer_ones(monkeypatch):
    """A ball that crowds a striped background together, against a picture of five times the resolution."""

    def glass(fine):
        camera = Camera(48 * fine, 40 * fine, 40)
        *maps, thick = ball(camera, CENTRE, RADIUS)
        stripe = np.sin(2 * np.pi * (np.arange(camera.width) + 0.5) / (6 * fine)) > 0
        picture = np.broadcast_to(stripe[None, :, None], (*thick.shape, 3)).astype(np.float32)
        return shown(maps, thick, 9.0, picture, back=back_of_ball(camera), camera=camera), maps[2]

    monkeypatch.setattr(ti, "SIDES", (1, 1))
    fine, inside = glass(5)
    twin = fine.reshape(40, 5, 48, 5, 3).mean((1, 3))
    whole = inside.reshape(40, 5, 48, 5).all((1, 3))
    error = []
    for side in (1, 2):
        monkeypatch.setattr(ti, "SIDES", (side, side))
        error.append(np.sqrt(np.mean((glass(1)[0] - twin)[whole] ** 2)))
    assert error[1] < 0.5 * error[0], error


@pytest.mark.parametrize("roughness", [0.0, 0.4])
def test_no_light_is_made_or_lost(roughness):
    out = shown(MAPS, THICK, 6.0, np.ones((*SHAPE, 3)), 1.0, roughness=roughness)
    # In a white room clear glass is white, whatever it does: what stays inside at the back leaves elsewhere.
    np.testing.assert_allclose(out[MAPS[2]], 1, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("roughness", "tilt"),
    [(0.3, 75.0), pytest.param(0.6, 45.0, marks=pytest.mark.slow), (1.0, 0.0)],
)
def test_a_rough_front_reflects_what_its_lobe_integrates_to(roughness, tilt):
    """F D G / (4 cos_i cos_o) over the upper hemisphere, by quadrature: nothing is reflected below the surface."""
    alpha = roughness**2
    angle = np.deg2rad(tilt)
    view = np.array([np.sin(angle), 0, np.cos(angle)])
    up = np.array([0, 0, 1.0])
    cosine, azimuth = np.meshgrid(
        (np.arange(800) + 0.5) / 800, (np.arange(200) + 0.5) / 200 * 2 * np.pi
    )
    sine = np.sqrt(1 - cosine**2)
    out = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], -1)
    half = (view + out) / np.linalg.norm(view + out, axis=-1, keepdims=True)
    normals = alpha**2 / (np.pi * (half[..., 2] ** 2 * (alpha**2 - 1) + 1) ** 2)
    value = (
        fresnel_dielectric(half @ view, 1.5)
        * normals
        * masking(out, up, alpha)
        * masking(view, up, alpha)
    )
    expected = 2 * np.pi * (value / (4 * view[2])).mean()
    count = 3000
    front = SimpleNamespace(
        point=np.zeros((1, 3)),
        direction=-view[None],
        normal=up[None],
        way=lambda _, d: d,
        back_at=lambda *_: -up[None],
    )
    found = [
        ti.cross(front, np.ones(1), ior=1.5, alpha=alpha, sample=(k, count)) for k in range(count)
    ]
    assert np.mean([c.reflectance for c in found]) == pytest.approx(expected, rel=0.02)
    assert all(c.reflected[0, 2] > 0 for c in found if c.reflectance[0] > 0)


def test_rays_that_meet_nothing_see_the_environment():
    sky = np.zeros((16, 32, 3))
    sky[:8] = 1.0  # the upper half
    origin = np.array([[0.0, 0, -2]] * 3)
    direction = np.array([[0.0, 0.9, 0.436], [0, -0.9, 0.436], [0, 0, -1.0]])
    behind = ti.Backdrop(np.full((*SHAPE, 3), 0.25), np.full(SHAPE, 5.0), sky)
    found = ti.look(origin, direction, behind, CAMERA)
    assert found[:, 0].tolist() == pytest.approx([1, 0, 0.25])
    empty = ti.Backdrop(behind.picture, np.zeros(SHAPE), sky)
    assert ti.look(origin[:1], direction[:1], empty, CAMERA)[0, 0] == 1
    # The sky that the picture shows comes from the picture.
    assert ti.look(origin[2:], direction[2:], empty, CAMERA)[0].tolist() == [0.25] * 3


def test_total_reflection_keeps_its_light():
    # A wedge: the back leans away so far that the ray cannot leave.
    depth, normal, mask, _ = pane(CAMERA, 0.0, tilt=0.7)
    outward = np.array([np.sin(0.7), 0, -np.cos(0.7)])
    front = ti.Front(CAMERA, normal, depth, mask, np.tile(outward, (*mask.shape, 1)))
    crossing = ti.cross(front, np.full(mask.sum(), 0.2), ior=2.4)
    inner, _ = ti.refract(front.direction, front.normal, 2.4)
    total = inner @ outward < np.sqrt(1 - 1 / 2.4**2)
    assert total.all()
    np.testing.assert_allclose(crossing.share, 1 - crossing.reflectance)
