"""Still lifes: things on a plain ground in any surroundings."""

import numpy as np

from materialist_lab.procedural import lights
from materialist_lab.procedural import materials as m
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.objects import things
from materialist_lab.procedural.objects.things import Meshes
from materialist_lab.procedural.world import (
    ScenePart,
    World,
    block,
    look,
    orbit,
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


def _flat(half: float, material: m.Material, n: int = 1) -> ScenePart:
    """A square ground of that half side, in n x n pieces."""
    return ScenePart(s.sheet((-half, 0, half), (2 * half, 0, 0), (0, 0, -2 * half), n), material)
