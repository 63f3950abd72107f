"""Procedural triangle meshes with texture coordinates, for synthetic scenes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from materialist.types import Array


@dataclass(frozen=True)
class Solid:
    """A closed triangle mesh standing on y = 0, in the frame of its scene (+Y up, metres)."""

    vertices: Array
    """[V, 3] float64."""
    faces: Array
    """[F, 3] int32, counter-clockwise from outside."""
    normals: Array
    """[V, 3] float64 unit shading normals, outwards."""
    uv: Array
    """[V, 2] float64; textures repeat outside [0, 1]."""


def box(size: Array) -> Solid:
    """Sharp box of extent `size` [3]; the texture covers each side once."""
    corners: list[Array] = []
    faces: list[list[list[int]]] = []
    normals: list[Array] = []
    uv: list[Array] = []
    quad = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    for axis in range(3):
        for sign in (-1, 1):
            first = 4 * len(faces)
            side = np.zeros((4, 3))
            side[:, axis] = sign / 2
            side[:, (axis + 1) % 3], side[:, (axis + 2) % 3] = quad[:, 0] * sign, quad[:, 1]
            corners.append(side)
            normals.append(np.tile(np.eye(3)[axis] * sign, (4, 1)))
            uv.append(quad + 0.5)
            faces.append([[first, first + 1, first + 2], [first, first + 2, first + 3]])
    vertices = np.concatenate(corners) * size + [0, size[1] / 2, 0]
    return Solid(vertices, np.concatenate(faces).astype(np.int32), np.concatenate(normals), np.concatenate(uv))


def superquadric(size: Array, e1: float, e2: float, n: int = 64) -> Solid:
    """Superellipsoid of extent `size` [3]: exponents 1 are an ellipsoid, towards 0 a box, (0.1, 1) a cylinder."""
    power = lambda x, e: np.sign(x) * np.abs(x) ** e  # noqa: E731
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
    radius, height = profile[:, :1], profile[:, 1:]
    points = np.stack(
        [radius * np.cos(phi), np.broadcast_to(height, (len(profile), n + 1)), radius * np.sin(phi)], axis=-1
    )
    return _grid(points)


def capsule(radius: float, length: float) -> Solid:
    """Upright capsule: a cylinder of `length` between two half spheres."""
    t = np.linspace(-np.pi / 2, 0, 20)
    lower = np.stack([np.cos(t), np.sin(t)], -1) * radius + [0, radius]
    upper = np.stack([np.cos(-t[::-1]), np.sin(-t[::-1])], -1) * radius + [0, radius + length]
    return lathe(np.concatenate([lower, upper]))


def vessel(control: Array, thickness: float, rows: int = 48, n: int = 96) -> Solid:
    """Open vase, cup or bowl: a smooth wall through `control` [K, 2] (radius, height), with an inside and a rim."""
    from scipy.interpolate import PchipInterpolator

    height = np.linspace(control[0, 1], control[-1, 1], rows)
    radius = PchipInterpolator(control[:, 1], control[:, 0])(height)
    inner = np.maximum(radius - thickness, np.minimum(0.02, radius / 2))
    keep = height > thickness
    t = np.linspace(0, np.pi, 8)[1:-1, None]
    rim = np.concatenate([np.cos(t), np.sin(t)], -1) * thickness / 2 + [radius[-1] - thickness / 2, height[-1]]
    outside = np.stack([radius, height], -1)
    inside = np.stack([inner, height], -1)[keep][::-1]
    bottom = np.stack([np.linspace(0, radius[0], 6), np.zeros(6)], -1)[:-1]
    floor = np.stack([np.linspace(inside[-1, 0], 0, 6), np.full(6, inside[-1, 1])], -1)[1:]
    return lathe(np.concatenate([bottom, outside, rim, inside, floor]), n)


def panel(origin: Array, right: Array, up: Array, repeat: tuple[float, float]) -> Solid:
    """Rectangle from `origin` along `right` and `up` (all [3]), facing right x up, its texture repeated."""
    vertices = np.stack([origin, origin + right, origin + right + up, origin + up]).astype(float)
    normal = np.cross(right, up)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * repeat
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Solid(vertices, faces, np.tile(normal / np.linalg.norm(normal), (4, 1)), uv)


def load(path: Path) -> Solid:
    """A PLY mesh, stood on y = 0 with longest side 1, smooth normals, and a texture wrapped around its Y axis."""
    import mitsuba as mi

    params = mi.traverse(mi.load_dict({"type": "ply", "filename": str(path)}))
    vertices = np.array(params["vertex_positions"], np.float64).reshape(-1, 3)
    faces = np.array(params["faces"], np.int32).reshape(-1, 3)
    low, high = vertices.min(0), vertices.max(0)
    vertices = (vertices - [(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2]) / (high - low).max()
    normals = _smooth_normals(vertices, faces)
    # Each face gets corners of its own, so that the texture can close around the axis without a seam.
    corners = vertices[faces]  # [F, 3, 3]
    u = np.arctan2(corners[..., 2], corners[..., 0]) / (2 * np.pi) + 0.5
    u = np.where((np.ptp(u, axis=1, keepdims=True) > 0.5) & (u < 0.5), u + 1, u)
    uv = np.stack([u, corners[..., 1]], -1).reshape(-1, 2)
    own = np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
    return Solid(corners.reshape(-1, 3), own, normals[faces].reshape(-1, 3), uv)


def placed(solid: Solid, *, scale: float = 1.0, turn: float = 0.0, at: tuple[float, float] = (0.0, 0.0)) -> Solid:
    """The solid scaled, turned about Y by `turn` radians, and moved to (x, z) on the ground."""
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    vertices = solid.vertices @ rotation.T * scale + [at[0], 0, at[1]]
    return replace(solid, vertices=vertices, normals=solid.normals @ rotation.T)


def _grid(points: Array) -> Solid:
    """Mesh of a parametric grid [n, m, 3] whose last column repeats the first; u along columns, v along rows."""
    n, m = points.shape[:2]
    faces = grid_faces(n, m)
    vertices = points.reshape(-1, 3).astype(np.float64)
    area = np.linalg.norm(face_normals(vertices, faces), axis=-1)
    faces = faces[area > 1e-12]  # the triangles at poles that have no area
    u, v = np.meshgrid(np.linspace(0, 1, m), np.linspace(0, 1, n))
    return Solid(vertices, faces, _smooth_normals(vertices, faces), np.stack([2 * u, v], -1).reshape(-1, 2))


def grid_faces(n: int, m: int, flip: bool = False) -> Array:
    """[2 (n - 1)(m - 1), 3] int32 triangles of an n x m grid of vertices, rows along the first axis."""
    index = np.arange(n * m).reshape(n, m)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return (faces[:, ::-1] if flip else faces).astype(np.int32)


def face_normals(vertices: Array, faces: Array) -> Array:
    """[F, 3] normals of triangles, of length twice their area."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)


def _smooth_normals(vertices: Array, faces: Array) -> Array:
    """[V, 3] area-weighted unit normals, shared by vertices at one place (seams and poles stay invisible)."""
    scale = np.ptp(vertices, axis=0).max()
    _, place = np.unique(np.round(vertices / scale * 1e6).astype(np.int64), axis=0, return_inverse=True)
    flat, corners = np.tile(face_normals(vertices, faces), (3, 1)), place.reshape(-1)[faces].T.ravel()
    return vertex_normals(corners, flat)[place.reshape(-1)]


def vertex_normals(corners: Array, normals: Array) -> Array:
    """[N, 3] unit sums of the normals [C, 3] of faces at their corners [C], which are numbers of places."""
    total = np.stack([np.bincount(corners, normals[:, k]) for k in range(3)], -1)
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    return np.where(length > 0, total / np.maximum(length, 1e-30), [0, 1, 0])
