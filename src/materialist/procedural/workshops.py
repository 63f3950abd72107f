"""Garages, workshops, halls: one or two large things in the middle of the picture, clutter along the walls."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural import rooms
from materialist.procedural.objects import furniture, machines, things
from materialist.procedural.objects.things import Parts
from materialist.procedural.objects.wheels import by
from materialist.procedural.world import View, World, look


def workshop(rng: np.random.Generator, meshes: tuple[Path, ...], captures: tuple[Path, ...]) -> World:
    """A large thing of many parts seen from one metre to five, in a room with loaded shelves."""
    size = rng.uniform(3.2, 8.0), rng.uniform(4.0, 9.0), rng.uniform(2.3, 4.0)
    w, d, _ = size
    ground = (m.ground(rng) if rng.random() < 0.7 else m.stone(rng)) if rng.random() < 0.5 else None
    parts, portals, envmap = rooms.shell(rng, rooms.four_walls(*size), size, captures, ground)
    parts += _along_walls(rng, size, meshes)
    main = np.array([rng.uniform(-0.25, 0.25) * w, 0, rng.uniform(-0.3, 0.1) * d])
    parts += things.placed(machines.big_thing(rng, meshes), main, rng.normal() * 0.5)
    for _ in range(int(rng.integers(0, 3))):
        at = main + by(rng.choice([-1, 1]) * rng.uniform(1.0, 2.2), 0, rng.uniform(-1.2, 1.0))
        if abs(at[0]) < w / 2 - 0.5 and abs(at[2]) < d / 2 - 0.5:
            parts += things.placed(machines.big_thing(rng, meshes), at, rng.uniform(0, 2 * np.pi))
    small = things.scattered(rng, int(rng.integers(0, 5)), (1.5, 1.2), (0.1, 0.5), meshes)
    parts += things.placed(small, main + by(0, 0, 0.3))
    parts += rooms.lamps(rng, size, portals, envmap)
    return World(parts, envmap, _view(rng, size, main), portals, "workshop")


def _along_walls(rng, size, meshes) -> Parts:
    """Racks, cupboards, benches, stacks and boards, from the left of every wall but the front one to its right."""
    w, d, h = size
    parts: Parts = []
    for length, turn, corner in (
        (w, 0.0, (-w / 2, -d / 2)),
        (d, np.pi / 2, (-w / 2, d / 2)),
        (d, -np.pi / 2, (w / 2, -d / 2)),
    ):
        along, out = np.array([np.cos(turn), 0, -np.sin(turn)]), np.array([np.sin(turn), 0, np.cos(turn)])
        at = 0.7
        while at < length - 0.9 and rng.random() < 0.9:
            wide = min(rng.uniform(0.7, 2.2), length - 0.5 - at)
            kind, deep = rng.random(), 0.35
            if kind < 0.5:
                piece = machines.rack(rng, wide, min(rng.uniform(1.2, 2.3), h - 0.2), meshes)
            elif kind < 0.65:
                found = furniture.pick(rng, ((furniture.cupboard, 1.0), (furniture.shelf, 1.0)), meshes)
                piece, wide, deep = found.parts, found.width, found.depth / 2 + 0.03
            else:
                piece = [machines.bench, machines.stack, machines.stack, machines.ladder][rng.integers(4)](rng)
                wide, deep = 1.2, 0.55
            place = np.array([corner[0], 0, corner[1]]) + along * (at + wide / 2) + out * deep
            parts += things.placed(piece, place, turn)
            at += wide + rng.choice([0.05, rng.uniform(0.1, 1.2)])
    return parts


def _view(rng, size, main) -> View:
    """Somebody in front of the large thing who looks at it."""
    w, d, h = size
    target = main + by(rng.normal() * 0.25, rng.uniform(0.3, 0.9), 0)
    turn, distance = rng.normal() * 0.5, rng.uniform(1.6, 4.5)
    eye = target + distance * np.array([np.sin(turn), 0, np.cos(turn)])
    eye[1] = rng.uniform(0.8, 1.8)
    eye = np.clip(eye, [-w / 2 + 0.2, 0.3, main[2] + 1.1], [w / 2 - 0.2, h - 0.3, d / 2 - 0.15])
    return look(eye, target, rng.uniform(33, 70), rng.normal() * 0.025)
