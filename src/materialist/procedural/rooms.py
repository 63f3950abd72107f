"""Rooms: walls, floor, ceiling, windows, lamps, furniture; and cameras that stand in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural import skies, walls
from materialist.procedural.objects import furniture as f
from materialist.procedural.objects import solids as s
from materialist.procedural.objects.parts import Parts, block, orb, placed, rod
from materialist.procedural.objects.shapes import lathe
from materialist.procedural.objects.things import Meshes
from materialist.procedural.walls import RoomWall
from materialist.procedural.world import Portal, ScenePart, Viewpoint, World, look, look_down
from materialist.types import Array

Size = Array
"""[3] width, depth and height of a room, metres; its floor is centred on the origin."""


@dataclass(frozen=True)
class Placed:
    """A piece of furniture where it stands."""

    piece: f.Piece
    x: float
    z: float
    turn: float
    half: tuple[float, float]
    """Half extents along the room's x and z, metres."""

    def clashes(self, other: Placed) -> bool:
        """Whether the two stand in each other."""
        return (
            abs(self.x - other.x) < self.half[0] + other.half[0]
            and abs(self.z - other.z) < self.half[1] + other.half[1]
        )


def room(rng: np.random.Generator, meshes: Meshes, captures: Meshes) -> World:
    """A furnished room seen by somebody who stands or sits in it."""
    return _world(rng, rng.uniform([2.6, 3.2, 2.3], [6.5, 8.0, 3.3]), meshes, captures, close=False)


def table_top(rng: np.random.Generator, meshes: Meshes, captures: Meshes) -> World:
    """Things on a table, a sideboard or a kitchen top, seen from close by, with the room behind them."""
    return _world(rng, rng.uniform([2.6, 3.0, 2.3], [5.0, 5.0, 3.0]), meshes, captures, close=True)


def _world(rng, size: Size, meshes, captures, close: bool) -> World:
    w, d, _ = size
    parts, portals, envmap = shell(rng, size, captures)
    furnished = _furnish(rng, size, meshes, close)
    for p in furnished:
        parts += placed(p.piece.parts, (p.x, 0, p.z), p.turn)
    if rng.random() < 0.5:
        a, b = w * rng.uniform(0.3, 0.7), d * rng.uniform(0.25, 0.6)
        rug = m.rug(rng, a, b) if rng.random() < 0.7 else m.fabric(rng)
        parts.append(block((a, 0.012, b), (rng.normal() * 0.3, 0, rng.normal() * 0.4), rug, 0.004))
    parts += lamps(rng, size, portals, envmap)
    view = _close_view(rng, size, furnished[0]) if close else _view(rng, size, furnished)
    return World(parts, envmap, view, portals, "table" if close else "room")


def shell(rng, size: Size, captures, ground: m.Material | None = None) -> tuple[Parts, list[Portal], Array]:
    """(walls, floor, ceiling and what hangs there; portals; envmap). The front wall is missing in some rooms.

    ground: what the floor is made of, if not what rooms have.
    """
    w, d, h = size
    is_open = rng.random() < 0.25
    parts: Parts = []
    portals: list[Portal] = []
    count = int(rng.choice([0, 1, 2], p=[0.1, 0.6, 0.3])) if not is_open else int(rng.random() < 0.3)
    with_windows = rng.permutation(2 if is_open else 4)[:count]
    paint, accent = m.wall_paint(rng), rng.integers(4) if rng.random() < 0.3 else -1
    lower = m.one_of(rng, m.wall_paint, m.tiled, m.wood) if rng.random() < 0.15 else None
    wood = m.white_paint(rng) if rng.random() < 0.7 else m.wood(rng)
    x, y, z = np.eye(3)
    corners = ((-w / 2, -d / 2, x, w), (w / 2, -d / 2, z, d), (w / 2, d / 2, -x, w), (-w / 2, d / 2, -z, d))
    for k, (left, back, right, length) in enumerate(corners):  # back, right, front, left, seen from inside
        wall = RoomWall(np.array([left, 0, back]), right, length, h)
        if is_open and k == 2:
            portals.append(Portal(wall.origin, wall.right * w, y * h))
            continue
        if k in with_windows and len(portals) < 4:
            more, holes = walls.windows(rng, wall, min(int(rng.integers(1, 4)), 4 - len(portals)))
            parts, portals = parts + more, portals + holes
        if rng.random() < 0.35:
            parts += walls.door(rng, wall)
        makers = (m.wall_paint, m.wallpaper, m.brick, m.tiled, m.wood, m.stone)
        parts += walls.surface(wall, m.one_of(rng, *makers) if k == accent else paint, lower, rng.uniform(0.8, 1.2))
        parts += walls.skirting(wall, wood, rng.uniform(0.05, 0.14))
        if rng.random() < 0.3:
            parts += walls.skirting(wall, wood, 0.06, h - 0.06, 0.05)
        parts += walls.hangings(rng, wall, int(rng.integers(0, 5)))
    floor = m.one_of(rng, m.floor_boards, m.floor_boards, m.tiled, m.stone, m.fabric)
    ceiling = m.floor_boards(rng) if rng.random() < 0.08 else m.white_paint(rng)
    parts.append(ScenePart(s.sheet((-w / 2, 0, d / 2), w * x, -d * z), ground or floor))
    parts.append(ScenePart(s.sheet((-w / 2, h, -d / 2), w * x, d * z), ceiling))
    if rng.random() < 0.12:
        beams = np.arange(-w / 2 + 0.4, w / 2, 0.9)
        parts += [block((0.14, 0.2, d), (at, h - 0.2, 0), m.wood(rng)) for at in beams]
    if not portals:
        return parts, portals, np.zeros((8, 16, 3), np.float32)
    return parts, portals, (skies.around if is_open else skies.outdoors)(rng, captures)


def _furnish(rng, size: Size, meshes, close: bool) -> list[Placed]:
    """Pieces along the walls and in the middle that do not stand in each other; the first of a close view on top."""
    w, d, _ = size
    out: list[Placed] = []

    def add(new: Placed) -> None:
        inside = abs(new.x) + new.half[0] <= w / 2 and abs(new.z) + new.half[1] <= d / 2
        if inside and not any(map(new.clashes, out)):
            out.append(new)

    if close:
        maker = m.pick(rng, ((0.6, f.table), (0.2, f.kitchen), (0.2, f.cupboard)))
        piece = f.table(rng, meshes, clutter=int(rng.integers(3, 10))) if maker is f.table else maker(rng, meshes)
        at_wall = maker is not f.table or rng.random() < 0.5
        z = -d / 2 + piece.depth / 2 + 0.03 if at_wall else rng.uniform(-0.3, 0.3)
        out.append(Placed(piece, rng.uniform(-0.3, 0.3), z, 0.0, (piece.width / 2, piece.depth / 2)))
    for _ in range(int(rng.integers(2, 4)) if close else int(rng.integers(3, 9))):
        piece = m.pick(rng, f.ALONG_WALLS)(rng, meshes)
        side = m.pick(rng, ((0.4, 0), (0.25, 1), (0.1, 2), (0.25, 3)))  # back, right, front, left
        a, b, edge = piece.width / 2, piece.depth / 2, 0.04
        half = (a, b) if side % 2 == 0 else (b, a)
        free = rng.uniform(-1, 1) * np.array([w / 2 - half[0] - edge, d / 2 - half[1] - edge])
        x = free[0] if side % 2 == 0 else (w / 2 - half[0] - edge) * (1 if side == 1 else -1)
        z = free[1] if side % 2 else (half[1] + edge - d / 2) * (1 if side == 0 else -1)
        add(Placed(piece, x, z, (0.0, -np.pi / 2, np.pi, np.pi / 2)[side], half))
    for _ in range(int(rng.integers(0, 2)) if close else int(rng.integers(1, 6))):
        piece = m.pick(rng, f.IN_THE_MIDDLE)(rng, meshes)
        r = np.hypot(piece.width, piece.depth) / 2 * 0.9
        x, z = rng.uniform([-0.35, -0.35], [0.35, 0.25]) * [w, d]
        add(Placed(piece, x, z, rng.uniform(0, 2 * np.pi), (r, r)))
    return out


def _glow(rng, power: float, area: float) -> m.Material:
    """A lamp of that power and area, its colour between candle and daylight."""
    t = rng.choice([rng.uniform(0, 0.35), rng.uniform(0.35, 1.0)])
    colour = (1 - t) * np.array([1.0, 0.62, 0.3]) + t * np.array([1.0, 0.97, 1.0])
    return m.light(rng, tuple(power / area * colour / colour.mean()))


def lamps(rng, size: Size, portals: list[Portal], envmap: Array) -> Parts:
    """Ceiling panels, spots, globes and shades; their power against the windows varies by a factor of a hundred.

    At times it is evening: `envmap` is made darker in place.
    """
    if portals and rng.random() < 0.4:
        return []
    through = sum(np.linalg.norm(np.cross(p.right, p.up)) for p in portals) / 2 if portals else 2.0
    power = through * float(np.exp(rng.uniform(np.log(0.08), np.log(8.0))))
    if portals and rng.random() < 0.12:
        envmap *= rng.uniform(0.005, 0.1)
    chosen = [LAMPS[k] for k in rng.permutation(len(LAMPS))[: int(rng.integers(1, 3))]]
    return [p for make in chosen for p in make(rng, size, power / len(chosen))]


def _panels(rng, size, power) -> Parts:
    _, d, h = size
    n, a, b = int(rng.integers(1, 4)), float(rng.choice([0.12, 0.3, 0.6])), rng.uniform(0.3, 1.2)
    glow, frame, parts = _glow(rng, power, n * a * b), m.metal(rng), []
    for z in np.linspace(-0.3, 0.3, n) * d if n > 1 else [rng.uniform(-0.2, 0.2) * d]:
        parts.append(block((a + 0.03, 0.03, b + 0.03), (0, h - 0.03, z), frame))
        parts.append(ScenePart(s.sheet((-a / 2, h - 0.032, z - b / 2), (a, 0, 0), (0, 0, b)), glow))
    return parts


def _spots(rng, size, power) -> Parts:
    w, d, h = size
    n, a = int(rng.integers(2, 7)), rng.uniform(0.05, 0.12)
    glow, places = _glow(rng, power, n * a * a), rng.uniform(-0.42, 0.42, (n, 2)) * [w, d]
    return [ScenePart(s.sheet((x, h - 0.004, z), (a, 0, 0), (0, 0, a)), glow) for x, z in places]


def _globes(rng, size, power) -> Parts:
    """Hanging balls in a row."""
    w, d, h = size
    n, r, drop = int(rng.integers(1, 4)), rng.uniform(0.06, 0.2), rng.uniform(0.3, 0.9)
    glow, cord = _glow(rng, power, n * 4 * np.pi * r * r), m.metal(rng)
    x, z = rng.uniform(-0.2, 0.2) * w, rng.uniform(-0.3, 0.2) * d
    row = [x + (k - n / 2) * 4 * r for k in range(n)]
    balls = [orb((at, h - drop, z), r, glow) for at in row]
    return balls + [rod([(at, h - drop + r, z), (at, h, z)], 0.006, cord, 5) for at in row]


def _shade(rng, size, power) -> Parts:
    """Floor lamp with a glowing shade."""
    w, d, _ = size
    r, tall, height = rng.uniform([0.12, 1.1, 0.18], [0.25, 1.7, 0.35])
    x, z = rng.choice([-1, 1]) * (w / 2 - r - 0.1), rng.uniform(-0.45, 0.2) * d
    glow, stand = _glow(rng, power, 2 * np.pi * r * height), m.metal(rng)
    shade = lathe(np.array([(r, 0), (r * rng.uniform(0.5, 1), height)]), 32)
    return [
        ScenePart(s.moved(shade, (x, tall, z)), glow),
        rod([(x, 0, z), (x, tall + height / 2, z)], 0.012, stand),
        block((0.28, 0.03, 0.28), (x, 0, z), stand, 0.01),
    ]


LAMPS = (_panels, _globes, _shade, _spots)


def _view(rng, size: Size, furnished: list[Placed]) -> Viewpoint:
    """Somebody in the front half of the room who looks towards its back."""
    w, d, h = size
    for _ in range(30):
        x, z = rng.uniform([-0.44, 0.05], [0.44, 0.48]) * [w, d]
        if not any(abs(x - p.x) < p.half[0] + 0.25 and abs(z - p.z) < p.half[1] + 0.25 for p in furnished):
            break
    height = rng.uniform(1.2, 1.75) if rng.random() < 0.7 else rng.uniform(0.5, 2.0)
    target = np.array([rng.uniform(-0.5, 0.5) * w, rng.uniform(0.3, 1.5), -d / 2 * rng.uniform(0.2, 1.0)])
    return look(np.array([x, min(height, h - 0.3), z]), target, rng.uniform(35, 75), rng.normal() * 0.025)


def _close_view(rng, size: Size, first: Placed) -> Viewpoint:
    """Down onto the top of a piece, from the side of the room."""
    w, d, h = size
    top, half = (first.piece.top, first.piece.width / 2) if first.piece.top is not None else (1.2, 0.4)
    target = np.array([first.x + rng.uniform(-0.5, 0.5) * half, top + rng.uniform(0.0, 0.15), first.z])
    distance, up, turn, fov = rng.uniform([0.5, np.radians(8), -0.9, 28], [1.5, np.radians(60), 0.9, 60])
    inside = np.array([[-w / 2 + 0.1, 0.2, -d / 2 + 0.2], [w / 2 - 0.1, h - 0.2, d / 2 - 0.1]])
    return look_down(target, distance, turn, up, fov, rng.normal() * 0.03, inside)
