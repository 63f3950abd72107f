"""What bounds a street or a yard: houses and walls. Base on y = 0, metres."""

import numpy as np

from materialist_lab.procedural import materials as m
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.world import Parts, ScenePart, block, bounds


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


def houses(
    rng: np.random.Generator, start: float, end: float, gap: float
) -> list[tuple[float, Parts]]:
    """(middle, house) of houses in a row between two places, some of them apart."""
    row = []
    while start < end:
        made = house(rng)
        width = float(np.ptp(bounds(made[:1]), axis=0)[0])
        row.append((start + width / 2, made))
        start += width + rng.choice([0.0, rng.uniform(0.5, gap)])
    return row


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
