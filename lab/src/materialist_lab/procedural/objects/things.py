"""Movable things, 3 to 60 centimetres high: what stands on tables, shelves and floors. Base on y = 0."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from materialist_lab.procedural import materials as m
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.world import Parts, ScenePart, block, one_thing, placed, rod

Meshes = tuple[Path, ...]


def thing(rng: np.random.Generator, size: float, meshes: Meshes = (), share: float = 0.3) -> Parts:
    """Some object about `size` metres high; with `share` probability a mesh from a file, if there are any."""
    if meshes and rng.random() < share:
        return one_thing(captured(rng, size, meshes))
    return one_thing(m.pick(rng, KINDS)(rng, size))


def captured(rng: np.random.Generator, size: float, meshes: Meshes) -> Parts:
    """A mesh from a file in any material, its longest side `size`."""
    # The texture wraps once around, about 0.6 times the height wide.
    solid = s.metric(s.load(meshes[rng.integers(len(meshes))]), np.pi * 0.6, 1)
    # Some lie on their front or back.
    tip = rng.choice([0, 0, 0, np.pi / 2, -np.pi / 2]) if rng.random() < 0.3 else 0.0
    standing = s.grounded(s.moved(solid, tip=tip, scale=size))
    return [ScenePart(standing, m.any_object(rng))]


def _box(rng, size) -> Parts:
    """A box, at times printed like a package."""
    extent = size * rng.uniform([0.4, 0.3, 0.4], [1.3, 1.0, 1.3])
    look = m.printed(rng, extent[0], extent[1]) if rng.random() < 0.3 else m.any_object(rng)
    rounding = float(rng.choice([0, 0.02, 0.08])) * size
    return [block(extent, (0, 0, 0), look, rounding)]


def _superquadric(rng, size) -> Parts:
    """Balls, eggs, rounded boxes, drums, diamonds."""
    extent = size * rng.uniform(0.5, 1.1, 3)
    e1, e2 = rng.uniform(0.2, 1.4, 2)
    if rng.random() < 0.4:  # a ball
        extent = np.full(3, extent[0])
        e1 = 1
        e2 = 1
    solid = s.superquadric(extent, e1, e2, 32)
    return [ScenePart(s.metric(solid, extent[0] * 1.5, extent[1] * 1.5), m.any_object(rng))]


def _blob(rng, size) -> Parts:
    """Fruit, bread, stones, folded soft things."""
    body = s.blob(rng, size * rng.uniform(0.5, 1.0, 3), rng.uniform(0.03, 0.3), 40)
    return [ScenePart(body, m.any_object(rng))]


def vase(rng, size) -> Parts:
    """Vase or jar of revolution, open at its top; flowers or twigs now and then."""
    radius = size * rng.uniform(0.18, 0.4)
    heights = np.linspace(0, 1, int(rng.integers(4, 7)))
    widths = rng.uniform(0.4, 1.0, len(heights))
    control = np.stack([widths * radius, heights * size], -1)
    parts = [ScenePart(s.pot(control, 0.04 * size), m.any_object(rng))]
    # Twigs begin within the vase and spread no wider than its mouth.
    if rng.random() < 0.35:
        mouth = widths[-1] * radius
        parts += _twigs(rng, size * 0.7, size * rng.uniform(0.7, 1.5), mouth * 0.6)
    return parts


def _twigs(rng, base, length, spread) -> Parts:
    """Leafy twigs of about that length which begin at the height `base`, within `spread` of the axis."""
    stem = m.foliage(rng)
    leaf = m.foliage(rng)
    parts = []
    t = np.linspace(0, 1, 6)[:, None]
    for _ in range(int(rng.integers(3, 9))):
        lean = rng.normal(size=2) * 0.35
        x, z = rng.uniform(-spread, spread, 2)
        # A parabola: the twig bends down towards its end.
        bend = t * [lean[0], 1, lean[1]] + t**2 * [lean[0], -0.2, 0]
        line = [x, base, z] + length * bend
        parts.append(rod(line, 0.008 * length, stem, 5))
        count = int(rng.integers(4, 12))
        roots = line[rng.integers(2, 6, count)]
        way = rng.normal((0, 0.5, 0), 1, (count, 3))
        leaves = s.leaves(rng, roots, way, 0.25 * length, 0.09 * length)
        parts.append(ScenePart(leaves, leaf))
    return parts


def _cup(rng, size) -> Parts:
    """Cup or mug with a handle and a drink in it."""
    radius = size * rng.uniform(0.4, 0.6)
    look = m.ceramic(rng)
    # (radius, height) of the wall; the exponent makes it straight or bellied.
    outline = np.array([(0.65, 0), (0.85, 0.2), (1, 0.6), (1.02, 1)])
    belly = rng.uniform(0.3, 1.3)
    control = outline ** [belly, 1] * [radius, size]
    # The handle is half an ellipse that begins and ends within the wall.
    phi = np.linspace(-np.pi / 2, np.pi / 2, 12)
    x = np.cos(phi) * 0.35 * size + radius * 0.9
    y = (np.sin(phi) * 0.3 + 0.5) * size
    loop = np.stack([x, y, 0 * phi], -1)
    # Coffee, tea, milk: a shiny disc.
    colour = m.hsv(rng.uniform(0.03, 0.12), rng.uniform(0.2, 0.9), rng.uniform(0.1, 0.8))
    drink = m.uniform(colour, 0.08)
    surface = s.moved(s.disc(radius * 0.9), (0, size * rng.uniform(0.6, 0.85), 0))
    return [
        ScenePart(s.pot(control, 0.05 * size), look),
        rod(loop, 0.05 * size, look, 7),
        ScenePart(surface, drink),
    ]


def _bowl(rng, size) -> Parts:
    """Plate or bowl, at times with fruit."""
    r = size * rng.uniform(0.6, 1.0)
    height = size * rng.uniform(0.15, 0.6)
    t = np.linspace(0, 1, 6)
    radius = r * (0.4 + 0.6 * t ** rng.uniform(0.3, 0.8))
    control = np.stack([radius, height * t], -1)
    parts = [ScenePart(s.pot(control, 0.03 * size), m.any_object(rng))]
    # Fruit, mostly of one kind.
    food = m.any_object(rng)
    for _ in range(int(rng.integers(2, 8)) if rng.random() < 0.5 else 0):
        piece = s.blob(rng, size * rng.uniform(0.25, 0.45, 3), 0.08, 24)
        place = rng.uniform([-0.4, 0.15, -0.4], [0.4, 0.45, 0.4]) * [r, height, r]
        look = food if rng.random() < 0.6 else m.any_object(rng)
        parts.append(ScenePart(s.moved(piece, place), look))
    return parts


def _bottle(rng, size) -> Parts:
    """An opaque bottle, mostly with a label."""
    r = size * rng.uniform(0.12, 0.2)
    neck = rng.uniform(0.3, 0.5)
    shoulder = rng.uniform(0.5, 0.75)
    # (radius, height) as shares: bottom, body, shoulder, neck, lip.
    profile = np.array(
        [
            (1e-3, 0),
            (0.95, 0),
            (1, 0.03),
            (1, shoulder),
            (neck + 0.1, shoulder + 0.15),
            (neck, 0.92),
            (neck * 1.1, 0.93),
            (neck * 1.1, 1),
            (1e-3, 1),
        ]
    ) * [r, size]
    look = m.plastic(rng) if rng.random() < 0.7 else m.metal(rng)
    parts = [ScenePart(s.metric(s.lathe(profile, 40), np.pi * r, size), look)]
    # The label is a band a hair outside the body.
    if rng.random() < 0.7:
        low, high = rng.uniform([0.05, 0.5], [0.25, 0.95]) * shoulder * size
        band = s.lathe(np.array([(1.012 * r, low), (1.012 * r, high)]), 40)
        label = replace(m.printed(rng, np.pi * r, high - low), offset=None)
        parts.append(ScenePart(s.metric(band, np.pi * r, high - low), label))
    return parts


def _books(rng, size) -> Parts:
    """A pile of books: pages between two covers."""
    parts = []
    top = 0.0
    paper = m.uniform(m.hsv(0.12, 0.12, 0.9), 0.8, grain=0.2)
    for _ in range(int(rng.integers(1, 6))):
        extent = size * rng.uniform([0.7, 0.06, 0.5], [1.1, 0.2, 0.8])
        w, h, d = extent
        turn = rng.normal() * 0.25
        cover = m.printed(rng, w, d) if rng.random() < 0.6 else m.plastic(rng)
        # The pages are a little smaller than their covers.
        pages = extent * [0.97, 0.8, 0.97]
        parts.append(block(pages, (0, top + 0.1 * h, 0), paper, turn=turn))
        for y in (top, top + 0.9 * h):
            parts.append(block((w, 0.1 * h, d), (0, y, 0), cover, turn=turn))
        top += h
    return parts


def plant(rng, size) -> Parts:
    """A potted plant: long blades from the soil, or leaves around a stem."""
    pot = size * rng.uniform(0.25, 0.4)
    leaf = m.foliage(rng)
    n = int(rng.integers(20, 120))
    control = np.array([(0.75, 0), (0.9, 0.5), (1, 1)]) * [pot * 0.5, pot]
    height = size - pot
    earth = m.uniform(m.hsv(0.07, 0.5, 0.25), 0.9, grain=0.8)
    soil = ScenePart(s.moved(s.disc(pot * 0.46), (0, 0.85 * pot, 0)), earth)
    parts = [ScenePart(s.pot(control, 0.05 * pot), m.any_object(rng)), soil]
    # --- Blades from the soil ---
    if rng.random() < 0.4:
        roots = rng.normal(size=(n, 3)) * [pot * 0.12, 0, pot * 0.12] + [0, pot * 0.85, 0]
        way = rng.normal(size=(n, 3)) * [0.5, 0, 0.5] + [0, 1, 0]
        width = height * rng.uniform(0.04, 0.12)
        blades = s.leaves(rng, roots, way, height * 1.1, width)
        return [*parts, ScenePart(blades, leaf)]
    # --- Leaves around a stem; the crown is widest at half its height, t ---
    t = rng.random(n)
    angle = rng.uniform(0, 2 * np.pi, n)
    out = rng.uniform(0, 0.35, n) * height * np.sin(np.pi * (0.2 + 0.7 * t))
    up = pot * 0.9 + t * height * 0.8
    roots = np.stack([out * np.cos(angle), up, out * np.sin(angle)], -1)
    way = np.stack([np.cos(angle), rng.uniform(0, 1.2, n), np.sin(angle)], -1)
    length = height * rng.uniform(0.2, 0.4)
    leaves = s.leaves(rng, roots, way, length, length * rng.uniform(0.25, 0.6))
    axis = [(0, 0.8 * pot, 0), (0, pot + 0.8 * height, 0)]
    return [*parts, rod(axis, 0.015 * size, m.wood(rng), 6), ScenePart(leaves, leaf)]


def _ring(rng, size) -> Parts:
    """Ring, wheel, roll of tape, lying or standing."""
    major = size * rng.uniform(0.3, 0.5)
    solid = s.torus(major, major * rng.uniform(0.12, 0.4), 16)
    tip = float(rng.choice([0, np.pi / 2]))
    return [ScenePart(s.grounded(s.moved(solid, tip=tip)), m.any_object(rng))]


def _stacked(rng, size) -> Parts:
    """Figures of stacked round parts: candles, chessmen, lamps, toys."""
    look = m.any_object(rng)
    top = 0.0
    parts = []
    for _ in range(int(rng.integers(2, 6))):
        height = size * rng.uniform(0.1, 0.4)
        r = size * rng.uniform(0.06, 0.25)
        # All three are made, whichever is taken: the random numbers of a seed stay in their places.
        kind = rng.integers(3)
        cone = s.drum(r, height, r * rng.uniform(0.5, 1))
        solid = (
            s.grounded(s.metric(cone, np.pi * r, height)),
            s.grounded(s.moved(s.ball(32), scale=height / 2)),
            s.slab((2 * r, height, 2 * r), 0.1 * r),
        )[kind]
        material = look if rng.random() < 0.6 else m.any_object(rng)
        parts.append(ScenePart(s.moved(solid, (0, top, 0)), material))
        # A little overlap, so that no gap shows.
        top += height * 0.97
    return parts


def cushion(rng, size) -> Parts:
    """A lumpy cushion that leans back."""
    extent = size * np.array([1, rng.uniform(0.7, 1), 0.3])
    base = s.superquadric(extent, 0.35, 0.35, 24)
    bump = s.lumps(rng, 0.05 * size, 2 / size)
    solid = s.warped(base, lambda p: p + bump(p)[:, None] * [0, 0, 1])
    leaning = s.moved(s.metric(solid, size, size), tip=-rng.uniform(0.1, 0.5))
    return [ScenePart(leaning, m.fabric(rng))]


KINDS = (
    (0.13, _box),
    (0.17, _superquadric),
    (0.1, _blob),
    (0.12, vase),
    (0.1, _cup),
    (0.08, _bowl),
    (0.1, _bottle),
    (0.06, _books),
    (0.05, plant),
    (0.03, _ring),
    (0.06, _stacked),
)


def scattered(
    rng: np.random.Generator,
    count: int,
    half: tuple[float, float],
    sizes: tuple[float, float],
    meshes: Meshes = (),
    share: float = 0.3,
) -> Parts:
    """Up to `count` things on the rectangle |x| <= half[0], |z| <= half[1] at y = 0 that do not touch each other."""
    taken: list[tuple[float, float, float]] = []
    parts: Parts = []
    for _ in range(count):
        item = thing(rng, float(np.exp(rng.uniform(*np.log(sizes)))), meshes, share)
        # The circle around it on the ground.
        radius = max(
            float(np.hypot(p.solid.vertices[:, 0], p.solid.vertices[:, 2]).max()) for p in item
        )
        # A dozen tries at a free place; a thing that fits nowhere is left out.
        for _ in range(12):
            x, z = rng.uniform(-1, 1, 2) * np.maximum(np.array(half) - 0.6 * radius, 0.01)
            if all(np.hypot(x - a, z - b) > 0.85 * (radius + r) for a, b, r in taken):
                taken.append((x, z, radius))
                parts += placed(item, (x, 0, z), rng.uniform(0, 2 * np.pi))
                break
    return parts
