"""Bodies whose parts melt into each other: toys, animals, statues on their plinths, as distance fields give them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from materialist.procedural.objects import shapes
from materialist.procedural.objects.shapes import Solid
from materialist.types import Array

POINTS = 60
"""Grid points along a side of the field."""
Field = Callable[[Array], Array]
"""Points [..., 3] to about their distance [...] from a surface, negative inside."""


def creature(rng: np.random.Generator) -> Solid:
    """Trunk, head, limbs and tail, mostly alike on the left and on the right, some on a plinth, with a rough skin."""
    build = rng.uniform(0.12, 0.3, 3) * [1, rng.uniform(1, 1.9), 1]
    parts: list[Field] = [_ellipsoid(np.zeros(3), build)]
    neck = np.array([0, 1, rng.uniform(-0.3, 1.2)]) * build * rng.uniform(0.9, 1.3)
    if rng.random() < 0.8:
        head = rng.uniform(0.08, 0.2)
        parts += [_limb(0.5 * neck, neck, 0.7 * head, 0.8 * head), _ellipsoid(neck, head * rng.uniform(0.7, 1.3, 3))]
        if rng.random() < 0.5:
            parts += _pair(neck, neck + head * rng.uniform([0.4, 0.5, -0.4], [1.2, 2.2, 0.4]), 0.3 * head, 0.15 * head)
    for _ in range(int(rng.integers(0, 4))):
        start = rng.uniform(-0.8, 0.8, 3) * build
        start[0] = abs(start[0])
        end = start + rng.uniform([0.0, -0.45, -0.3], [0.35, 0.25, 0.35])
        thick = rng.uniform(0.03, 0.11)
        whole = _pair(start, end, thick, thick * rng.uniform(0.4, 1.1))
        parts += whole if rng.random() < 0.75 else whole[:1]
    if rng.random() < 0.3:
        back = np.array([0, rng.uniform(-0.9, 0), -0.8]) * build
        parts.append(_limb(back, back + rng.uniform([-0.3, -0.1, -0.5], [0.3, 0.4, -0.1]), 0.07, 0.02))
    low = -build[1] - rng.uniform(0, 0.1)
    if rng.random() < 0.35:
        parts.append(_plinth(rng, low, 1.3 * max(build[0], build[2])))
    melt = rng.uniform(0.015, 0.07)
    skin = shapes.lumps(rng, rng.uniform(0, 0.018), rng.uniform(2, 8))

    def field(p: Array) -> Array:
        total = parts[0](p)
        for part in parts[1:]:
            total = _melted(total, part(p), melt)
        total = total + skin(p)
        return np.maximum(total, low - 0.06 - p[..., 1])  # it stands

    return surface(field, *_bounds(field))


def surface(field: Field, low: Array, high: Array, points: int = POINTS) -> Solid:
    """The zero of a field within a box, one vertex a cell and one quad a crossed edge (surface nets, Gibson 1998)."""
    axes = [np.linspace(a, b, points) for a, b in zip(low, high, strict=True)]
    values = field(np.stack(np.meshgrid(*axes, indexing="ij"), -1))
    for k in range(3):  # closed: nothing inside touches the box
        edge = np.moveaxis(values, k, 0)
        edge[[0, -1]] = np.maximum(edge[[0, -1]], 1e-3)
    cells = points - 1
    total, count = np.zeros((cells, cells, cells, 3)), np.zeros((cells, cells, cells))
    number, quads = np.arange(cells**3).reshape(cells, cells, cells), []
    for k in range(3):
        order = [k, *(m for m in range(3) if m != k)]
        one, two = (np.moveaxis(values, k, 0)[part] for part in (np.s_[:-1], np.s_[1:]))  # edges along axis k
        crossed = (one < 0) != (two < 0)
        share = one / np.where(crossed, one - two, 1)
        for i, j in np.ndindex(2, 2):  # the four such edges of every cell
            here = np.s_[:, i : cells + i, j : cells + j]
            place = np.stack(np.broadcast_arrays(share[here], i, j), -1)[..., np.argsort(order)]
            np.moveaxis(total, k, 0)[...] += np.where(crossed[here][..., None], place, 0)
            np.moveaxis(count, k, 0)[...] += crossed[here]
        a, b, c = np.nonzero(crossed[:, 1:-1, 1:-1])
        around = np.moveaxis(number, k, 0)
        quad = np.stack([around[a, b, c], around[a, b + 1, c], around[a, b + 1, c + 1], around[a, b, c + 1]], -1)
        rising = (one[:, 1:-1, 1:-1][a, b, c] < 0) != (k == 1)  # axes (1, 0, 2) are left-handed
        quads.append(np.where(rising[:, None], quad, quad[:, ::-1]))
    used, corner = np.unique(np.concatenate(quads), return_inverse=True)
    index = np.stack(np.unravel_index(used, number.shape), -1)
    within = total.reshape(-1, 3)[used] / count.reshape(-1)[used, None]
    vertices = low + (index + within) * (high - low) / cells
    a, b, c, d = corner.reshape(-1, 4).T
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).astype(np.int32)
    return Solid(vertices, faces, shapes.smooth_normals(vertices, faces), vertices[:, :2].copy())


def _bounds(field: Field) -> tuple[Array, Array]:
    """Corners of a box around the body, found on a coarse grid."""
    axis = np.linspace(-1.4, 1.4, 36)
    inside = field(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1)) < 0.04
    found = np.argwhere(inside)
    return axis[np.maximum(found.min(0) - 1, 0)], axis[np.minimum(found.max(0) + 1, len(axis) - 1)]


def _melted(a: Array, b: Array, width: float) -> Array:
    """The union of two fields, rounded over about that width (Quilez's polynomial smooth minimum)."""
    share = np.clip(0.5 + 0.5 * (b - a) / width, 0, 1)
    return b + (a - b) * share - width * share * (1 - share)


def _ellipsoid(centre: Array, radii: Array) -> Field:
    def field(p: Array) -> Array:
        unit = (p - centre) / radii
        far = np.linalg.norm(unit, axis=-1)
        return far * (far - 1) / np.maximum(np.linalg.norm(unit / radii, axis=-1), 1e-9)

    return field


def _limb(start: Array, end: Array, first: float, last: float) -> Field:
    """A capsule between two points that goes from one radius to another."""
    along = end - start

    def field(p: Array) -> Array:
        t = np.clip((p - start) @ along / max(float(along @ along), 1e-9), 0, 1)
        return np.linalg.norm(p - start - t[..., None] * along, axis=-1) - (first + t * (last - first))

    return field


def _pair(start: Array, end: Array, first: float, last: float) -> list[Field]:
    """A limb and its mirror image."""
    mirror = np.array([-1, 1, 1])
    return [_limb(start, end, first, last), _limb(start * mirror, end * mirror, first, last)]


def _plinth(rng: np.random.Generator, low: float, wide: float) -> Field:
    """A flat box or disc, about where the body ends."""
    half, round_one = np.array([wide * rng.uniform(0.5, 1), 0.06, wide * rng.uniform(0.5, 1)]), rng.random() < 0.5

    def field(p: Array) -> Array:
        q = np.abs(p - [0, low, 0])
        if round_one:
            return np.maximum(np.hypot(q[..., 0], q[..., 2]) - half[0], q[..., 1] - half[1])
        return (q - half).max(-1)

    return field
