"""Rooms: walls, floor, ceiling, windows, lamps, furniture; and cameras that stand in them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural import skies, walls
from materialist.procedural.objects import furniture as f
from materialist.procedural.objects import solids as s
from materialist.procedural.objects import things
from materialist.procedural.objects.things import Parts
from materialist.procedural.walls import Wall
from materialist.procedural.world import Part, Portal, View, World, look

_X, _Y, _Z = np.eye(3)


@dataclass(frozen=True)
class Placed:
    """A piece of furniture where it stands."""

    piece: f.Piece
    x: float
    z: float
    turn: float
    half: tuple[float, float]
    """Half extents along the room's x and z, metres."""


def room(rng: np.random.Generator, meshes: tuple[Path, ...], captures: tuple[Path, ...]) -> World:
    """A furnished room seen by somebody who stands or sits in it."""
    w, d, h = rng.uniform(2.6, 6.5), rng.uniform(3.2, 8.0), rng.uniform(2.3, 3.3)
    return _world(rng, (w, d, h), meshes, captures, close=False)


def table_top(rng: np.random.Generator, meshes: tuple[Path, ...], captures: tuple[Path, ...]) -> World:
    """Things on a table, a sideboard or a kitchen top, seen from close by, with the room behind them."""
    w, d, h = rng.uniform(2.6, 5.0), rng.uniform(3.0, 5.0), rng.uniform(2.3, 3.0)
    return _world(rng, (w, d, h), meshes, captures, close=True)


def _world(rng, size, meshes, captures, close: bool) -> World:
    w, d, h = size
    sides = four_walls(w, d, h)
    parts, portals, envmap = shell(rng, sides, size, captures)
    standing = _furnish(rng, size, meshes, close)
    for p in standing:
        parts += things.placed(p.piece.parts, (p.x, 0, p.z), p.turn)
    if rng.random() < 0.5:
        a, b = w * rng.uniform(0.3, 0.7), d * rng.uniform(0.25, 0.6)
        flat = s.moved(s.slab(np.array([a, 0.012, b]), 0.004), (rng.normal() * 0.3, 0, rng.normal() * 0.4))
        parts.append(Part(flat, m.rug(rng, a, b) if rng.random() < 0.7 else m.fabric(rng)))
    parts += lamps(rng, size, portals, envmap)
    view = _close_view(rng, size, standing) if close else _view(rng, size, standing)
    return World(parts, envmap, view, portals, "table" if close else "room")


def four_walls(w: float, d: float, h: float) -> list[Wall]:
    """Back, right, front, left, seen from inside."""
    corners = [(-w / 2, -d / 2), (w / 2, -d / 2), (w / 2, d / 2), (-w / 2, d / 2)]
    way = [_X, _Z, -_X, -_Z]
    length = [w, d, w, d]
    return [Wall(np.array([x, 0, z]), r, n, h) for (x, z), r, n in zip(corners, way, length)]


def shell(rng, sides: list[Wall], size, captures, ground: m.Material | None = None):
    """(walls, floor, ceiling and what hangs there; portals; envmap). The front wall is missing in some rooms.

    ground: what the floor is made of, if not what rooms have.
    """
    w, d, h = size
    is_open = rng.random() < 0.25
    parts: Parts = []
    portals: list[Portal] = []
    count = int(rng.choice([0, 1, 2], p=[0.1, 0.6, 0.3])) if not is_open else int(rng.random() < 0.3)
    with_windows = rng.permutation(4 if not is_open else 2)[:count]
    paint = m.wall_paint(rng)
    accent = rng.integers(4) if rng.random() < 0.3 else -1
    lower = _lower(rng) if rng.random() < 0.15 else None
    wood = walls._white(rng) if rng.random() < 0.7 else m.wood(rng)
    for k, wall in enumerate(sides):
        if is_open and k == 2:
            portals.append(Portal(wall.origin, wall.right * w, _Y * h))
            continue
        if k in with_windows and len(portals) < 4:
            more, holes = walls.windows(rng, wall, min(int(rng.integers(1, 4)), 4 - len(portals)))
            parts += more
            portals += holes
        if rng.random() < 0.35:
            parts += walls.door(rng, wall)
        finish = _accent(rng) if k == accent else paint
        parts += walls.surface(wall, finish, lower, rng.uniform(0.8, 1.2))
        parts += walls.skirting(wall, wood, rng.uniform(0.05, 0.14))
        if rng.random() < 0.3:
            parts += walls.skirting(wall, wood, 0.06, h - 0.06, 0.05)
        parts += walls.hangings(rng, wall, int(rng.integers(0, 5)))
    floor = [m.floor_boards, m.floor_boards, m.tiled, m.stone, m.fabric][rng.integers(5)](rng)
    ceiling = m.wood(rng, "planks") if rng.random() < 0.08 else walls._white(rng)
    parts.append(Part(s.sheet((-w / 2, 0, d / 2), w * _X, -d * _Z), ground or floor))
    parts.append(Part(s.sheet((-w / 2, h, -d / 2), w * _X, d * _Z), ceiling))
    if rng.random() < 0.12:
        parts += [Part(s.moved(s.slab(np.array([0.14, 0.2, d])), (x, h - 0.2, 0)), m.wood(rng))
                  for x in np.arange(-w / 2 + 0.4, w / 2, 0.9)]  # fmt: skip
    envmap = skies.outdoors(rng, captures) if not is_open else skies.around(rng, captures)
    if not portals:
        envmap = np.zeros((8, 16, 3), np.float32)
    return parts, portals, envmap


def _accent(rng) -> m.Material:
    return [m.wall_paint, m.wallpaper, m.brick, m.tiled, m.wood, m.stone][rng.integers(6)](rng)


def _lower(rng) -> m.Material:
    return [m.wall_paint, m.tiled, m.wood][rng.integers(3)](rng)


def _furnish(rng, size, meshes, close: bool) -> list[Placed]:
    """Pieces along the walls and in the middle that do not stand in each other."""
    w, d, _ = size
    out: list[Placed] = []
    if close:
        maker = [f.table, f.table, f.table, f.kitchen, f.cupboard][rng.integers(5)]
        piece = f.table(rng, meshes, clutter=int(rng.integers(3, 10))) if maker is f.table else maker(rng, meshes)
        at_wall = maker is not f.table or rng.random() < 0.5
        z = -d / 2 + piece.depth / 2 + 0.03 if at_wall else rng.uniform(-0.3, 0.3)
        out.append(Placed(piece, rng.uniform(-0.3, 0.3), z, 0.0, (piece.width / 2, piece.depth / 2)))
    for _ in range(int(rng.integers(2, 4)) if close else int(rng.integers(3, 9))):
        piece = f.pick(rng, f.ALONG_WALLS, meshes)
        side = int(rng.choice([0, 1, 3, 2], p=[0.4, 0.25, 0.25, 0.1]))
        turn = [0.0, -np.pi / 2, np.pi, np.pi / 2][side]
        half = (piece.width / 2, piece.depth / 2) if side % 2 == 0 else (piece.depth / 2, piece.width / 2)
        edge = 0.04
        if side % 2 == 0:
            x, z = rng.uniform(-1, 1) * (w / 2 - half[0] - edge), (half[1] + edge - d / 2) * (1 if side == 0 else -1)
        else:
            x, z = (w / 2 - half[0] - edge) * (1 if side == 1 else -1), rng.uniform(-1, 1) * (d / 2 - half[1] - edge)
        _add(out, Placed(piece, x, z, turn, half), size)
    for _ in range(int(rng.integers(0, 2)) if close else int(rng.integers(1, 6))):
        piece, turn = f.pick(rng, f.IN_THE_MIDDLE, meshes), rng.uniform(0, 2 * np.pi)
        r = np.hypot(piece.width, piece.depth) / 2 * 0.9
        x, z = rng.uniform(-0.7, 0.7) * w / 2, rng.uniform(-0.7, 0.5) * d / 2
        _add(out, Placed(piece, x, z, turn, (r, r)), size)
    return out


def _add(out: list[Placed], new: Placed, size) -> None:
    w, d, _ = size
    if abs(new.x) + new.half[0] > w / 2 or abs(new.z) + new.half[1] > d / 2:
        return
    for old in out:
        if abs(new.x - old.x) < new.half[0] + old.half[0] and abs(new.z - old.z) < new.half[1] + old.half[1]:
            return
    out.append(new)


def kelvin(rng: np.random.Generator) -> np.ndarray:
    """[3] colour of a lamp between candle and daylight, mean 1."""
    t = rng.choice([rng.uniform(0, 0.35), rng.uniform(0.35, 1.0)])
    colour = (1 - t) * np.array([1.0, 0.62, 0.3]) + t * np.array([1.0, 0.97, 1.0])
    return colour / colour.mean()


def lamps(rng, size, portals, envmap) -> Parts:
    """Ceiling panels, spots, globes and shades; their power against the windows varies by a factor of a hundred."""
    dark = not portals
    if not dark and rng.random() < 0.4:
        return []
    through = sum(np.linalg.norm(np.cross(p.right, p.up)) for p in portals) if portals else 2.0
    power = through * float(np.exp(rng.uniform(np.log(0.08), np.log(8.0)))) * (0.5 if portals else 1.0)
    if not dark and rng.random() < 0.12:
        envmap *= rng.uniform(0.005, 0.1)  # evening
    kinds = [_panels, _globe, _shade, _spots]
    chosen = [kinds[k] for k in rng.permutation(4)[: int(rng.integers(1, 3))]]
    return [p for make in chosen for p in make(rng, size, power / len(chosen))]


def _panels(rng, size, power) -> Parts:
    _, d, h = size
    n = int(rng.integers(1, 4))
    a, b = float(rng.choice([0.12, 0.3, 0.6])), rng.uniform(0.3, 1.2)
    glow = m.light(rng, tuple(power / (n * a * b) * kelvin(rng)))
    z = np.linspace(-0.3, 0.3, n) * d if n > 1 else [rng.uniform(-0.2, 0.2) * d]
    frame, parts = m.metal(rng), []
    for k in z:
        parts.append(Part(s.moved(s.slab(np.array([a + 0.03, 0.03, b + 0.03])), (0, h - 0.03, k)), frame))
        parts.append(Part(s.sheet((-a / 2, h - 0.032, k - b / 2), a * _X, b * _Z), glow))
    return parts


def _spots(rng, size, power) -> Parts:
    w, d, h = size
    n, a = int(rng.integers(2, 7)), rng.uniform(0.05, 0.12)
    glow = m.light(rng, tuple(power / (n * a * a) * kelvin(rng)))
    places = rng.uniform(-0.42, 0.42, (n, 2)) * [w, d]
    return [Part(s.sheet((x, h - 0.004, z), a * _X, a * _Z), glow) for x, z in places]


def _globe(rng, size, power) -> Parts:
    """Hanging ball, or a row of them."""
    w, d, h = size
    n, r, drop = int(rng.integers(1, 4)), rng.uniform(0.06, 0.2), rng.uniform(0.3, 0.9)
    glow = m.light(rng, tuple(power / (n * 4 * np.pi * r * r) * kelvin(rng)))
    cord, x, z = m.metal(rng), rng.uniform(-0.2, 0.2) * w, rng.uniform(-0.3, 0.2) * d
    parts = []
    for k in range(n):
        at = np.array([x + (k - n / 2) * 4 * r, h - drop, z])
        parts.append(Part(s.moved(s.ball(24), at, scale=r), glow))
        parts.append(Part(s.tube([(at[0], at[1] + r, at[2]), (at[0], h, at[2])], 0.006, 5), cord))
    return parts


def _shade(rng, size, power) -> Parts:
    """Floor lamp with a glowing shade."""
    from materialist.procedural.objects.shapes import lathe

    w, d, _ = size
    r, tall, height = rng.uniform(0.12, 0.25), rng.uniform(1.1, 1.7), rng.uniform(0.18, 0.35)
    x, z = rng.choice([-1, 1]) * (w / 2 - r - 0.1), rng.uniform(-0.45, 0.2) * d
    glow = m.light(rng, tuple(power / (2 * np.pi * r * height) * kelvin(rng)))
    shade = lathe(np.array([(r, 0), (r * rng.uniform(0.5, 1), height)]), 32)
    stand = m.metal(rng)
    return [
        Part(s.moved(shade, (x, tall, z)), glow),
        Part(s.tube([(x, 0, z), (x, tall + height / 2, z)], 0.012, 8), stand),
        Part(s.moved(s.slab(np.array([0.28, 0.03, 0.28]), 0.01), (x, 0, z)), stand),
    ]


def _view(rng, size, standing: list[Placed]) -> View:
    """Somebody in the front half of the room who looks towards its back."""
    w, d, h = size
    for _ in range(30):
        x, z = rng.uniform(-0.88, 0.88) * w / 2, d / 2 * rng.uniform(0.1, 0.96)
        if not any(abs(x - p.x) < p.half[0] + 0.25 and abs(z - p.z) < p.half[1] + 0.25 for p in standing):
            break
    height = rng.uniform(1.2, 1.75) if rng.random() < 0.7 else rng.uniform(0.5, 2.0)
    eye = np.array([x, min(height, h - 0.3), z])
    target = np.array([rng.uniform(-0.5, 0.5) * w, rng.uniform(0.3, 1.5), -d / 2 * rng.uniform(0.2, 1.0)])
    return look(eye, target, rng.uniform(35, 75), rng.normal() * 0.025)


def _close_view(rng, size, standing: list[Placed]) -> View:
    """Down onto the first piece's top, from the side of the room."""
    w, d, h = size
    first = standing[0]
    top, half_w, _, _ = first.piece.tops[0] if first.piece.tops else (1.2, 0.4, 0.2, 0.0)
    target = np.array([first.x + rng.uniform(-0.5, 0.5) * half_w, top + rng.uniform(0.0, 0.15), first.z])
    distance, up = rng.uniform(0.5, 1.5), np.radians(rng.uniform(8, 60))
    turn = rng.uniform(-0.9, 0.9)
    eye = target + distance * np.array([np.sin(turn) * np.cos(up), np.sin(up), np.cos(turn) * np.cos(up)])
    eye = np.clip(eye, [-w / 2 + 0.1, 0.2, -d / 2 + 0.2], [w / 2 - 0.1, h - 0.2, d / 2 - 0.1])
    return look(eye, target, rng.uniform(28, 60), rng.normal() * 0.03)
