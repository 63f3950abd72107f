"""Walls of rooms with windows, doors and what hangs on them: x along the wall, y up, z into the room."""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from materialist_lab.procedural import materials as m
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.world import Parts, ScenePart, block, one_thing, rod

X = np.array([1.0, 0, 0])
Y = np.array([0.0, 1, 0])


class Opening(NamedTuple):
    """A rectangle on a wall, metres."""

    left: float
    right: float
    bottom: float
    top: float


@dataclass
class RoomWall:
    """A wall from (0, 0, 0) to (length, height, 0) and what is on it so far."""

    length: float
    height: float
    holes: list[Opening] = field(default_factory=list)
    """Windows, apart from each other and above the skirting."""
    taken: list[tuple[float, float]] = field(default_factory=list)
    """Stretches (left, right) where nothing more may hang."""

    def free(self, rng: np.random.Generator, width: float) -> float | None:
        """The middle of a free stretch of that width, which is then taken; None where there is none."""
        half = width / 2
        # Eight tries; none where the wall is too short.
        for _ in range(8 if self.length > width + 0.2 else 0):
            c = float(rng.uniform(width / 2 + 0.05, self.length - width / 2 - 0.05))
            if all(c + half < a or c - half > b for a, b in self.taken):
                # Five centimetres stay free at both sides.
                self.taken.append((c - half - 0.05, c + half + 0.05))
                return c
        return None


def surface(
    wall: RoomWall, material: m.Material, lower: m.Material | None = None, split: float = 1.0
) -> Parts:
    """The wall around its holes; with `lower`, another material up to `split` metres."""
    # Horizontal bands between all heights at which something begins or ends.
    heights = {0.0, wall.height, *(v for h in wall.holes for v in h[2:])}
    if lower:
        heights.add(split)
    parts = []
    for y0, y1 in pairwise(sorted(heights)):
        # Within a band, the wall is what lies between the holes.
        crossing = sorted(h for h in wall.holes if h.bottom < y1 and h.top > y0)
        edges = [0.0, *(x for h in crossing for x in h[:2]), wall.length]
        for x0, x1 in zip(edges[::2], edges[1::2]):
            piece = s.sheet((x0, y0, 0), (x1 - x0) * X, (y1 - y0) * Y)
            # The pattern runs on from piece to piece.
            piece = replace(piece, uv=piece.uv + np.array([x0, y0]))
            parts.append(ScenePart(piece, lower if lower and y1 <= split else material))
    return parts


def board(
    left: float, bottom: float, size: ArrayLike, look: m.Material, out: float = 0.0
) -> ScenePart:
    """A board of (width, height, depth) on the wall, its back `out` metres from it."""
    width, _, depth = np.asarray(size)
    return block(size, (left + width / 2, bottom, out + depth / 2), look, min(0.006, depth / 4))


def frame(hole: Opening, wide: float, deep: float, look: m.Material) -> Parts:
    """Four boards around an opening, `wide` metres in the plane of the wall and `deep` out of it."""
    left, right, bottom, top = hole
    upright = (wide, top - bottom, deep)
    level = (right - left + 2 * wide, wide, deep)
    parts = [board(x, bottom, upright, look) for x in (left - wide, right)]
    return parts + [board(left - wide, y, level, look) for y in (bottom - wide, top)]


def windows(rng: np.random.Generator, wall: RoomWall, count: int) -> Parts:
    """Up to `count` windows of one kind with frames, reveals and sills, at times curtains; adds holes to the wall."""
    parts: Parts = []
    # --- What all windows of the wall share ---
    look = m.pick(rng, ((0.15, m.plastic), (0.25, m.wood), (0.6, m.white_paint)))(rng)
    bottom = rng.uniform(0.4, 1.0) if rng.random() < 0.8 else 0.15
    top = min(wall.height - rng.uniform(0.1, 0.5), bottom + rng.uniform(1.0, 2.2))
    width = rng.uniform(0.5, max(0.6, min(2.4, wall.length * 0.7 / count)))
    cloth = m.fabric(rng)
    dressed = rng.random() < 0.5
    panes = rng.integers(1, (4, 3))
    # --- Each where there is room ---
    for _ in range(count):
        middle = wall.free(rng, width + 0.2)
        if middle is None:
            break
        hole = Opening(middle - width / 2, middle + width / 2, bottom, top)
        wall.holes.append(hole)
        parts += _window(rng, hole, look, panes)
        if dressed:
            parts += (_blinds if rng.random() < 0.25 else _curtains)(rng, hole, cloth)
    return parts


def _window(rng, hole: Opening, look, panes) -> Parts:
    """A window set back in its wall; `panes` counts them (across, up)."""
    left, right, bottom, top = hole
    deep = rng.uniform(0.1, 0.3)
    t = rng.uniform(0.03, 0.07)
    white = m.white_paint(rng)
    w = right - left
    h = top - bottom
    out = np.array([0, 0, -deep])
    up = h * Y
    along = w * X
    corner = np.array([left, bottom, 0])
    # --- The four sides of the opening, from the wall back to the frame ---
    reveals = (
        (corner, up, out),
        (corner + along, out, up),
        (corner + up, along, out),
        (corner, out, along),
    )
    parts = [ScenePart(s.sheet(*reveal), white) for reveal in reveals]
    # --- Frame and glazing bars: one more of them than panes, along both axes ---
    parts += [
        board(left + x * (w - t), bottom, (t, h, 0.04), look, -deep)
        for x in np.linspace(0, 1, panes[0] + 1)
    ]
    parts += [
        board(left, bottom + y * (h - t), (w, t, 0.04), look, -deep)
        for y in np.linspace(0, 1, panes[1] + 1)
    ]
    # --- Sill and mouldings around it ---
    parts.append(board(left - 0.06, bottom - 0.03, (w + 0.12, 0.03, 0.12), white))
    if rng.random() < 0.6:
        parts = parts + frame(hole, rng.uniform(0.06, 0.12), 0.02, white)
    return parts


def _blinds(rng, hole: Opening, cloth) -> Parts:
    """Slats, down to the sill or half way."""
    pitch = rng.uniform(0.05, 0.09)
    tilt = rng.uniform(0.1, 1.0)
    look = m.one_of(rng, m.plastic, m.white_paint)
    low = hole.bottom + (hole.top - hole.bottom) * rng.choice([0, rng.uniform(0.2, 0.8)])
    size = (hole.right - hole.left - 0.02, 0.003, pitch * 0.9)
    middle = (hole.left + hole.right) / 2
    return [
        block(size, (middle, y, -0.05), look, tip=tilt) for y in np.arange(low, hole.top, pitch)
    ]


def _curtains(rng, hole: Opening, cloth) -> Parts:
    """Folded cloth at both sides, on a rod."""
    left, right, bottom, top = hole
    # Down to the floor, or to a little below the sill.
    drop = 0.02 if rng.random() < 0.6 else max(bottom - 0.15, 0.02)
    width, waves, phase, deep = rng.uniform([0.2, 4, 0, 0.02], [0.5, 9, 6, 0.05])
    flat = s.sheet((0, 0, 0), width * X, (top + 0.12 - drop) * Y, 48)

    def fold(p):
        """[V] how far the cloth stands out: waves across it that lean a little with the height."""
        return deep * np.sin(p[:, 0] / width * 2 * np.pi * waves + phase + 0.3 * p[:, 1])

    cloths = s.warped(flat, lambda p: p + fold(p)[:, None] * [0, 0, 1])
    hung = [
        ScenePart(s.moved(cloths, (x, drop, 0.1)), cloth)
        for x in (left - 0.6 * width, right - 0.4 * width)
    ]
    ends = [(x, top + 0.13, 0.1) for x in (left - 0.4, right + 0.4)]
    return one_thing([*hung, rod(ends, 0.012, m.metal(rng), 6)])


def door(rng: np.random.Generator, wall: RoomWall) -> Parts:
    """A closed door with panels, frame and handle."""
    width = rng.uniform(0.75, 0.95)
    height = min(rng.uniform(1.95, 2.15), wall.height - 0.1)
    middle = wall.free(rng, width + 0.25)
    if middle is None:
        return []
    look = m.one_of(rng, m.white_paint, m.wood)
    left = middle - width / 2
    parts = [board(left, 0.005, (width, height, 0.02), look)]
    parts += frame(Opening(left, left + width, 0, height), rng.uniform(0.05, 0.1), 0.04, look)
    # Raised panels, none on a flat door.
    rows = int(rng.integers(0, 4))
    columns = int(rng.integers(1, 3))
    for r, k in np.ndindex(rows, columns):
        w = width / columns
        h = height / rows
        panel = (w - 0.18, h - 0.2, 0.015)
        parts.append(board(left + k * w + 0.09, r * h + 0.1, panel, look, 0.02))
    handle = left + (0.06 if rng.random() < 0.5 else width - 0.18)
    return [*parts, board(handle, 1.0, (0.12, 0.02, 0.05), m.metal(rng), 0.02)]
