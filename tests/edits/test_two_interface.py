"""The two-interface model, against slabs, balls and energy in closed form."""

from types import SimpleNamespace

import numpy as np
import pytest

from materialist.bsdf.dielectric import fresnel_dielectric, masking
from materialist.camera import pixel_rays, project
from materialist.edits.glass import two_interface as ti
from materialist.errors import InputError
from materialist.types import Camera

CAMERA = Camera(48, 40, 40)
SHAPE = (40, 48)


def ball(camera, radius=0.6, distance=3.0):
    """Depth, normal, mask, and cosine of incidence of a ball straight ahead."""
    rays = pixel_rays(camera).astype(float)
    d = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    centre = np.array([0.0, 0, -distance])
    b = d @ centre
    inside = b**2 - distance**2 + radius**2
    mask = inside > 1e-4
    point = d * (b - np.sqrt(np.maximum(inside, 0)))[..., None]
    normal = np.where(mask[..., None], (point - centre) / radius, [0, 0, 1])
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    cosine = np.where(mask, -np.sum(normal * d, -1), 1)
    return np.where(mask, -point[..., 2], 0), normal, mask, cosine


def gradient(camera):
    """A background that tells where it was looked up: x and y in the picture, in [0, 1]."""
    h, w = camera.height, camera.width
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
    crossing = ti.cross(front, 0.3 / inner, ior=1.5, back="same")
    np.testing.assert_allclose(crossing.direction, front.direction, atol=1e-9)
    # Closed form: a pane of thickness t moves a ray aside by t sin(i) (1 - cos(i) / (n cos(r))).
    offset = np.linalg.norm(np.cross(crossing.exit - front.point, front.direction), axis=-1)
    expected = 0.3 * np.sqrt(1 - cosine**2) * (1 - cosine / (1.5 * inner))
    np.testing.assert_allclose(offset, expected, atol=1e-9)


def test_a_ball_bends_rays_twice_by_the_difference_of_angles():
    camera = Camera(160, 160, 30)
    depth, normal, mask, cosine = ball(camera)
    front = ti.Front(camera, normal, depth, mask)
    ci = cosine[mask]
    cr = np.sqrt(1 - (1 - ci**2) / 1.5**2)
    crossing = ti.cross(front, 2 * 0.6 * cr, ior=1.5)
    # The exit lies on the ball, and the deviation is 2 (i - r), as for every ball lens.
    np.testing.assert_allclose(np.linalg.norm(crossing.exit - np.array([0, 0, -3.0]), axis=-1), 0.6, atol=1e-6)
    deviation = np.arccos(np.clip(np.sum(crossing.direction * front.direction, -1), -1, 1))
    core = ci > 0.5  # at the rim a pixel sees many normals
    np.testing.assert_allclose(deviation[core], 2 * (np.arccos(ci) - np.arccos(cr))[core], atol=0.02)


def test_a_back_of_its_own_bends_rays_as_that_back_does():
    """A wedge: flat in front, its back leaning; the mirrored front would let rays through as a pane does."""
    depth, normal, mask, thick = pane(CAMERA, 0.3)
    lean = np.radians(10)
    back = np.tile([np.sin(lean), 0, -np.cos(lean)], (*mask.shape, 1))
    front = ti.Front(CAMERA, normal, depth, mask, back)
    crossing = ti.cross(front, thick[mask], ior=1.5)
    middle = np.argmax(front.direction @ [0, 0, -1.0])
    # Snell's law at the back of a prism for a ray along the axis: sin(out) = n sin(lean).
    with pytest.raises(InputError, match="back has shape"):
        ti.two_interface(
            CAMERA, normal, depth, mask, thick, depth + 1, gradient(CAMERA), np.ones((8, 16, 3)), back=back[1:]
        )
    found = np.arcsin(crossing.direction[middle, 0])
    assert abs(front.direction[middle, 0]) < 0.02
    assert found == pytest.approx(lean - np.arcsin(1.5 * np.sin(lean)), abs=0.03)


def test_without_refraction_the_background_is_seen_unchanged():
    depth, normal, mask, cosine = ball(CAMERA)
    picture = gradient(CAMERA)
    thickness = 1.2 * cosine
    out = ti.two_interface(
        CAMERA, normal, depth, mask, thickness, np.full(SHAPE, 6.0), picture, np.ones((8, 16, 3)), ior=1.0
    )
    np.testing.assert_allclose(out[mask], picture[mask], atol=1e-4)
    assert (out[~mask] == 0).all()


def test_a_ball_lens_turns_the_background_round():
    depth, normal, mask, cosine = ball(CAMERA)
    thickness = 1.2 * np.sqrt(1 - (1 - cosine**2) / 1.5**2)
    out = ti.two_interface(
        CAMERA, normal, depth, mask, thickness, np.full(SHAPE, 9.0), gradient(CAMERA), np.zeros((8, 16, 3)), ior=1.5
    )
    row = out[20, mask[20], 0]
    middle = len(row) // 2
    assert row[middle - 3] > row[middle + 3] + 0.05


def test_a_pixel_is_the_mean_of_finer_ones(monkeypatch):
    """A ball that crowds a striped background together, against a picture of five times the resolution."""

    def glass(fine):
        camera = Camera(48 * fine, 40 * fine, 40)
        depth, normal, mask, cosine = ball(camera)
        stripe = np.sin(2 * np.pi * (np.arange(camera.width) + 0.5) / (6 * fine)) > 0
        picture = np.broadcast_to(stripe[None, :, None], (*mask.shape, 3)).astype(np.float32)
        thickness = 1.2 * np.sqrt(1 - (1 - cosine**2) / 1.5**2)
        far, dark = np.full(mask.shape, 9.0), np.zeros((8, 16, 3))
        return ti.two_interface(camera, normal, depth, mask, thickness, far, picture, dark, ior=1.5), mask

    fine, inside = glass(5)
    twin = fine.reshape(40, 5, 48, 5, 3).mean((1, 3))
    whole = inside.reshape(40, 5, 48, 5).all((1, 3))
    error = {}
    for sides in ((1, 1), ti.SIDES):
        monkeypatch.setattr(ti, "SIDES", sides)
        error[sides] = np.sqrt(np.mean((glass(1)[0] - twin)[whole] ** 2))
    assert error[ti.SIDES] < 0.5 * error[1, 1], error


def test_rays_are_spread_where_the_background_is_crowded_together():
    inside = np.zeros((5, 9), bool)
    inside[1:4, 1:8] = True
    y, x = np.argwhere(inside).T
    assert (ti.crowding(np.stack([x, y], -1) + 0.3, inside) == 0).all()  # as the picture is
    assert (ti.crowding(np.stack([x / 2, y / 3], -1), inside) == 0).all()  # magnified
    np.testing.assert_allclose(ti.crowding(np.stack([1.5 * x, y], -1), inside), 0.5)
    found = np.zeros(inside.shape)
    found[inside] = ti.crowding(np.stack([np.where(x < 4, x, x + 40), y], -1), inside)
    np.testing.assert_array_equal(found[2] > 0, [0, 0, 0, 1, 1, 0, 0, 0, 0])  # either side of a crease
    assert not ti.crowding(np.zeros((1, 2)), np.ones((1, 1), bool)).any()


@pytest.mark.parametrize("roughness", [0.0, 0.4])
def test_no_light_is_made_or_lost(roughness):
    depth, normal, mask, cosine = ball(CAMERA)
    white = np.ones((*SHAPE, 3))
    out = ti.two_interface(
        CAMERA, normal, depth, mask, 1.2 * cosine, np.full(SHAPE, 6.0), white, np.ones((8, 16, 3)), ior=1.5,
        roughness=roughness,
    )  # fmt: skip
    assert (out[mask] <= 1 + 1e-6).all()
    # In a white room clear glass is white, whatever it does: what stays inside at the back leaves elsewhere.
    np.testing.assert_allclose(out[mask], 1, atol=1e-6)


def test_transmission_and_tint_scale_what_is_behind():
    depth, normal, mask, cosine = ball(CAMERA)
    arguments = (CAMERA, normal, depth, mask, 1.2 * cosine, np.full(SHAPE, 6.0), gradient(CAMERA), np.zeros((8, 16, 3)))
    clear = ti.two_interface(*arguments, ior=1.3)
    mirror = ti.two_interface(*arguments, ior=1.3, transmission=0)
    dim = ti.two_interface(*arguments, ior=1.3, transmission=0.5, tint=(1, 0.5, 0))
    np.testing.assert_allclose(dim - mirror, (clear - mirror) * [0.5, 0.25, 0], atol=1e-6)
    assert np.median(mirror[mask]) == 0 < mirror.max()  # most of it reflects the dark behind the camera


def test_the_front_reflects_what_is_behind_where_its_reflection_meets_that():
    """A pane that leans away: its mirror image is the right border of the background, not the environment."""
    depth, normal, mask, thick = pane(CAMERA, 0.1, tilt=1.2)
    middle = SHAPE[0] // 2, SHAPE[1] // 2
    mask = mask & (depth > 0) & (depth < 5)
    arguments = (CAMERA, normal, depth, mask, thick, np.full(SHAPE, 6.0), gradient(CAMERA), np.zeros((8, 16, 3)))
    seen = ti.two_interface(*arguments, ior=1.5, transmission=0)[middle]
    cosine = -normal[middle] @ ti._unit(pixel_rays(CAMERA).astype(float)[middle])
    share = float(ti.fresnel_dielectric(np.array([cosine]), 1.5)[0])
    assert mask[middle] and seen[0] == pytest.approx(share * (1 - 0.5 / SHAPE[1]), rel=0.02)


def test_a_known_back_is_left_where_rays_meet_it():
    """A ball with the normals of its back: every refracted ray leaves on the ball, wherever it went in."""
    camera = Camera(96, 80, 40)
    depth, normal, mask, cosine = ball(camera)
    centre, rays = np.array([0, 0, -3.0]), pixel_rays(camera).astype(float)
    thick = np.where(mask, 1.2 * cosine, 0)
    far = rays * (depth + thick / np.linalg.norm(rays, axis=-1))[..., None]
    back = np.where(mask[..., None], ti._unit(far - centre), [0, 0, -1.0])
    inside = mask & (cosine > 0.4)  # at the border the depth map of the back ends
    front = ti.Front(camera, normal, depth, inside, back, thick)
    crossing = ti.cross(front, thick[inside], ior=1.5)
    off = np.abs(np.linalg.norm(crossing.exit - centre, axis=-1) - 0.6)
    assert np.median(off) < 0.003 and np.percentile(off, 95) < 0.03
    guessed = ti.cross(ti.Front(camera, normal, depth, inside, back), thick[inside], ior=1.5)
    assert np.median(np.abs(np.linalg.norm(guessed.exit - centre, axis=-1) - 0.6)) > 4 * np.median(off)
    same = ti.back_of(depth, mask, thick, None, camera)
    assert np.degrees(np.arccos(np.clip((same * back).sum(-1), -1, 1)))[inside].mean() < 3
    assert ti.back_of(depth, mask, thick, back, camera) is back


def test_rough_glass_blurs():
    depth, normal, mask, thickness = pane(CAMERA, 0.05)
    checker = np.repeat((np.indices(SHAPE).sum(0) // 2 % 2)[..., None], 3, -1).astype(float)
    arguments = (CAMERA, normal, depth, mask, thickness, np.full(SHAPE, 4.0), checker, np.zeros((8, 16, 3)))
    clear, rough = (ti.two_interface(*arguments, ior=1.5, roughness=r) for r in (0.0, 0.5))
    inner = np.s_[10:30, 10:38]
    assert rough[inner].std() < 0.4 * clear[inner].std()
    assert rough[inner].mean() == pytest.approx(clear[inner].mean(), rel=0.15)


@pytest.mark.parametrize("tilt", [0.0, 45.0, 75.0])
@pytest.mark.parametrize("roughness", [0.3, 0.6, 1.0])
def test_a_rough_front_reflects_what_its_lobe_integrates_to(roughness, tilt):
    """F D G / (4 cos_i cos_o) over the upper hemisphere, by quadrature: nothing is reflected below the surface."""
    alpha, angle = roughness**2, np.deg2rad(tilt)
    view, up = np.array([np.sin(angle), 0, np.cos(angle)]), np.array([0, 0, 1.0])
    cosine, azimuth = np.meshgrid((np.arange(1500) + 0.5) / 1500, (np.arange(600) + 0.5) / 600 * 2 * np.pi)
    sine = np.sqrt(1 - cosine**2)
    out = np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), cosine], -1)
    half = (view + out) / np.linalg.norm(view + out, axis=-1, keepdims=True)
    normals = alpha**2 / (np.pi * (half[..., 2] ** 2 * (alpha**2 - 1) + 1) ** 2)
    value = fresnel_dielectric(half @ view, 1.5) * normals * masking(out, up, alpha) * masking(view, up, alpha)
    expected = 2 * np.pi * (value / (4 * view[2])).mean()
    count = 3000
    front = SimpleNamespace(
        point=np.zeros((1, 3)), direction=-view[None], normal=up[None], way=lambda _, d: d, back_at=lambda *_: -up[None]
    )
    found = [ti.cross(front, np.ones(1), ior=1.5, alpha=alpha, sample=(k, count)) for k in range(count)]
    assert np.mean([c.reflectance for c in found]) == pytest.approx(expected, rel=0.02)
    assert all(c.reflected[0, 2] > 0 for c in found if c.reflectance[0] > 0)


def test_distance_to_a_slanting_background():
    camera = Camera(64, 64, 50)
    n = np.array([0.3, 0.8, 0.5])
    depth = -1.5 * n[2] / np.minimum(pixel_rays(camera).astype(float) @ n, -1e-3)
    depth = np.where((depth > 0) & (depth < 50), depth, 0)  # n.p = -1.5 n_z
    origin = np.array([[0.0, 0.0, -1.0], [0.1, 0.2, -1.2]])
    direction = np.array([[0.0, -0.6, -0.8], [0.1, -0.7, -0.4]])
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    found = ti.background_distance(origin, direction, depth, camera)
    np.testing.assert_allclose(found, (-1.5 * n[2] - origin @ n) / (direction @ n), rtol=0.02)


def test_rays_that_meet_nothing_see_the_environment():
    sky = np.zeros((16, 32, 3))
    sky[:8] = 1.0  # the upper half
    origin, direction = np.array([[0.0, 0, -2]] * 3), np.array([[0.0, 0.9, 0.436], [0, -0.9, 0.436], [0, 0, -1.0]])
    behind = ti.Behind(np.full((*SHAPE, 3), 0.25), np.full(SHAPE, 5.0), sky)
    found = ti.look(origin, direction, behind, CAMERA)
    assert found[:, 0].tolist() == pytest.approx([1, 0, 0.25])
    empty = ti.Behind(behind.picture, np.zeros(SHAPE), sky)
    assert ti.look(origin[:1], direction[:1], empty, CAMERA)[0, 0] == 1
    # The sky that the picture shows comes from the picture.
    assert ti.look(origin[2:], direction[2:], empty, CAMERA)[0].tolist() == [0.25] * 3


def test_total_reflection_keeps_its_light():
    # A wedge: the back leans away so far that the ray cannot leave.
    depth, normal, mask, _ = pane(CAMERA, 0.0, tilt=0.7)
    front = ti.Front(CAMERA, normal, depth, mask)
    crossing = ti.cross(front, np.full(mask.sum(), 0.2), ior=2.4)
    inner, _ = ti.refract(front.direction, front.normal, 1 / 2.4)
    outward = ti.reflect(front.normal, ti._unit(crossing.exit))
    total = np.sum(inner * outward, -1) < np.sqrt(1 - 1 / 2.4**2)
    assert total.all()
    np.testing.assert_allclose(crossing.share, 1 - crossing.reflectance)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"ior": 0.9}, "index of refraction is 0.9"),
        ({"transmission": 1.5}, "Transmission is 1.5"),
        ({"tint": (1, 2, 0)}, "tint is"),
        ({"back": "odd"}, "back is 'odd'"),
    ],
)
def test_bad_options_are_refused(change, words):
    depth, normal, mask, thickness = pane(CAMERA, 0.1)
    with pytest.raises(InputError, match=words):
        ti.two_interface(
            CAMERA, normal, depth, mask, thickness, depth + 1, gradient(CAMERA), np.ones((8, 16, 3)), **change
        )


def test_maps_of_another_size_are_refused():
    depth, normal, mask, thickness = pane(CAMERA, 0.1)
    with pytest.raises(InputError, match="thickness has shape"):
        ti.two_interface(
            CAMERA, normal, depth, mask, thickness[1:], depth + 1, gradient(CAMERA), np.ones((8, 16, 3))
        )  # fmt: skip


def test_positions_in_the_picture_agree_with_the_camera():
    picture = gradient(CAMERA)
    point = np.array([[0.2, -0.1, -2.0], [-0.3, 0.25, -3.0]])
    place, _ = project(point, CAMERA)
    np.testing.assert_allclose(ti.bilinear(picture, place)[:, :2], place / [48, 40], atol=1e-6)
