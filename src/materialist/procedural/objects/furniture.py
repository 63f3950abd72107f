"""Furniture of slabs, tubes and soft bodies; it stands on y = 0 with its back to -Z."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural.objects import solids as s
from materialist.procedural.objects import things
from materialist.procedural.objects.things import Parts
from materialist.procedural.world import Part


@dataclass(frozen=True)
class Piece:
    """One piece of furniture and the room it takes."""

    parts: Parts
    width: float
    depth: float
    tops: tuple[tuple[float, float, float, float], ...] = ()
    """Surfaces to put things on: (height, half width, half depth, z of the centre), metres."""


def _board(size, at, material, radius=0.004) -> Part:
    return Part(s.moved(s.slab(np.asarray(size, float), radius), at), material)


def _legs(rng, width, depth, height, material) -> Parts:
    r, inset = rng.uniform(0.015, 0.04), 0.06
    corners = [(x * (width / 2 - inset), z * (depth / 2 - inset)) for x in (-1, 1) for z in (-1, 1)]
    if rng.random() < 0.5:
        return [_board((2 * r, height, 2 * r), (x, 0, z), material) for x, z in corners]
    return [
        Part(s.tube([(x * 1.03, 0, z * 1.03), (x, height / 2, z), (x, height, z)], r, 10), material) for x, z in corners
    ]


def _solid_look(rng) -> m.Material:
    """What cupboards and tables are made of: wood, lacquer, paint."""
    return m.wood(rng) if rng.random() < 0.6 else m.plastic(rng) if rng.random() < 0.5 else m.wall_paint(rng)


def table(rng, meshes=(), clutter: int | None = None, low: bool | None = None) -> Piece:
    """Dining, coffee or work table, with things on it."""
    low = rng.random() < 0.35 if low is None else low
    width, depth = rng.uniform(0.8, 2.0), rng.uniform(0.55, 1.0)
    height = rng.uniform(0.35, 0.5) if low else rng.uniform(0.7, 0.78)
    thick = rng.uniform(0.02, 0.05)
    top = m.stone(rng) if rng.random() < 0.2 else _solid_look(rng)
    parts = [_board((width, thick, depth), (0, height - thick, 0), top, rng.choice([0, 0.008]))]
    parts += _legs(rng, width, depth, height - thick, top if rng.random() < 0.5 else m.metal(rng))
    if rng.random() < 0.2:
        cloth = s.sheet(
            (-width * 0.3, height + 0.003, depth / 2), np.array([width * 0.6, 0, 0]), np.array([0, 0, -depth])
        )
        parts.append(Part(cloth, m.fabric(rng)))
    count = int(rng.integers(0, 7)) if clutter is None else clutter
    on = things.scattered(rng, count, (width / 2, depth / 2), (0.08, 0.35), meshes)
    parts += things.placed(on, (0, height + 0.003, 0))
    return Piece(parts, width, depth, ((height, width / 2, depth / 2, 0),))


def chair(rng, meshes=()) -> Piece:
    """Chair or stool, with or without a cushion."""
    w, h, back = rng.uniform(0.4, 0.5), rng.uniform(0.42, 0.48), rng.uniform(0.35, 0.55)
    frame, seat = (
        (m.wood(rng) if rng.random() < 0.7 else m.metal(rng)),
        (m.fabric(rng) if rng.random() < 0.5 else m.wood(rng)),
    )
    parts = [_board((w, 0.04, w), (0, h - 0.04, 0), seat, 0.015), *_legs(rng, w, w, h - 0.04, frame)]
    if rng.random() < 0.85:
        if rng.random() < 0.5:
            parts.append(Part(s.moved(s.slab(np.array([w, back, 0.03]), 0.01), (0, h, -w / 2 + 0.02), tip=-0.12), seat))
        else:
            for x in np.linspace(-w / 2 + 0.02, w / 2 - 0.02, int(rng.integers(2, 6))):
                parts.append(Part(s.tube([(x, h, -w / 2 + 0.02), (x, h + back, -w / 2 - 0.05)], 0.012, 6), frame))
            parts.append(_board((w, 0.08, 0.02), (0, h + back - 0.08, -w / 2 - 0.05), frame))
    return Piece(parts, w, w)


def sofa(rng, meshes=()) -> Piece:
    """Sofa or armchair with cushions."""
    width = float(rng.choice([rng.uniform(0.75, 1.0), rng.uniform(1.4, 2.3)]))
    depth, seat, back, arm = (
        rng.uniform(0.75, 0.95),
        rng.uniform(0.36, 0.45),
        rng.uniform(0.3, 0.5),
        rng.uniform(0.1, 0.22),
    )
    cloth, r = m.fabric(rng), rng.uniform(0.03, 0.09)
    parts = [
        _board((width, seat - 0.16, depth), (0, 0.06, 0), cloth, 0.03),
        _board((width, back + seat - 0.1, 0.2), (0, 0.1, -depth / 2 + 0.1), cloth, r),
    ]
    parts += [_board((arm, seat + 0.16, depth), (x * (width - arm) / 2, 0.05, 0), cloth, r) for x in (-1, 1)]
    count = max(1, round((width - 2 * arm) / 0.65))
    each = (width - 2 * arm) / count
    for k in range(count):
        x = -width / 2 + arm + each * (k + 0.5)
        parts.append(_board((each * 0.98, 0.16, depth - 0.22), (x, seat - 0.12, 0.1), cloth, 0.05))
        if rng.random() < 0.7:
            lean = s.moved(
                s.slab(np.array([each * 0.96, 0.42, 0.16]), 0.06), (x, seat + 0.02, -depth / 2 + 0.3), tip=-0.2
            )
            parts.append(Part(lean, cloth))
        if rng.random() < 0.35:
            parts += things.placed(
                things.cushion(rng, rng.uniform(0.32, 0.45)), (x, seat + 0.03, 0.02), rng.normal() * 0.3
            )
    return Piece(parts, width, depth)


def cupboard(rng, meshes=()) -> Piece:
    """Chest, sideboard, wardrobe or kitchen block, with doors or drawers and handles."""
    width, depth = rng.uniform(0.5, 2.2), rng.uniform(0.35, 0.6)
    height = float(rng.choice([rng.uniform(0.45, 1.0), rng.uniform(1.7, 2.2)], p=[0.7, 0.3]))
    body, front = _solid_look(rng), _solid_look(rng)
    front = body if rng.random() < 0.6 else front
    foot = float(rng.choice([0.0, 0.08, 0.15]))
    parts = [_board((width, height - foot, depth), (0, foot, 0), body)]
    if foot:
        parts += _legs(rng, width, depth, foot, m.metal(rng))
    columns = max(1, round(width / rng.uniform(0.4, 0.7)))
    rows = int(rng.integers(1, 5)) if height < 1.2 else int(rng.integers(1, 3))
    w, h, knob = width / columns, (height - foot) / rows, m.metal(rng)
    for c in range(columns):
        for r in range(rows):
            x, y = -width / 2 + (c + 0.5) * w, foot + r * h
            parts.append(_board((w - 0.012, h - 0.012, 0.02), (x, y + 0.006, depth / 2 + 0.008), front))
            side = 0.0 if rows > 2 else (w / 2 - 0.05) * (1 if c % 2 else -1)
            size = (0.12, 0.012, 0.02) if rows > 2 else (0.012, 0.14, 0.02)
            parts.append(_board(size, (x + side, y + h * 0.55, depth / 2 + 0.03), knob))
    if height < 1.3:
        on = things.scattered(rng, int(rng.integers(0, 6)), (width / 2, depth / 2), (0.1, 0.4), meshes)
        parts += things.placed(on, (0, height, 0))
    return Piece(parts, width, depth, ((height, width / 2, depth / 2, 0),) if height < 1.3 else ())


def shelf(rng, meshes=()) -> Piece:
    """Open shelves with rows of books and things."""
    width, depth, height = rng.uniform(0.6, 1.8), rng.uniform(0.25, 0.38), rng.uniform(0.9, 2.2)
    levels, look = int(rng.integers(2, 6)), _solid_look(rng)
    parts = [_board((0.025, height, depth), (x * width / 2, 0, 0), look) for x in (-1, 1)]
    if rng.random() < 0.6:
        parts.append(_board((width, height, 0.01), (0, 0, -depth / 2), look))
    gap = (height - 0.06) / levels
    for k in range(levels + 1):
        y = 0.04 + k * gap
        parts.append(_board((width, 0.022, depth), (0, y - 0.02, 0), look))
        if k < levels:
            parts += things.placed(_shelf_load(rng, width - 0.08, depth, gap * 0.85, meshes), (0, y + 0.002, 0))
    return Piece(parts, width, depth)


def _shelf_load(rng, width, depth, height, meshes) -> Parts:
    if rng.random() < 0.5:
        return things.scattered(
            rng, int(rng.integers(1, 6)), (width / 2, depth / 2 * 0.7), (0.4 * height, height), meshes
        )
    parts, x = [], -width / 2
    end = width / 2 * rng.uniform(-0.5, 1)
    while x < end:
        thick, tall = rng.uniform(0.012, 0.055), height * rng.uniform(0.6, 0.98)
        deep = depth * rng.uniform(0.55, 0.85)
        look = m.plastic(rng) if rng.random() < 0.7 else m.printed(rng, thick, tall)
        parts.append(_board((thick, tall, deep), (x + thick / 2, 0, (depth - deep) / 2 - 0.02), look, 0.003))
        x += thick + 0.002
    return parts


def bed(rng, meshes=()) -> Piece:
    """Bed with a rumpled cover and pillows."""
    width, length, height = rng.uniform(0.9, 1.8), rng.uniform(1.9, 2.1), rng.uniform(0.35, 0.5)
    frame, cover = _solid_look(rng), m.fabric(rng)
    parts = [_board((width, height * 0.6, length), (0, 0.05, 0), frame, 0.02)]
    parts.append(_board((width, rng.uniform(0.7, 1.2), 0.06), (0, 0, -length / 2), frame, 0.02))
    soft = s.sheet(
        (-width / 2 - 0.02, 0, length / 2), np.array([width + 0.04, 0, 0]), np.array([0, 0, -length * 0.85]), 44
    )
    wave, fold = s.lumps(rng, 0.05, 1.2), s.lumps(rng, 0.02, 4.0)
    rumpled = s.warped(soft, lambda p: p + np.stack([0 * p[:, 0], wave(p) + fold(p), 0 * p[:, 0]], -1))
    parts += [_board((width - 0.02, 0.2, length - 0.05), (0, height * 0.55, 0), cover, 0.06)]
    parts.append(Part(s.moved(rumpled, (0, height * 0.55 + 0.24, 0)), cover))
    for x in (-0.25, 0.25) if width > 1.3 else (0.0,):
        parts += things.placed(things.cushion(rng, 0.55), (x * width, height + 0.17, -length / 2 + 0.25))
    return Piece(parts, width, length)


def floor_thing(rng, meshes=()) -> Piece:
    """Something large on the floor: a plant, a vase, a box, a mesh."""
    kind = rng.random()
    size = rng.uniform(0.4, 1.3)
    parts = things.plant(rng, size) if kind < 0.4 else things.thing(rng, size * 0.7, meshes, 0.5)
    width = 2 * things.footprint(parts)
    return Piece(parts, width, width)


def kitchen(rng, meshes=()) -> Piece:
    """A worktop over cupboards, wall units above, tiles between."""
    width, depth = rng.uniform(1.6, 3.2), 0.6
    front, stone = _solid_look(rng), m.stone(rng) if rng.random() < 0.6 else m.wood(rng)
    parts = [
        _board((width, 0.78, depth - 0.05), (0, 0.08, -0.02), front),
        _board((width, 0.04, depth), (0, 0.86, 0), stone),
    ]
    count = max(2, round(width / 0.55))
    knob, upper = m.metal(rng), rng.random() < 0.75
    for k in range(count):
        x, w = -width / 2 + (k + 0.5) * width / count, width / count - 0.012
        parts.append(_board((w, 0.74, 0.02), (x, 0.1, depth / 2 - 0.03), front))
        parts.append(_board((0.14, 0.012, 0.025), (x, 0.76, depth / 2 - 0.005), knob))
        if upper and rng.random() < 0.9:
            parts.append(_board((w, 0.65, 0.33), (x, 1.42, -0.13), front))
    splash = s.sheet((-width / 2, 0.9, -depth / 2 + 0.01), np.array([width, 0, 0]), np.array([0, 0.52, 0]))
    parts.append(Part(splash, m.tiled(rng)))
    on = things.scattered(rng, int(rng.integers(2, 9)), (width / 2, depth / 2 * 0.8), (0.08, 0.35), meshes)
    return Piece([*parts, *things.placed(on, (0, 0.903, 0))], width, depth, ((0.9, width / 2, depth / 2, 0),))


ALONG_WALLS = (
    (cupboard, 0.24),
    (shelf, 0.2),
    (sofa, 0.2),
    (bed, 0.08),
    (table, 0.12),
    (kitchen, 0.08),
    (floor_thing, 0.08),
)
IN_THE_MIDDLE = ((table, 0.45), (chair, 0.25), (sofa, 0.12), (floor_thing, 0.18))


def pick(rng: np.random.Generator, among, meshes) -> Piece:
    """One piece of a table of (maker, share)."""
    makers, shares = zip(*among)
    return makers[rng.choice(len(makers), p=np.array(shares) / sum(shares))](rng, meshes)
