"""Streets, yards and open ground under a sky; and still lifes on a plain ground in any surroundings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from materialist.bench import shapes
from materialist.train.data import materials as m
from materialist.train.data import skies, things
from materialist.train.data import solids as s
from materialist.train.data.things import Parts
from materialist.train.data.world import Part, World, look

_X, _Y, _Z = np.eye(3)


def still_life(rng: np.random.Generator, meshes: tuple[Path, ...], captures: tuple[Path, ...]) -> World:
    """Three to nine things on a ground, before a wall, a curved backdrop, or the surroundings alone."""
    makers = (m.wood, m.stone, m.fabric, m.tiled, m.plastic, m.wall_paint, m.floor_boards, m.ground, m.metal)
    ground = makers[rng.choice(9, p=[0.2, 0.13, 0.13, 0.1, 0.1, 0.1, 0.1, 0.1, 0.04])](rng)
    half = rng.uniform(0.6, 1.2) if rng.random() < 0.5 else rng.uniform(2, 5)
    parts = [Part(s.sheet((-half, 0, half), 2 * half * _X, -2 * half * _Z), ground)]
    if half < 1.3:
        parts = [Part(s.moved(s.slab(np.array([2 * half, 0.04, 2 * half]), 0.008), (0, -0.04, 0)), ground)]
    back = rng.random()
    if back < 0.35:
        wall = [m.wall_paint, m.wallpaper, m.brick, m.stone, m.tiled, m.fabric][rng.integers(6)](rng)
        z = -rng.uniform(0.35, 0.9)
        parts.append(Part(s.sheet((-half, 0, z), 2 * half * _X, rng.uniform(0.6, 2.5) * _Y), wall))
    elif back < 0.45:
        parts.append(Part(_sweep(half), ground))
    parts += things.scattered(rng, int(rng.integers(3, 10)), (0.42, 0.35), (0.07, 0.4), meshes, 0.45)
    target = np.array([rng.normal() * 0.06, rng.uniform(0.05, 0.18), rng.normal() * 0.06])
    up, turn = np.radians(rng.uniform(5, 60)), rng.uniform(-0.7, 0.7)
    distance, fov = rng.uniform(0.65, 1.4), rng.uniform(25, 60)
    eye = target + distance * np.array([np.sin(turn) * np.cos(up), np.sin(up), np.cos(turn) * np.cos(up)])
    envmap = skies.around(rng, captures)
    return World(parts, envmap, look(eye, target, fov, rng.normal() * 0.03), kind="still life")


def _sweep(half: float) -> s.Solid:
    """A ground that bends up behind the things, as in a studio."""
    t = np.linspace(0, np.pi / 2, 16)
    y = np.concatenate([0.4 * (1 - np.cos(t)), [2.0]])
    z = np.concatenate([-0.6 - 0.4 * np.sin(t), [-1.0]])
    x = np.array([-half, half])
    vertices = np.stack(
        [np.broadcast_to(x[None], (17, 2)), np.repeat(y[:, None], 2, 1), np.repeat(z[:, None], 2, 1)], -1
    )
    flat, faces = vertices.reshape(-1, 3), s._grid_faces(17, 2, flip=True)
    along = np.concatenate([[0], np.cumsum(np.hypot(np.diff(y), np.diff(z)))])
    uv = np.stack(np.broadcast_arrays(x[None], along[:, None]), -1).reshape(-1, 2)
    return s.Solid(flat, faces, s.smooth_normals(flat, faces), uv)


def outdoor(rng: np.random.Generator, meshes: tuple[Path, ...], captures: tuple[Path, ...]) -> World:
    """A street, a square, a garden or open land."""
    place = [_street, _yard, _land][rng.choice(3, p=[0.4, 0.35, 0.25])]
    parts = place(rng, meshes)
    low = rng.random() < 0.2
    eye = np.array([rng.normal() * 0.8, rng.uniform(0.4, 1.0) if low else rng.uniform(1.3, 2.4), rng.uniform(3, 7)])
    target = np.array([rng.normal() * 1.5, rng.uniform(0.0, 2.2), -rng.uniform(2, 12)])
    envmap = skies.outdoors(rng, captures)
    return World(parts, envmap, look(eye, target, rng.uniform(30, 70), rng.normal() * 0.02), kind="outdoor")


def _ground(rng, half: float = 150.0) -> Parts:
    """The ground to the horizon, a little uneven near by."""
    far = s.sheet((-half, 0, half), 2 * half * _X, -2 * half * _Z, 12)
    return [Part(far, m.ground(rng))]


def _house(rng) -> Parts:
    """A house facing +Z: a block with a front of windows, a plinth, ledges, a door, a roof."""
    w, h, d = rng.uniform(5, 14), rng.uniform(3.5, 14), rng.uniform(6, 10)
    front = m.facade(rng) if rng.random() < 0.8 else m.brick(rng)
    parts = [Part(s.moved(s.slab(np.array([w, h, d])), (0, 0, -d / 2)), front)]
    trim = m.stone(rng) if rng.random() < 0.5 else m.wall_paint(rng)
    if rng.random() < 0.7:
        parts.append(Part(s.moved(s.slab(np.array([w + 0.1, rng.uniform(0.4, 1.0), 0.12])), (0, 0, 0.03)), trim))
    for y in np.arange(3.2, h, 3.2):
        if rng.random() < 0.5:
            parts.append(Part(s.moved(s.slab(np.array([w + 0.1, 0.15, 0.2])), (0, y, 0.05)), trim))
    x = rng.uniform(-0.35, 0.35) * w
    parts.append(Part(s.moved(s.slab(np.array([1.3, 2.4, 0.16])), (x, 0, 0.03)), trim))
    parts.append(Part(s.moved(s.slab(np.array([1.0, 2.2, 0.2])), (x, 0, 0.03)), m.wood(rng)))
    if rng.random() < 0.6:
        rise, look_ = rng.uniform(1.5, 3.5), m.brick(rng)
        for side in (1, -1):
            run = np.array([0, -rise, side * (d / 2 + 0.5)])
            start = np.array([-side * (w / 2 + 0.3), h + rise, -d / 2])
            parts.append(Part(s.sheet(start + run, side * (w + 0.6) * _X, -run), look_))
    else:
        parts.append(Part(s.moved(s.slab(np.array([w + 0.6, 0.3, d + 0.6])), (0, h, -d / 2)), trim))
    return parts


def _car(rng) -> Parts:
    """A car along X."""
    length, width = rng.uniform(3.6, 4.8), rng.uniform(1.6, 1.85)
    paint = m.any_colour(rng)
    body = m.Material(0, (paint,) * 3, 0.0, (rng.uniform(0.08, 0.3),) * 2, (float(rng.choice([0.0, 0.4])),) * 2)
    dark = m.Material(0, (m.hsv(0.6, 0.2, 0.12),) * 3, 0.0, (0.08, 0.08))
    rubber, rim = m.Material(0, (m.hsv(0.1, 0.05, 0.15),) * 3, 0.1, (0.8, 0.8)), m.metal(rng)
    cabin, hood = rng.uniform(1.7, 2.8), rng.uniform(-0.4, 0.3)
    lower, upper = s.slab(np.array([length, 0.6, width]), 0.2), s.slab(np.array([cabin, 0.62, width * 0.9]), 0.25)
    taper = lambda p: p * np.stack([1 - 0.22 * p[:, 1], 1 + 0 * p[:, 1], 1 - 0.12 * p[:, 1]], -1)  # noqa: E731
    parts = [Part(s.moved(lower, (0, 0.28, 0)), body), Part(s.moved(s.warped(upper, taper), (hood, 0.8, 0)), dark)]
    parts.append(Part(s.moved(s.slab(np.array([cabin * 0.72, 0.08, width * 0.78]), 0.04), (hood, 1.36, 0)), body))
    for x in (-0.31 * length, 0.31 * length):
        for z in (-width / 2 + 0.1, width / 2 - 0.1):
            wheel = shapes.lathe(np.array([(1e-3, -0.1), (0.31, -0.1), (0.31, 0.1), (1e-3, 0.1)]), 24)
            hub = shapes.lathe(np.array([(1e-3, -0.11), (0.19, -0.11), (0.19, 0.11), (1e-3, 0.11)]), 24)
            parts += [Part(s.moved(o, (x, 0.31, z), tip=np.pi / 2), k) for o, k in ((wheel, rubber), (hub, rim))]
    for x in (-length / 2 - 0.005, length / 2 + 0.005):
        light = m.any_colour(rng) if rng.random() < 0.5 else (0.8, 0.8, 0.8)
        lamp = m.Material(0, (light,) * 3, 0.0, (0.1, 0.1))
        for z in (-0.36, 0.36):
            parts.append(Part(s.moved(s.slab(np.array([0.04, 0.14, 0.3]), 0.02), (x, 0.62, z * width)), lamp))
    return parts


def tree(rng, size: float) -> Parts:
    """A tree: trunk, boughs, and a crown of leaves or of soft masses; bare in winter."""
    trunk, leaf, kind = m.wood(rng, gloss=False), m.foliage(rng), rng.random()
    fork = size * rng.uniform(0.25, 0.45)
    parts = [Part(s.tube([(0, 0, 0), (0.02 * size, fork, 0), (0, 0.75 * size, 0.03 * size)],
                         size * np.array([0.035, 0.025, 0.008])), trunk)]  # fmt: skip
    tips = []
    for _ in range(int(rng.integers(4, 10))):
        end = np.array([rng.normal() * 0.22, rng.uniform(0.55, 1.0), rng.normal() * 0.22]) * size
        start = np.array([0, fork + rng.uniform(0, 0.2) * size, 0])
        middle = (start + end) / 2 + [0, 0.06 * size, 0]
        parts.append(Part(s.tube([start, middle, end], size * np.array([0.016, 0.01, 0.004]), 6), trunk))
        tips += [middle, end]
    centres = np.array(tips)
    if kind < 0.55:
        n = int(rng.integers(400, 1500))
        roots = centres[rng.integers(len(centres), size=n)] + rng.normal(size=(n, 3)) * 0.11 * size
        length = size * rng.uniform(0.04, 0.09)
        parts.append(Part(s.leaves(rng, roots, rng.normal(size=(n, 3)), length, 0.5 * length), leaf))
    elif kind < 0.9:
        for c in centres[:8]:
            mass = s.blob(rng, size * rng.uniform(0.25, 0.5, 3), 0.25, 32)
            parts.append(Part(s.moved(mass, c - [0, 0.12 * size, 0]), leaf))
    return parts


def _bush(rng, size: float) -> Parts:
    leaf, n = m.foliage(rng), int(rng.integers(150, 500))
    core = s.blob(rng, size * np.array([1.0, 0.8, 1.0]), 0.2, 32)
    roots = core.vertices[rng.integers(len(core.vertices), size=n)] * 0.95
    length = size * rng.uniform(0.12, 0.25)
    return [
        Part(core, leaf),
        Part(s.leaves(rng, roots, rng.normal((0, 0.4, 0), 1, (n, 3)), length, 0.4 * length), leaf),
    ]


def _person(rng) -> Parts:
    """Somebody standing, of capsules and a head."""
    tall = rng.uniform(1.5, 1.9)
    skin, shirt, trousers, hair = m.skin(rng), m.fabric(rng), m.fabric(rng), m.plastic(rng)
    leg, hip, neck = 0.02, 0.5 * tall, 0.84 * tall
    parts = []
    for x in (-0.09, 0.09):
        foot = rng.normal() * 0.12
        parts.append(
            Part(
                s.tube([(x, 0.03, foot), (x, hip / 2, foot * 0.3), (x, hip, 0)], np.array([0.06, 0.07, 0.1]), 12),
                trousers,
            )
        )
        hand = (x * 3.2, hip * 0.95, rng.normal() * 0.12 + leg)
        parts.append(
            Part(
                s.tube(
                    [(x * 2, neck - 0.06, 0), (x * 2.9, 0.66 * tall, -0.03), hand], np.array([0.06, 0.05, 0.035]), 10
                ),
                shirt,
            )
        )
        parts.append(Part(s.moved(s.ball(16), hand, scale=0.05), skin))
    torso = s.warped(s.ball(32), lambda p: p * [0.21, 0.19 * tall, 0.13] * (1 + 0.15 * p[:, 1:2]))
    parts.append(Part(s.moved(torso, (0, 0.66 * tall, 0)), shirt))
    parts.append(Part(s.moved(s.warped(s.ball(32), lambda p: p * [0.078, 0.11, 0.092]), (0, 0.925 * tall, 0.01)), skin))
    parts.append(Part(s.moved(s.warped(s.ball(32), lambda p: p * [0.086, 0.1, 0.095]), (0, 0.95 * tall, -0.02)), hair))
    return parts


def _post(rng) -> Parts:
    """Lamp post, bollard or sign."""
    height, kind = rng.uniform(0.8, 5), rng.random()
    look_ = m.metal(rng) if kind < 0.5 else m.plastic(rng)
    parts = [Part(s.tube([(0, 0, 0), (0, height, 0)], rng.uniform(0.04, 0.12), 12), look_)]
    if height > 2 and kind < 0.7:
        parts.append(
            Part(s.moved(s.slab(np.array([0.5, 0.5, 0.03]), 0.01), (0, height - 0.3, 0.1)), m.printed(rng, 0.5, 0.5))
        )
    elif height < 1.4:
        parts.append(Part(s.moved(s.ball(24), (0, height, 0), scale=0.13), look_))
    return parts


def _wall(rng, length: float) -> Parts:
    height = rng.uniform(0.5, 3.0)
    look_ = [m.brick, m.stone, m.wall_paint, m.wood][rng.integers(4)](rng)
    if rng.random() < 0.25:  # fence
        bars = [Part(s.moved(s.slab(np.array([0.09, height * 0.6, 0.03])), (x, 0, 0)), look_)
                for x in np.arange(-length / 2, length / 2, 0.16)]  # fmt: skip
        return [*bars, Part(s.moved(s.slab(np.array([length, 0.07, 0.04])), (0, height * 0.4, 0.03)), look_)]
    parts = [Part(s.slab(np.array([length, height, 0.3])), look_)]
    if rng.random() < 0.5:
        parts.append(Part(s.moved(s.slab(np.array([length + 0.1, 0.08, 0.4])), (0, height, 0)), m.stone(rng)))
    return parts


def _street(rng, meshes) -> Parts:
    """A road away from the viewer with pavements, houses, cars, trees, people."""
    parts, half = _ground(rng), rng.uniform(2.5, 6)
    kerb, pave = m.stone(rng), m.ground(rng)
    wide = rng.uniform(1.5, 4)
    for side in (-1, 1):
        x = side * (half + wide / 2)
        parts.append(Part(s.moved(s.slab(np.array([wide, 0.14, 140])), (x, 0, -55)), pave))
        parts.append(Part(s.moved(s.slab(np.array([0.18, 0.145, 140]), 0.02), (side * (half + 0.08), 0, -55)), kerb))
        z = rng.uniform(0, 6)
        while z > -70 and rng.random() < 0.96:
            house = _house(rng)
            width = float(np.ptp(house[0].solid.vertices[:, 0]))
            parts += things.placed(house, (side * (half + wide + 0.1), 0, z - width / 2), -side * np.pi / 2)
            z -= width + rng.choice([0.0, rng.uniform(0.5, 5)])
        for _ in range(int(rng.integers(0, 5))):
            one = [_car, _post, _person, lambda r: tree(r, r.uniform(3, 7))][rng.choice(4, p=[0.35, 0.2, 0.25, 0.2])](
                rng
            )
            off = -0.95 if len(one) > 8 and one[0].solid.vertices[:, 1].max() < 1.2 else rng.uniform(0.3, wide - 0.3)
            at = (side * (half + off), 0.0 if off < 0 else 0.14, rng.uniform(-22, 1.5))
            parts += things.placed(one, at, np.pi / 2 + rng.normal() * 0.06 if off < 0 else rng.uniform(0, 6))
    white = m.Material(0, (m.hsv(0.1, 0.05, 0.9),) * 3, 0.4, (0.7, 0.7))
    if rng.random() < 0.6:
        for z in np.arange(-50, 4, 4.0):
            parts.append(Part(s.sheet((-0.07, 0.004, z + 2), 0.14 * _X, -2 * _Z), white))
    if rng.random() < 0.5:
        parts += things.placed(_car(rng), (rng.uniform(-0.5, 0.5) * half, 0, -rng.uniform(4, 20)), np.pi / 2)
    return parts


def _yard(rng, meshes) -> Parts:
    """A square or garden: a house or wall behind, things, people and plants on the ground."""
    parts, back = _ground(rng), -rng.uniform(2, 12)
    if rng.random() < 0.7:
        x = -rng.uniform(6, 14)
        while x < 14:
            house = _house(rng)
            width = float(np.ptp(house[0].solid.vertices[:, 0]))
            parts += things.placed(house, (x + width / 2, 0, back + rng.normal() * 0.3))
            x += width + rng.choice([0.0, rng.uniform(0.5, 4)])
    else:
        parts += things.placed(_wall(rng, 40.0), (0, 0, back))
    if rng.random() < 0.4:
        parts += things.placed(_wall(rng, 12.0), (rng.choice([-1, 1]) * rng.uniform(3, 7), 0, 0), np.pi / 2)
    if rng.random() < 0.4:
        flat = s.slab(np.array([rng.uniform(2, 6), 0.05, rng.uniform(2, 8)]))
        parts.append(Part(s.moved(flat, (rng.normal() * 2, 0, rng.normal() * 2)), m.ground(rng)))
    return parts + _strewn(rng, meshes, int(rng.integers(3, 12)), (4.5, back + 1.5, 2.5))


def _strewn(rng, meshes, count: int, bounds) -> Parts:
    """Plants, people, cars, posts and things within |x| <= bounds[0], bounds[1] <= z <= bounds[2]."""
    parts: Parts = []
    for _ in range(count):
        kind = rng.random()
        if kind < 0.2:
            one = _bush(rng, rng.uniform(0.4, 1.5))
        elif kind < 0.35:
            one = tree(rng, rng.uniform(2.5, 7))
        elif kind < 0.5:
            one = _person(rng)
        elif kind < 0.58:
            one = _car(rng)
        elif kind < 0.68:
            one = _post(rng)
        elif kind < 0.8:
            one = [Part(s.blob(rng, rng.uniform(0.2, 1.5) * rng.uniform(0.6, 1, 3), 0.25, 40), m.stone(rng))]
        else:
            one = things.thing(rng, rng.uniform(0.3, 1.4), meshes, 0.6)
        at = (rng.uniform(-1, 1) * bounds[0], 0, rng.uniform(bounds[1], bounds[2]))
        parts += things.placed(one, at, rng.uniform(0, 2 * np.pi))
    return parts


def _land(rng, meshes) -> Parts:
    """Meadow or park, with hills, trees and stones."""
    n, half = 64, 120.0
    t = np.sinh(np.linspace(-4, 4, n)) / np.sinh(4) * half
    x, z = np.meshgrid(t, t, indexing="ij")
    hills, bumps = s.lumps(rng, rng.uniform(0, 7), 0.012), s.lumps(rng, rng.uniform(0, 0.25), 0.12)
    p = np.stack([x, 0 * x, z], -1)
    far = np.clip((np.hypot(x, z - 4) - 4) / 25, 0, 1)
    y = hills(p) * far**1.5 + bumps(p) * np.clip(far * 4, 0, 1)
    flat = np.stack([x, y, z], -1).reshape(-1, 3)
    faces = s._grid_faces(n, n, flip=True)
    land = s.Solid(flat, faces, s.smooth_normals(flat, faces), flat[:, [0, 2]])
    parts = [Part(land, m.ground(rng))]
    if rng.random() < 0.5:
        parts.append(Part(s.sheet((-1.5, 0.01, 12), rng.uniform(1, 3) * _X, -14 * _Z), m.ground(rng)))
    for _ in range(int(rng.integers(4, 16))):
        at = np.array([rng.uniform(-20, 20), 0, rng.uniform(-40, -3)])
        at[1] = y.ravel()[np.argmin((flat[:, 0] - at[0]) ** 2 + (flat[:, 2] - at[2]) ** 2)] - 0.05
        one = tree(rng, rng.uniform(3, 9)) if rng.random() < 0.6 else _bush(rng, rng.uniform(0.6, 2.5))
        parts += things.placed(one, at, rng.uniform(0, 6))
    return parts + _strewn(rng, meshes, int(rng.integers(1, 7)), (3.5, -4, 2))
