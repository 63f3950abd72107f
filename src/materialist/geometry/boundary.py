"""Depth map to triangle mesh with duplicated boundaries (paper, Mesh Reconstruction).

Every pixel with a surface is one quad whose vertices sit at the pixel's corners. Where surfaces part, a corner holds
one vertex per surface (the paper's duplication), and the farther surface is continued under the nearer one by a pixel,
so that no ray through the picture passes between them. See docs/geometry.md for why corners and not centres.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from materialist.camera import rays_through
from materialist.errors import InputError
from materialist.geometry.cuts import Cuts, find_cuts
from materialist.options import TAU
from materialist.types import Array, Camera, Mesh


@dataclass(frozen=True)
class BoundarySettings:
    """How far depth is carried on to the corners of pixels, and under the foreground; tuned by eye."""

    # inverse depth at a pixel's corner stays within this factor of the pixel's own
    extrapolation: float = 2.0
    behind: float = 1e-3  # part of the depth by which a continued background lies behind the foreground, at least
    # pixels, at most, by which a tuck that had to leave the background's vertex reaches under it
    overlap: float = 0.02
    least_facing: float = 0.02  # least n . v of shading normals (89 degrees), so that every visible point can be shaded


SETTINGS = BoundarySettings()
# Corner slots of a pixel, and pixel slots around a grid corner, in reading order.
TOP_LEFT, TOP_RIGHT, BOTTOM_LEFT, BOTTOM_RIGHT = range(4)
QUAD = np.array([[TOP_LEFT, BOTTOM_LEFT, BOTTOM_RIGHT], [TOP_LEFT, BOTTOM_RIGHT, TOP_RIGHT]])
"""[2, 3] the two triangles of a pixel, counter-clockwise seen from the camera."""


def grid_faces(rows: int, columns: int) -> Array:
    """[F, 3] the triangles of a grid of rows x columns points, counter-clockwise where rows run downwards."""
    index = np.arange(rows * columns).reshape(rows, columns)
    cells = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]], -1)
    return cells.reshape(-1, 4)[:, QUAD].reshape(-1, 3)


def joined_faces(parts: Sequence[Any]) -> tuple[Array, Array]:
    """Vertices [V, 3] and faces [F, 3] int32 of several meshes or bodies as one; faces keep their order."""
    first = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, first)]).astype(
        np.int32
    )
    return np.concatenate([part.vertices for part in parts]), faces


def depth_to_mesh(depth: Array, normal: Array, camera: Camera, *, tau: float = TAU) -> Mesh:
    """Turn a depth map into a mesh with clean occlusion boundaries.

    depth: [H, W] planar depth along -Z, scene units; 0 where there is no surface (left open).
    normal: [H, W, 3] unit, camera frame; becomes the vertices' shading normals.
    tau: grazing angle in degrees, in (0, 90), below which a step in depth is an occlusion boundary (paper: 6).

    Faces come row-major by pixel, two for each pixel with a surface, then the continued background ("tucks"), which the
    camera never sees. `uv` is the screen position, except on tucks, where it is the centre of the pixel they continue.
    Raises InputError for wrong shapes, NaN, negative depth, no surface at all, or tau out of range.
    """
    depth, normal = check_maps(depth, normal, camera)
    if not 0 < tau < 90:
        raise InputError(
            f"The grazing angle tau is {tau} degrees; choose one between 0 and 90 (the paper uses 6)."
        )
    cuts = find_cuts(depth, camera, tau, normal)
    # Inverse depth, 1 / scene unit: [H, W] of the pixels, and [H, W, 4] at their corners.
    inverse = np.where(depth > 0, 1 / np.where(depth > 0, depth, 1), 0).astype(np.float64)
    reach = corner_inverse_depth(inverse, cuts)
    vertex = corner_vertices(depth > 0, cuts)
    return _assemble(inverse, normal, camera, cuts, vertex, reach)


def check_maps(depth: Array, normal: Array, camera: Camera) -> tuple[Array, Array]:
    """Validate depth [H, W] (scene units) and normal [H, W, 3]: float64 and float32 copies, or InputError."""
    depth = np.asarray(depth, np.float64)
    normal = np.asarray(normal, np.float32)
    size = (camera.height, camera.width)
    if depth.shape != size:
        raise InputError(
            f"The depth map is {depth.shape} but the camera is {size} (H, W); make them the same."
        )
    if normal.shape != (*size, 3):
        raise InputError(
            f"The normal map is {normal.shape} but the camera needs {(*size, 3)}; make them the same."
        )
    if not np.isfinite(depth).all():
        bad = np.count_nonzero(~np.isfinite(depth))
        raise InputError(
            f"The depth map has {bad} NaN or infinite values; set them to 0 (no surface)."
        )
    if depth.min() < 0:
        raise InputError(
            f"The depth map goes down to {depth.min():g}; depth must be >= 0, with 0 for no surface."
        )
    if not depth.any():
        raise InputError(
            "The depth map is 0 everywhere, so there is no surface to build; check the depth prediction."
        )
    if not np.isfinite(normal[depth > 0]).all():
        raise InputError(
            "The normal map has NaN or infinite values on the surface; replace them by unit vectors."
        )
    return depth, normal


def corner_vertices(surface: Array, cuts: Cuts) -> Array:
    """[H, W, 4] int64 vertex index at each corner of each pixel, numbered by grid corner, -1 where there is no surface.

    Around a grid corner the up to four pixels fall into connected components under the links between them; each
    component has its own vertex. surface: [H, W] bool.
    """
    # Which of a corner's four pixels have a surface, and which pairs of them are linked: [H+1, W+1] each.
    before = (1, 0)
    after = (0, 1)
    both = (1, 1)
    pixels = np.stack([np.pad(surface, sides) for sides in product((before, after), repeat=2)], -1)
    linked = [
        (TOP_LEFT, TOP_RIGHT, np.pad(cuts.link_x, (before, both))),
        (BOTTOM_LEFT, BOTTOM_RIGHT, np.pad(cuts.link_x, (after, both))),
        (TOP_LEFT, BOTTOM_LEFT, np.pad(cuts.link_y, (both, before))),
        (TOP_RIGHT, BOTTOM_RIGHT, np.pad(cuts.link_y, (both, after))),
    ]
    # --- Connected components: each of the four slots takes the smallest one it is linked to ---
    component = np.broadcast_to(np.arange(4), pixels.shape).copy()
    for _ in range(3):  # the longest chain has three links
        for a, b, link in linked:
            pair = component[..., [a, b]]
            component[..., [a, b]] = np.where(link[..., None], pair.min(-1, keepdims=True), pair)
    # --- One vertex a component, numbered by its smallest slot ---
    leads = pixels & (component == np.arange(4))
    number = (np.cumsum(leads) - 1).reshape(leads.shape)
    index = np.where(pixels, np.take_along_axis(number, component, -1), -1)
    # --- From the slots around grid corners to the corners of pixels ---
    upper = index[:-1, :-1, BOTTOM_RIGHT], index[:-1, 1:, BOTTOM_LEFT]
    return np.stack([*upper, index[1:, :-1, TOP_RIGHT], index[1:, 1:, TOP_LEFT]], -1)


def corner_inverse_depth(inverse: Array, cuts: Cuts) -> Array:
    """[H, W, 4] inverse depth at the corners of each pixel, extrapolated from its centre with its own gradient.

    inverse: [H, W] 1 / scene unit. The gradient is that of `_half_step` (exact on planes), and
    the result stays within a factor of the centre's value.
    """
    half_x = _half_step(inverse, cuts.link_x)  # [H, W] change over half a pixel to the right
    half_y = _half_step(inverse.T, cuts.link_y.T).T  # [H, W] ... downwards
    corners = (
        np.stack([-half_x - half_y, half_x - half_y, half_y - half_x, half_x + half_y], -1)
        + inverse[..., None]
    )
    return np.clip(
        corners,
        inverse[..., None] / SETTINGS.extrapolation,
        inverse[..., None] * SETTINGS.extrapolation,
    )


def _half_step(inverse: Array, link: Array) -> Array:
    """[H, W] half the mean step to the linked horizontal neighbours; 0 without any.

    Where both go one way, it is at most twice the smaller one (van Leer's monotonized central slope): beside a steep
    step the corner would stick out towards the camera.
    """
    step = np.where(link, np.diff(inverse, axis=1), 0)
    left, right = (np.pad(step, ((0, 0), side)) for side in ((1, 0), (0, 1)))
    count = np.pad(link, ((0, 0), (1, 0))).astype(int) + np.pad(link, ((0, 0), (0, 1)))
    # Only steps that go the same way limit the slope.
    least = np.where(left * right > 0, np.minimum(np.abs(left), np.abs(right)), np.inf)
    mean = (left + right) / np.maximum(count, 1)
    return 0.5 * np.where(count == 2, np.clip(mean, -2 * least, 2 * least), mean)


def _assemble(
    inverse: Array, normal: Array, camera: Camera, cuts: Cuts, vertex: Array, reach: Array
) -> Mesh:
    """Front faces and tucks as one Mesh; arrays as in `depth_to_mesh`."""
    height, width = inverse.shape
    surface = inverse > 0
    # --- Front vertices: depth and normal are means over the pixels that meet there ---
    ids = vertex[surface]  # [P, 4] for the P pixels with a surface
    count = int(ids.max()) + 1
    weight = np.bincount(ids.ravel(), minlength=count)  # [V] pixels that meet in each vertex
    mean_inverse = np.bincount(ids.ravel(), reach[surface].ravel(), count) / weight  # [V]
    screen = np.empty((count, 2), np.int64)  # [V, 2] column and row of the grid corner
    rows, columns = np.nonzero(surface)
    for slot in range(4):
        screen[ids[:, slot], 0] = columns + slot % 2
        screen[ids[:, slot], 1] = rows + slot // 2
    points = rays_through(screen, camera) / mean_inverse[:, None]  # [V, 3]
    normals = np.stack(
        [np.bincount(ids.ravel(), np.repeat(normal[surface][:, k], 4), count) for k in range(3)], -1
    )
    # --- Front faces: two triangles a pixel ---
    faces = ids[:, QUAD].reshape(-1, 3)  # [2P, 3]
    pixel = np.repeat(rows * width + columns, 2)

    # --- Tucks: quads of their own vertices, which look like the background pixel ---
    tuck_screen, tuck_inverse, back = _tucks(surface, cuts, vertex, reach, mean_inverse)
    tuck_points = (rays_through(tuck_screen, camera) / tuck_inverse[..., None]).reshape(-1, 3)
    tuck_normals = np.repeat(normal.reshape(-1, 3)[back], 4, axis=0)
    tuck_uv = np.repeat(
        np.stack([(back % width + 0.5) / width, (back // width + 0.5) / height], -1), 4, axis=0
    )
    tuck_faces = (count + np.arange(len(back))[:, None, None] * 4 + QUAD).reshape(-1, 3)
    points = np.concatenate([points, tuck_points])
    return Mesh(
        vertices=points.astype(np.float32),
        faces=np.concatenate([faces, tuck_faces]).astype(np.int32),
        normals=face_camera(np.concatenate([normals, tuck_normals]), points),
        uv=np.concatenate([screen / (width, height), tuck_uv]).astype(np.float32),
        face_pixel=np.concatenate([pixel, np.repeat(back, 2)]).astype(np.int32),
        face_plane=np.full(len(faces) + len(tuck_faces), -1, np.int16),
    )


def _tucks(
    surface: Array, cuts: Cuts, vertex: Array, reach: Array, mean_inverse: Array
) -> tuple[Array, Array, Array]:
    """Continue the farther surface of every cut pair under the nearer pixel, over the whole of that pixel.

    Returns screen corners [T, 4, 2] (column, row), inverse depth there [T, 4], and the row-major background pixel [T].
    On the shared edge a tuck takes the background's own vertices, so that the two join without a seam.
    """
    width = surface.shape[1]
    # --- Which corners of the nearer pixel are corners of the farther one, too ---
    front, back, offset = _parted_pairs(surface, cuts, reach.mean(-1))
    flat_vertex = vertex.reshape(-1, 4)
    flat_reach = reach.reshape(-1, 4)
    corner = np.arange(4)
    # Corner c of the front pixel lies at this corner of the back pixel when it is shared, else beyond it.
    column = corner % 2 + offset[:, :1]  # [T, 4] 0 or 1 inside the back pixel
    row = corner // 2 + offset[:, 1:]
    shared = (column >= 0) & (column <= 1) & (row >= 0) & (row <= 1)  # [T, 4]
    slot = np.where(shared, 2 * np.clip(row, 0, 1) + np.clip(column, 0, 1), 0)
    # [T, 4] the background's vertex at shared corners.
    joint = np.take_along_axis(flat_vertex[back], slot, 1)
    # --- Depth of the background over the whole of the nearer pixel ---
    # Beyond the back pixel its corner values go on linearly: in x the far side is 2 * near - opposite, and so in y.
    grid = flat_reach[back].reshape(-1, 2, 2)
    slope_x = (grid[:, :, 1] - grid[:, :, 0]).mean(1, keepdims=True)  # [T, 1] per pixel
    slope_y = (grid[:, 1] - grid[:, 0]).mean(1, keepdims=True)
    centre = grid.mean((1, 2))[:, None]
    beyond = centre + slope_x * (column - 0.5) + slope_y * (row - 0.5)
    beyond = np.clip(beyond, centre / SETTINGS.extrapolation, centre * SETTINGS.extrapolation)
    inverse = np.where(shared, mean_inverse[joint], beyond)
    # --- Where that would come in front, the tuck passes under the nearer surface ---
    front_vertex = flat_vertex[front]  # [T, 4]
    # At the tip of a cut both surfaces have this vertex in common.
    tip = shared & (joint == front_vertex)
    limit = mean_inverse[front_vertex] * np.where(tip, 1, 1 - SETTINGS.behind)
    loose = shared & (inverse > limit)
    # So moved, such a corner must stay behind the front face carried on to there, whose slope is at most this.
    slope = np.ptp(mean_inverse[front_vertex], axis=1, keepdims=True)
    # Less on a steep face: its inverse depth would pass through 0, and the tuck behind the camera.
    overlap = np.minimum(SETTINGS.overlap, limit / np.maximum(4 * slope, 1e-300)) * loose
    inverse = np.minimum(inverse, limit - 2 * overlap * slope)
    # A cut whose both ends are tips has not opened: there is no gap to close.
    torn = (shared & ~tip).any(1)
    screen = np.stack(
        [front[:, None] % width + corner % 2, front[:, None] // width + corner // 2], -1
    )
    # Diagonally, a moved corner would come out beside the nearer pixel.
    straight = (offset == 0).any(1)
    screen = screen - (overlap * straight[:, None])[..., None] * offset[:, None]
    return screen[torn], inverse[torn], back[torn]


def _parted_pairs(surface: Array, cuts: Cuts, inverse: Array) -> tuple[Array, Array, Array]:
    """Nearer and farther pixel [T] of pairs whose surfaces may part, and the step (x, y) to the nearer one [T, 2].

    All cut pairs, and the diagonal ones next to a cut: else round-off opens a pinhole where the rim turns a corner.
    """
    height, width = surface.shape
    index = np.arange(height * width).reshape(height, width)
    cut = np.zeros((height - 1, width - 1), bool)  # 2x2 blocks with a cut in them
    cut |= cuts.cut_x[:-1] | cuts.cut_x[1:] | cuts.cut_y[:, :-1] | cuts.cut_y[:, 1:]
    falling = cut & surface[:-1, :-1] & surface[1:, 1:]
    rising = cut & surface[:-1, 1:] & surface[1:, :-1]
    # First pixel, second pixel, and the step (x, y) from one to the other.
    pairs = [
        (index[:, :-1][cuts.cut_x], index[:, 1:][cuts.cut_x], (1, 0)),
        (index[:-1][cuts.cut_y], index[1:][cuts.cut_y], (0, 1)),
        (index[:-1, :-1][falling], index[1:, 1:][falling], (1, 1)),
        (index[:-1, 1:][rising], index[1:, :-1][rising], (-1, 1)),
    ]
    first, second = (np.concatenate([pair[k] for pair in pairs]) for k in (0, 1))
    step = np.concatenate([np.tile(pair[2], (len(pair[0]), 1)) for pair in pairs])
    # The nearer one has the larger inverse depth.
    nearer = inverse.ravel()[second] > inverse.ravel()[first]
    front = np.where(nearer, second, first)
    back = np.where(nearer, first, second)
    return front, back, np.where(nearer[:, None], step, -step)


def face_camera(normals: Array, points: Array) -> Array:
    """[N, 3] float32 unit normals, turned by the least amount that lets them face the camera at the origin.

    Zero-length normals become the view direction. points: [N, 3] scene units.
    """
    view = -points / np.maximum(np.linalg.norm(points, axis=-1, keepdims=True), 1e-300)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    unit = np.where(length > 1e-6, normals / np.maximum(length, 1e-6), view)
    facing = (unit * view).sum(-1, keepdims=True)
    # The turn is in the plane of normal and view, to n . v = `least_facing`.
    aside = unit - facing * view
    aside_length = np.linalg.norm(aside, axis=-1, keepdims=True)
    turned = SETTINGS.least_facing * view + np.sqrt(
        1 - SETTINGS.least_facing**2
    ) * aside / np.maximum(aside_length, 1e-6)
    # A normal that points straight away has no nearest turn; it is taken as flipped.
    turned = np.where(aside_length > 1e-6, turned, view)
    unit = np.where(facing < SETTINGS.least_facing, turned, unit)
    return (unit / np.linalg.norm(unit, axis=-1, keepdims=True)).astype(np.float32)
