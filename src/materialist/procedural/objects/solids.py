"""Solids beside those of `shapes`: rounded slabs, soft bodies, thin leaves; texture coordinates in metres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from materialist.procedural.objects.shapes import Solid, face_normals, grid_faces, lathe, vertex_normals, vessel
from materialist.types import Array

_AXES = ((0, 2, 1), (1, 0, 2), (2, 0, 1))
"""Normal axis, axis of u, axis of v of each pair of sides, so that v is the vertical of upright sides."""


def slab(size: ArrayLike, radius: float = 0.0) -> Solid:
    """Box of extent `size` [3] standing on y = 0 with edges rounded by `radius`; texture coordinates in metres."""
    half = np.asarray(size, float) / 2
    radius = float(min(radius, 0.95 * half.min()))
    arc = np.sin(np.linspace(0, np.pi / 4, 4)) * np.sqrt(2) if radius > 0 else np.zeros(0)
    parts = []
    for axis, u, v in _AXES:
        for sign in (-1.0, 1.0):
            parts.append(_side(half, radius, arc, axis, u, v, sign))
    solid = joined(parts)
    return replace(solid, vertices=solid.vertices + np.array([0, half[1], 0]))


def _side(half: Array, radius: float, arc: Array, axis: int, u: int, v: int, sign: float) -> Solid:
    """One side of a rounded box about the origin."""
    # Towards the edge the grid crowds as tan, so that the arc it is pushed onto has even steps.
    lines = [_line(half[k], radius, arc) for k in (u, v)]
    a, b = np.meshgrid(*lines, indexing="ij")
    p = np.empty((*a.shape, 3))
    p[..., axis], p[..., u], p[..., v] = sign * half[axis], a, b
    inner = np.clip(p, -(half - radius), half - radius)
    normal = p - inner if radius > 0 else np.eye(3)[axis] * sign + np.zeros_like(p)
    normal = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    place = inner + radius * normal
    handed = np.linalg.det(np.stack([np.eye(3)[u], np.eye(3)[v], np.eye(3)[axis] * sign]))
    faces = grid_faces(len(a), a.shape[1], flip=handed < 0)
    uv = np.stack([a, b], -1).reshape(-1, 2)
    return Solid(place.reshape(-1, 3), faces, normal.reshape(-1, 3), uv)


def _line(half: float, radius: float, arc: Array) -> Array:
    if radius <= 0:
        return np.array([-half, half])
    tips = half - radius + radius * np.tan(np.linspace(0, np.pi / 4, 4))
    return np.concatenate([-tips[::-1], tips])


def sheet(origin: ArrayLike, right: ArrayLike, up: ArrayLike, n: int = 1) -> Solid:
    """Rectangle from `origin` along `right` and `up` (all [3], metres), facing right x up, in n x n pieces."""
    right, up, t = np.asarray(right, float), np.asarray(up, float), np.linspace(0, 1, n + 1)
    a, b = np.meshgrid(t, t, indexing="ij")
    vertices = np.asarray(origin) + a[..., None] * right + b[..., None] * up
    normal = np.cross(right, up)
    normal = np.broadcast_to(normal / np.linalg.norm(normal), vertices.shape)
    uv = np.stack([a * np.linalg.norm(right), b * np.linalg.norm(up)], -1)
    return Solid(vertices.reshape(-1, 3), grid_faces(n + 1, n + 1), normal.reshape(-1, 3).copy(), uv.reshape(-1, 2))


def warped(solid: Solid, function) -> Solid:
    """The solid with its vertices [V, 3] sent through `function`, and new smooth normals."""
    vertices = function(solid.vertices)
    return replace(solid, vertices=vertices, normals=smooth_normals(vertices, solid.faces, solid.vertices))


def smooth_normals(vertices: Array, faces: Array, places: Array | None = None) -> Array:
    """[V, 3] area-weighted unit normals, shared by the vertices at one of `places` [V, 3] (their own).

    Faster and coarser than those of `shapes`; the photographs of the benches depend on the last bit of both.
    """
    places = vertices if places is None else places
    scale = max(float(np.ptp(places, axis=0).max()), 1e-9)
    keys = np.round(places / scale * 1e5).astype(np.int64) @ np.array([1, 2**21, 2**42])
    _, place = np.unique(keys, return_inverse=True)
    return vertex_normals(place[faces].ravel(), np.repeat(face_normals(vertices, faces), 3, axis=0))[place]


def lumps(rng: np.random.Generator, amount: float, waves: float, count: int = 6):
    """A function [..., 3] -> [...] of smooth noise with about that amplitude and that many waves a metre."""
    wave = rng.normal(size=(count, 3)) * waves * 2 * np.pi / np.sqrt(3)
    phase, weight = rng.uniform(0, 2 * np.pi, count), rng.uniform(0.4, 1, count) * amount / np.sqrt(count)
    return lambda p: np.sin(p @ wave.T + phase) @ weight


def ball(n: int = 48) -> Solid:
    """Unit sphere about the origin; texture coordinates in metres at its equator."""
    t = np.linspace(-np.pi / 2, np.pi / 2, n // 2 + 1)
    sphere = lathe(np.stack([np.maximum(np.cos(t), 0), np.sin(t)], -1), n)
    return replace(sphere, uv=sphere.uv * [np.pi, np.pi])


def blob(rng: np.random.Generator, size: ArrayLike, roughness: float, n: int = 48) -> Solid:
    """Smooth lumpy body of about extent `size` [3] standing on y = 0: stones, fruit, bread, bushes."""
    bump, fine = lumps(rng, roughness, 0.35), lumps(rng, roughness * 0.35, 1.2)
    half = np.asarray(size, float) / 2
    body = warped(ball(n), lambda p: p * (1 + bump(p) + fine(p))[..., None] * half)
    return grounded(replace(body, uv=body.uv * half.mean()))


def pot(control: Array, thickness: float) -> Solid:
    """`shapes.vessel` with an eighth of its faces; texture coordinates in metres."""
    radius, height = control[:, 0].mean(), control[-1, 1]
    return metric(vessel(control, thickness, rows=18, n=40), np.pi * radius, 2 * height)


def disc(radius: float) -> Solid:
    """A flat disc about the origin that faces upwards."""
    return lathe(np.array([[radius, 0], [1e-4, 0]]), 32)


def drum(radius: float, height: float, top: float | None = None) -> Solid:
    """A cylinder about the Y axis, its middle at the origin; or a cone, whose upper radius is `top`."""
    h = height / 2
    return lathe(np.array([(1e-3, -h), (radius, -h), (radius if top is None else top, h), (1e-3, h)]), 24)


def torus(major: float, minor: float, n: int) -> Solid:
    """A ring about the Y axis, its tube of n sides; texture coordinates in metres."""
    phi = np.linspace(0, 2 * np.pi, n + 1)
    ring = lathe(np.stack([major + minor * np.cos(phi), minor * np.sin(phi)], -1), 40)
    return metric(ring, np.pi * major, 2 * np.pi * minor)


def strip(line: ArrayLike, width: float, flip: bool = False) -> Solid:
    """A band of that width along Z over a line [P, 3] in the plane of X and Y; texture coordinates in metres."""
    line = np.asarray(line, float)
    vertices = (line[:, None] + [[0, 0, -width / 2], [0, 0, width / 2]]).reshape(-1, 3)
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=-1))])
    uv = np.stack(np.broadcast_arrays([0, width], along[:, None]), -1).reshape(-1, 2)
    faces = grid_faces(len(line), 2, flip)
    return Solid(vertices, faces, smooth_normals(vertices, faces), uv)


def grounded(solid: Solid) -> Solid:
    """The solid moved up or down to stand on y = 0."""
    return replace(solid, vertices=solid.vertices - [0, solid.vertices[:, 1].min(), 0])


def metric(solid: Solid, width: float, height: float) -> Solid:
    """The solid with texture coordinates in metres: u over `width`, v over `height`."""
    return replace(solid, uv=solid.uv * [width, height])


def tube(points: ArrayLike, radius: ArrayLike, n: int = 8) -> Solid:
    """Round tube along points [P, 3] with one radius or [P] radii; open ends."""
    line = np.asarray(points, float)
    along = np.gradient(line, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=-1, keepdims=True), 1e-9)
    helper = np.where(np.abs(along[:, 1:2]) > 0.9, [[1.0, 0, 0]], [[0, 1.0, 0]])
    side = np.cross(along, helper)
    side /= np.linalg.norm(side, axis=-1, keepdims=True)
    other = np.cross(along, side)
    phi = np.linspace(0, 2 * np.pi, n + 1)[None, :, None]
    normal = np.cos(phi) * side[:, None] + np.sin(phi) * other[:, None]
    width = np.broadcast_to(np.asarray(radius, float), len(line))
    vertices = line[:, None] + width[:, None, None] * normal
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=-1))])
    uv = np.stack(np.broadcast_arrays(phi[..., 0] * width.mean(), length[:, None]), -1)
    faces = grid_faces(*vertices.shape[:2])
    return Solid(vertices.reshape(-1, 3), faces, normal.reshape(-1, 3), uv.reshape(-1, 2))


def leaves(rng: np.random.Generator, roots: Array, directions: Array, length: float, width: float) -> Solid:
    """Bent leaves of six triangles each, from roots [N, 3] along unit directions [N, 3]."""
    n = len(roots)
    directions = directions / np.maximum(np.linalg.norm(directions, axis=-1, keepdims=True), 1e-9)
    side = np.cross(directions, np.array([0, 1, 0]) + rng.normal(scale=0.3, size=(n, 3)))
    side /= np.maximum(np.linalg.norm(side, axis=-1, keepdims=True), 1e-9)
    size = (length * rng.uniform(0.6, 1.2, n))[:, None]
    rows = []
    for t, w in ((0.0, 0.1), (0.35, 1.0), (0.7, 0.8), (1.0, 0.05)):
        spine = roots + directions * size * t + np.array([0, -1, 0]) * size * 0.35 * t * t
        rows += [spine - side * width / 2 * w * size / length, spine + side * width / 2 * w * size / length]
    vertices = np.stack(rows, 1)  # [N, 8, 3]
    one = np.array([[0, 1, 3], [0, 3, 2], [2, 3, 5], [2, 5, 4], [4, 5, 7], [4, 7, 6]])
    faces = (one[None] + 8 * np.arange(n)[:, None, None]).reshape(-1, 3).astype(np.int32)
    flat = vertices.reshape(-1, 3)
    uv = np.tile(np.stack([np.tile([0, width], 4), np.repeat([0, 0.35, 0.7, 1], 2) * length], -1), (n, 1))
    return Solid(flat, faces, smooth_normals(flat, faces, flat + np.repeat(np.arange(n), 8)[:, None] * 1e3), uv)


def joined(parts: list[Solid]) -> Solid:
    """Several solids as one."""
    offset = np.cumsum([0, *(len(p.vertices) for p in parts)])[:-1]
    return Solid(
        np.concatenate([p.vertices for p in parts]),
        np.concatenate([p.faces + k for p, k in zip(parts, offset)]).astype(np.int32),
        np.concatenate([p.normals for p in parts]),
        np.concatenate([p.uv for p in parts]),
    )


def moved(
    solid: Solid, at: ArrayLike = (0.0, 0.0, 0.0), turn: float = 0.0, tip: float = 0.0, scale: float = 1.0
) -> Solid:
    """The solid scaled, tipped about X, turned about Y (radians) and moved by `at` [3]."""
    c, s, ct, st = np.cos(turn), np.sin(turn), np.cos(tip), np.sin(tip)
    rotation = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ np.array([[1, 0, 0], [0, ct, -st], [0, st, ct]])
    vertices = (solid.vertices * scale) @ rotation.T + np.asarray(at, float)
    return replace(solid, vertices=vertices, normals=solid.normals @ rotation.T, uv=solid.uv * scale)
