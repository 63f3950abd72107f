"""What stands outdoors: houses, cars, trees, bushes, people, posts, walls. Base on y = 0, metres."""

from __future__ import annotations

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural.objects import shapes
from materialist.procedural.objects import solids as s
from materialist.procedural.objects.things import Parts
from materialist.procedural.world import Part

_X = np.eye(3)[0]


def house(rng) -> Parts:
    """A house facing +Z: a block with a front of windows, a plinth, ledges, a door, a roof."""
    w, h, d = rng.uniform(5, 14), rng.uniform(3.5, 14), rng.uniform(6, 10)
    front = m.facade(rng) if rng.random() < 0.8 else m.brick(rng)
    parts = [Part(s.moved(s.slab(np.array([w, h, d])), (0, 0, -d / 2)), front)]
    trim = m.stone(rng) if rng.random() < 0.5 else m.wall_paint(rng)
    if rng.random() < 0.7:
        parts.append(Part(s.moved(s.slab(np.array([w + 0.1, rng.uniform(0.4, 1.0), 0.12])), (0, 0, 0.03)), trim))
    for y in np.arange(3.2, h, 3.2):
        if rng.random() < 0.5:
            parts.append(Part(s.moved(s.slab(np.array([w + 0.1, 0.15, 0.2])), (0, y, 0.05)), trim))
    x = rng.uniform(-0.35, 0.35) * w
    parts.append(Part(s.moved(s.slab(np.array([1.3, 2.4, 0.16])), (x, 0, 0.03)), trim))
    parts.append(Part(s.moved(s.slab(np.array([1.0, 2.2, 0.2])), (x, 0, 0.03)), m.wood(rng)))
    if rng.random() < 0.6:
        rise, look_ = rng.uniform(1.5, 3.5), m.brick(rng)
        for side in (1, -1):
            run = np.array([0, -rise, side * (d / 2 + 0.5)])
            start = np.array([-side * (w / 2 + 0.3), h + rise, -d / 2])
            parts.append(Part(s.sheet(start + run, side * (w + 0.6) * _X, -run), look_))
    else:
        parts.append(Part(s.moved(s.slab(np.array([w + 0.6, 0.3, d + 0.6])), (0, h, -d / 2)), trim))
    return parts


def car(rng) -> Parts:
    """A car along X."""
    length, width = rng.uniform(3.6, 4.8), rng.uniform(1.6, 1.85)
    paint = m.any_colour(rng)
    body = m.Material(0, (paint,) * 3, 0.0, (rng.uniform(0.08, 0.3),) * 2, (float(rng.choice([0.0, 0.4])),) * 2)
    dark = m.Material(0, (m.hsv(0.6, 0.2, 0.12),) * 3, 0.0, (0.08, 0.08))
    rubber, rim = m.Material(0, (m.hsv(0.1, 0.05, 0.15),) * 3, 0.1, (0.8, 0.8)), m.metal(rng)
    cabin, hood = rng.uniform(1.7, 2.8), rng.uniform(-0.4, 0.3)
    lower, upper = s.slab(np.array([length, 0.6, width]), 0.2), s.slab(np.array([cabin, 0.62, width * 0.9]), 0.25)
    taper = lambda p: p * np.stack([1 - 0.22 * p[:, 1], 1 + 0 * p[:, 1], 1 - 0.12 * p[:, 1]], -1)  # noqa: E731
    parts = [Part(s.moved(lower, (0, 0.28, 0)), body), Part(s.moved(s.warped(upper, taper), (hood, 0.8, 0)), dark)]
    parts.append(Part(s.moved(s.slab(np.array([cabin * 0.72, 0.08, width * 0.78]), 0.04), (hood, 1.36, 0)), body))
    for x in (-0.31 * length, 0.31 * length):
        for z in (-width / 2 + 0.1, width / 2 - 0.1):
            wheel = shapes.lathe(np.array([(1e-3, -0.1), (0.31, -0.1), (0.31, 0.1), (1e-3, 0.1)]), 24)
            hub = shapes.lathe(np.array([(1e-3, -0.11), (0.19, -0.11), (0.19, 0.11), (1e-3, 0.11)]), 24)
            parts += [Part(s.moved(o, (x, 0.31, z), tip=np.pi / 2), k) for o, k in ((wheel, rubber), (hub, rim))]
    for x in (-length / 2 - 0.005, length / 2 + 0.005):
        light = m.any_colour(rng) if rng.random() < 0.5 else (0.8, 0.8, 0.8)
        lamp = m.Material(0, (light,) * 3, 0.0, (0.1, 0.1))
        for z in (-0.36, 0.36):
            parts.append(Part(s.moved(s.slab(np.array([0.04, 0.14, 0.3]), 0.02), (x, 0.62, z * width)), lamp))
    return parts


def tree(rng, size: float) -> Parts:
    """A tree: trunk, boughs, and a crown of leaves or of soft masses; bare in winter."""
    trunk, leaf, kind = m.wood(rng, gloss=False), m.foliage(rng), rng.random()
    fork = size * rng.uniform(0.25, 0.45)
    parts = [Part(s.tube([(0, 0, 0), (0.02 * size, fork, 0), (0, 0.75 * size, 0.03 * size)],
                         size * np.array([0.035, 0.025, 0.008])), trunk)]  # fmt: skip
    tips = []
    for _ in range(int(rng.integers(4, 10))):
        end = np.array([rng.normal() * 0.22, rng.uniform(0.55, 1.0), rng.normal() * 0.22]) * size
        start = np.array([0, fork + rng.uniform(0, 0.2) * size, 0])
        middle = (start + end) / 2 + [0, 0.06 * size, 0]
        parts.append(Part(s.tube([start, middle, end], size * np.array([0.016, 0.01, 0.004]), 6), trunk))
        tips += [middle, end]
    centres = np.array(tips)
    if kind < 0.55:
        n = int(rng.integers(400, 1500))
        roots = centres[rng.integers(len(centres), size=n)] + rng.normal(size=(n, 3)) * 0.11 * size
        length = size * rng.uniform(0.04, 0.09)
        parts.append(Part(s.leaves(rng, roots, rng.normal(size=(n, 3)), length, 0.5 * length), leaf))
    elif kind < 0.9:
        for c in centres[:8]:
            mass = s.blob(rng, size * rng.uniform(0.25, 0.5, 3), 0.25, 32)
            parts.append(Part(s.moved(mass, c - [0, 0.12 * size, 0]), leaf))
    return parts


def bush(rng, size: float) -> Parts:
    """A round mass of leaves."""
    leaf, n = m.foliage(rng), int(rng.integers(150, 500))
    core = s.blob(rng, size * np.array([1.0, 0.8, 1.0]), 0.2, 32)
    roots = core.vertices[rng.integers(len(core.vertices), size=n)] * 0.95
    length = size * rng.uniform(0.12, 0.25)
    return [
        Part(core, leaf),
        Part(s.leaves(rng, roots, rng.normal((0, 0.4, 0), 1, (n, 3)), length, 0.4 * length), leaf),
    ]


def person(rng) -> Parts:
    """Somebody standing, of capsules and a head."""
    tall = rng.uniform(1.5, 1.9)
    skin, shirt, trousers, hair = m.skin(rng), m.fabric(rng), m.fabric(rng), m.plastic(rng)
    leg, hip, neck = 0.02, 0.5 * tall, 0.84 * tall
    parts = []
    for x in (-0.09, 0.09):
        foot = rng.normal() * 0.12
        parts.append(
            Part(
                s.tube([(x, 0.03, foot), (x, hip / 2, foot * 0.3), (x, hip, 0)], np.array([0.06, 0.07, 0.1]), 12),
                trousers,
            )
        )
        hand = (x * 3.2, hip * 0.95, rng.normal() * 0.12 + leg)
        parts.append(
            Part(
                s.tube(
                    [(x * 2, neck - 0.06, 0), (x * 2.9, 0.66 * tall, -0.03), hand], np.array([0.06, 0.05, 0.035]), 10
                ),
                shirt,
            )
        )
        parts.append(Part(s.moved(s.ball(16), hand, scale=0.05), skin))
    torso = s.warped(s.ball(32), lambda p: p * [0.21, 0.19 * tall, 0.13] * (1 + 0.15 * p[:, 1:2]))
    parts.append(Part(s.moved(torso, (0, 0.66 * tall, 0)), shirt))
    parts.append(Part(s.moved(s.warped(s.ball(32), lambda p: p * [0.078, 0.11, 0.092]), (0, 0.925 * tall, 0.01)), skin))
    parts.append(Part(s.moved(s.warped(s.ball(32), lambda p: p * [0.086, 0.1, 0.095]), (0, 0.95 * tall, -0.02)), hair))
    return parts


def post(rng) -> Parts:
    """Lamp post, bollard or sign."""
    height, kind = rng.uniform(0.8, 5), rng.random()
    look_ = m.metal(rng) if kind < 0.5 else m.plastic(rng)
    parts = [Part(s.tube([(0, 0, 0), (0, height, 0)], rng.uniform(0.04, 0.12), 12), look_)]
    if height > 2 and kind < 0.7:
        parts.append(
            Part(s.moved(s.slab(np.array([0.5, 0.5, 0.03]), 0.01), (0, height - 0.3, 0.1)), m.printed(rng, 0.5, 0.5))
        )
    elif height < 1.4:
        parts.append(Part(s.moved(s.ball(24), (0, height, 0), scale=0.13), look_))
    return parts


def wall(rng, length: float) -> Parts:
    """A wall or a fence along X."""
    height = rng.uniform(0.5, 3.0)
    look_ = [m.brick, m.stone, m.wall_paint, m.wood][rng.integers(4)](rng)
    if rng.random() < 0.25:  # fence
        bars = [Part(s.moved(s.slab(np.array([0.09, height * 0.6, 0.03])), (x, 0, 0)), look_)
                for x in np.arange(-length / 2, length / 2, 0.16)]  # fmt: skip
        return [*bars, Part(s.moved(s.slab(np.array([length, 0.07, 0.04])), (0, height * 0.4, 0.03)), look_)]
    parts = [Part(s.slab(np.array([length, height, 0.3])), look_)]
    if rng.random() < 0.5:
        parts.append(Part(s.moved(s.slab(np.array([length + 0.1, 0.08, 0.4])), (0, height, 0)), m.stone(rng)))
    return parts
