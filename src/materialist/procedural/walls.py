"""Walls with windows and doors, and what hangs on them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural.objects import solids as s
from materialist.procedural.objects import things
from materialist.procedural.objects.things import Parts
from materialist.procedural.world import Part, Portal
from materialist.types import Array

_UP = np.array([0.0, 1.0, 0.0])


@dataclass
class Wall:
    """A wall seen from inside: from `origin` [3] (lower left) `length` along `right` [3, unit], `height` up."""

    origin: Array
    right: Array
    length: float
    height: float
    holes: list[tuple[float, float, float, float]] = field(default_factory=list)
    """(left, right, bottom, top) in metres on the wall, apart from each other."""
    taken: list[tuple[float, float]] = field(default_factory=list)
    """Stretches (left, right) where nothing more may hang."""

    @property
    def inward(self) -> Array:
        """[3] unit normal into the room."""
        return np.cross(self.right, _UP)

    def point(self, along: float, up: float, out: float = 0.0) -> Array:
        """[3] the place on the wall, `out` metres into the room."""
        return self.origin + self.right * along + _UP * up + self.inward * out

    @property
    def turn(self) -> float:
        """Angle about Y that turns +Z into the inward normal."""
        return float(np.arctan2(self.inward[0], self.inward[2]))

    def hung(self, parts: Parts, along: float, up: float, out: float = 0.0) -> Parts:
        """Parts made to face +Z, put on the wall with their origin at that place."""
        return things.placed(parts, self.point(along, up, out), self.turn)

    def free(self, rng: np.random.Generator, width: float) -> float | None:
        """The middle of a free stretch of that width, which is then taken; None where there is none."""
        for _ in range(8):
            if self.length < width + 0.2:
                return None
            c = rng.uniform(width / 2 + 0.05, self.length - width / 2 - 0.05)
            if all(c + width / 2 < a or c - width / 2 > b for a, b in self.taken):
                self.taken.append((c - width / 2 - 0.05, c + width / 2 + 0.05))
                return float(c)
        return None


def surface(wall: Wall, material: m.Material, lower: m.Material | None = None, split: float = 1.0) -> Parts:
    """The wall around its holes; with `lower`, another material up to `split` metres."""
    levels = sorted({0.0, wall.height, *([split] if lower else []), *(v for h in wall.holes for v in h[2:])})
    parts = []
    for y0, y1 in pairwise(levels):
        look = lower if lower and y1 <= split + 1e-6 else material
        edges = [0.0]
        for left, right, bottom, top in sorted(wall.holes):
            if bottom < y1 - 1e-6 and top > y0 + 1e-6:
                edges += [left, right]
        edges.append(wall.length)
        for x0, x1 in zip(edges[::2], edges[1::2]):
            if x1 - x0 > 1e-3:
                piece = s.sheet(wall.point(x0, y0), wall.right * (x1 - x0), _UP * (y1 - y0))
                parts.append(Part(replace(piece, uv=piece.uv + np.array([x0, y0])), look))
    return parts


def bar(
    wall: Wall, left: float, bottom: float, width: float, height: float, depth: float, look, out: float = 0.0
) -> Part:
    """A board on the wall, `depth` thick, its back `out` metres from it."""
    solid = s.slab(np.array([width, height, depth]), min(0.006, depth / 4))
    return Part(s.moved(solid, wall.point(left + width / 2, bottom, out + depth / 2), wall.turn), look)


def skirting(wall: Wall, look: m.Material, height: float, at: float = 0.0, depth: float = 0.015) -> Parts:
    """A strip along the wall, left out at doors."""
    edges = [0.0]
    for left, right, bottom, top in sorted(wall.holes):
        if bottom < at + height and top > at:
            edges += [left, right]
    edges.append(wall.length)
    return [bar(wall, a, at, b - a, height, depth, look) for a, b in zip(edges[::2], edges[1::2]) if b - a > 0.02]


def windows(rng: np.random.Generator, wall: Wall, count: int) -> tuple[Parts, list[Portal]]:
    """Holes with frames, reveals, sills, at times curtains, blinds and a radiator; adds them to `wall`."""
    parts, portals = [], []
    frame = m.plastic(rng) if rng.random() < 0.15 else m.wood(rng) if rng.random() < 0.3 else _white(rng)
    bottom = float(rng.choice([0.05, rng.uniform(0.4, 1.0)], p=[0.2, 0.8]))
    top = min(wall.height - rng.uniform(0.1, 0.5), bottom + rng.uniform(1.0, 2.2))
    width = rng.uniform(0.5, max(0.6, min(2.4, wall.length * 0.7 / count)))
    cloth = m.fabric(rng)
    dressed = rng.random() < 0.5
    panes = (int(rng.integers(1, 4)), int(rng.integers(1, 3)))
    for _ in range(count):
        middle = wall.free(rng, width + 0.2)
        if middle is None:
            break
        left, right = middle - width / 2, middle + width / 2
        wall.holes.append((left, right, bottom, top))
        parts += _window(rng, wall, (left, right, bottom, top), frame, panes)
        portals.append(Portal(wall.point(left, bottom, -0.01), wall.right * width, _UP * (top - bottom)))
        if dressed:
            parts += _dressing(rng, wall, (left, right, bottom, top), cloth)
        if bottom > 0.35 and rng.random() < 0.35:
            white = _white(rng)
            for x in np.arange(left + 0.05, right - 0.05, 0.09):
                parts.append(bar(wall, x, 0.12, 0.075, min(bottom - 0.2, 0.6), 0.08, white, 0.04))
    return parts, portals


def _white(rng: np.random.Generator) -> m.Material:
    """Painted white woodwork."""
    colour = m.hsv(rng.uniform(0.08, 0.15), rng.uniform(0, 0.08), rng.uniform(0.82, 0.97))
    return m.Material(0, (colour,) * 3, 0.03, (rng.uniform(0.2, 0.6),) * 2)


def _window(rng, wall: Wall, hole, frame, panes) -> Parts:
    left, right, bottom, top = hole
    deep, w, h = rng.uniform(0.1, 0.3), right - left, top - bottom
    look, parts = _white(rng), []
    out = -wall.inward * deep
    for start, side, other in (
        (wall.point(left, bottom), _UP * h, out), (wall.point(right, bottom), out, _UP * h),
        (wall.point(left, top), wall.right * w, out), (wall.point(left, bottom), out, wall.right * w),
    ):  # fmt: skip
        parts.append(Part(s.sheet(start, side, other), look))
    t = rng.uniform(0.03, 0.07)
    for k in range(panes[0] + 1):
        parts.append(bar(wall, left + k * (w - t) / panes[0], bottom, t, h, 0.04, frame, -deep))
    for k in range(panes[1] + 1):
        parts.append(bar(wall, left, bottom + k * (h - t) / panes[1], w, t, 0.04, frame, -deep))
    if bottom > 0.3:
        parts.append(bar(wall, left - 0.06, bottom - 0.03, w + 0.12, 0.03, 0.12, look))
        if rng.random() < 0.3:
            parts += wall.hung(things.thing(rng, 0.25), rng.uniform(left + 0.2, right - 0.2), bottom, 0.05 - deep / 2)
    if rng.random() < 0.6:  # casing
        c = rng.uniform(0.06, 0.12)
        for x, y, a, b in ((left - c, bottom, c, h), (right, bottom, c, h), (left - c, top, w + 2 * c, c)):
            parts.append(bar(wall, x, y, a, b, 0.02, look))
    return parts


def _dressing(rng, wall: Wall, hole, cloth) -> Parts:
    """Curtains at both sides, or slatted blinds."""
    left, right, bottom, top = hole
    if rng.random() < 0.25:
        pitch, look = rng.uniform(0.05, 0.09), m.plastic(rng) if rng.random() < 0.4 else _white(rng)
        low = bottom + (top - bottom) * rng.choice([0, rng.uniform(0.2, 0.8)])
        tilt = rng.uniform(0.1, 1.0)
        slats = []
        for y in np.arange(low, top, pitch):
            slat = s.moved(s.slab(np.array([right - left - 0.02, 0.003, pitch * 0.9])), tip=tilt)
            slats += wall.hung([Part(slat, look)], (left + right) / 2, y, -0.05)
        return slats
    parts, drop = [], 0.02 if rng.random() < 0.6 else max(bottom - 0.15, 0.02)
    width = rng.uniform(0.2, 0.5)
    for start in (left - 0.6 * width, right - 0.4 * width):
        if start < 0.02 or start + width > wall.length - 0.02:
            continue
        hang = s.sheet((0, 0, 0), np.array([width, 0, 0]), np.array([0, top + 0.12 - drop, 0]), 48)
        waves, phase, deep = rng.uniform(4, 9), rng.uniform(0, 6), rng.uniform(0.02, 0.05)

        def folded(p, waves=waves, phase=phase, deep=deep):
            out = deep * np.sin(p[:, 0] / width * 2 * np.pi * waves + phase + 0.3 * p[:, 1])
            return p + out[:, None] * [0, 0, 1]

        parts += wall.hung([Part(s.warped(hang, folded), cloth)], start, drop, 0.1)
    rod = [Part(s.tube([(0, 0, 0), (right - left + 0.8, 0, 0)], 0.012, 6), m.metal(rng))]
    return parts + wall.hung(rod, left - 0.4, top + 0.13, 0.1)


def door(rng: np.random.Generator, wall: Wall) -> Parts:
    """A closed door with panels, frame and handle."""
    width, height = rng.uniform(0.75, 0.95), min(rng.uniform(1.95, 2.15), wall.height - 0.1)
    middle = wall.free(rng, width + 0.25)
    if middle is None:
        return []
    look = _white(rng) if rng.random() < 0.55 else m.wood(rng)
    frame = look if rng.random() < 0.7 else m.wood(rng)
    left, c = middle - width / 2, rng.uniform(0.05, 0.1)
    parts = [bar(wall, left, 0.005, width, height, 0.02, look)]
    for x, y, a, b in ((left - c, 0, c, height), (left + width, 0, c, height), (left - c, height, width + 2 * c, c)):
        parts.append(bar(wall, x, y, a, b, 0.04, frame))
    rows, columns = int(rng.integers(0, 4)), int(rng.integers(1, 3))
    for r in range(rows):
        for k in range(columns):
            w, h = width / columns, height / rows
            parts.append(bar(wall, left + k * w + 0.09, r * h + 0.1, w - 0.18, h - 0.2, 0.015, look, 0.02))
    parts.append(
        bar(wall, left + (0.06 if rng.random() < 0.5 else width - 0.18), 1.0, 0.12, 0.02, 0.05, m.metal(rng), 0.02)
    )
    return parts


def hangings(rng: np.random.Generator, wall: Wall, count: int, meshes=()) -> Parts:
    """Pictures, mirrors, screens, wall shelves, round clocks and switches, as far as there is room."""
    parts = []
    for _ in range(count):
        kind, width = rng.random(), rng.uniform(0.25, 1.2)
        if kind > 0.8:
            width = min(width, 0.35)
        middle = wall.free(rng, width)
        if middle is None:
            continue
        height = width * rng.uniform(0.6, 1.5)
        up = float(np.clip(rng.uniform(1.3, 1.7) - height / 2, 0.9, max(wall.height - height - 0.1, 0.9)))
        if kind < 0.65:
            parts += _picture(rng, wall, middle - width / 2, up, width, height)
        elif kind < 0.8:
            board = bar(wall, middle - width / 2, up, width, 0.03, 0.22, m.wood(rng))
            on = things.scattered(rng, int(rng.integers(1, 6)), (width / 2, 0.09), (0.08, 0.3), meshes)
            parts += [board, *wall.hung(on, middle, up + 0.03, 0.11)]
        elif kind < 0.9:
            disc = s.moved(s.ball(32), scale=1.0)
            flat = s.warped(disc, lambda p, w=width: p * [w / 2, w / 2, 0.02])
            parts += wall.hung([Part(flat, m.any_object(rng))], middle, up + width / 2, 0.02)
        else:
            parts.append(bar(wall, middle, 1.1, 0.08, 0.08, 0.01, _white(rng)))
    return parts


def _picture(rng, wall: Wall, left, up, width, height) -> Parts:
    """A framed picture, a mirror, a screen or a loose poster."""
    kind = rng.random()
    if kind < 0.1:
        inner = m.Material(0, ((0.9, 0.9, 0.9),) * 3, 0.0, (0.05, 0.05), (1.0, 1.0))
    elif kind < 0.2:
        inner = m.Material(0, (m.hsv(0.6, 0.1, 0.08),) * 3, 0.0, (0.1, 0.1))
    else:
        inner = m.printed(rng, width, height)
    parts = [bar(wall, left, up, width, height, 0.012, inner)]
    if rng.random() < 0.8:
        t, look = rng.uniform(0.015, 0.07), m.wood(rng) if rng.random() < 0.6 else m.metal(rng)
        for x, y, a, b in ((left - t, up - t, t, height + 2 * t), (left + width, up - t, t, height + 2 * t),
                           (left, up - t, width, t), (left, up + height, width, t)):  # fmt: skip
            parts.append(bar(wall, x, y, a, b, 0.03, look))
    return parts
