"""What stands outdoors: houses, cars, trees, bushes, people, posts, walls. Base on y = 0, metres."""

import numpy as np

from materialist_lab.procedural import materials as m
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.world import Parts, ScenePart, block, orb, rod


def house(rng) -> Parts:
    """A house facing +Z: a block with a front of windows, a plinth, ledges, a door, a roof."""
    w, h, d = rng.uniform([5, 3.5, 6], [14, 14, 10])
    trim = m.one_of(rng, m.stone, m.wall_paint)
    x = rng.uniform(-0.35, 0.35) * w
    front = m.facade(rng) if rng.random() < 0.8 else m.brick(rng)
    # --- The block, its plinth, ledges at the storeys and a door ---
    parts = [block((w, h, d), (0, 0, -d / 2), front)]
    if rng.random() < 0.7:
        parts.append(block((w + 0.1, rng.uniform(0.4, 1.0), 0.12), (0, 0, 0.03), trim))
    ledges = [y for y in np.arange(3.2, h, 3.2) if rng.random() < 0.5]
    parts += [block((w + 0.1, 0.15, 0.2), (0, y, 0.05), trim) for y in ledges]
    parts += [
        block((1.3, 2.4, 0.16), (x, 0, 0.03), trim),
        block((1.0, 2.2, 0.2), (x, 0, 0.03), m.wood(rng)),
    ]
    # --- A flat roof, or two slopes ---
    if rng.random() < 0.4:
        return [*parts, block((w + 0.6, 0.3, d + 0.6), (0, h, -d / 2), trim)]
    rise = rng.uniform(1.5, 3.5)
    roof = m.brick(rng)
    for side in (1, -1):
        run = np.array([0, -rise, side * (d / 2 + 0.5)])
        start = np.array([-side * (w / 2 + 0.3), h + rise, -d / 2])
        parts.append(ScenePart(s.sheet(start + run, (side * (w + 0.6), 0, 0), -run), roof))
    return parts


def car(rng) -> Parts:
    """A car along X."""
    length, width, cabin, hood = rng.uniform([3.6, 1.6, 1.7, -0.4], [4.8, 1.85, 2.8, 0.3])
    body = m.uniform(m.shade(rng), rng.uniform(0.08, 0.3), float(rng.choice([0.0, 0.4])))
    dark = m.uniform(m.hsv(0.6, 0.2, 0.12), 0.08)
    rubber = m.uniform(m.hsv(0.1, 0.05, 0.15), 0.8)
    rim = m.metal(rng)

    def taper(p):
        """Narrower towards the roof, more so along the car than across it."""
        return p * np.stack([1 - 0.22 * p[:, 1], 1 + 0 * p[:, 1], 1 - 0.12 * p[:, 1]], -1)

    # --- Body, cabin and roof ---
    upper = s.warped(s.slab((cabin, 0.62, width * 0.9), 0.25), taper)
    parts = [
        block((length, 0.6, width), (0, 0.28, 0), body, 0.2),
        ScenePart(s.moved(upper, (hood, 0.8, 0)), dark),
        block((cabin * 0.72, 0.08, width * 0.78), (hood, 1.36, 0), body, 0.04),
    ]
    # --- Wheels: a tyre, and a rim that stands out of it a little ---
    for x in (-0.31 * length, 0.31 * length):
        for z in (0.1 - width / 2, width / 2 - 0.1):
            for radius, thick, look in ((0.31, 0.2, rubber), (0.19, 0.22, rim)):
                wheel = s.moved(s.drum(radius, thick), (x, 0.31, z), tip=np.pi / 2)
                parts.append(ScenePart(wheel, look))
    # --- Lamps at both ends ---
    for x in (-length / 2 - 0.005, length / 2 + 0.005):
        lamp = m.uniform(m.shade(rng) if rng.random() < 0.5 else (0.8, 0.8, 0.8), 0.1)
        parts += [block((0.04, 0.14, 0.3), (x, 0.62, z * width), lamp, 0.02) for z in (-0.36, 0.36)]
    return parts


def tree(rng, size: float) -> Parts:
    """A tree: trunk, boughs, and a crown of leaves or of soft masses; bare in winter."""
    # --- Trunk and boughs ---
    trunk = m.raw_wood(rng)
    leaf = m.foliage(rng)
    kind = rng.random()
    tips = []
    fork = rng.uniform(0.25, 0.45)
    line = size * np.array([(0, 0, 0), (0.02, fork, 0), (0, 0.75, 0.03)])
    parts = [rod(line, size * np.array([0.035, 0.025, 0.008]), trunk)]
    for _ in range(int(rng.integers(4, 10))):
        # From the trunk above the fork to somewhere in the crown.
        lowest = [(0, fork, 0), (-0.4, 0.55, -0.4)]
        highest = [(0, fork + 0.2, 0), (0.4, 1, 0.4)]
        start, end = size * rng.uniform(lowest, highest)
        middle = (start + end) / 2 + [0, 0.06 * size, 0]
        parts.append(rod([start, middle, end], size * np.array([0.016, 0.01, 0.004]), trunk, 6))
        tips += [middle, end]
    # --- The crown: leaves around the tips, soft masses, or nothing ---
    if kind < 0.55:
        n = int(rng.integers(400, 1500))
        length = size * rng.uniform(0.04, 0.09)
        boughs = np.array(tips)[rng.integers(len(tips), size=n)]
        roots = boughs + rng.normal(size=(n, 3)) * 0.11 * size
        leaves = s.leaves(rng, roots, rng.normal(size=(n, 3)), length, 0.5 * length)
        parts.append(ScenePart(leaves, leaf))
    # Soft masses on the first tips.
    elif kind < 0.9:
        masses = [s.blob(rng, size * rng.uniform(0.25, 0.5, 3), 0.25, 32) for _ in tips[:8]]
        parts += [
            ScenePart(s.moved(crown, tip - [0, 0.12 * size, 0]), leaf)
            for crown, tip in zip(masses, tips)
        ]
    return parts


def bush(rng, size: float) -> Parts:
    """A round mass of leaves."""
    leaf = m.foliage(rng)
    n = int(rng.integers(150, 500))
    length = size * rng.uniform(0.12, 0.25)
    # A dark core behind the leaves: a bush is not transparent.
    core = s.blob(rng, size * np.array([1.0, 0.8, 1.0]), 0.2, 32)
    roots = core.vertices[rng.integers(len(core.vertices), size=n)] * 0.95
    leaves = s.leaves(rng, roots, rng.normal((0, 0.4, 0), 1, (n, 3)), length, 0.4 * length)
    return [ScenePart(core, leaf), ScenePart(leaves, leaf)]


def person(rng) -> Parts:
    """Somebody standing, of capsules and a head."""
    tall = rng.uniform(1.5, 1.9)
    skin = m.skin(rng)
    shirt = m.fabric(rng)
    trousers = m.fabric(rng)
    parts = []
    hip = 0.5 * tall
    neck = 0.84 * tall
    # A leg and an arm on each side.
    for x in (-0.09, 0.09):
        foot, reach = rng.normal(size=2) * 0.12
        leg = [(x, 0.03, foot), (x, hip / 2, foot * 0.3), (x, hip, 0)]
        arm = [(x * 2, neck - 0.06, 0), (x * 2.9, 0.66 * tall, -0.03), (x * 3.2, hip * 0.95, reach)]
        parts += [
            rod(leg, [0.06, 0.07, 0.1], trousers, 12),
            rod(arm, [0.06, 0.05, 0.035], shirt, 10),
        ]
        parts.append(orb(arm[-1], 0.05, skin, 16))
    torso = s.warped(s.ball(32), lambda p: p * [0.21, 0.19 * tall, 0.13] * (1 + 0.15 * p[:, 1:2]))
    parts.append(ScenePart(s.moved(torso, (0, 0.66 * tall, 0)), shirt))
    head = (0.078, 0.11, 0.092)
    hair = (0.086, 0.1, 0.095)
    # The hair is a larger ellipsoid, a little higher and further back.
    for half, y, z, look in ((head, 0.925, 0.01, skin), (hair, 0.95, -0.02, m.plastic(rng))):
        ellipsoid = s.warped(s.ball(32), lambda p, h=half: p * h)
        parts.append(ScenePart(s.moved(ellipsoid, (0, y * tall, z)), look))
    return parts


def post(rng) -> Parts:
    """A tall post, at times with a sign, or a bollard with a ball on it."""
    height = rng.uniform(0.8, 5)
    look = m.one_of(rng, m.metal, m.plastic)
    parts = [rod([(0, 0, 0), (0, height, 0)], rng.uniform(0.04, 0.12), look, 12)]
    if height > 2 and rng.random() < 0.7:
        parts.append(
            block((0.5, 0.5, 0.03), (0, height - 0.3, 0.1), m.printed(rng, 0.5, 0.5), 0.01)
        )
    elif height < 1.4:
        parts.append(orb((0, height, 0), 0.13, look))
    return parts


def wall(rng, length: float) -> Parts:
    """A wall or a fence along X."""
    height = rng.uniform(0.5, 3.0)
    look = m.one_of(rng, m.brick, m.stone, m.wall_paint, m.wood)
    if rng.random() < 0.25:
        bars = [
            block((0.09, height * 0.6, 0.03), (x, 0, 0), look)
            for x in np.arange(-length / 2, length / 2, 0.16)
        ]
        return [*bars, block((length, 0.07, 0.04), (0, height * 0.4, 0.03), look)]
    parts = [block((length, height, 0.3), (0, 0, 0), look)]
    if rng.random() < 0.5:
        parts.append(block((length + 0.1, 0.08, 0.4), (0, height, 0), m.stone(rng)))
    return parts
