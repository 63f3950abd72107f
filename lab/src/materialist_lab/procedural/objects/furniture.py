"""Furniture of slabs, rods and soft bodies; it stands on y = 0 with its back to -Z.

The first part of what one can look down on is its top.
"""

from collections.abc import Callable
from functools import partial

import numpy as np

from materialist_lab.procedural import materials as m
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.objects import things
from materialist_lab.procedural.world import Parts, ScenePart, block, placed, rod


def _legs(rng, width, depth, height, look) -> Parts:
    """Four square or round legs, six centimetres in from the corners."""
    r = rng.uniform(0.015, 0.04)
    square = rng.random() < 0.5
    to_x = width / 2 - 0.06
    to_z = depth / 2 - 0.06
    corners = [(x * to_x, 0, z * to_z) for x in (-1, 1) for z in (-1, 1)]
    if square:
        return [block((2 * r, height, 2 * r), at, look) for at in corners]
    return [rod([(x, 0, z), (x, height, z)], r, look, 10) for x, _, z in corners]


def _board_look(rng) -> m.Material:
    """What cupboards and tables are made of: wood, lacquer, paint."""
    return m.wood(rng) if rng.random() < 0.6 else m.one_of(rng, m.plastic, m.wall_paint)


def _cluttered(rng, width, depth, height, count, meshes) -> Parts:
    """Up to `count` things on a top of that size and height."""
    load = things.scattered(rng, count, (width / 2, depth / 2), (0.08, 0.38), meshes)
    # A little above the top: surfaces at one height would flicker in each other.
    return placed(load, (0, height + 0.003, 0))


def table(rng, meshes=(), fewest: int = 0) -> Parts:
    """Dining, coffee or work table, with things on it."""
    width, depth, thick = rng.uniform([0.8, 0.55, 0.02], [2.0, 1.0, 0.05])
    # A coffee table, or one to sit at.
    height = rng.uniform(0.35, 0.5) if rng.random() < 0.35 else rng.uniform(0.7, 0.78)
    top = m.stone(rng) if rng.random() < 0.2 else _board_look(rng)
    parts = [block((width, thick, depth), (0, height - thick, 0), top, rng.choice([0, 0.008]))]
    parts += _legs(rng, width, depth, height - thick, top if rng.random() < 0.5 else m.metal(rng))
    # A runner across the middle.
    if rng.random() < 0.2:
        corner = (-width * 0.3, height + 0.003, depth / 2)
        cloth = s.sheet(corner, (width * 0.6, 0, 0), (0, 0, -depth))
        parts.append(ScenePart(cloth, m.fabric(rng)))
    count = int(rng.integers(fewest, fewest + 7))
    return parts + _cluttered(rng, width, depth, height, count, meshes)


def chair(rng, meshes=()) -> Parts:
    """Chair or stool, with or without a cushion."""
    w, h, back = rng.uniform([0.4, 0.42, 0.35], [0.5, 0.48, 0.55])
    frame = m.wood(rng) if rng.random() < 0.7 else m.metal(rng)
    seat = m.one_of(rng, m.fabric, m.wood)
    kind = rng.random()
    parts = [block((w, 0.04, w), (0, h - 0.04, 0), seat, 0.015)]
    parts += _legs(rng, w, w, h - 0.04, frame)
    # A solid back, a back of rods under a rail, or none: a stool.
    if kind < 0.42:
        parts.append(block((w, back, 0.03), (0, h, -w / 2 + 0.02), seat, 0.01, tip=-0.12))
    elif kind < 0.85:
        for x in np.linspace(-w / 2 + 0.02, w / 2 - 0.02, int(rng.integers(2, 6))):
            ends = [(x, h, -w / 2 + 0.02), (x, h + back, -w / 2 - 0.05)]
            parts.append(rod(ends, 0.012, frame, 6))
        parts.append(block((w, 0.08, 0.02), (0, h + back - 0.08, -w / 2 - 0.05), frame))
    return parts


def sofa(rng, meshes=()) -> Parts:
    """Armchair or sofa, with cushions on each seat."""
    width = rng.uniform(0.75, 1.0) if rng.random() < 0.5 else rng.uniform(1.4, 2.3)
    depth, seat, back, arm, r = rng.uniform(
        [0.75, 0.36, 0.3, 0.1, 0.03], [0.95, 0.45, 0.5, 0.22, 0.09]
    )
    cloth = m.fabric(rng)
    # --- Body: base, back, arms ---
    parts = [block((width, seat - 0.16, depth), (0, 0.06, 0), cloth, 0.03)]
    parts.append(block((width, back + seat - 0.1, 0.2), (0, 0.1, -depth / 2 + 0.1), cloth, r))
    parts += [
        block((arm, seat + 0.16, depth), (x * (width - arm) / 2, 0.05, 0), cloth, r)
        for x in (-1, 1)
    ]
    # --- Cushions: a seat about 65 cm wide each, with a back cushion and a loose one at times ---
    count = max(1, round((width - 2 * arm) / 0.65))
    each = (width - 2 * arm) / count
    for x in (np.arange(count) + 0.5) * each - width / 2 + arm:
        parts.append(block((each * 0.98, 0.16, depth - 0.22), (x, seat - 0.12, 0.1), cloth, 0.05))
        if rng.random() < 0.7:
            at = (x, seat + 0.02, -depth / 2 + 0.3)
            parts.append(block((each * 0.96, 0.42, 0.16), at, cloth, 0.06, tip=-0.2))
        if rng.random() < 0.35:
            loose = things.cushion(rng, rng.uniform(0.32, 0.45))
            parts += placed(loose, (x, seat + 0.03, 0.02), rng.normal() * 0.3)
    return parts


def _fronts(width, height, at, columns, rows, front, knob) -> Parts:
    """Doors, or drawers where there are more than two rows, with handles, on the face of a body at `at` [3]."""
    w = width / columns
    h = height / rows
    parts = []
    drawers = rows > 2
    # Drawers have a level handle in the middle, doors an upright one at the side that opens.
    handle = (0.12, 0.012, 0.02) if drawers else (0.012, 0.14, 0.02)
    for c, r in np.ndindex(columns, rows):
        low = np.add(at, (-width / 2 + (c + 0.5) * w, r * h, 0))
        side = 0.0 if drawers else (w / 2 - 0.05) * (1 if c % 2 else -1)
        # Gaps of twelve millimetres between the fronts.
        face = (w - 0.012, h - 0.012, 0.02)
        parts.append(block(face, np.add(low, (0, 0.006, 0.008)), front, 0.004))
        parts.append(block(handle, np.add(low, (side, h * 0.55, 0.03)), knob, 0.004))
    return parts


def cupboard(rng, meshes=(), wardrobes: bool = True) -> Parts:
    """Chest, sideboard or, where `wardrobes` may be, wardrobe, with doors or drawers."""
    height = rng.uniform(1.7, 2.2) if wardrobes and rng.random() >= 0.7 else rng.uniform(0.45, 1.0)
    width = rng.uniform(0.5, 2.2)
    depth = rng.uniform(0.35, 0.6)
    foot = float(rng.choice([0.0, 0.08, 0.15]))
    body = _board_look(rng)
    # Low ones have drawers at times and things on them.
    low = height < 1.3
    front = body if rng.random() < 0.6 else _board_look(rng)
    parts = [block((width, height - foot, depth), (0, foot, 0), body, 0.004)]
    parts += _legs(rng, width, depth, foot, m.metal(rng)) if foot else []
    columns = max(1, round(width / rng.uniform(0.4, 0.7)))
    rows = int(rng.integers(1, 5 if low else 3))
    face = (0, foot, depth / 2)
    parts += _fronts(width, height - foot, face, columns, rows, front, m.metal(rng))
    count = int(rng.integers(0, 6)) if low else 0
    return parts + _cluttered(rng, width, depth, height, count, meshes)


def kitchen(rng, meshes=()) -> Parts:
    """A worktop over cupboards, wall units above, tiles between."""
    width = rng.uniform(1.6, 3.2)
    depth = 0.6
    front = _board_look(rng)
    knob = m.metal(rng)
    count = max(2, round(width / 0.55))
    # --- Worktop and the cupboards under it ---
    parts = [block((width, 0.04, depth), (0, 0.86, 0), m.one_of(rng, m.stone, m.wood))]
    parts.append(block((width, 0.78, depth - 0.05), (0, 0.08, -0.02), front))
    parts += _fronts(width, 0.74, (0, 0.1, depth / 2 - 0.035), count, 1, front, knob)
    # --- Wall units ---
    if rng.random() < 0.75:
        parts.append(block((width, 0.65, 0.32), (0, 1.42, -0.13), front))
        parts += _fronts(width, 0.65, (0, 1.42, 0.035), count, 1, front, knob)
    # --- Tiles between them, and what stands on the worktop ---
    splash = s.sheet((-width / 2, 0.9, -depth / 2 + 0.01), (width, 0, 0), (0, 0.52, 0))
    load = _cluttered(rng, width, depth * 0.8, 0.9, int(rng.integers(2, 9)), meshes)
    return [*parts, ScenePart(splash, m.tiled(rng)), *load]


def shelf(rng, meshes=()) -> Parts:
    """Open shelves with books and things; with a back at times."""
    width, depth, height = rng.uniform([0.6, 0.25, 0.9], [1.8, 0.38, 2.2])
    levels = int(rng.integers(2, 6))
    look = _board_look(rng)
    parts = [block((0.025, height, depth), (x * width / 2, 0, 0), look) for x in (-1, 1)]
    if rng.random() < 0.6:
        parts.append(block((width, height, 0.01), (0, 0, -depth / 2), look))
    gap = (height - 0.06) / levels
    for y in 0.02 + gap * np.arange(levels + 1):
        parts.append(block((width, 0.022, depth), (0, y, 0), look))
        # Nothing on the uppermost board.
        if y < height - gap:
            load = _shelf_load(rng, width - 0.08, depth, gap * 0.85, meshes)
            parts += placed(load, (0, y + 0.022, 0))
    return parts


def _shelf_load(rng, width, depth, height, meshes) -> Parts:
    """Things, or a row of books from the left."""
    if rng.random() < 0.5:
        half = (width / 2, depth * 0.35)
        sizes = (0.4 * height, height)
        return things.scattered(rng, int(rng.integers(1, 6)), half, sizes, meshes)
    parts = []
    # Books of random thickness, two centimetres behind the front edge.
    x = -width / 2
    end = width / 2 * rng.uniform(-0.5, 1)
    while x < end:
        size = rng.uniform([0.012, 0.6, 0.55], [0.055, 0.98, 0.85]) * [1, height, depth]
        look = m.plastic(rng) if rng.random() < 0.7 else m.printed(rng, size[0], size[1])
        parts.append(block(size, (x + size[0] / 2, 0, (depth - size[2]) / 2 - 0.02), look, 0.003))
        x += size[0] + 0.002
    return parts


def bed(rng, meshes=()) -> Parts:
    """A bed with a rumpled cover, a head board and one or two pillows."""
    width, length, height, head = rng.uniform([0.9, 1.9, 0.35, 0.7], [1.8, 2.1, 0.5, 1.2])
    frame = _board_look(rng)
    cover = m.fabric(rng)
    # The cover: a fine sheet, two centimetres wider than the bed, lifted onto it with waves.
    wave = s.lumps(rng, 0.05, 2.0)
    corner = (-width / 2 - 0.02, 0, length / 2)
    soft = s.sheet(corner, (width + 0.04, 0, 0), (0, 0, -length * 0.85), 44)
    rumpled = s.warped(soft, lambda p: p + (wave(p) + height * 0.55 + 0.24)[:, None] * [0, 1, 0])
    parts = [
        block((width, height * 0.6, length), (0, 0.05, 0), frame, 0.02),
        ScenePart(rumpled, cover),
    ]
    parts.append(block((width, head, 0.06), (0, 0, -length / 2), frame, 0.02))
    parts.append(block((width - 0.02, 0.2, length - 0.05), (0, height * 0.55, 0), cover, 0.06))
    # Pillows: two on a double bed.
    for x in (-0.25, 0.25) if width > 1.3 else (0.0,):
        parts += placed(things.cushion(rng, 0.55), (x * width, height + 0.17, -length / 2 + 0.25))
    return parts


def floor_thing(rng, meshes=()) -> Parts:
    """Something large on the floor: a plant, a vase, a box, a mesh."""
    size = rng.uniform(0.4, 1.3)
    if rng.random() < 0.4:
        return things.plant(rng, size)
    return things.thing(rng, size * 0.7, meshes, 0.5)


# (share, maker) of what stands where.
ALONG_WALLS = (
    (0.24, cupboard),
    (0.2, shelf),
    (0.2, sofa),
    (0.08, bed),
    (0.12, table),
    (0.08, kitchen),
    (0.08, floor_thing),
)
IN_THE_MIDDLE = ((0.45, table), (0.25, chair), (0.12, sofa), (0.18, floor_thing))
set_table: Callable[..., Parts] = partial(table, fewest=3)
sideboard: Callable[..., Parts] = partial(cupboard, wardrobes=False)
TO_LOOK_ON = ((0.6, set_table), (0.2, kitchen), (0.2, sideboard))
