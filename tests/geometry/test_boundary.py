"""The mesh of a depth map: one quad a pixel, duplicated boundaries, and no way to see between two surfaces."""

import numpy as np
import pytest
from geometry_scenes import look, plane_depth, screen_rays, trace
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy import ndimage

from materialist.geometry.boundary import corner_inverse_depth, corner_vertices, depth_to_mesh
from materialist.geometry.cuts import find_cuts
from materialist.types import Camera


def towards(shape):
    """[H, W, 3] normals straight along +Z."""
    return np.broadcast_to(np.float32([0, 0, 1]), (*shape, 3))


def mesh_of(depth, fov=40.0, tau=6.0):
    camera = Camera(depth.shape[1], depth.shape[0], fov)
    return depth_to_mesh(depth, towards(depth.shape), camera, tau=tau), camera


@st.composite
def depth_maps(draw):
    """Random small depth maps: noise, steps, and holes; at least one pixel has a surface."""
    height = draw(st.integers(1, 9))
    width = draw(st.integers(1, 9))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    depth = 2 + rng.integers(0, draw(st.integers(1, 4)), (height, width)) * draw(
        st.sampled_from([0.01, 0.5, 30.0])
    )
    depth = depth * rng.uniform(1, 1 + draw(st.sampled_from([1e-6, 0.05, 1.0])), depth.shape)
    depth[rng.random(depth.shape) < draw(st.sampled_from([0, 0.2, 0.6]))] = 0
    depth[rng.integers(height), rng.integers(width)] = 1.5
    return depth


def corners_by_loop(depth, cuts):
    """Slow twin of `corner_vertices` and `corner_inverse_depth`: loops over grid corners, flood fill at each."""
    height, width = depth.shape
    vertex = np.full((height, width, 4), -1)
    inverse = np.zeros((height, width, 4))

    def linked(p, q):
        (i, j), (k, m) = min(p, q), max(p, q)
        return (
            bool(cuts.link_x[i, j] if i == k else cuts.link_y[i, j])
            if abs(i - k) + abs(j - m) == 1
            else False
        )

    def gradient(i, j, axis):
        steps = []
        for sign in (-1, 1):
            k, m = (i, j + sign) if axis == 0 else (i + sign, j)
            if 0 <= k < height and 0 <= m < width and depth[k, m] > 0 and linked((i, j), (k, m)):
                steps.append(sign * (1 / depth[k, m] - 1 / depth[i, j]))
        if len(steps) == 2:
            least = min(map(abs, steps)) if steps[0] * steps[1] > 0 else float("inf")
            return min(max(sum(steps) / 2, -2 * least), 2 * least)
        return sum(steps) / len(steps) if steps else 0.0

    count = 0
    for row in range(height + 1):
        for column in range(width + 1):
            around = [(row - 1, column - 1), (row - 1, column), (row, column - 1), (row, column)]
            around = [
                (i, j) for i, j in around if 0 <= i < height and 0 <= j < width and depth[i, j] > 0
            ]
            while around:
                group = [around.pop(0)]
                for member in group:
                    for other in [p for p in around if linked(member, p)]:
                        around.remove(other)
                        group.append(other)
                for i, j in group:
                    slot = 2 * (row - i) + column - j
                    vertex[i, j, slot] = count
                    own = 1 / depth[i, j]
                    value = (
                        own
                        + (column - j - 0.5) * gradient(i, j, 0)
                        + (row - i - 0.5) * gradient(i, j, 1)
                    )
                    inverse[i, j, slot] = min(max(value, own / 2), own * 2)
                count += 1
    return vertex, inverse


@given(depth_maps(), st.sampled_from([1.0, 6.0, 20.0]))
@settings(max_examples=40, deadline=None)
def test_duplication_agrees_with_its_slow_twin(depth, tau):
    cuts = find_cuts(depth, Camera(depth.shape[1], depth.shape[0], 40.0), tau)
    vertex, inverse = corners_by_loop(depth, cuts)
    np.testing.assert_array_equal(corner_vertices(depth > 0, cuts), vertex)
    fast = corner_inverse_depth(np.where(depth > 0, 1 / np.where(depth > 0, depth, 1), 0), cuts)
    np.testing.assert_allclose(fast[depth > 0], inverse[depth > 0], rtol=1e-12)


@given(depth_maps(), st.sampled_from([1.0, 6.0, 20.0]))
@settings(max_examples=40, deadline=None)
def test_the_mesh_is_sound_for_any_depth_map(depth, tau):
    mesh, camera = mesh_of(depth, tau=tau)
    surface = np.flatnonzero(depth.ravel() > 0)
    front = 2 * len(surface)
    np.testing.assert_array_equal(mesh.face_pixel[:front], np.repeat(surface, 2))
    assert np.isin(mesh.face_pixel, surface).all() and (mesh.face_plane == -1).all()
    assert mesh.faces.min() >= 0 and mesh.faces.max() < len(mesh.vertices)
    assert len(np.unique(mesh.faces)) == len(mesh.vertices)
    for array in (mesh.vertices, mesh.normals, mesh.uv):
        assert np.isfinite(array).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=-1), 1, atol=1e-5)
    corners = mesh.vertices[mesh.faces].astype(float)
    facing = -(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * corners[:, 0]
    ).sum(-1)
    assert (facing > 0).all()  # counter-clockwise seen from the camera, tucks too
    assert ((mesh.normals * -mesh.vertices).sum(-1) > 0).all()
    points = mesh.vertices[np.unique(mesh.faces[:front])].astype(float)
    screen = points[:, :2] / -points[:, 2:] * [camera.focal, -camera.focal] + [
        camera.width / 2,
        camera.height / 2,
    ]
    np.testing.assert_allclose(
        mesh.uv[: len(screen)] * [camera.width, camera.height], screen, atol=1e-3
    )
    # Wherever a ray hits a face, a nearest-texel lookup at its uv gives the face's pixel.
    weights = np.random.default_rng(0).dirichlet(np.ones(3), len(mesh.faces)) * 0.98 + 0.02 / 3
    uv = (weights[..., None] * mesh.uv[mesh.faces]).sum(1)
    texel = np.floor(uv[:, 1] * camera.height).astype(int) * camera.width + np.floor(
        uv[:, 0] * camera.width
    )
    np.testing.assert_array_equal(texel, mesh.face_pixel)


# A front face so steep that a tuck carried on along it once came out behind the camera.
STEEP_FRONT = np.array(
    [
        [2, 0, 32, 0],
        [2, 2, 0, 32],
        [2, 32, 2, 32],
        [0, 2, 1.5, 32],
        [32, 2, 32, 2],
        [2, 0, 2, 32],
        [32, 32, 32, 32],
    ]
)


@given(depth_maps(), st.sampled_from([1.0, 6.0, 8.0, 12.0]), st.integers(0, 99))
@example(STEEP_FRONT, 1.0, 0)
@settings(max_examples=30, deadline=None)
def test_rays_see_every_surface_and_only_its_own_pixel(depth, tau, seed):
    mesh, camera = mesh_of(depth, tau=tau)
    inside = 0.01 + 0.98 * np.random.default_rng(seed).beta(
        0.2, 0.2, (depth.size, 2)
    )  # mostly near a pixel's edge
    distance, face = look(mesh, camera, inside)
    surface = depth.ravel() > 0
    np.testing.assert_array_equal(face >= 0, surface)  # no white border, and the sky is open
    np.testing.assert_array_equal(mesh.face_pixel[face[surface]], np.flatnonzero(surface))
    assert (face < 2 * surface.sum()).all()  # the tucks stay hidden
    # A corner's inverse depth is a mean of values within a factor of two of its pixels' own.
    most = ndimage.maximum_filter(depth, 3, mode="nearest").ravel()[surface]
    least = ndimage.minimum_filter(np.where(depth > 0, depth, np.inf), 3, mode="nearest").ravel()[
        surface
    ]
    assert (distance[surface] < 2.001 * most).all() and (distance[surface] > 0.499 * least).all()


@given(depth_maps(), st.sampled_from([1.0, 6.0, 12.0]), st.integers(0, 99))
@settings(max_examples=30, deadline=None)
def test_rays_exactly_on_edges_and_corners_never_pass_between(depth, tau, seed):
    depth = np.where(depth > 0, depth, 7.0)
    mesh, camera = mesh_of(depth, tau=tau)
    rng = np.random.default_rng(seed)
    rows, columns = (
        np.mgrid[0 : camera.height + 1, 0 : camera.width + 1].reshape(2, -1).astype(float)
    )
    on_corner = np.stack([columns, rows], -1)
    on_column = np.stack([columns, rng.uniform(0, camera.height, len(rows))], -1)
    on_row = np.stack([rng.uniform(0, camera.width, len(rows)), rows], -1)
    screen = np.concatenate([on_corner, on_column, on_row])
    screen = np.concatenate([screen, screen + rng.normal(0, 1e-5, screen.shape)])
    screen = np.clip(screen, 1e-4, np.array([camera.width, camera.height]) - 1e-4)
    _, face = trace(mesh, np.zeros(3), screen_rays(camera, screen))
    assert (face >= 0).all()


@pytest.mark.parametrize("tau", [1.0, 6.0, 12.0])
@pytest.mark.parametrize("width", [1, 2, 3, 8])
def test_thin_bars_stand_free_of_the_background(width, tau):
    depth = np.full((12, 40), 6.0)
    depth[:, 14 : 14 + width] = 2.0
    mesh, camera = mesh_of(depth, fov=40, tau=tau)
    distance, face = look(mesh, camera, np.random.default_rng(0).random((depth.size, 2)))
    np.testing.assert_allclose(distance, depth.ravel(), rtol=1e-5)
    np.testing.assert_array_equal(mesh.face_pixel[face], np.arange(depth.size))
    # Nothing spans the gap: every face is all bar or all background ...
    spread = np.ptp(mesh.vertices[mesh.faces, 2], axis=1)
    assert spread.max() < 1e-4
    # ... and from the side, light passes between the two.
    _, between = trace(mesh, np.array([-20.0, 0.01, -4.0]), np.array([[1.0, 0, 0]]))
    assert between[0] == -1


@given(
    st.floats(-1.2, 1.2),
    st.floats(-1.2, 1.2),
    st.floats(0.5, 20),
    st.integers(3, 30),
    st.integers(3, 20),
)
@settings(max_examples=25, deadline=None)
def test_planes_are_reproduced_exactly(x, y, distance, width, height):
    normal = np.array([x, y, 1.0]) / np.linalg.norm([x, y, 1.0])
    camera = Camera(width, height, 50.0)
    depth = plane_depth(camera, normal, -distance)
    assume(np.isfinite(depth).all())
    inverse = np.pad(1 / depth, 1, mode="reflect", reflect_type="odd")  # linear on a plane
    assume(
        (2 * inverse[:-2] > inverse[1:-1]).all() and inverse.min() > 0
    )  # the horizon is not in the picture
    mesh = depth_to_mesh(depth, np.broadcast_to(normal, (*depth.shape, 3)), camera)
    assert len(mesh.vertices) == (width + 1) * (height + 1)  # one sheet
    np.testing.assert_allclose(mesh.vertices @ normal, -distance, rtol=2e-5)


def test_beside_a_smeared_outline_the_surface_has_no_lip():
    """A receding side whose outline the depth smears over some pixels: nothing there comes back to the camera."""
    side = np.concatenate([np.linspace(2.6, 2.75, 16), [3.11, 4.13, 4.7], np.full(13, 4.86)])
    depth = np.tile(side, (8, 1))
    camera = Camera(32, 8, 35.0)
    normal = np.tile(np.array([0, 0, 1], np.float32), (8, 32, 1))
    mesh = depth_to_mesh(depth, normal, camera)
    front = mesh.faces[: 2 * depth.size].reshape(8, 32, 6)
    nearest = -mesh.vertices[front][..., 2].max(-1).max(0)  # [32] of each column of pixels
    assert (np.diff(nearest) > -1e-6).all()


@pytest.mark.parametrize("slope", [12, -12, 40])
def test_a_small_region_is_a_piece_of_its_own_however_small_the_step(slope):
    camera = Camera(100, 100, 40.0)
    depth = np.full((100, 100), 10.0)
    depth[43:46, 43:46] *= np.exp(slope / camera.focal)
    mesh = depth_to_mesh(depth, towards(depth.shape), camera)
    z = mesh.vertices[mesh.faces[: 2 * depth.size]][..., 2]
    assert np.ptp(z, axis=1).max() < 1e-4


def test_a_wall_seen_through_a_small_hole_is_no_part_of_what_has_the_hole():
    """As in a jug's handle: a sheet between them would shade the wall."""
    depth = np.full((100, 100), 10.0, np.float32)
    depth[40:49, 40:49] = 5
    depth[43:46, 43:46] = 10
    mesh, _ = mesh_of(depth)
    far = mesh.vertices[mesh.faces][..., 2] < -7.5
    assert (far.all(-1) | ~far.any(-1)).all()
