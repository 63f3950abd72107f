"""Shapes that RefractionNet learns from: glassware, vessels, and free bodies, solid and hollow.

Every shape is about 1 high and wide, its middle at the origin, +Y up. Its surface is the boundary of its material: a
vessel has an inside and a rim, a closed bottle a cavity whose faces look into it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from materialist.procedural.objects import shapes
from materialist.procedural.objects.implicit import creature
from materialist.procedural.objects.shapes import Solid
from materialist.types import Array

SPLITS = {"train": 71, "heldout": 72}
"""Numbers that keep the shapes of training and of testing apart."""


@dataclass(frozen=True)
class Shape:
    """One shape."""

    solid: Solid
    hollow: bool
    """Whether it has an inside, which only then has walls to learn from."""
    kind: str
    upright: bool
    """Whether it stands as it is; other shapes are seen from everywhere."""


def make_shape(index: int, split: str = "train", seed: int = 0) -> Shape:
    """Shape number `index` of a split; the same numbers give the same shape, and no two splits share one."""
    rng = np.random.default_rng([seed, SPLITS[split], index])
    kinds = list(_KINDS)
    kind = kinds[index % len(kinds)]
    solid, hollow = _KINDS[kind](rng)
    return Shape(centred(solid), hollow, kind, kind not in _ANY_WAY)


def _profile(rng: np.random.Generator, points: int, low: float = 0.25) -> Array:
    """[P, 2] smooth outline (radius, height) through random points, height 0 to 1."""
    from scipy.interpolate import PchipInterpolator

    heights = np.concatenate([[0], np.sort(rng.uniform(0.08, 0.92, points)), [1]])
    heights = heights[np.concatenate([[True], np.diff(heights) > 0.05])]
    heights[-1] = 1
    radii = rng.uniform(low, 1, len(heights))
    y = np.linspace(0, 1, 40)
    return np.stack([PchipInterpolator(heights, radii)(y) * rng.uniform(0.18, 0.55), y], -1)


def _turned(outline: Array) -> Solid:
    """Surface of revolution of an outline [P, 2], closed at both ends."""
    closed = np.concatenate([[[1e-4, outline[0, 1]]], outline, [[1e-4, outline[-1, 1]]]])
    return shapes.lathe(closed, 56)


def _body(rng: np.random.Generator) -> tuple[Solid, bool]:
    """Solid of revolution: balusters, chess men, drops, bulbs."""
    outline = _profile(rng, int(rng.integers(1, 7)), 0.12)
    if rng.random() < 0.6:  # round ends instead of flat ones
        t = np.linspace(0, 1, len(outline))
        ends = [rng.choice([0.02, rng.uniform(0.05, 0.5)]) for _ in range(2)]
        outline[:, 0] *= np.sqrt(np.clip(t / ends[0], 0, 1)) * np.sqrt(np.clip((1 - t) / ends[1], 0, 1)) + 1e-3
    return _turned(outline), False


def _wall(rng: np.random.Generator, outline: Array) -> Solid:
    """An open vessel with that outside [P, 2], its wall 3 to 14 % of its width."""
    wall = outline[:, 0].max() * rng.uniform(0.06, 0.28)
    bottom = wall * rng.uniform(0.6, 2.0)
    inner = np.stack([np.maximum(outline[:, 0] - wall, 0.012), outline[:, 1]], -1)
    inner = inner[outline[:, 1] > bottom][::-1]
    lip = (outline[-1] + inner[0]) / 2 + [0, 0.3 * wall]
    ends = [[[1e-4, outline[0, 1]]], outline, [lip], inner, [[1e-4, inner[-1, 1]]]]
    return shapes.lathe(np.concatenate(ends), 56)


def _vase(rng: np.random.Generator) -> tuple[Solid, bool]:
    return _wall(rng, _profile(rng, int(rng.integers(1, 5)))), True


def _cup(rng: np.random.Generator) -> tuple[Solid, bool]:
    """Tumblers, cups and bowls: the outline only widens, or hardly narrows."""
    y = np.linspace(0, 1, 40)
    foot, top, bend = rng.uniform(0.5, 1.05), 1.0, rng.uniform(0.3, 2.2)
    outline = np.stack([(foot + (top - foot) * y**bend) * rng.uniform(0.3, 1.1), y], -1)
    if rng.random() < 0.4:
        outline[:, 0] *= np.clip(y / rng.uniform(0.1, 0.5), 0.02, 1) ** 0.5  # a round bottom
    return _wall(rng, outline), True


def _mug(rng: np.random.Generator) -> tuple[Solid, bool]:
    """A cup with a handle: a bent tube that ends in the wall."""
    solid, _ = _cup(rng)
    width = np.abs(solid.vertices[:, 0]).max()
    t = np.linspace(-1.3, 1.3, 24)
    reach, high = width * rng.uniform(0.3, 0.6), rng.uniform(0.2, 0.35)
    line = np.stack([width * 0.9 + reach * np.cos(t), rng.uniform(0.45, 0.55) + high * np.sin(t), 0 * t], -1)
    return shapes.joined([solid, _tube(line, width * rng.uniform(0.06, 0.14), 12)]), True


def _goblet(rng: np.random.Generator) -> tuple[Solid, bool]:
    """Foot, stem and bowl."""
    foot, stem, bowl = rng.uniform(0.2, 0.32), rng.uniform(0.025, 0.06), rng.uniform(0.2, 0.38)
    rise, wall = rng.uniform(0.3, 0.55), rng.uniform(0.015, 0.04)
    y = np.linspace(0, 1, 24)
    curve = np.sin(np.pi / 2 * np.clip(y * rng.uniform(1.0, 1.4), 0, 1.35)) ** rng.uniform(0.5, 0.9)
    cup = np.stack([np.maximum(bowl * curve, stem), rise + (1 - rise) * y], -1)
    outline = np.concatenate([[[foot, 0], [foot, 0.02], [stem * 1.5, 0.06], [stem, 0.12], [stem, rise - 0.03]], cup])
    inner = cup[6:][::-1] - [wall, 0]
    profile = np.concatenate([[[1e-4, 0]], outline, np.maximum(inner, [0.005, 0]), [[1e-4, inner[-1, 1]]]])
    return shapes.lathe(profile, 56), True


def _bottle(rng: np.random.Generator) -> tuple[Solid, bool]:
    """Closed bottle or jar: shoulder and neck, with a cavity."""
    body, neck = rng.uniform(0.14, 0.3), rng.uniform(0.04, 0.1)
    shoulder, start = rng.uniform(0.45, 0.8), rng.uniform(0.03, 0.1)
    y = np.linspace(0, 1, 48)
    blend = np.clip((y - shoulder) / rng.uniform(0.05, 0.25), 0, 1)
    radius = body + (neck - body) * (3 * blend**2 - 2 * blend**3)
    radius = radius * np.sqrt(np.clip(0.5 + y / start * 0.5, 0, 1))
    wall = body * rng.uniform(0.06, 0.2)
    outside = _turned(np.stack([radius, y], -1))
    keep = (y > wall) & (y < 1 - wall) & (radius > 1.3 * wall)
    inside = _turned(np.stack([radius - wall, y], -1)[keep])
    return shapes.joined([outside, replace(inside, faces=inside.faces[:, ::-1], normals=-inside.normals)]), True


def _tube(line: Array, radius: Array | float, n: int) -> Solid:
    """`shapes.tube` with its faces turned outwards."""
    solid = shapes.tube(line, radius, n)
    return replace(solid, faces=solid.faces[:, ::-1])


def _superquadric(rng: np.random.Generator) -> tuple[Solid, bool]:
    return shapes.superquadric(rng.uniform(0.35, 1, 3), rng.uniform(0.15, 1.6), rng.uniform(0.15, 1.6), 36), False


def _box(rng: np.random.Generator) -> tuple[Solid, bool]:
    extent = rng.uniform(0.25, 1, 3)
    return shapes.slab(extent, float(rng.choice([0.0, 0.04, 0.15])) * extent.min()), False


def _frustum(rng: np.random.Generator) -> tuple[Solid, bool]:
    """Pyramids, cones, prisms and what is left of them when the top is cut off, upright or on their heads."""
    corners = int(rng.choice([3, 4, 4, 5, 6, 48]))
    angle = 2 * np.pi * (np.arange(corners) + 0.5) / corners
    around = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], -1) * [
        rng.uniform(0.25, 0.7),
        0,
        rng.uniform(0.25, 0.7),
    ]
    top = rng.choice([1e-3, rng.uniform(0.1, 1)])
    low, high = around, top * around + [*rng.normal(0, 0.05, 1), 1, *rng.normal(0, 0.05, 1)]
    if rng.random() < 0.2:
        upwards = np.array([0.0, 1, 0])
        low, high = high - upwards, around + upwards
    sides = [np.stack([low[k - 1], low[k], high[k], high[k - 1]]) for k in range(corners)]
    return shapes.joined([_flat(side[::-1]) for side in sides] + [_flat(low), _flat(high[::-1])]), False


def _flat(corners: Array) -> Solid:
    """A convex polygon [N, 3] with corners of its own, to be seen from where they run anticlockwise."""
    across = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    if len(corners) == 4:  # one side may be as good as none
        across = np.cross(corners[2] - corners[0], corners[3] - corners[1])
    normal = np.broadcast_to(across / max(float(np.linalg.norm(across)), 1e-12), corners.shape)
    k = np.arange(1, len(corners) - 1)
    faces = np.stack([0 * k, k, k + 1], -1).astype(np.int32)
    return Solid(corners, faces, normal.copy(), np.zeros((len(corners), 2)))


def _blob(rng: np.random.Generator) -> tuple[Solid, bool]:
    return shapes.blob(rng, rng.uniform(0.5, 1, 3), rng.uniform(0.08, 0.45), 56), False


def _ring(rng: np.random.Generator) -> tuple[Solid, bool]:
    """Torus, lying, standing or tilted."""
    t = np.linspace(0, 2 * np.pi, 49)
    radius = rng.uniform(0.22, 0.38)
    line = radius * np.stack([np.cos(t), np.sin(t) * rng.uniform(0.6, 1), 0 * t], -1)
    return shapes.moved(_tube(line, rng.uniform(0.25, 0.75) * radius, 24), tip=rng.uniform(0, 1.6)), False


def twisted(rng: np.random.Generator) -> tuple[Solid, bool]:
    """Twisted, bent and tapered prisms."""
    solid = shapes.superquadric(
        np.array([0.5, 1, rng.uniform(0.2, 0.5)]), rng.uniform(0.1, 0.6), rng.uniform(0.2, 1), 40
    )
    twist, bend, taper = rng.uniform(-3, 3), rng.uniform(-0.5, 0.5), rng.uniform(-0.6, 0.6)

    def warp(p: Array) -> Array:
        angle, scale = twist * p[:, 1], 1 + taper * (p[:, 1] - 0.5)
        x, z = (p[:, 0] * np.cos(angle) - p[:, 2] * np.sin(angle), p[:, 0] * np.sin(angle) + p[:, 2] * np.cos(angle))
        return np.stack([x * scale + bend * p[:, 1] ** 2, p[:, 1], z * scale], -1)

    return shapes.warped(solid, warp), False


def _figure(rng: np.random.Generator) -> tuple[Solid, bool]:
    """Several bodies grown together, often alike on the left and on the right: toys, animals, fruit."""
    trunk = shapes.moved(shapes.ball(32), scale=1)
    parts = [replace(trunk, vertices=trunk.vertices * rng.uniform(0.2, 0.45, 3))]
    for _ in range(int(rng.integers(1, 5))):
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        at = direction * rng.uniform(0.2, 0.45)
        extent = rng.uniform(0.06, 0.28, 3)
        for side in (1, -1) if rng.random() < 0.6 and abs(at[0]) > 0.08 else (1,):
            limb = shapes.moved(shapes.ball(24), turn=rng.uniform(0, 3), tip=rng.uniform(0, 3))
            parts.append(replace(limb, vertices=limb.vertices * extent + at * [side, 1, 1]))
    body = shapes.joined(parts)
    return replace(body, normals=shapes.smooth_normals(body.vertices, body.faces)), False


def _creature(rng: np.random.Generator) -> tuple[Solid, bool]:
    return creature(rng), False


def _stick(rng: np.random.Generator) -> tuple[Solid, bool]:
    """Bars, tubes, cones, hooks: round along a bent line."""
    t = np.linspace(0, 1, 28)
    line = np.cumsum(rng.normal(size=(4, 3)) * [0.4, 0.6, 0.4], axis=0)
    bent = np.stack([np.interp(t, np.linspace(0, 1, 4), c) for c in line.T], -1)
    kernel = np.hanning(13)[1:-1] / np.hanning(13).sum()
    padded = np.pad(bent, ((5, 5), (0, 0)), mode="edge")
    bent = np.stack([np.convolve(c, kernel, "valid") for c in padded.T], -1) + t[:, None] * 1e-3
    radius = np.interp(t, [0, rng.uniform(0.2, 0.8), 1], rng.uniform(0.06, 0.3, 3))
    radius[[0, -1]] = 1e-3
    return _tube(bent, radius * np.linalg.norm(bent[-1] - bent[0]).clip(0.5), 20), False


_KINDS: dict[str, Callable[[np.random.Generator], tuple[Solid, bool]]] = {
    "body": _body, "vase": _vase, "superquadric": _superquadric, "figure": _figure, "cup": _cup, "blob": _blob,
    "bottle": _bottle, "twisted": twisted, "box": _box, "mug": _mug, "goblet": _goblet, "figure 2": _figure,
    "body 2": _body, "ring": _ring, "stick": _stick, "blob 2": _blob, "creature": _creature, "creature 2": _creature,
    "creature 3": _creature, "frustum": _frustum,
}  # fmt: skip
_ANY_WAY = ("superquadric", "blob", "blob 2", "twisted", "box", "ring", "stick", "figure 2", "creature 2")


def centred(solid: Solid) -> Solid:
    """The solid about the origin, its longest side 1."""
    low, high = solid.vertices.min(0), solid.vertices.max(0)
    return replace(solid, vertices=(solid.vertices - (low + high) / 2) / (high - low).max())
