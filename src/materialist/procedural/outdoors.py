"""Streets, yards and open ground under a sky; and still lifes on a plain ground in any surroundings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural import skies
from materialist.procedural.objects import solids as s
from materialist.procedural.objects import street_things, things
from materialist.procedural.objects.things import Parts
from materialist.procedural.world import Part, World, look

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
            house = street_things.house(rng)
            width = float(np.ptp(house[0].solid.vertices[:, 0]))
            parts += things.placed(house, (side * (half + wide + 0.1), 0, z - width / 2), -side * np.pi / 2)
            z -= width + rng.choice([0.0, rng.uniform(0.5, 5)])
        for _ in range(int(rng.integers(0, 5))):
            one = [
                street_things.car,
                street_things.post,
                street_things.person,
                lambda r: street_things.tree(r, r.uniform(3, 7)),
            ][rng.choice(4, p=[0.35, 0.2, 0.25, 0.2])](rng)
            off = -0.95 if len(one) > 8 and one[0].solid.vertices[:, 1].max() < 1.2 else rng.uniform(0.3, wide - 0.3)
            at = (side * (half + off), 0.0 if off < 0 else 0.14, rng.uniform(-22, 1.5))
            parts += things.placed(one, at, np.pi / 2 + rng.normal() * 0.06 if off < 0 else rng.uniform(0, 6))
    white = m.Material(0, (m.hsv(0.1, 0.05, 0.9),) * 3, 0.4, (0.7, 0.7))
    if rng.random() < 0.6:
        for z in np.arange(-50, 4, 4.0):
            parts.append(Part(s.sheet((-0.07, 0.004, z + 2), 0.14 * _X, -2 * _Z), white))
    if rng.random() < 0.5:
        parts += things.placed(
            street_things.car(rng), (rng.uniform(-0.5, 0.5) * half, 0, -rng.uniform(4, 20)), np.pi / 2
        )
    return parts


def _yard(rng, meshes) -> Parts:
    """A square or garden: a house or wall behind, things, people and plants on the ground."""
    parts, back = _ground(rng), -rng.uniform(2, 12)
    if rng.random() < 0.7:
        x = -rng.uniform(6, 14)
        while x < 14:
            house = street_things.house(rng)
            width = float(np.ptp(house[0].solid.vertices[:, 0]))
            parts += things.placed(house, (x + width / 2, 0, back + rng.normal() * 0.3))
            x += width + rng.choice([0.0, rng.uniform(0.5, 4)])
    else:
        parts += things.placed(street_things.wall(rng, 40.0), (0, 0, back))
    if rng.random() < 0.4:
        parts += things.placed(
            street_things.wall(rng, 12.0), (rng.choice([-1, 1]) * rng.uniform(3, 7), 0, 0), np.pi / 2
        )
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
            one = street_things.bush(rng, rng.uniform(0.4, 1.5))
        elif kind < 0.35:
            one = street_things.tree(rng, rng.uniform(2.5, 7))
        elif kind < 0.5:
            one = street_things.person(rng)
        elif kind < 0.58:
            one = street_things.car(rng)
        elif kind < 0.68:
            one = street_things.post(rng)
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
        one = (
            street_things.tree(rng, rng.uniform(3, 9))
            if rng.random() < 0.6
            else street_things.bush(rng, rng.uniform(0.6, 2.5))
        )
        parts += things.placed(one, at, rng.uniform(0, 6))
    return parts + _strewn(rng, meshes, int(rng.integers(1, 7)), (3.5, -4, 2))
