"""Movable things, 3 to 60 centimetres high: what stands on tables, shelves and floors. Base on y = 0."""

from pathlib import Path

import numpy as np

from materialist_lab.procedural import materials as m
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.world import Parts, ScenePart, block, one_thing, placed

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


def _vase(rng, size) -> Parts:
    """Vase or jar of revolution, open at its top."""
    radius = size * rng.uniform(0.18, 0.4)
    heights = np.linspace(0, 1, int(rng.integers(4, 7)))
    widths = rng.uniform(0.4, 1.0, len(heights))
    control = np.stack([widths * radius, heights * size], -1)
    return [ScenePart(s.pot(control, 0.04 * size), m.any_object(rng))]


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


KINDS = (
    (0.2, _box),
    (0.25, _superquadric),
    (0.15, _blob),
    (0.2, _vase),
    (0.05, _ring),
    (0.15, _stacked),
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
