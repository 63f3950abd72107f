"""Garages, workshops, halls: one or two large things in the middle of the picture, clutter along the walls."""

from __future__ import annotations

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural import rooms
from materialist.procedural.objects import furniture, machines, things
from materialist.procedural.objects.parts import Parts, placed
from materialist.procedural.objects.things import Meshes
from materialist.procedural.world import Viewpoint, World, look


def workshop(rng: np.random.Generator, meshes: Meshes, captures: Meshes) -> World:
    """A large thing of many parts seen from one metre to five, in a room with loaded shelves."""
    w, d, _ = size = rng.uniform([3.2, 4.0, 2.3], [8.0, 9.0, 4.0])
    ground = m.one_of(rng, m.ground, m.ground, m.stone) if rng.random() < 0.5 else None
    parts, portals, envmap = rooms.shell(rng, size, captures, ground)
    parts += _along_walls(rng, size, meshes)
    main = np.array([rng.uniform(-0.25, 0.25) * w, 0, rng.uniform(-0.3, 0.1) * d])
    parts += placed(machines.big_thing(rng, meshes), main, rng.normal() * 0.5)
    for _ in range(int(rng.integers(0, 3))):
        at = np.add(main, (rng.choice([-1, 1]) * rng.uniform(1.0, 2.2), 0, rng.uniform(-1.2, 1.0)))
        if abs(at[0]) < w / 2 - 0.5 and abs(at[2]) < d / 2 - 0.5:
            parts += placed(machines.big_thing(rng, meshes), at, rng.uniform(0, 2 * np.pi))
    small = things.scattered(rng, int(rng.integers(0, 5)), (1.5, 1.2), (0.1, 0.5), meshes)
    parts += placed(small, np.add(main, (0, 0, 0.3)))
    parts += rooms.lamps(rng, size, portals, envmap)
    return World(parts, envmap, _view(rng, size, main), portals, "workshop")


def _along_walls(rng, size, meshes) -> Parts:
    """Racks, cupboards, benches, stacks and ladders, from the left of every wall but the front one to its right."""
    w, d, h = size
    walls = ((w, 0.0, (-w / 2, -d / 2)), (d, np.pi / 2, (-w / 2, d / 2)), (d, -np.pi / 2, (w / 2, -d / 2)))
    parts: Parts = []
    for length, turn, (x, z) in walls:
        along, out = np.array([np.cos(turn), 0, -np.sin(turn)]), np.array([np.sin(turn), 0, np.cos(turn)])
        at = 0.7
        while at < length - 0.9 and rng.random() < 0.9:
            wide, deep, kind = min(rng.uniform(0.7, 2.2), length - 0.5 - at), 0.35, rng.random()
            if kind < 0.5:
                piece = machines.rack(rng, wide, min(rng.uniform(1.2, 2.3), h - 0.2), meshes)
            elif kind < 0.65:
                found = m.pick(rng, ((1, furniture.cupboard), (1, furniture.shelf)))(rng, meshes)
                piece, wide, deep = found.parts, found.width, found.depth / 2 + 0.03
            else:
                piece = m.pick(rng, ((1, machines.bench), (2, machines.stack), (1, machines.ladder)))(rng)
                wide, deep = 1.2, 0.55
            parts += placed(piece, [x, 0, z] + along * (at + wide / 2) + out * deep, turn)
            at += wide + rng.choice([0.05, rng.uniform(0.1, 1.2)])
    return parts


def _view(rng, size, main) -> Viewpoint:
    """Somebody in front of the large thing who looks at it."""
    w, d, h = size
    target = np.add(main, (rng.normal() * 0.25, rng.uniform(0.3, 0.9), 0))
    turn, distance = rng.normal() * 0.5, rng.uniform(1.6, 4.5)
    eye = target + distance * np.array([np.sin(turn), 0, np.cos(turn)])
    eye[1] = rng.uniform(0.8, 1.8)
    eye = np.clip(eye, [-w / 2 + 0.2, 0.3, main[2] + 1.1], [w / 2 - 0.2, h - 0.3, d / 2 - 0.15])
    return look(eye, target, rng.uniform(33, 70), rng.normal() * 0.025)
