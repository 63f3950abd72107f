"""Streets, yards and open ground under a sky; and still lifes on a plain ground in any surroundings."""

from dataclasses import replace

import numpy as np

from materialist_lab.procedural import lights
from materialist_lab.procedural import materials as m
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.objects import street_things as street
from materialist_lab.procedural.objects import things
from materialist_lab.procedural.objects.things import Meshes
from materialist_lab.procedural.world import (
    Parts,
    ScenePart,
    World,
    block,
    bounds,
    look,
    orbit,
    placed,
)

GROUNDS: tuple[tuple[float, m.Maker], ...] = (
    (0.2, m.wood),
    (0.13, m.stone),
    (0.13, m.fabric),
    (0.1, m.tiled),
    (0.1, m.plastic),
    (0.1, m.wall_paint),
    (0.1, m.floor_boards),
    (0.1, m.ground),
    (0.04, m.metal),
)
HORIZON = 150.0
"""Metres to the edge of a ground."""


def still_life(rng: np.random.Generator, meshes: Meshes, captures: Meshes) -> World:
    """Three to nine things on a ground, before a wall, a curved backdrop, or the surroundings alone."""
    ground = m.pick(rng, GROUNDS)(rng)
    back = rng.random()
    # --- The ground: a table top, or one that reaches out of the picture ---
    if rng.random() < 0.5:
        half = rng.uniform(0.6, 1.2)
        parts = [block((2 * half, 0.04, 2 * half), (0, -0.04, 0), ground, 0.008)]
    else:
        half = rng.uniform(2, 5)
        parts = [_flat(half, ground)]
    # --- Behind the things: a wall, a ground that bends up as in a studio, or nothing ---
    if back < 0.35:
        wall = m.one_of(rng, m.wall_paint, m.wallpaper, m.brick, m.stone, m.tiled, m.fabric)
        corner = (-half, 0, -rng.uniform(0.35, 0.9))
        sheet = s.sheet(corner, (2 * half, 0, 0), (0, rng.uniform(0.6, 2.5), 0))
        parts.append(ScenePart(sheet, wall))
    elif back < 0.45:
        t = np.linspace(0, np.pi / 2, 16)
        bend = np.stack([-0.6 - 0.4 * np.sin(t), 0.4 * (1 - np.cos(t)), 0 * t], -1)
        sweep = s.strip(np.concatenate([bend, [[-1.0, 2.0, 0]]]), 2 * half, flip=True)
        parts.append(ScenePart(s.moved(sweep, turn=-np.pi / 2), ground))
    # --- Things ---
    count = int(rng.integers(3, 10))
    parts += things.scattered(rng, count, (0.42, 0.35), (0.07, 0.4), meshes, 0.45)
    # --- The camera, on a sphere about a point among them ---
    target = np.array([rng.normal() * 0.06, rng.uniform(0.05, 0.18), rng.normal() * 0.06])
    up, turn, distance, fov = rng.uniform(
        [np.radians(5), -0.7, 0.65, 25], [np.radians(60), 0.7, 1.4, 60]
    )
    view = look(orbit(target, distance, turn, up, fov).position, target, fov, rng.normal() * 0.03)
    return World(parts, lights.around(rng, captures), view, kind="still life")


def outdoor(rng: np.random.Generator, meshes: Meshes, captures: Meshes) -> World:
    """A street, a square, a garden or open land."""
    parts = m.pick(rng, ((0.4, _street), (0.35, _yard), (0.25, _land)))(rng, meshes)
    # From low down now and then, else from about eye level.
    height = rng.uniform(0.4, 1.0) if rng.random() < 0.2 else rng.uniform(1.3, 2.4)
    eye = np.array([rng.normal() * 0.8, height, rng.uniform(3, 7)])
    target = np.array([rng.normal() * 1.5, rng.uniform(0.0, 2.2), -rng.uniform(2, 12)])
    view = look(eye, target, rng.uniform(30, 70), rng.normal() * 0.02)
    return World(parts, lights.outdoors(rng, captures), view, kind="outdoor")


def _flat(half: float, material: m.Material, n: int = 1) -> ScenePart:
    """A square ground of that half side, in n x n pieces."""
    return ScenePart(s.sheet((-half, 0, half), (2 * half, 0, 0), (0, 0, -2 * half), n), material)


def houses(
    rng: np.random.Generator, start: float, end: float, gap: float
) -> list[tuple[float, Parts]]:
    """(middle, house) of houses in a row between two places, some of them apart."""
    row = []
    while start < end:
        house = street.house(rng)
        width = float(np.ptp(bounds(house[:1]), axis=0)[0])
        row.append((start + width / 2, house))
        start += width + rng.choice([0.0, rng.uniform(0.5, gap)])
    return row


def _street(rng, meshes) -> Parts:
    """A road away from the viewer with pavements, houses, cars, trees, people."""
    parts = [_flat(HORIZON, m.ground(rng), 12)]
    half = rng.uniform(2.5, 6)
    wide = rng.uniform(1.5, 4)
    kerb = m.stone(rng)
    pave = m.ground(rng)
    for side in (-1, 1):
        # --- Pavement, kerb and houses that face the road ---
        parts.append(block((wide, 0.14, 140), (side * (half + wide / 2), 0, -55), pave))
        parts.append(block((0.18, 0.145, 140), (side * (half + 0.08), 0, -55), kerb, 0.02))
        for along, house in houses(rng, -rng.uniform(0, 6), rng.uniform(20, 70), 5):
            parts += placed(house, (side * (half + wide + 0.1), 0, -along), -side * np.pi / 2)
        # --- Parked cars at the kerb; posts, people and trees on the pavement ---
        for _ in range(int(rng.integers(0, 5))):
            if rng.random() < 0.35:
                at = (side * (half - 0.95), 0.0, rng.uniform(-22, 1.5))
                item = street.car(rng)
                turn = np.pi / 2
            else:
                item = m.one_of(
                    rng, street.post, street.person, lambda r: street.tree(r, r.uniform(3, 7))
                )
                at = (side * (half + rng.uniform(0.3, wide - 0.3)), 0.14, rng.uniform(-22, 1.5))
                turn = rng.uniform(0, 6)
            parts += placed(item, at, turn + rng.normal() * 0.06)
    # --- A broken white line, two metres of every four ---
    if rng.random() < 0.6:
        white = m.uniform(m.hsv(0.1, 0.05, 0.9), 0.7, grain=0.4)
        for z in np.arange(-50, 4, 4.0):
            line = s.sheet((-0.07, 0.004, z + 2), (0.14, 0, 0), (0, 0, -2))
            parts.append(ScenePart(line, white))
    # --- A car on the road ---
    if rng.random() < 0.5:
        car = street.car(rng)
        at = (rng.uniform(-0.5, 0.5) * half, 0, -rng.uniform(4, 20))
        parts += placed(car, at, np.pi / 2)
    return parts


def _yard(rng, meshes) -> Parts:
    """A square or garden: a house or wall behind, things, people and plants on the ground."""
    parts = [_flat(HORIZON, m.ground(rng), 12)]
    back = -rng.uniform(2, 12)
    if rng.random() < 0.7:
        for x, house in houses(rng, -rng.uniform(6, 14), 14, 4):
            parts += placed(house, (x, 0, back + rng.normal() * 0.3))
    else:
        parts += placed(street.wall(rng, 40.0), (0, 0, back))
    # A wall at one side.
    if rng.random() < 0.4:
        wall = street.wall(rng, 12.0)
        at = (rng.choice([-1, 1]) * rng.uniform(3, 7), 0, 0)
        parts += placed(wall, at, np.pi / 2)
    return parts + _strewn(rng, meshes, int(rng.integers(3, 12)), (4.5, back + 1.5, 2.5))


def _stone(rng) -> Parts:
    """A boulder of 20 to 150 centimetres."""
    extent = rng.uniform(0.2, 1.5) * rng.uniform(0.6, 1, 3)
    body = s.blob(rng, extent, 0.25, 40)
    return [ScenePart(body, m.stone(rng))]


def _strewn(rng, meshes, count: int, bounds) -> Parts:
    """Plants, people, cars, posts and things within |x| <= bounds[0], bounds[1] <= z <= bounds[2]."""
    kinds = (
        (0.2, lambda r: street.bush(r, r.uniform(0.4, 1.5))),
        (0.15, lambda r: street.tree(r, r.uniform(2.5, 7))),
        (0.15, street.person),
        (0.08, street.car),
        (0.1, street.post),
        (0.12, _stone),
        (0.2, lambda r: things.thing(r, r.uniform(0.3, 1.4), meshes, 0.6)),
    )
    parts: Parts = []
    for _ in range(count):
        at = (rng.uniform(-1, 1) * bounds[0], 0, rng.uniform(bounds[1], bounds[2]))
        parts += placed(m.pick(rng, kinds)(rng), at, rng.uniform(0, 2 * np.pi))
    return parts


def _land(rng, meshes) -> Parts:
    """Meadow or park, with hills, trees and stones."""
    hills = s.lumps(rng, rng.uniform(0, 7), 0.012)
    bumps = s.lumps(rng, rng.uniform(0, 0.25), 0.12)

    def height(p):
        """[...] of the ground at points [..., 3], level around the viewer."""
        far = np.clip((np.hypot(p[..., 0], p[..., 2] - 4) - 4) / 25, 0, 1)
        return hills(p) * far**1.5 + bumps(p) * np.clip(far * 4, 0, 1)

    # A grid that sinh spreads: fine around the viewer, coarse towards the horizon.
    unit = s.sheet((-1, 0, 1), (2, 0, 0), (0, 0, -2), 64)
    wide = np.sinh(4 * unit.vertices) / np.sinh(4) * 0.8 * HORIZON
    land = s.warped(
        replace(unit, vertices=wide, uv=wide[:, [0, 2]]),
        lambda p: p + height(p)[:, None] * [0, 1, 0],
    )
    parts = [ScenePart(land, m.ground(rng))]
    # A path.
    if rng.random() < 0.5:
        path = s.sheet((-1.5, 0.01, 12), (rng.uniform(1, 3), 0, 0), (0, 0, -14))
        parts.append(ScenePart(path, m.ground(rng)))
    # Trees and bushes, their feet five centimetres in the ground: it is not level under them.
    for _ in range(int(rng.integers(4, 16))):
        at = rng.uniform([-20, 0, -40], [20, 0, -3])
        at[1] = height(at) - 0.05
        tall = rng.random() < 0.6
        maker = street.tree if tall else street.bush
        height_range = (3, 9) if tall else (0.6, 2.5)
        parts += placed(maker(rng, rng.uniform(*height_range)), at)
    return parts + _strewn(rng, meshes, int(rng.integers(1, 7)), (3.5, -4, 2))
