"""Shapes that RefractionNet learns from: glassware, vessels, and free bodies, solid and hollow.

Every shape is about 1 high and wide, its middle at the origin, +Y up. Its surface is the boundary of its material: a
vessel has an inside and a rim, a closed bottle a cavity whose faces look into it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial import cKDTree
from skimage.measure import marching_cubes

from materialist.camera import unit
from materialist.types import Array
from materialist_lab.procedural.objects import shapes
from materialist_lab.procedural.objects.shapes import Solid

SPLITS = {"train": 71, "heldout": 72}
"""Numbers that keep the shapes of training and of testing apart."""


@dataclass(frozen=True)
class Shape:
    """One shape."""

    solid: Solid
    hollow: bool
    """Whether it has an inside, which only then has walls to learn from."""
    upright: bool
    """Whether it stands as it is; other shapes are seen from everywhere."""


def make_shape(index: int, split: str = "train", seed: int = 0) -> Shape:
    """Shape number `index` of a split; the same numbers give the same shape, and no two splits share one."""
    rng = np.random.default_rng([seed, SPLITS[split], index])
    make, hollow, upright = _KINDS[index % len(_KINDS)]
    return Shape(centred(make(rng)), hollow, upright)


def any_shape(rng: np.random.Generator) -> Solid:
    """A shape of any kind."""
    make, *_ = _KINDS[rng.integers(KINDS)]
    return centred(make(rng))


def centred(solid: Solid) -> Solid:
    """The solid about the origin, its longest side 1."""
    low = solid.vertices.min(0)
    high = solid.vertices.max(0)
    return replace(solid, vertices=(solid.vertices - (low + high) / 2) / (high - low).max())


def _profile(rng: np.random.Generator, points: int, low: float = 0.25) -> Array:
    """[40, 2] smooth outline (radius, height) through random radii at even heights, height 0 to 1."""
    y = np.linspace(0, 1, 40)
    knots = np.linspace(0, 1, points + 2)
    radius = PchipInterpolator(knots, rng.uniform(low, 1, points + 2))(y)
    return np.stack([radius * rng.uniform(0.18, 0.55), y], -1)


def _turned(outline: Array) -> Solid:
    """Surface of revolution of an outline [P, 2], closed at both ends."""
    bottom = [[1e-4, outline[0, 1]]]
    top = [[1e-4, outline[-1, 1]]]
    return shapes.lathe(np.concatenate([bottom, outline, top]), 56)


def _body(rng: np.random.Generator) -> Solid:
    """Solid of revolution: balusters, chess men, drops, bulbs; some with round ends."""
    outline = _profile(rng, int(rng.integers(1, 7)), 0.12)
    if rng.random() < 0.6:
        # A square root towards the ends, as of an ellipse.
        t = outline[:, 1]
        ends = rng.uniform(0.02, 0.5, 2)
        lower = np.clip(t / ends[0], 0, 1)
        upper = np.clip((1 - t) / ends[1], 0, 1)
        outline[:, 0] *= np.sqrt(lower * upper) + 1e-3
    return _turned(outline)


def _wall(rng: np.random.Generator, outline: Array) -> Solid:
    """An open vessel with that outside [P, 2], its wall 3 to 14 % of its width."""
    wall = outline[:, 0].max() * rng.uniform(0.06, 0.28)
    inner = np.stack([np.maximum(outline[:, 0] - wall, 0.012), outline[:, 1]], -1)
    # The floor is thinner or thicker than the wall; the inside is walked downwards.
    inner = inner[outline[:, 1] > wall * rng.uniform(0.6, 2.0)][::-1]
    lip = (outline[-1] + inner[0]) / 2 + [0, 0.3 * wall]
    return _turned(np.concatenate([outline, [lip], inner]))


def _vase(rng: np.random.Generator) -> Solid:
    return _wall(rng, _profile(rng, int(rng.integers(1, 5))))


def _cup(rng: np.random.Generator) -> Solid:
    """Tumblers, cups and bowls: the outline only widens, or hardly narrows; some with a round bottom."""
    y = np.linspace(0, 1, 40)
    foot = rng.uniform(0.5, 1.05)
    bulge = y ** rng.uniform(0.3, 2.2)
    radius = (foot + (1 - foot) * bulge) * rng.uniform(0.3, 1.1)
    # A round bottom.
    if rng.random() < 0.4:
        radius = radius * np.clip(y / rng.uniform(0.1, 0.5), 0.02, 1) ** 0.5
    return _wall(rng, np.stack([radius, y], -1))


def _mug(rng: np.random.Generator) -> Solid:
    """A cup with a handle: a bent tube that ends in the wall."""
    solid = _cup(rng)
    # Most of an ellipse whose ends lie within the wall.
    width = np.abs(solid.vertices[:, 0]).max()
    t = np.linspace(-1.3, 1.3, 24)
    reach = width * rng.uniform(0.3, 0.6)
    high = rng.uniform(0.2, 0.35)
    x = width * 0.9 + reach * np.cos(t)
    y = rng.uniform(0.45, 0.55) + high * np.sin(t)
    line = np.stack([x, y, 0 * t], -1)
    handle = shapes.tube(line, width * rng.uniform(0.06, 0.14), 12)
    return shapes.joined([solid, handle])


def jug(rng: np.random.Generator) -> Solid:
    """A solid of revolution with a handle at one side, as one closed surface; it stands."""
    # --- The radius at even heights from 0 to 1; the handle is a bent rod that ends in the body ---
    knots = np.linspace(0, 1, 4)
    radius = PchipInterpolator(knots, rng.uniform(0.28, 0.5, 4))
    t = np.linspace(-1.5, 1.5, 200)
    low, high = rng.uniform([0.15, 0.7], [0.3, 0.9])
    inner = float(min(radius(low), radius(high))) - 0.03
    x = inner + rng.uniform(0.2, 0.35) * np.cos(t)
    y = (low + high) / 2 + (high - low) / 2 * np.sin(t)
    rod = cKDTree(np.stack([x, y - 0.5, 0 * t], -1))
    thick = rng.uniform(0.035, 0.06)

    def field(p: Array) -> Array:
        """[...] about the distance of points [..., 3] from the surface, negative inside."""
        away = np.hypot(p[..., 0], p[..., 2]) - radius(np.clip(p[..., 1] + 0.5, 0, 1))
        body = np.maximum(away, np.abs(p[..., 1]) - 0.5)
        # Far from the rod, where a search takes longest, its distance does not matter.
        return np.minimum(body, rod.query(p, distance_upper_bound=3 * thick)[0] - thick)

    return level_set(field, 0.9, points=128)


def _goblet(rng: np.random.Generator) -> Solid:
    """Foot, stem and bowl."""
    foot, stem, bowl, rise, wall = rng.uniform(
        [0.2, 0.025, 0.2, 0.3, 0.015], [0.32, 0.06, 0.38, 0.55, 0.04]
    )
    # The bowl widens as a sine; past its quarter it narrows again.
    y = np.linspace(0, 1, 24)
    quarter = np.clip(y * rng.uniform(1.0, 1.4), 0, 1.35)
    curve = np.sin(np.pi / 2 * quarter) ** rng.uniform(0.5, 0.9)
    cup = np.stack([np.maximum(bowl * curve, stem), rise + (1 - rise) * y], -1)
    # (radius, height) of foot and stem, then the outside of the bowl and its inside downwards.
    outline = [[foot, 0], [foot, 0.02], [stem * 1.5, 0.06], [stem, 0.12], [stem, rise - 0.03]]
    inner = np.maximum(cup[6:][::-1] - [wall, 0], [0.005, 0])
    return _turned(np.concatenate([outline, cup, inner]))


def _bottle(rng: np.random.Generator) -> Solid:
    """Closed bottle or jar: shoulder and neck, with a cavity."""
    body, neck, shoulder, start = rng.uniform([0.14, 0.04, 0.45, 0.03], [0.3, 0.1, 0.8, 0.1])
    # A smooth step from the body to the neck, and a rounded bottom edge.
    y = np.linspace(0, 1, 48)
    blend = np.clip((y - shoulder) / rng.uniform(0.05, 0.25), 0, 1)
    radius = body + (neck - body) * (3 * blend**2 - 2 * blend**3)
    radius = radius * np.sqrt(np.clip(0.5 + y / start * 0.5, 0, 1))
    # The cavity ends a wall's thickness from every outside; its faces look into it.
    wall = body * rng.uniform(0.06, 0.2)
    keep = (y > wall) & (y < 1 - wall) & (radius > 1.3 * wall)
    inside = _turned(np.stack([radius - wall, y], -1)[keep])
    cavity = replace(inside, faces=inside.faces[:, ::-1], normals=-inside.normals)
    outside = _turned(np.stack([radius, y], -1))
    return shapes.joined([outside, cavity])


def _superquadric(rng: np.random.Generator) -> Solid:
    return shapes.superquadric(
        rng.uniform(0.35, 1, 3), rng.uniform(0.15, 1.6), rng.uniform(0.15, 1.6), 36
    )


def _box(rng: np.random.Generator) -> Solid:
    extent = rng.uniform(0.25, 1, 3)
    return shapes.slab(extent, float(rng.choice([0.0, 0.04, 0.15])) * extent.min())


def _frustum(rng: np.random.Generator) -> Solid:
    """Pyramids, cones, prisms and what is left of them when the top is cut off, upright or on their heads."""
    low = rng.uniform(0.25, 0.7)
    high = rng.choice([1e-2, rng.uniform(0.05, 0.7)])
    deep = rng.uniform(0.4, 1)
    profile = np.array([(1e-3, 0), (low, 0), (high, 1), (1e-3, 1)])
    solid = shapes.lathe(profile, int(rng.choice([3, 4, 4, 5, 6, 48])))
    vertices = solid.vertices * [1, 1, deep]
    # Flat faces: each gets corners of its own, with its own normal.
    corners = vertices[solid.faces].reshape(-1, 3)
    flat = unit(shapes.face_normals(vertices, solid.faces))
    corner_faces = np.arange(solid.faces.size, dtype=np.int32).reshape(-1, 3)
    uv = np.zeros((solid.faces.size, 2))
    return Solid(corners, corner_faces, np.repeat(flat, 3, 0), uv)


def _blob(rng: np.random.Generator) -> Solid:
    return shapes.blob(rng, rng.uniform(0.5, 1, 3), rng.uniform(0.08, 0.45), 56)


def _ring(rng: np.random.Generator) -> Solid:
    """Torus, lying, standing or tilted."""
    ring = shapes.torus(0.3, rng.uniform(0.25, 0.75) * 0.3, 24)
    squeezed = shapes.warped(ring, lambda p: p * [1, 1, rng.uniform(0.6, 1)])
    return shapes.moved(squeezed, tip=rng.uniform(0, 1.6))


def _twisted(rng: np.random.Generator) -> Solid:
    """Twisted, bent and tapered prisms."""
    extent = np.array([0.5, 1, rng.uniform(0.2, 0.5)])
    solid = shapes.superquadric(extent, rng.uniform(0.1, 0.6), rng.uniform(0.2, 1), 40)
    twist, bend, taper = rng.uniform([-3, -0.5, -0.6], [3, 0.5, 0.6])

    def warp(p: Array) -> Array:
        angle = twist * p[:, 1]
        scale = 1 + taper * (p[:, 1] - 0.5)
        x = p[:, 0] * np.cos(angle) - p[:, 2] * np.sin(angle)
        z = p[:, 0] * np.sin(angle) + p[:, 2] * np.cos(angle)
        return np.stack([x * scale + bend * p[:, 1] ** 2, p[:, 1], z * scale], -1)

    return shapes.warped(solid, warp)


def _stick(rng: np.random.Generator) -> Solid:
    """Bars, tubes, cones, hooks: round along a bent line."""
    # A spline through four steps of a random walk.
    t = np.linspace(0, 1, 28)
    knots = np.linspace(0, 1, 4)
    walk = np.cumsum(rng.normal(size=(4, 3)) * [0.4, 0.6, 0.4], axis=0)
    line = CubicSpline(knots, walk)(t)
    radius = np.interp(t, [0, rng.uniform(0.2, 0.8), 1], rng.uniform(0.06, 0.3, 3))
    radius[[0, -1]] = 1e-3  # nearly closed ends
    length = np.linalg.norm(line[-1] - line[0]).clip(0.5)
    return shapes.tube(line, radius * length, 20)


def creature(rng: np.random.Generator) -> Solid:
    """Trunk, head, limbs and tail that melt into each other, mostly alike on the left and on the right, skin rough."""
    # --- Trunk; a limb is (start, end, radius at the start, radius at the end) ---
    build = rng.uniform(0.12, 0.3, 3) * [1, rng.uniform(1, 1.9), 1]
    thick = build.min()
    limbs = [(build * [0, -0.5, 0], build * [0, 0.5, 0], thick, thick)]
    # --- Neck, head, ears ---
    neck = np.array([0, 1, rng.uniform(-0.3, 1.2)]) * build * rng.uniform(0.9, 1.3)
    if rng.random() < 0.8:
        head = rng.uniform(0.08, 0.2)
        limbs += [(0.5 * neck, neck, 0.7 * head, 0.8 * head), (neck, neck * 1.1, head, head)]
        ear = neck + head * rng.uniform([0.4, 0.5, -0.4], [1.2, 2.2, 0.4])
        limbs += [
            (neck, ear * [side, 1, 1], 0.3 * head, 0.15 * head)
            for side in (-1, 1)
            if rng.random() < 0.5
        ]
    # --- Limbs and tails, mostly in pairs ---
    for _ in range(int(rng.integers(1, 5))):
        start = rng.uniform([0, -0.8, -0.8], 0.8) * build
        end = start + rng.uniform([0.0, -0.45, -0.3], [0.35, 0.25, 0.35])
        first, last = rng.uniform(0.03, 0.11, 2)
        sides = (-1, 1) if rng.random() < 0.75 else (1,)
        limbs += [(start * [side, 1, 1], end * [side, 1, 1], first, last) for side in sides]
    # --- How they melt together, the skin, and where it is cut off to stand ---
    melt = rng.uniform(0.015, 0.07)
    skin = shapes.lumps(rng, rng.uniform(0, 0.018), rng.uniform(2, 8))
    foot = -build[1] - rng.uniform(0, 0.1)

    def field(p: Array) -> Array:
        """[...] about the distance of points [..., 3] from the surface, negative inside."""
        total = _limb(p, *limbs[0])
        # Rounded over where they meet: Quilez's polynomial smooth minimum,
        # min(a, b) = b + (a - b) h - k h (1 - h) with h = clip(1/2 + (b - a) / 2k, 0, 1), k = melt.
        for limb in limbs[1:]:
            other = _limb(p, *limb)
            share = np.clip(0.5 + 0.5 * (other - total) / melt, 0, 1)
            total = other + (total - other) * share - melt * share * (1 - share)
        return np.maximum(total + skin(p), foot - p[..., 1])  # it stands

    return level_set(field, 1.3)


def _limb(p: Array, start: Array, end: Array, first: float, last: float) -> Array:
    """[...] about the distance of points [..., 3] from a capsule that goes from one radius to another."""
    # t is the share of the axis at the nearest point of it.
    along = end - start
    t = np.clip((p - start) @ along / max(float(along @ along), 1e-9), 0, 1)
    distance = np.linalg.norm(p - start - t[..., None] * along, axis=-1)
    return distance - (first + t * (last - first))


def level_set(field: Callable[[Array], Array], reach: float, points: int = 72) -> Solid:
    """The zero of a function of points [..., 3], negative inside, within a box of that half side about the origin."""
    axis = np.linspace(-reach, reach, points)
    values = field(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1))
    # Outside at the border of the box, so that the surface closes.
    closed = np.pad(values[1:-1, 1:-1, 1:-1], 1, constant_values=1e-3)
    vertices, faces, *_ = marching_cubes(closed, 0.0, spacing=(axis[1] - axis[0],) * 3)
    vertices = vertices.astype(np.float64) - reach
    faces = faces.astype(np.int32)
    return Solid(vertices, faces, shapes.smooth_normals(vertices, faces), vertices[:, :2].copy())


_KINDS: tuple[tuple[Callable[[np.random.Generator], Solid], bool, bool], ...] = (
    (_body, False, True),
    (_vase, True, True),
    (_superquadric, False, False),
    (creature, False, True),
    (_cup, True, True),
    (_blob, False, True),
    (_bottle, True, True),
    (_twisted, False, False),
    (_box, False, False),
    (_mug, True, True),
    (_goblet, True, True),
    (creature, False, False),
    (_body, False, True),
    (_ring, False, False),
    (_stick, False, False),
    (_blob, False, False),
    (creature, False, True),
    (creature, False, False),
    (_vase, True, True),
    (_frustum, False, True),
)
"""What makes a shape, whether the shape is hollow, and whether it stands."""
KINDS = len(_KINDS)
