"""Continue the dominant planes behind objects and beyond the picture, where light and reflections would look for them.

Nothing that the picture shows changes: inside the picture only what lies behind the observed surface is added, and
where the picture shows open sky nothing is.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree
from skimage.morphology import convex_hull_image
from trimesh.intersections import slice_faces_plane

from materialist.camera import rays_through, unproject
from materialist.geometry.boundary import grid_faces, joined_faces
from materialist.geometry.planes import Plane, axes
from materialist.types import Array, Camera, Mesh


@dataclass(frozen=True)
class CompletionSettings:
    """Which planes go on, and how far; distances in scene radii (median distance of the surface) unless said."""

    behind: float = 0.01  # part of the depth by which a continuation lies behind the observed surface; tuned by eye
    extent: float = 2.0  # from the plane's visible middle: under the camera and somewhat behind it; tuned by eye
    ground_extent: float = 20.0  # the same for ground under open sky; tuned by eye
    # share of the picture without a surface from which a scene counts as outdoors
    sky_share: float = 0.05
    upward: float = 0.5  # least Y of the normal of a floor, as of `drop`: a table seen from above has 0.6; by eye
    # extent of a wall in its own seen size, beyond the picture; tuned on 8 scenes
    wall_reach: float = 0.8
    # the same for what lies behind things that the picture shows; tuned on 8 scenes
    wall_behind: float = 1.2
    bounding: float = 0.9  # share of the other points in front of a plane from which it bounds the scene (floor, wall)
    touch: float = 0.2  # share of a frame side that a plane must cover to go on across it
    # share of a plane's pixels on one side of another for the planes to stop at each other
    one_side: float = 0.9
    # cells of a continuation along the picture's longer side; at least a pixel each
    cells: int = 256
    # pixels by which the part beyond the frame keeps clear of it, against round-off
    rim: float = 0.01
    cell: float = 0.2  # size of a continuation's cells beyond the frame, part of the distance from its middle; by eye


SETTINGS = CompletionSettings()


@dataclass(frozen=True)
class _Sheet:
    """A plane with what is needed to continue it."""

    index: int
    plane: Plane
    points: Array
    """[N, 3] some of the visible points, dropped onto the plane; scene units."""
    pixels: Array
    """[N] their row-major pixels."""
    bounding: bool
    touches: tuple[bool, ...]
    """[4] whether its pixels reach the frame's bottom, left, right, top."""
    half: float
    """Half a side of the square about its middle that it may fill beyond the picture, scene units."""
    behind: float
    """Radius about its middle within which it goes on behind what the picture shows, scene units."""


def complete(
    mesh: Mesh, planes: list[Plane], depth: Array, camera: Camera, *, walls: bool = False
) -> Mesh:
    """Append the continuations of the planes to the mesh of the depth map.

    mesh: from `depth_to_mesh`, whose faces come first. depth: [H, W] planar scene units, 0 = none.
    walls: whether planes that do not face up go on beyond the picture, too, not only behind what it shows.

    The new faces have face_plane = k for planes[k], face_pixel = the plane's pixel nearest to the face, uv at that
    pixel's centre, and the plane's normal. Planes that intersect stop at each other. Planes that are neither bounds
    of the scene nor cross the frame (the flat side of an object) are left alone.
    """
    depth = np.asarray(depth, np.float64)
    sheets = _sheets(planes, depth, camera)
    parts = [mesh]
    farthest = _farthest_shown(mesh, depth)
    for sheet in sheets:
        stops = _stops(sheet, sheets)  # [S, 4] half-spaces that hold the continuation
        patches = [_inside_frame(sheet, stops, farthest, camera)]  # [Q, 4, 3]
        if walls or sheet.plane.normal[1] >= SETTINGS.upward:
            patches.append(_beyond_frame(sheet, stops, camera))  # [T, 3, 3]
        parts += [_patch(sheet, corners, camera) for corners in patches if len(corners)]
    # Faces keep their order.
    vertices, faces = joined_faces(parts)
    names = ("normals", "uv", "face_pixel", "face_plane")
    others = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return Mesh(vertices, faces, **others)


def _sheets(planes: list[Plane], depth: Array, camera: Camera) -> list[_Sheet]:
    """The planes that are part of the scene's structure, measured."""
    surface = depth > 0
    points = unproject(depth, camera).astype(np.float64)
    radius = float(np.median(np.linalg.norm(points[surface], axis=-1)))
    patches = []
    for index, plane in enumerate(planes):
        # Floors and walls have the others in front of them, up to 2 % of the scene's radius.
        others = points[surface & ~plane.mask]
        bounding = (
            not len(others)
            or np.mean(others @ plane.normal - plane.offset > -0.02 * radius) > SETTINGS.bounding
        )
        sides = plane.mask[-1], plane.mask[:, 0], plane.mask[:, -1], plane.mask[0]
        touches = tuple(bool(side.mean() > SETTINGS.touch) for side in sides)
        # A plane through the camera would cut the view open.
        if -plane.offset < 0.02 * radius or not (bounding or any(touches)):
            continue
        # --- Some of its points, dropped onto the plane ---
        pixels = np.flatnonzero(plane.mask)
        pixels = pixels[:: max(1, len(pixels) // 20_000)]
        flat = points.reshape(-1, 3)[pixels]
        flat = flat - (flat @ plane.normal - plane.offset)[:, None] * plane.normal
        # --- How far it goes on: ground under open sky farthest, walls by their own size ---
        outdoors = np.mean(~surface) > SETTINGS.sky_share and plane.normal[1] > SETTINGS.upward
        half = behind = (SETTINGS.ground_extent if outdoors else SETTINGS.extent) * radius
        if plane.normal[1] < SETTINGS.upward:
            half = min(half, SETTINGS.wall_reach * _size(flat))
            behind = min(behind, SETTINGS.wall_behind * _size(flat))
        patches.append(_Sheet(index, plane, flat, pixels, bool(bounding), touches, half, behind))
    return patches


def _size(points: Array) -> float:
    return float(np.linalg.norm(points - points.mean(0), axis=-1).max())


def _farthest_shown(mesh: Mesh, depth: Array) -> Array:
    """[H, W] smallest inverse depth over the front faces of each pixel (1 / scene unit); 0 where there is no surface.

    Inverse depth is linear in screen space on a triangle, so what lies behind the corners lies behind the face.
    """
    surface = np.flatnonzero(depth.ravel() > 0)
    corners = mesh.vertices[mesh.faces[: 2 * len(surface)], 2].reshape(len(surface), 6)
    farthest = np.zeros(depth.size)
    farthest[surface] = 1 / (-corners).max(1)
    return farthest.reshape(depth.shape)


def _stops(sheet: _Sheet, sheets: list[_Sheet]) -> Array:
    """[S, 4] half-spaces a . p + b >= 0: one for each other plane that the sheet's pixels lie on one side of."""
    walls = [np.zeros((0, 4))]
    for other in sheets:
        if other is sheet:
            continue
        height = sheet.points @ other.plane.normal - other.plane.offset  # [N] above the other plane
        share = float(np.mean(height > 0))
        if max(share, 1 - share) >= SETTINGS.one_side:
            sign = 1 if share > 0.5 else -1
            walls.append(sign * np.array([[*other.plane.normal, -other.plane.offset]]))
    if sheet.plane.normal[1] < SETTINGS.upward:
        walls.append(np.array([[0.0, 0, -1, 0]]))  # in front of the camera
    return np.concatenate(walls)


def _inside_frame(sheet: _Sheet, walls: Array, farthest: Array, camera: Camera) -> Array:
    """[Q, 4, 3] corners of the quads that continue the plane behind what the picture shows, scene units."""
    # --- The plane at the corners of screen cells ---
    height, width = farthest.shape
    cell = max(1, max(height, width) // SETTINGS.cells)
    xs, ys = (np.unique(np.append(np.arange(0, n, cell), n)) for n in (width, height))
    rays = rays_through(np.stack(np.meshgrid(xs, ys), -1), camera)  # [h+1, w+1, 3]
    # [h+1, w+1] inverse depth of the plane; <= 0 where a ray never meets it.
    reach = rays @ (sheet.plane.normal / sheet.plane.offset)
    points = rays / np.maximum(reach, 1e-9)[..., None]
    allowed = (reach > 0) & ((points @ walls[:, :3].T + walls[:, 3]) >= 0).all(-1)
    close = (reach > 0) & (np.linalg.norm(points - sheet.points.mean(0), axis=-1) < sheet.behind)
    # --- Cells that lie behind all that their pixels show ---
    reach4, allowed4, close4, points4 = (  # [h, w, 4, ...] counter-clockwise seen from the camera
        np.stack([g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]], 2)
        for g in (reach, allowed, close, points)
    )
    # On the plane's own pixels there is nothing to add: no inverse depth is below 0.
    hidden = np.where(sheet.plane.mask, 0, farthest)
    # [h, w] the farthest in each cell.
    hidden = np.minimum.reduceat(np.minimum.reduceat(hidden, ys[:-1], 0), xs[:-1], 1)
    # A cell half beyond a stop stays: the planes then overlap by a cell instead of leaving a slit.
    keep = close4.all(-1) & allowed4.any(-1) & (reach4.max(-1) < (1 - SETTINGS.behind) * hidden)
    if not sheet.bounding:
        # A table top is continued between its own pixels only.
        hull = convex_hull_image(sheet.plane.mask)
        keep &= hull[np.ix_((ys[:-1] + ys[1:]) // 2, (xs[:-1] + xs[1:]) // 2)]
    return points4[keep]


def _beyond_frame(sheet: _Sheet, walls: Array, camera: Camera) -> Array:
    """[T, 3, 3] triangles of the plane outside the view frustum, scene units."""
    # --- A grid on the plane, about the middle of what is seen of it ---
    origin = sheet.points.mean(0)
    spread = float(np.linalg.norm(sheet.points - origin, axis=-1).mean())
    reach = np.arcsinh(sheet.half / spread)
    # Cells grow with the distance from the middle, from as far away as the visible points are in the mean.
    along = spread * np.sinh(
        np.linspace(-reach, reach, 2 * int(np.ceil(reach / SETTINGS.cell)) + 1)
    )
    places = np.stack(np.meshgrid(along, -along), -1).reshape(-1, 2)
    rest = origin + places @ axes(sheet.plane.normal), grid_faces(len(along), len(along))
    # --- Without what lies beyond other planes ---
    for wall in walls:
        rest = _cut(rest, wall)
    # --- Its part outside of the view, one side of the frame after the other ---
    side_x = (camera.width / 2 + SETTINGS.rim) / camera.focal
    side_y = (camera.height / 2 + SETTINGS.rim) / camera.focal
    # a . p >= 0 inside the frustum: bottom, left, right, top
    frustum = np.array(
        [[0.0, 1, -side_y, 0], [1, 0, -side_x, 0], [-1, 0, -side_x, 0], [0, -1, -side_y, 0]]
    )
    pieces = [np.zeros((0, 3, 3))]
    for inward, touched in zip(frustum, sheet.touches):
        if sheet.bounding or touched:
            points, faces = _cut(rest, -inward)
            pieces.append(points[faces])
        rest = _cut(rest, inward)  # what is beyond this side is done; go on with the rest
    return np.concatenate(pieces)


def _cut(surface: tuple[Array, Array], half_space: Array) -> tuple[Array, Array]:
    """The part of a surface (points [V, 3], faces [F, 3]) in a half-space [4], a . p + b >= 0."""
    normal = half_space[:3]
    offset = half_space[3]
    points, faces, _ = slice_faces_plane(*surface, normal, -offset / (normal @ normal) * normal)
    return points, faces


def _patch(sheet: _Sheet, corners: Array, camera: Camera) -> Mesh:
    """A Mesh of polygons [N, 3 or 4, 3] (scene units), each with its own vertices and the plane's nearest pixel."""
    count, sides = corners.shape[:2]
    triangles = np.array([[0, 1, 2], [0, 2, 3]][: sides - 2])
    nearest = sheet.pixels[cKDTree(sheet.points).query(corners.mean(1))[1]]  # [N]
    # The centre of that pixel: the face looks like it.
    uv = np.stack(
        [
            (nearest % camera.width + 0.5) / camera.width,
            (nearest // camera.width + 0.5) / camera.height,
        ],
        -1,
    )
    vertices = corners.reshape(-1, 3).astype(np.float32)
    return Mesh(
        vertices=vertices,
        faces=(np.arange(count)[:, None, None] * sides + triangles).reshape(-1, 3).astype(np.int32),
        normals=np.tile(sheet.plane.normal.astype(np.float32), (len(vertices), 1)),
        uv=np.repeat(uv, sides, 0).astype(np.float32),
        face_pixel=np.repeat(nearest, len(triangles)).astype(np.int32),
        face_plane=np.full(count * len(triangles), sheet.index, np.int16),
    )
