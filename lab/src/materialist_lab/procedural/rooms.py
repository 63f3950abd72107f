"""Rooms: walls, floor, ceiling, windows, lamps; and cameras that stand in them."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from materialist.types import Array
from materialist_lab.procedural import lights, walls, world
from materialist_lab.procedural import materials as m
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.walls import RoomWall
from materialist_lab.procedural.world import Parts, ScenePart, block, moved, placed

Size = Array
"""[3] width, depth and height of a room, metres; its floor is centred on the origin."""


def sides(size: Size) -> list[tuple[Array, float, float]]:
    """(lower left corner, turn about Y, length) of the back, right, front and left wall, as seen from inside."""
    w, d, _ = size
    corners = np.array([(-w, 0, -d), (w, 0, -d), (w, 0, d), (-w, 0, d)]) / 2
    return list(zip(corners, (0.0, -np.pi / 2, np.pi, np.pi / 2), (w, d, w, d)))


Hangings = Callable[[np.random.Generator, RoomWall, int], Parts]
"""(random numbers, wall, how many) -> what hangs on the wall where there is room."""


def shell(
    rng: np.random.Generator, size: Size, captures: tuple[Path, ...], hangings: Hangings
) -> tuple[Parts, list[world.Portal], Array]:
    """(walls, floor, ceiling and what hangs there; portals; envmap). The front wall is missing in some rooms."""
    w, d, h = size
    parts: Parts = []
    portals: list[world.Portal] = []
    # --- What differs between rooms: the open front, windows, paints ---
    is_open = rng.random() < 0.25
    count = int(rng.random() < 0.3) if is_open else int(rng.choice([0, 1, 2], p=[0.1, 0.6, 0.3]))
    with_windows = rng.permutation(2 if is_open else 4)[:count]
    paint = m.wall_paint(rng)
    accent = rng.integers(4) if rng.random() < 0.3 else -1
    lower = m.one_of(rng, m.wall_paint, m.tiled, m.wood) if rng.random() < 0.15 else None
    wood = m.white_paint(rng) if rng.random() < 0.7 else m.wood(rng)
    x = np.array([1.0, 0, 0])
    z = np.array([0, 0, 1.0])
    # --- Walls; a missing one is a hole of its whole size ---
    for k, (corner, turn, length) in enumerate(sides(size)):
        holes = [walls.Opening(0, length, 0, h)]
        if not (is_open and k == 2):
            wall = RoomWall(length, h)
            max_windows = 4 if count == 1 else 3
            hung = (
                walls.windows(rng, wall, int(rng.integers(1, max_windows)))
                if k in with_windows
                else []
            )
            hung += walls.door(rng, wall) if rng.random() < 0.35 else []
            makers = (m.wall_paint, m.wallpaper, m.brick, m.tiled, m.wood, m.stone)
            hung += walls.surface(
                wall, m.one_of(rng, *makers) if k == accent else paint, lower, rng.uniform(0.8, 1.2)
            )
            hung.append(walls.board(0, 0, (length, rng.uniform(0.05, 0.14), 0.015), wood))
            hung += hangings(rng, wall, int(rng.integers(0, 5)))
            parts = parts + moved(hung, corner, turn)
            holes = wall.holes
        # A portal a centimetre outside each hole tells the tracer where daylight comes in.
        for hole in holes:
            up = (0, hole.top - hole.bottom, 0)
            sheet = s.sheet((hole.left, hole.bottom, -0.01), (hole.right - hole.left) * x, up)
            low, up, right, _ = s.moved(sheet, corner, turn).vertices
            portals.append(world.Portal(low, right - low, up - low))
    # --- Floor, ceiling, beams ---
    floor = m.one_of(rng, m.floor_boards, m.floor_boards, m.tiled, m.stone, m.fabric)
    ceiling = m.floor_boards(rng) if rng.random() < 0.08 else m.white_paint(rng)
    parts.append(ScenePart(s.sheet((-w / 2, 0, d / 2), w * x, -d * z), floor))
    parts.append(ScenePart(s.sheet((-w / 2, h, -d / 2), w * x, d * z), ceiling))
    if rng.random() < 0.12:
        beams = np.arange(-w / 2 + 0.4, w / 2, 0.9)
        look = m.wood(rng)
        parts += [block((0.14, 0.2, d), (at, h - 0.2, 0), look) for at in beams]
    # --- Light from afar, black where none can come in ---
    if not portals:
        return parts, portals, np.zeros((8, 16, 3), np.float32)
    surroundings = lights.around if is_open else lights.outdoors
    return parts, portals, surroundings(rng, captures)


class Furniture:
    """What stands in a room, with the boxes around it."""

    def __init__(self, size: Size):
        self.size = size
        self.parts: Parts = []
        self.boxes: list[tuple[Array, Array]] = []

    def add(self, piece: Parts) -> None:
        """Take the piece in, unless it reaches through a wall or into another piece."""
        low, high = world.bounds(piece)
        inside = (np.maximum(-low, high)[[0, 2]] <= self.size[:2] / 2).all()
        touches = any((low < b).all() and (high > a).all() for a, b in self.boxes)
        if inside and not touches:
            self.parts += piece
            self.boxes.append((low, high))

    def along_walls(self, rng: np.random.Generator, pieces: list[Parts]) -> None:
        """Stand pieces with their backs to a wall, most at the back and the sides."""
        for piece in pieces:
            side = rng.choice(4, p=[0.4, 0.25, 0.1, 0.25])
            corner, turn, length = sides(self.size)[side]
            low, high = world.bounds(piece)
            # Four centimetres of air to each wall.
            at = rng.uniform(0.04, max(0.05, length - (high - low)[0] - 0.04))
            self.add(moved(placed(piece, (at - low[0], 0, 0.04 - low[2])), corner, turn))

    def in_the_middle(self, rng: np.random.Generator, pieces: list[Parts]) -> None:
        """Stand pieces anywhere, turned anyhow."""
        for piece in pieces:
            x, z = rng.uniform(-0.35, [0.35, 0.25]) * self.size[:2]
            self.add(placed(piece, (x, 0, z), rng.uniform(0, 2 * np.pi)))


def _glow(rng, power: float, area: float) -> m.Material:
    """A lamp of that power and area, its colour between candle and daylight."""
    t = rng.choice([rng.uniform(0, 0.35), rng.uniform(0.35, 1.0)])
    colour = (1 - t) * np.array([1.0, 0.62, 0.3]) + t * np.array([1.0, 0.97, 1.0])
    return m.light(rng, tuple(power / area * colour / colour.mean()))


def lamps(rng, size: Size, portals: list[world.Portal], envmap: Array) -> Parts:
    """Ceiling panels and spots; their power against the windows varies by a factor of a hundred.

    At times it is evening: `envmap` is made darker in place.
    """
    if portals and rng.random() < 0.4:
        return []
    # About what comes in through the windows: their area times a radiance of 1, halved.
    through = 2.0
    if portals:
        through = float(sum(np.linalg.norm(np.cross(p.right, p.up)) for p in portals)) / 2
    power = through * float(np.exp(rng.uniform(np.log(0.08), np.log(8.0))))
    # Evening.
    if portals and rng.random() < 0.12:
        envmap *= rng.uniform(0.005, 0.1)
    # A few long panels or several small spots.
    w, d, h = size
    spots = rng.random() < 0.5
    if spots:
        n = rng.integers(2, 7)
        a, b = 0.1, 0.1
    else:
        n = rng.integers(1, 4)
        a, b = rng.uniform(0.12, [0.6, 1.2])
    glow = _glow(rng, power, n * a * b)
    edge = m.metal(rng)
    parts = []
    for x, z in rng.uniform(-0.4, 0.4, (n, 2)) * [w, d]:
        # The luminous sheet lies just below its casing.
        parts.append(block((a + 0.03, 0.03, b + 0.03), (x, h - 0.03, z), edge))
        panel = s.sheet((x - a / 2, h - 0.032, z - b / 2), (a, 0, 0), (0, 0, b))
        parts.append(ScenePart(panel, glow))
    return parts


def view_of(rng: np.random.Generator, size: Size, standing: Furniture) -> world.Viewpoint:
    """Somebody in the front half of the room who looks towards its back."""
    w, d, h = size
    # A place on the floor that no furniture takes; the last one tried in a full room.
    for _ in range(30):
        eye = rng.uniform([-0.44, 0, 0.05], [0.44, 0, 0.48]) * [w, 0, d]
        taken = any(
            (eye > low - 0.25).all() and (eye < high + 0.25).all() for low, high in standing.boxes
        )
        if not taken:
            break
    # Eye level of people mostly; now and then that of a child or a tripod.
    level = rng.uniform(1.2, 1.75) if rng.random() < 0.7 else rng.uniform(0.5, 2.0)
    eye[1] = min(level, h - 0.3)
    x = rng.uniform(-0.5, 0.5) * w
    y = rng.uniform(0.3, 1.5)
    z = -d / 2 * rng.uniform(0.2, 1.0)
    target = np.array([x, y, z])
    return world.look(eye, target, rng.uniform(35, 75), rng.normal() * 0.025)
