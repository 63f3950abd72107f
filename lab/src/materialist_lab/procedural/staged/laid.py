"""Tables, chests, shelves and floors with things on them, seen from close by, with the room behind."""

import numpy as np

from materialist_lab.procedural import rooms, world
from materialist_lab.procedural.catalog.support import LevelPlace
from materialist_lab.procedural.staged.furnished import furnished_world, some_pieces
from materialist_lab.procedural.staged.pieces import laid, piece
from materialist_lab.procedural.staged.stock import Stock
from materialist_lab.procedural.world import Parts, World, placed


def laid_table(rng: np.random.Generator, stock: Stock) -> World:
    """Things on something level, with the room around them."""
    parts, place = _table(rng, stock)
    parts = parts + laid(rng, place, int(rng.integers(3, 13)), stock, crowd=rng.choice([0.0, 1.0]))
    # --- The room: large enough for the piece, which stands at the back wall or near the middle ---
    low, high = world.bounds(parts)
    size = rng.uniform([2.8, 3.0, 2.3], [5.5, 5.5, 3.0])
    size[:2] = np.maximum(size[:2], (high - low)[[0, 2]] + 0.8)
    at_wall = rng.random() < 0.5
    x = rng.uniform(-0.3, 0.3)
    z = -size[1] / 2 - low[2] + 0.03 if at_wall else rng.uniform(-0.3, 0.3)
    standing = rooms.Furniture(size)
    standing.add(placed(parts, (x, 0, z)))
    standing.along_walls(rng, some_pieces(rng, stock, int(rng.integers(1, 4))))
    if not at_wall:
        standing.in_the_middle(rng, some_pieces(rng, stock, int(rng.integers(0, 3)), ("chair",)))
    # --- The camera, on a sphere about a point on the place, held within the walls ---
    centre_x = (place.left + place.right) / 2 + x
    centre_z = (place.back + place.front) / 2 + z
    middle = np.array([centre_x, place.height, centre_z])
    half = np.array([place.right - place.left, 0, place.front - place.back]) / 2
    target = middle + rng.uniform(-0.4, 0.4, 3) * half + [0, rng.uniform(0.0, 0.12), 0]
    distance, up, turn, fov = rng.uniform(
        [0.45, np.radians(6), -0.9, 22], [1.5, np.radians(58), 0.9, 58]
    )
    w, d, h = size
    lowest = np.array([-w / 2 + 0.1, 0.15, -d / 2 + 0.2])
    highest = np.array([w / 2 - 0.1, h - 0.2, d / 2 - 0.1])
    eye = np.clip(world.orbit(target, distance, turn, up, fov).position, lowest, highest)
    view = world.look(eye, target, fov, rng.normal() * 0.03)
    view = world.through_lens(rng, view, float(np.linalg.norm(eye - target)), 0.35)
    return furnished_world(rng, size, stock, standing.parts, view, "laid")


def _table(rng: np.random.Generator, stock: Stock) -> tuple[Parts, LevelPlace]:
    """(a piece that things can stand on, its place)."""
    # --- A model with a level place at a reachable height, large places preferred ---
    for _ in range(6 if rng.random() < 0.85 else 0):
        model = stock.model(rng, "table", "table", "shelf", "storage", "storage")
        places = (
            []
            if model is None
            else [p for p in model.places if p.height < 1.4 and p.clearance > 0.2]
        )
        if places and model is not None:
            areas = np.array([(p.right - p.left) * (p.front - p.back) for p in places])
            place = places[rng.choice(len(places), p=areas / areas.sum())]
            return piece(rng, model, stock), place
    # --- Else a place on the floor ---
    wide, deep = rng.uniform(0.6, 1.4, 2)
    return [], LevelPlace(0.003, -wide / 2, wide / 2, -deep / 2, deep / 2, 10.0)
