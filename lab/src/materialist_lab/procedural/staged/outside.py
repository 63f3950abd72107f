"""Streets, yards and gardens with real vehicles, trees, furniture and people."""

import numpy as np

from materialist_lab.procedural import lights
from materialist_lab.procedural import materials as m
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.objects import street_things as street
from materialist_lab.procedural.relief import Relief
from materialist_lab.procedural.staged.finishes import covered
from materialist_lab.procedural.staged.pieces import backdrop_of, piece
from materialist_lab.procedural.staged.stock import Stock
from materialist_lab.procedural.world import Parts, ScenePart, World, bounds, look, placed

GROUND = 60.0
"""Metres to the edge of the ground."""
THINGS = (
    "outdoor",
    "outdoor",
    "outdoor",
    "vehicle",
    "vehicle",
    "person",
    "person",
    "thing",
    "chair",
)


def outside(rng: np.random.Generator, stock: Stock) -> World:
    """Things on open ground, at times before houses or a photograph, under a sky."""
    parts = [_ground(rng, stock)]
    # --- Behind: houses, a wall, or open land, perhaps with a photograph as the backdrop ---
    behind = rng.random()
    at = -rng.uniform(6, 16)
    if behind < 0.45:
        for x, house in street.houses(rng, -rng.uniform(6, 14), 14, 4):
            parts += placed(house, (x, 0, at + rng.normal() * 0.3))
    elif behind < 0.6:
        parts += placed(street.wall(rng, 40.0), (0, 0, at))
    parts += _standing(rng, stock, int(rng.integers(3, 13)), at + 0.5 if behind < 0.6 else -9.0)
    # --- The camera: crouching now and then, else standing ---
    height = rng.uniform(0.5, 1.0) if rng.random() < 0.25 else rng.uniform(1.3, 2.2)
    eye = np.array([rng.normal() * 0.8, height, rng.uniform(4, 8)])
    target = np.array([rng.normal() * 1.2, rng.uniform(0.2, 1.6), -rng.uniform(1, 5)])
    view = look(eye, target, rng.uniform(25, 68), rng.normal() * 0.02)
    envmap = lights.outdoors(rng, stock.captures)
    backdrop = backdrop_of(rng, stock, 1.5, 0.3) if behind > 0.6 and rng.random() < 0.5 else None
    return World(parts, envmap, view, kind="outside", backdrop=backdrop)


def _ground(rng: np.random.Generator, stock: Stock) -> ScenePart:
    # A photographed ground at times, else one of ours.
    sheet = s.sheet((-GROUND, 0, GROUND), (2 * GROUND, 0, 0), (0, 0, -2 * GROUND), 12)
    picture = stock.texture(rng, "stone") if rng.random() < 0.3 else None
    if picture is not None:
        return ScenePart(sheet, covered(rng, picture, rng.uniform(1, 3), "stone"))
    relief = Relief("rough", (rng.uniform(0.3, 2),) * 3, rng.uniform(0.03, 0.25))
    return ScenePart(sheet, m.replace(m.ground(rng), relief=relief, emboss=rng.uniform(0, 0.01)))


def _standing(rng: np.random.Generator, stock: Stock, count: int, back: float) -> Parts:
    """Up to `count` models before z = `back` that do not touch each other, the larger ones farther away."""
    taken: list[tuple[float, float, float]] = []
    parts: Parts = []
    for _ in range(count):
        model = stock.model(rng, str(rng.choice(THINGS)))
        if model is None:
            continue
        item = piece(rng, model, stock)
        low, high = bounds(item)
        radius = float(np.hypot(*(high - low)[[0, 2]]) / 2)
        for _ in range(10):
            x = rng.uniform(-4.5, 4.5)
            z = rng.uniform(back + radius, max(3.0 - radius, back + radius))
            if all(np.hypot(x - a, z - b) > 0.8 * (radius + r) for a, b, r in taken):
                taken.append((x, z, radius))
                parts += placed(item, (x, 0, z), rng.uniform(0, 2 * np.pi))
                break
    return parts
