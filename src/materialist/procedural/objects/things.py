"""Movable things, 3 to 60 centimetres high: what stands on tables, shelves and floors. Base on y = 0."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from materialist.errors import InputError
from materialist.procedural import materials as m
from materialist.procedural.objects import shapes
from materialist.procedural.objects import solids as s
from materialist.procedural.objects.shapes import Solid
from materialist.procedural.world import Part

Parts = list[Part]


def thing(rng: np.random.Generator, size: float, meshes: tuple[Path, ...] = (), share: float = 0.3) -> Parts:
    """Some object about `size` metres high; with `share` probability a mesh from a file, if there are any."""
    if meshes and rng.random() < share:
        return one_thing(captured(rng, size, meshes))
    return one_thing(_KINDS[rng.choice(len(_KINDS), p=_SHARES)](rng, size))


def one_thing(parts: Parts) -> Parts:
    """The parts, those that belong to nothing yet as one thing."""
    thing = object()
    return [part if part.thing is not None else replace(part, thing=thing) for part in parts]


def captured(rng: np.random.Generator, size: float, meshes: tuple[Path, ...]) -> Parts:
    """A mesh from a file in any material, its longest side `size`."""
    solid = mesh(meshes[rng.integers(len(meshes))])
    solid = replace(solid, uv=solid.uv * [np.pi * 0.6, 1])
    tip = rng.choice([0, 0, 0, np.pi / 2, -np.pi / 2]) if rng.random() < 0.3 else 0.0
    placed = s.grounded(s.moved(solid, tip=tip, scale=size))
    return [Part(placed, m.any_object(rng))]


@lru_cache(maxsize=40)
def mesh(path: Path) -> Solid:
    """The mesh in a .ply file; see `shapes.load`. Raises InputError when it is damaged or has no faces."""
    from materialist.render.variant import setup

    setup()
    try:
        solid = shapes.load(path)
        usable = len(solid.faces) > 0 and bool(np.isfinite(solid.vertices).all())
    except (RuntimeError, LookupError, ValueError) as error:
        raise InputError(f"The mesh {path} cannot be read; mend it, or take it out of the folder.") from error
    if not usable:
        raise InputError(f"The mesh {path} has no faces, or no size; mend it, or take it out of the folder.")
    return solid


def _box(rng, size):
    extent = size * rng.uniform([0.4, 0.3, 0.4], [1.3, 1.0, 1.3])
    solid = s.slab(extent, float(rng.choice([0, 0.02, 0.08])) * size)
    if rng.random() < 0.3:  # a carton with printed sides
        return [Part(solid, m.printed(rng, extent[0], extent[1]))]
    return [Part(solid, m.any_object(rng))]


def _superquadric(rng, size):
    extent = size * rng.uniform(0.5, 1.1, 3)
    solid = shapes.superquadric(extent, rng.uniform(0.2, 1.4), rng.uniform(0.2, 1.4), 32)
    return [Part(s.metric(solid, extent[0] * 1.5, extent[1] * 1.5), m.any_object(rng))]


def _ball(rng, size):
    radius = size * rng.uniform(0.25, 0.5)
    solid = s.grounded(s.moved(s.ball(40), scale=radius, tip=rng.uniform(0, 3)))
    return [Part(solid, m.any_object(rng))]


def _blob(rng, size):
    """Fruit, bread, stones, folded soft things."""
    extent = size * rng.uniform(0.5, 1.0, 3)
    return [Part(s.blob(rng, extent, rng.uniform(0.03, 0.3), 40), m.any_object(rng))]


def vase(rng, size):
    """Lathed vase or jar, open at its top; flowers or twigs now and then."""
    height, radius = size, size * rng.uniform(0.18, 0.4)
    heights = np.sort(np.concatenate([[0, 1], rng.uniform(0.1, 0.95, int(rng.integers(2, 5)))]))
    widths = rng.uniform(0.35, 1.0, len(heights))
    widths[0] = max(widths[0], 0.5)
    control = np.stack([widths * radius, heights * height], -1)
    control = control[np.concatenate([[True], np.diff(control[:, 1]) > 0.04 * height])]
    parts = [Part(s.pot(control, 0.04 * size), m.any_object(rng))]
    if rng.random() < 0.35:
        parts += _twigs(rng, height * 0.7, size * rng.uniform(0.7, 1.5), widths[-1] * radius * 0.6)
    return parts


def _twigs(rng, base, length, spread):
    stem, leaf, parts = m.foliage(rng), m.foliage(rng), []
    for _ in range(int(rng.integers(3, 9))):
        lean = rng.normal(size=2) * 0.35
        t = np.linspace(0, 1, 6)[:, None]
        start = np.array([*rng.uniform(-spread, spread, 2), base])[[0, 2, 1]]
        line = start + t * length * np.array([lean[0], 1, lean[1]]) + t**2 * [lean[0] * length, -0.2 * length, 0]
        parts.append(Part(s.tube(line, 0.008 * length, 5), stem))
        count = int(rng.integers(4, 12))
        roots = line[rng.integers(2, 6, count)]
        parts.append(Part(s.leaves(rng, roots, rng.normal((0, 0.5, 0), 1, (count, 3)), 0.25 * length,
                                   0.09 * length), leaf))  # fmt: skip
    return parts


def cup(rng, size):
    """Cup or mug with a handle and a drink in it, at times on a saucer."""
    height, radius = size, size * rng.uniform(0.4, 0.6)
    control = np.array([(0.65, 0), (0.85, 0.2), (1, 0.6), (1.02, 1)]) ** [rng.uniform(0.3, 1.3), 1] * [radius, height]
    material, lift = m.ceramic(rng), 0.0
    parts = []
    if rng.random() < 0.35:
        parts += _dish(rng, size * 1.8, material)
        lift = 0.12 * size
    body = s.pot(control, 0.05 * size)
    parts.append(Part(s.moved(body, (0, lift, 0)), material))
    phi = np.linspace(-np.pi / 2, np.pi / 2, 12)
    loop = np.stack(
        [np.cos(phi) * 0.35 * size + radius * 0.9, np.sin(phi) * 0.3 * size + 0.5 * height + lift, 0 * phi], -1
    )
    parts.append(Part(s.tube(loop, 0.05 * size, 7), material))
    drink = shapes.lathe(np.array([[radius * 0.9, 0], [1e-4, 0]]), 32)
    level = height * rng.uniform(0.6, 0.85) + lift
    colour = m.hsv(rng.uniform(0.03, 0.12), rng.uniform(0.2, 0.9), rng.uniform(0.1, 0.8))
    liquid = m.Material(0, (colour,) * 3, 0.0, (0.08, 0.08))
    return [*parts, Part(s.moved(drink, (0, level, 0)), liquid)]


def _dish(rng, width, material):
    r = width / 2
    control = np.array([(0.5, 0), (0.6, 0.3), (0.95, 0.8), (1, 1)]) * [r, width * rng.uniform(0.08, 0.2)]
    return [Part(s.pot(control, 0.03 * width), material)]


def bowl(rng, size):
    """Plate or bowl, at times with fruit."""
    r, height = size * rng.uniform(0.6, 1.0), size * rng.uniform(0.15, 0.6)
    power = rng.uniform(0.3, 0.8)
    t = np.linspace(0, 1, 6)
    control = np.stack([r * (0.4 + 0.6 * t**power), height * t], -1)
    parts = [Part(s.pot(control, 0.03 * size), m.any_object(rng))]
    if rng.random() < 0.5:
        food = m.any_object(rng)
        for _ in range(int(rng.integers(2, 8))):
            piece = s.blob(rng, size * rng.uniform(0.25, 0.45, 3), 0.08, 24)
            place = (rng.uniform(-0.4, 0.4) * r, height * 0.3 * rng.uniform(0.5, 1.5), rng.uniform(-0.4, 0.4) * r)
            parts.append(Part(s.moved(piece, place), food if rng.random() < 0.6 else m.any_object(rng)))
    return parts


def bottle(rng, size):
    """Bottle with a cap and a label."""
    r = size * rng.uniform(0.12, 0.2)
    neck, shoulder = rng.uniform(0.3, 0.5), rng.uniform(0.5, 0.75)
    profile = np.array([(1e-3, 0), (0.95, 0), (1, 0.03), (1, shoulder), (neck + 0.1, shoulder + 0.15), (neck, 0.92),
                        (neck * 1.1, 0.93), (neck * 1.1, 1), (1e-3, 1)]) * [r, size]  # fmt: skip
    parts = [
        Part(
            s.metric(shapes.lathe(profile, 40), np.pi * r, size), m.plastic(rng) if rng.random() < 0.7 else m.metal(rng)
        )
    ]
    if rng.random() < 0.7:
        low, high = sorted(rng.uniform(0.08, shoulder - 0.03, 2) * size)
        band = np.array([(1.012 * r, low), (1.012 * r, max(high, low + 0.1 * size))])
        label = replace(m.printed(rng, np.pi * r, high - low + 0.1 * size), offset=None)
        parts.append(Part(s.metric(shapes.lathe(band, 40), np.pi * r, high - low), label))
    return parts


def books(rng, size):
    """A stack of books, or a single open one."""
    parts, top = [], 0.0
    for _ in range(int(rng.integers(1, 6))):
        extent = np.array([size * rng.uniform(0.7, 1.1), size * rng.uniform(0.06, 0.2), size * rng.uniform(0.5, 0.8)])
        turn = rng.normal() * 0.25
        cover = m.printed(rng, extent[0], extent[2]) if rng.random() < 0.6 else m.plastic(rng)
        paper = m.Material(0, (m.hsv(0.12, 0.12, 0.9),) * 3, 0.2, (0.8, 0.8))
        pages = s.slab(extent * [0.97, 0.8, 0.97])
        parts.append(Part(s.moved(pages, (0, top + 0.1 * extent[1], 0), turn), paper))
        for y in (top, top + 0.9 * extent[1]):
            parts.append(Part(s.moved(s.slab(extent * [1, 0.1, 1]), (0, y, 0), turn), cover))
        top += extent[1]
    return parts


def plant(rng, size):
    """Pot plant: a pot, stems, leaves."""
    pot = size * rng.uniform(0.25, 0.4)
    control = np.array([(0.75, 0), (0.9, 0.5), (1, 1)]) * [pot * 0.5, pot]
    parts = [Part(s.pot(control, 0.05 * pot), m.any_object(rng))]
    soil = shapes.lathe(np.array([[pot * 0.46, 0], [1e-4, 0]]), 24)
    parts.append(Part(s.moved(soil, (0, 0.85 * pot, 0)), m.Material(0, (m.hsv(0.07, 0.5, 0.25),) * 3, 0.8, (0.9, 0.9))))
    leaf, height = m.foliage(rng), size - pot
    n, long = int(rng.integers(20, 120)), rng.random() < 0.4
    if long:  # blades from the soil
        roots = np.stack([rng.normal(size=n) * pot * 0.12, np.full(n, pot * 0.85), rng.normal(size=n) * pot * 0.12], -1)
        way = np.stack([rng.normal(size=n) * 0.5, np.ones(n), rng.normal(size=n) * 0.5], -1)
        return [*parts, Part(s.leaves(rng, roots, way, height * 1.1, height * rng.uniform(0.04, 0.12)), leaf)]
    t = rng.random(n)
    angle, out = rng.uniform(0, 2 * np.pi, n), rng.uniform(0, 0.35, n) * height * np.sin(np.pi * (0.2 + 0.7 * t))
    roots = np.stack([out * np.cos(angle), pot * 0.9 + t * height * 0.8, out * np.sin(angle)], -1)
    way = np.stack([np.cos(angle), rng.uniform(0, 1.2, n), np.sin(angle)], -1)
    width = rng.uniform(0.25, 0.6)
    stem = np.stack([np.zeros(5), np.linspace(pot * 0.8, pot + 0.8 * height, 5), np.zeros(5)], -1)
    parts.append(Part(s.tube(stem, 0.015 * size, 6), m.wood(rng)))
    length = height * rng.uniform(0.2, 0.4)
    return [*parts, Part(s.leaves(rng, roots, way, length, length * width), leaf)]


def _rings(rng, size):
    """Ring, wheel, roll of tape."""
    phi = np.linspace(0, 2 * np.pi, 48)
    major = size * rng.uniform(0.3, 0.5)
    minor = major * rng.uniform(0.12, 0.4)
    loop = np.stack([np.cos(phi) * major, np.zeros(48), np.sin(phi) * major], -1)
    return [
        Part(s.grounded(s.moved(s.tube(loop, minor, 16), tip=float(rng.choice([0, np.pi / 2])))), m.any_object(rng))
    ]


def _candle(rng, size):
    """Rods: candles, pens in a cup, figures of stacked round parts (chessmen, lamps, toys)."""
    material, top, parts = m.any_object(rng), 0.0, []
    for _ in range(int(rng.integers(2, 6))):
        height, r = size * rng.uniform(0.1, 0.4), size * rng.uniform(0.06, 0.25)
        kind = rng.random()
        if kind < 0.4:
            profile = np.array([(1e-3, 0), (r, 0), (r * rng.uniform(0.5, 1), height), (1e-3, height)])
            solid = s.metric(shapes.lathe(profile, 32), np.pi * r, height)
        elif kind < 0.8:
            solid = s.moved(s.ball(32), (0, height / 2, 0), scale=height / 2)
        else:
            solid = s.slab(np.array([2 * r, height, 2 * r]), 0.1 * r)
        parts.append(Part(s.moved(solid, (0, top, 0)), material if rng.random() < 0.6 else m.any_object(rng)))
        top += height * 0.97
    return parts


def cushion(rng, size):
    """A soft cushion, leaning back."""
    extent = np.array([size, size * rng.uniform(0.7, 1), size * 0.3])
    base = shapes.superquadric(extent, 0.35, 0.35, 24)
    bump = s.lumps(rng, 0.05 * size, 2 / size)
    solid = s.warped(base, lambda p: p * [1, 1, 1] + bump(p)[:, None] * [0, 0, 1])
    return [Part(s.moved(s.metric(solid, size, size), tip=-rng.uniform(0.1, 0.5)), m.fabric(rng))]


def _device(rng, size):
    """Screen, radio, box with a dark glossy front."""
    extent = size * np.array([rng.uniform(0.9, 1.7), 1.0, rng.uniform(0.06, 0.5)])
    body = m.plastic(rng) if rng.random() < 0.7 else m.metal(rng)
    dark = m.Material(0, (m.hsv(0.6, 0.2, rng.uniform(0.05, 0.2)),) * 3, 0.0, (0.1, 0.1))
    front = dark if rng.random() < 0.6 else m.printed(rng, extent[0] * 0.9, extent[1] * 0.85)
    pane = s.moved(s.slab(np.array([0.9 * extent[0], 0.85 * extent[1], 0.01 * size])),
                   (0, 0.07 * extent[1], extent[2] / 2))  # fmt: skip
    return [Part(s.slab(extent, 0.03 * size), body), Part(pane, front)]


_TABLE = (
    (_box, 0.13), (_superquadric, 0.1), (_ball, 0.07), (_blob, 0.1), (vase, 0.12), (cup, 0.1), (bowl, 0.08),
    (bottle, 0.1), (books, 0.06), (plant, 0.05), (_rings, 0.03), (_candle, 0.06),
)  # fmt: skip
_KINDS = [kind for kind, _ in _TABLE]
_SHARES = np.array([share for _, share in _TABLE]) / sum(share for _, share in _TABLE)
device, box = _device, _box


def placed(parts: Parts, at: ArrayLike, turn: float = 0.0) -> Parts:
    """The parts turned about Y and moved by `at` [3], as one thing but for those that are things already."""
    return [replace(p, solid=s.moved(p.solid, at, turn)) for p in one_thing(parts)]


def footprint(parts: Parts) -> float:
    """Radius about the Y axis that holds all parts, metres."""
    return max(float(np.hypot(p.solid.vertices[:, 0], p.solid.vertices[:, 2]).max()) for p in parts)


def scattered(
    rng: np.random.Generator, count: int, half: tuple[float, float], sizes: tuple[float, float],
    meshes: tuple[Path, ...] = (), share: float = 0.3, taken: list | None = None,
) -> Parts:  # fmt: skip
    """Up to `count` things on the rectangle |x| <= half[0], |z| <= half[1] at y = 0 that do not touch each other."""
    taken, parts = [] if taken is None else taken, []
    for _ in range(count):
        one = thing(rng, float(np.exp(rng.uniform(*np.log(sizes)))), meshes, share)
        radius = footprint(one)
        for _ in range(12):
            x, z = rng.uniform(-1, 1, 2) * np.maximum(np.array(half) - 0.6 * radius, 0.01)
            if all(np.hypot(x - a, z - b) > 0.85 * (radius + r) for a, b, r in taken):
                taken.append((x, z, radius))
                parts += placed(one, (x, 0, z), rng.uniform(0, 2 * np.pi))
                break
    return parts
