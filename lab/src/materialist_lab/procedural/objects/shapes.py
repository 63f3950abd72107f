"""Procedural triangle meshes with texture coordinates: closed solids, and sheets and tubes."""

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator

from materialist.camera import unit
from materialist.errors import InputError
from materialist.geometry.boundary import joined_faces
from materialist.render.variant import setup
from materialist.types import Array, Triangles


class Solid(Triangles):
    """A surface in the frame of its scene (+Y up, metres), float64; the closed ones stand on y = 0.

    Textures repeat outside [0, 1].
    """


def box(size: Array) -> Solid:
    """Sharp box of extent `size` [3] standing on y = 0; the texture covers each side once."""
    sides = []
    for axis in range(3):
        u = np.eye(3)[(axis + 1) % 3]
        v = np.eye(3)[(axis + 2) % 3]
        # Turning one edge round with the sign keeps right x up pointing outwards.
        for sign in (-1, 1):
            corner = (sign * (np.eye(3)[axis] - u) - v) / 2
            sides.append(panel(corner * size, sign * u * size, v * size, (1, 1)))
    return grounded(joined(sides))


def superquadric(size: Array, e1: float, e2: float, n: int = 64) -> Solid:
    """Superellipsoid of extent `size` [3]: exponents 1 are an ellipsoid, towards 0 a box, (0.1, 1) a cylinder."""

    def power(x, e):
        return np.sign(x) * np.abs(x) ** e

    # Samples bunch up at the corners of small exponents when the angle is spaced evenly: space them by the exponent.
    t = np.linspace(-1, 1, n + 1)
    eta = (np.pi / 2 * power(t, 1 / max(e1, 0.3) if e1 < 1 else 1))[:, None]
    omega = np.linspace(-np.pi, np.pi, 2 * n + 1)[None, :]
    x = power(np.cos(eta), e1) * power(np.cos(omega), e2)
    z = power(np.cos(eta), e1) * power(np.sin(omega), e2)
    y = np.broadcast_to(power(np.sin(eta), e1), x.shape)
    solid = _grid(np.stack([x, y, z], -1) * np.asarray(size) / 2)
    return replace(solid, vertices=solid.vertices + np.array([0, size[1] / 2, 0]))


def lathe(profile: Array, n: int = 96) -> Solid:
    """Surface of revolution of a profile [P, 2] (radius, height), walked upwards on the outside, y up."""
    phi = np.linspace(0, 2 * np.pi, n + 1)
    radius = profile[:, :1]
    height = profile[:, 1:]
    x = radius * np.cos(phi)
    z = radius * np.sin(phi)
    return _grid(np.stack(np.broadcast_arrays(x, height, z), axis=-1))


def capsule(radius: float, length: float) -> Solid:
    """Upright capsule: a cylinder of `length` between two half spheres."""
    t = np.linspace(-np.pi / 2, 0, 20)
    lower = np.stack([np.cos(t), np.sin(t)], -1) * radius + [0, radius]
    upper = np.stack([np.cos(-t[::-1]), np.sin(-t[::-1])], -1) * radius + [0, radius + length]
    return lathe(np.concatenate([lower, upper]))


def vessel(control: Array, thickness: float) -> Solid:
    """Open vase, cup or bowl: a smooth wall through `control` [K, 2] (radius, height), with an inside and a rim."""
    # A monotone cubic through the control points never overshoots them.
    height = np.linspace(control[0, 1], control[-1, 1], 48)
    radius = PchipInterpolator(control[:, 1], control[:, 0])(height)
    inner = np.maximum(radius - thickness, np.minimum(0.02, radius / 2))
    # The inside begins above the bottom, which is as thick as the wall.
    keep = height > thickness
    # The rim is a half circle from the outside to the inside.
    t = np.linspace(0, np.pi, 8)[1:-1, None]
    middle = [radius[-1] - thickness / 2, height[-1]]
    rim = np.concatenate([np.cos(t), np.sin(t)], -1) * thickness / 2 + middle
    # The outline, walked from the middle of the bottom over the outside to the middle of the floor.
    outside = np.stack([radius, height], -1)
    inside = np.stack([inner, height], -1)[keep][::-1]
    bottom = np.stack([np.linspace(0, radius[0], 6), np.zeros(6)], -1)[:-1]
    floor = np.stack([np.linspace(inside[-1, 0], 0, 6), np.full(6, inside[-1, 1])], -1)[1:]
    return lathe(np.concatenate([bottom, outside, rim, inside, floor]))


def panel(origin: ArrayLike, right: Array, up: Array, repeat: tuple[float, float]) -> Solid:
    """Rectangle from `origin` along `right` and `up` (all [3]), facing right x up, its texture repeated."""
    solid = sheet(origin, right, up)
    return replace(solid, uv=np.array([[0, 0], [0, 1], [1, 0], [1, 1]]) * repeat)


@lru_cache(maxsize=40)
def load(path: Path) -> Solid:
    """A PLY mesh, stood on y = 0 with longest side 1, smooth normals, and a texture wrapped around its Y axis.

    Raises InputError when it is damaged, or has no faces or no size.
    """
    # Mitsuba needs a variant before it reads anything.
    setup()
    try:
        params = mi.traverse(mi.load_dict({"type": "ply", "filename": str(path)}))
        vertices = np.array(params["vertex_positions"], np.float64).reshape(-1, 3)
        faces = np.array(params["faces"], np.int32).reshape(-1, 3)
        used = vertices[faces]
    except (RuntimeError, LookupError, ValueError) as error:
        raise InputError(
            f"The mesh {path} cannot be read; mend it, or take it out of the folder."
        ) from error
    if not len(faces) or not 0 < np.ptp(used, axis=(0, 1)).max() < np.inf:
        raise InputError(
            f"The mesh {path} has no faces, or no size; mend it, or take it out of the folder."
        )
    # On the ground, its longest side 1.
    low = vertices.min(0)
    high = vertices.max(0)
    base = [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]
    vertices = (vertices - base) / (high - low).max()
    normals = _exact_normals(vertices, faces)
    # Each face gets corners of its own, so that the texture can close around the axis without a seam.
    corners = vertices[faces]  # [F, 3, 3]
    u = np.arctan2(corners[..., 2], corners[..., 0]) / (2 * np.pi) + 0.5
    # A face across the seam: its small u belong to the next turn.
    u = np.where((np.ptp(u, axis=1, keepdims=True) > 0.5) & (u < 0.5), u + 1, u)
    uv = np.stack([u, corners[..., 1]], -1).reshape(-1, 2)
    corner_faces = np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
    return Solid(corners.reshape(-1, 3), corner_faces, normals[faces].reshape(-1, 3), uv)


def placed(
    solid: Solid, *, scale: float = 1.0, turn: float = 0.0, at: tuple[float, float] = (0.0, 0.0)
) -> Solid:
    """The solid as `moved` to (x, z) on the ground, its texture as many times on it as before."""
    return replace(moved(solid, (at[0], 0, at[1]), turn, scale=scale), uv=solid.uv)


def _grid(points: Array) -> Solid:
    """Mesh of a parametric grid [n, m, 3] whose last column repeats the first; u along columns, v along rows."""
    n, m = points.shape[:2]
    faces = _grid_triangles(n, m)
    vertices = points.reshape(-1, 3).astype(np.float64)
    # The triangles at poles have no area, and so no normal.
    area = np.linalg.norm(face_normals(vertices, faces), axis=-1)
    faces = faces[area > 1e-12]
    u, v = np.meshgrid(np.linspace(0, 1, m), np.linspace(0, 1, n))
    uv = np.stack([2 * u, v], -1).reshape(-1, 2)
    return Solid(vertices, faces, _exact_normals(vertices, faces), uv)


def _grid_triangles(n: int, m: int, flip: bool = False) -> Array:
    """[2 (n - 1)(m - 1), 3] int32 triangles of an n x m grid of vertices, rows along the first axis."""
    index = np.arange(n * m).reshape(n, m)
    a = index[:-1, :-1]
    b = index[1:, :-1]
    c = index[1:, 1:]
    d = index[:-1, 1:]
    lower = np.stack([a, b, c], -1).reshape(-1, 3)
    upper = np.stack([a, c, d], -1).reshape(-1, 3)
    faces = np.concatenate([lower, upper])
    return (faces[:, ::-1] if flip else faces).astype(np.int32)


def face_normals(vertices: Array, faces: Array) -> Array:
    """[F, 3] normals of triangles, of length twice their area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _exact_normals(vertices: Array, faces: Array) -> Array:
    """[V, 3] area-weighted unit normals, shared by vertices at one place (seams and poles stay invisible)."""
    # Vertices that agree to a millionth of the mesh's size are one place.
    scale = np.ptp(vertices, axis=0).max()
    keys = np.round(vertices / scale * 1e6).astype(np.int64)
    _, place = np.unique(keys, axis=0, return_inverse=True)
    place = place.reshape(-1)
    flat = np.tile(face_normals(vertices, faces), (3, 1))
    corners = place[faces].T.ravel()
    return vertex_normals(corners, flat)[place]


def vertex_normals(corners: Array, normals: Array) -> Array:
    """[N, 3] unit sums of the normals [C, 3] of faces at their corners [C], which are numbers of places."""
    total = np.stack([np.bincount(corners, normals[:, k]) for k in range(3)], -1)
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    return np.where(length > 0, total / np.maximum(length, 1e-30), [0, 1, 0])


def slab(size: ArrayLike, radius: float = 0.0) -> Solid:
    """Box of extent `size` [3] standing on y = 0 with edges rounded by `radius`; texture coordinates in metres."""
    half = np.asarray(size, float) / 2
    radius = float(min(radius, 0.95 * half.min()))
    # Towards the edge the grid crowds as tan, so that the arc it is pushed onto has even steps.
    bend = radius * np.tan(np.linspace(0, np.pi / 4, 4)) if radius > 0 else np.zeros(1)
    # Positions of the grid along each axis: `bend` crowds at both ends.
    lines = []
    for h in half:
        tips = h - radius + bend
        lines.append(np.concatenate([-tips[::-1], tips]))
    sides = []
    for axis, u, v in ((0, 2, 1), (1, 0, 2), (2, 0, 1)):  # v is the vertical of upright sides
        a, b = np.meshgrid(lines[u], lines[v], indexing="ij")
        for sign in (-1.0, 1.0):
            p = np.empty((*a.shape, 3))
            p[..., axis] = sign * half[axis]
            p[..., u] = a
            p[..., v] = b
            # Edges are round where the box is a smaller one, `inner`, grown by a ball.
            inner = np.clip(p, -(half - radius), half - radius)
            normal = p - inner if radius > 0 else np.eye(3)[axis] * sign + np.zeros_like(p)
            normal = (normal / np.linalg.norm(normal, axis=-1, keepdims=True)).reshape(-1, 3)
            vertices = inner.reshape(-1, 3) + radius * normal
            # Faces must look outwards, whichever way (u, v, axis) turns.
            mirrored = np.linalg.det(np.eye(3)[[u, v, axis]]) * sign < 0
            faces = _grid_triangles(len(a), a.shape[1], mirrored)
            uv = np.stack([a, b], -1).reshape(-1, 2)
            sides.append(Solid(vertices, faces, normal, uv))
    return moved(joined(sides), (0, half[1], 0))


def sheet(origin: ArrayLike, right: ArrayLike, up: ArrayLike, n: int = 1) -> Solid:
    """Rectangle from `origin` along `right` and `up` (all [3], metres), facing right x up, in n x n pieces."""
    right = np.asarray(right, float)
    up = np.asarray(up, float)
    t = np.linspace(0, 1, n + 1)
    a, b = np.meshgrid(t, t, indexing="ij")
    vertices = np.asarray(origin) + a[..., None] * right + b[..., None] * up
    normal = np.cross(right, up)
    normal = np.broadcast_to(normal / np.linalg.norm(normal), vertices.shape)
    # Texture coordinates in metres.
    uv = np.stack([a * np.linalg.norm(right), b * np.linalg.norm(up)], -1)
    faces = _grid_triangles(n + 1, n + 1)
    return Solid(vertices.reshape(-1, 3), faces, normal.reshape(-1, 3).copy(), uv.reshape(-1, 2))


def warped(solid: Solid, function) -> Solid:
    """The solid with its vertices [V, 3] sent through `function`, and new smooth normals."""
    vertices = function(solid.vertices)
    # Seams stay closed: vertices share a normal where they lay together before.
    normals = smooth_normals(vertices, solid.faces, solid.vertices)
    return replace(solid, vertices=vertices, normals=normals)


def smooth_normals(vertices: Array, faces: Array, places: Array | None = None) -> Array:
    """[V, 3] area-weighted unit normals, shared by the vertices at one of `places` [V, 3] (their own).

    Faster and coarser than `_exact_normals`; the photographs of the benches depend on the last bit of both.
    """
    places = vertices if places is None else places
    scale = max(float(np.ptp(places, axis=0).max()), 1e-9)
    # Three rounded coordinates in one integer, of 21 bits each: sorting one column is fast.
    keys = np.round(places / scale * 1e5).astype(np.int64) @ np.array([1, 2**21, 2**42])
    _, place = np.unique(keys, return_inverse=True)
    flat = np.repeat(face_normals(vertices, faces), 3, axis=0)
    return vertex_normals(place[faces].ravel(), flat)[place]


def lumps(rng: np.random.Generator, amount: float, waves: float, count: int = 6):
    """A function [..., 3] -> [...] of smooth noise with about that amplitude and that many waves a metre."""
    # A sum of sines of random direction, length and phase; 1 / sqrt(count) keeps its power.
    wave = rng.normal(size=(count, 3)) * waves * 2 * np.pi / np.sqrt(3)
    phase = rng.uniform(0, 2 * np.pi, count)
    weight = rng.uniform(0.4, 1, count) * amount / np.sqrt(count)
    return lambda p: np.sin(p @ wave.T + phase) @ weight


def ball(n: int = 48) -> Solid:
    """Unit sphere about the origin; texture coordinates in metres at its equator."""
    t = np.linspace(-np.pi / 2, np.pi / 2, n // 2 + 1)
    sphere = lathe(np.stack([np.maximum(np.cos(t), 0), np.sin(t)], -1), n)
    return replace(sphere, uv=sphere.uv * [np.pi, np.pi])


def blob(rng: np.random.Generator, size: ArrayLike, roughness: float, n: int = 48) -> Solid:
    """Smooth lumpy body of about extent `size` [3] standing on y = 0: stones, fruit, bread, bushes."""
    # Large lumps and, on them, finer ones.
    bump = lumps(rng, roughness, 0.35)
    fine = lumps(rng, roughness * 0.35, 1.2)
    half = np.asarray(size, float) / 2
    body = warped(ball(n), lambda p: p * (1 + bump(p) + fine(p))[..., None] * half)
    return grounded(replace(body, uv=body.uv * half.mean()))


def torus(major: float, minor: float, n: int) -> Solid:
    """A ring about the Y axis, its tube of n sides; texture coordinates in metres."""
    phi = np.linspace(0, 2 * np.pi, n + 1)
    ring = lathe(np.stack([major + minor * np.cos(phi), minor * np.sin(phi)], -1), 40)
    return metric(ring, np.pi * major, 2 * np.pi * minor)


def band(line: ArrayLike, width: float, flip: bool = False) -> Solid:
    """A band of that width along Z over a line [P, 3] in the plane of X and Y; texture coordinates in metres."""
    line = np.asarray(line, float)
    edges = [[0, 0, -width / 2], [0, 0, width / 2]]
    vertices = (line[:, None] + edges).reshape(-1, 3)
    along = _lengths(line)[:, None]
    uv = np.stack(np.broadcast_arrays([0, width], along), -1).reshape(-1, 2)
    faces = _grid_triangles(len(line), 2, flip)
    return Solid(vertices, faces, smooth_normals(vertices, faces), uv)


def _lengths(line: Array) -> Array:
    """[P] lengths along a line [P, 3] from its first point."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=-1)
    return np.concatenate([[0], np.cumsum(steps)])


def grounded(solid: Solid) -> Solid:
    """The solid moved up or down to stand on y = 0."""
    return replace(solid, vertices=solid.vertices - [0, solid.vertices[:, 1].min(), 0])


def metric(solid: Solid, width: float, height: float) -> Solid:
    """The solid with texture coordinates in metres: u over `width`, v over `height`."""
    return replace(solid, uv=solid.uv * [width, height])


def tube(points: ArrayLike, radius: ArrayLike, n: int = 8) -> Solid:
    """Round tube along points [P, 3] with one radius or [P] radii; open ends."""
    line = np.asarray(points, float)
    # A frame at every point: along the line, and two directions across it.
    along = unit(np.gradient(line, axis=0))
    steep = np.abs(along[:, 1:2]) > 0.9
    side = unit(np.cross(along, np.where(steep, [[1.0, 0, 0]], [[0, 1.0, 0]])))
    other = np.cross(along, side)
    # Circles in these frames.
    phi = np.linspace(0, 2 * np.pi, n + 1)[None, :, None]
    normal = np.cos(phi) * side[:, None] + np.sin(phi) * other[:, None]
    width = np.broadcast_to(np.asarray(radius, float), len(line))
    vertices = line[:, None] + width[:, None, None] * normal
    around = phi[..., 0] * width.mean()
    uv = np.stack(np.broadcast_arrays(around, _lengths(line)[:, None]), -1)
    faces = _grid_triangles(len(line), n + 1, flip=True)
    return Solid(vertices.reshape(-1, 3), faces, normal.reshape(-1, 3), uv.reshape(-1, 2))


def joined(parts: list[Solid]) -> Solid:
    """Several solids as one."""
    vertices, faces = joined_faces(parts)
    normals = np.concatenate([part.normals for part in parts])
    uv = np.concatenate([part.uv for part in parts])
    return Solid(vertices, faces, normals, uv)


def moved(
    solid: Solid,
    at: ArrayLike = (0.0, 0.0, 0.0),
    turn: float = 0.0,
    tip: float = 0.0,
    scale: float = 1.0,
) -> Solid:
    """The solid scaled, tipped about X, turned about Y (radians) and moved by `at` [3]."""
    c = np.cos(turn)
    s = np.sin(turn)
    about_y = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    c = np.cos(tip)
    s = np.sin(tip)
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    rotation = about_y @ about_x
    vertices = solid.vertices @ rotation.T * scale + np.asarray(at, float)
    normals = solid.normals @ rotation.T
    # Texture coordinates are metres: they grow with the solid.
    return replace(solid, vertices=vertices, normals=normals, uv=solid.uv * scale)
