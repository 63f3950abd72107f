"""Walls with windows and doors, and what hangs on them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural.objects import solids as s
from materialist.procedural.objects import things
from materialist.procedural.objects.parts import Parts, block, placed, rod
from materialist.procedural.world import Portal, ScenePart
from materialist.types import Array

UP = np.array([0.0, 1.0, 0.0])


class Opening(NamedTuple):
    """A rectangle cut out of a wall, metres on it."""

    left: float
    right: float
    bottom: float
    top: float


@dataclass
class RoomWall:
    """A wall seen from inside: from `origin` [3] (lower left) `length` along `right` [3, unit], `height` up."""

    origin: Array
    right: Array
    length: float
    height: float
    holes: list[Opening] = field(default_factory=list)
    """Apart from each other."""
    taken: list[tuple[float, float]] = field(default_factory=list)
    """Stretches (left, right) where nothing more may hang."""

    @property
    def inward(self) -> Array:
        """[3] unit normal into the room."""
        return np.cross(self.right, UP)

    def point(self, along: float, up: float, out: float = 0.0) -> Array:
        """[3] the place on the wall, `out` metres into the room."""
        return self.origin + self.right * along + UP * up + self.inward * out

    @property
    def turn(self) -> float:
        """Angle about Y that turns +Z into the inward normal."""
        return float(np.arctan2(self.inward[0], self.inward[2]))

    def hung(self, parts: Parts, along: float, up: float, out: float = 0.0) -> Parts:
        """Parts made to face +Z, put on the wall with their origin at that place."""
        return placed(parts, self.point(along, up, out), self.turn)

    def bar(self, left: float, bottom: float, size: tuple[float, float, float], look, out: float = 0.0) -> ScenePart:
        """A board of (width, height, depth) on the wall, its back `out` metres from it."""
        at = self.point(left + size[0] / 2, bottom, out + size[2] / 2)
        return block(size, at, look, min(0.006, size[2] / 4), turn=self.turn)

    def frame(self, hole: Opening, wide: float, deep: float, look, sill: bool = False) -> Parts:
        """Boards around a rectangle, with one below it if `sill`."""
        left, right, bottom, top = hole
        low, width = bottom - wide * sill, right - left
        sides = [self.bar(x, low, (wide, top - low, deep), look) for x in (left - wide, right)]
        level = [self.bar(left - wide, top, (width + 2 * wide, wide, deep), look)]
        return sides + level + ([self.bar(left, low, (width, wide, deep), look)] if sill else [])

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

    def stretches(self, low: float, high: float) -> list[tuple[float, float]]:
        """(from, to) along the wall between its holes, at heights from `low` to `high`."""
        crossing = sorted(h for h in self.holes if h.bottom < high - 1e-6 and h.top > low + 1e-6)
        edges = [0.0, *(x for h in crossing for x in h[:2]), self.length]
        return list(zip(edges[::2], edges[1::2]))


def surface(wall: RoomWall, material: m.Material, lower: m.Material | None = None, split: float = 1.0) -> Parts:
    """The wall around its holes; with `lower`, another material up to `split` metres."""
    levels = sorted({0.0, wall.height, *([split] if lower else []), *(v for h in wall.holes for v in h[2:])})
    parts = []
    for y0, y1 in pairwise(levels):
        look = lower if lower and y1 <= split + 1e-6 else material
        for x0, x1 in wall.stretches(y0, y1):
            if x1 - x0 > 1e-3:
                piece = s.sheet(wall.point(x0, y0), wall.right * (x1 - x0), UP * (y1 - y0))
                parts.append(ScenePart(replace(piece, uv=piece.uv + np.array([x0, y0])), look))
    return parts


def skirting(wall: RoomWall, look: m.Material, height: float, at: float = 0.0, depth: float = 0.015) -> Parts:
    """A strip along the wall, left out at doors."""
    stretches = wall.stretches(at, at + height)
    return [wall.bar(a, at, (b - a, height, depth), look) for a, b in stretches if b - a > 0.02]


def windows(rng: np.random.Generator, wall: RoomWall, count: int) -> tuple[Parts, list[Portal]]:
    """Holes with frames, reveals, sills, at times curtains, blinds and a radiator; adds them to `wall`."""
    parts, portals = [], []
    frame = m.pick(rng, ((0.15, m.plastic), (0.25, m.wood), (0.6, m.white_paint)))(rng)
    bottom = rng.uniform(0.4, 1.0) if rng.random() < 0.8 else 0.05
    top = min(wall.height - rng.uniform(0.1, 0.5), bottom + rng.uniform(1.0, 2.2))
    width = rng.uniform(0.5, max(0.6, min(2.4, wall.length * 0.7 / count)))
    cloth, dressed = m.fabric(rng), rng.random() < 0.5
    panes = (int(rng.integers(1, 4)), int(rng.integers(1, 3)))
    for _ in range(count):
        middle = wall.free(rng, width + 0.2)
        if middle is None:
            break
        hole = Opening(middle - width / 2, middle + width / 2, bottom, top)
        wall.holes.append(hole)
        parts += _window(rng, wall, hole, frame, panes)
        portals.append(Portal(wall.point(hole.left, bottom, -0.01), wall.right * width, UP * (top - bottom)))
        if dressed:
            parts += (_blinds if rng.random() < 0.25 else _curtains)(rng, wall, hole, cloth)
        if bottom > 0.35 and rng.random() < 0.35:
            white, ribs = m.white_paint(rng), np.arange(hole.left + 0.05, hole.right - 0.05, 0.09)
            parts += [wall.bar(x, 0.12, (0.075, min(bottom - 0.2, 0.6), 0.08), white, 0.04) for x in ribs]
    return parts, portals


def _window(rng, wall: RoomWall, hole: Opening, frame, panes) -> Parts:
    left, right, bottom, top = hole
    deep, t, w, h, look = rng.uniform(0.1, 0.3), rng.uniform(0.03, 0.07), right - left, top - bottom, m.white_paint(rng)
    out, up, along = -wall.inward * deep, UP * h, wall.right * w
    corner = wall.point(left, bottom)
    reveals = ((corner, up, out), (corner + along, out, up), (corner + up, along, out), (corner, out, along))
    parts = [ScenePart(s.sheet(*reveal), look) for reveal in reveals]
    for k in range(panes[0] + 1):
        parts.append(wall.bar(left + k * (w - t) / panes[0], bottom, (t, h, 0.04), frame, -deep))
    for k in range(panes[1] + 1):
        parts.append(wall.bar(left, bottom + k * (h - t) / panes[1], (w, t, 0.04), frame, -deep))
    if bottom > 0.3:
        parts.append(wall.bar(left - 0.06, bottom - 0.03, (w + 0.12, 0.03, 0.12), look))
        if rng.random() < 0.3:
            parts += wall.hung(things.thing(rng, 0.25), rng.uniform(left + 0.2, right - 0.2), bottom, 0.05 - deep / 2)
    return parts + (wall.frame(hole, rng.uniform(0.06, 0.12), 0.02, look) if rng.random() < 0.6 else [])


def _blinds(rng, wall: RoomWall, hole: Opening, cloth) -> Parts:
    """Slats, down to the sill or half way."""
    pitch, tilt, look = rng.uniform(0.05, 0.09), rng.uniform(0.1, 1.0), m.one_of(rng, m.plastic, m.white_paint)
    low = hole.bottom + (hole.top - hole.bottom) * rng.choice([0, rng.uniform(0.2, 0.8)])
    slat = block((hole.right - hole.left - 0.02, 0.003, pitch * 0.9), (0, 0, 0), look, tip=tilt)
    middle = (hole.left + hole.right) / 2
    return [part for y in np.arange(low, hole.top, pitch) for part in wall.hung([slat], middle, y, -0.05)]


def _curtains(rng, wall: RoomWall, hole: Opening, cloth) -> Parts:
    """Folded cloth at both sides, on a rod."""
    left, right, bottom, top = hole
    drop = 0.02 if rng.random() < 0.6 else max(bottom - 0.15, 0.02)
    width, waves, phase, deep = rng.uniform([0.2, 4, 0, 0.02], [0.5, 9, 6, 0.05])
    flat = s.sheet((0, 0, 0), (width, 0, 0), (0, top + 0.12 - drop, 0), 48)
    fold = lambda p: deep * np.sin(p[:, 0] / width * 2 * np.pi * waves + phase + 0.3 * p[:, 1])  # noqa: E731
    hang = ScenePart(s.warped(flat, lambda p: p + fold(p)[:, None] * [0, 0, 1]), cloth)
    parts = wall.hung(
        [rod([(0, 0, 0), (right - left + 0.8, 0, 0)], 0.012, m.metal(rng), 6)], left - 0.4, top + 0.13, 0.1
    )
    for start in (left - 0.6 * width, right - 0.4 * width):
        if 0.02 <= start <= wall.length - 0.02 - width:
            parts += wall.hung([hang], start, drop, 0.1)
    return parts


def door(rng: np.random.Generator, wall: RoomWall) -> Parts:
    """A closed door with panels, frame and handle."""
    width, height = rng.uniform(0.75, 0.95), min(rng.uniform(1.95, 2.15), wall.height - 0.1)
    middle = wall.free(rng, width + 0.25)
    if middle is None:
        return []
    look, left = m.one_of(rng, m.white_paint, m.wood), middle - width / 2
    frame = look if rng.random() < 0.7 else m.wood(rng)
    parts = [wall.bar(left, 0.005, (width, height, 0.02), look)]
    parts += wall.frame(Opening(left, left + width, 0, height), rng.uniform(0.05, 0.1), 0.04, frame)
    rows, columns = int(rng.integers(0, 4)), int(rng.integers(1, 3))
    for r, k in np.ndindex(rows, columns):
        w, h = width / columns, height / rows
        parts.append(wall.bar(left + k * w + 0.09, r * h + 0.1, (w - 0.18, h - 0.2, 0.015), look, 0.02))
    handle = left + (0.06 if rng.random() < 0.5 else width - 0.18)
    return [*parts, wall.bar(handle, 1.0, (0.12, 0.02, 0.05), m.metal(rng), 0.02)]


def hangings(rng: np.random.Generator, wall: RoomWall, count: int) -> Parts:
    """Pictures, mirrors, screens, wall shelves, round clocks and switches, as far as there is room."""
    parts = []
    for _ in range(count):
        kind, width = rng.random(), rng.uniform(0.25, 1.2)
        middle = wall.free(rng, width if kind < 0.8 else min(width, 0.35))
        if middle is None:
            continue
        height, left = width * rng.uniform(0.6, 1.5), middle - width / 2
        up = float(np.clip(rng.uniform(1.3, 1.7) - height / 2, 0.9, max(wall.height - height - 0.1, 0.9)))
        if kind < 0.65:
            parts += _picture(rng, wall, Opening(left, left + width, up, up + height))
        elif kind < 0.8:
            on = things.scattered(rng, int(rng.integers(1, 6)), (width / 2, 0.09), (0.08, 0.3))
            parts += [wall.bar(left, up, (width, 0.03, 0.22), m.wood(rng)), *wall.hung(on, middle, up + 0.03, 0.11)]
        elif kind < 0.9:
            radius = min(width, 0.35) / 2
            flat = s.warped(s.ball(32), lambda p, r=radius: p * [r, r, 0.02])
            parts += wall.hung([ScenePart(flat, m.any_object(rng))], middle, up + width / 2, 0.02)
        else:
            parts.append(wall.bar(middle, 1.1, (0.08, 0.08, 0.01), m.white_paint(rng)))
    return parts


def _picture(rng, wall: RoomWall, place: Opening) -> Parts:
    """A framed picture, a mirror, a screen or a loose poster."""
    size = (place.right - place.left, place.top - place.bottom, 0.012)
    mirror, screen = m.uniform((0.9, 0.9, 0.9), 0.05, 1.0), m.uniform(m.hsv(0.6, 0.1, 0.08), 0.1)
    inner = m.pick(rng, ((0.1, mirror), (0.1, screen), (0.8, m.printed(rng, size[0], size[1]))))
    parts = [wall.bar(place.left, place.bottom, size, inner)]
    if rng.random() < 0.8:
        look = m.wood(rng) if rng.random() < 0.6 else m.metal(rng)
        parts += wall.frame(place, rng.uniform(0.015, 0.07), 0.03, look, sill=True)
    return parts
