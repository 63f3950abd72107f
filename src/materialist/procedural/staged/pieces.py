"""Models as parts of a scene: finished, lit, and laid with other things."""

from dataclasses import replace

import numpy as np

from materialist.procedural import materials as m
from materialist.procedural.catalog.cache import CatalogModel
from materialist.procedural.catalog.support import LevelPlace
from materialist.procedural.objects import shapes as s
from materialist.procedural.objects import things
from materialist.procedural.staged.finishes import finish, style
from materialist.procedural.staged.stock import Stock
from materialist.procedural.world import Parts, ScenePart, bounds, one_thing, orb, placed

GLOW = (4.0, 60.0)
"""Radiance of what glows in a lamp, log-uniform; the light of a day is about 1."""


def piece(rng: np.random.Generator, model: CatalogModel, stock: Stock, *, lit: bool = False) -> Parts:
    """A model as one thing at the origin, in materials of its own. lit: its lamps shine."""
    one = style(rng)
    finished: dict[tuple[object, ...], m.Material] = {}
    parts: Parts = []
    glow = np.exp(rng.uniform(*np.log(GLOW))) * np.array([1.0, rng.uniform(0.6, 0.95), rng.uniform(0.3, 0.9)])
    for solid, look, picture in zip(model.solids, model.looks, model.pictures):
        key = (look, id(picture))
        if key not in finished:
            shines = lit and look.family == "bulb"
            finished[key] = m.light(rng, tuple(glow)) if shines else finish(rng, look, picture, one, stock)
        parts.append(ScenePart(solid, finished[key]))
    if lit and not any(look.family == "bulb" for look in model.looks):
        width, _, depth = model.entry.size
        for x, y, z in model.entry.lights[:3]:
            parts.append(orb((x - width / 2, y, z - depth / 2), 0.035, m.light(rng, tuple(3 * glow)), 12))
    return one_thing(parts)


def small_thing(rng: np.random.Generator, stock: Stock, high: float, tall: float = 1.0) -> Parts:
    """Something to stand on a table or shelf, not longer than `high` nor taller than `tall` metres."""
    if rng.random() < 0.15:
        parts = things.thing(rng, rng.uniform(0.08, min(0.3, high)), stock.meshes, 0.5)
        return parts if bounds(parts)[1][1] <= tall else []
    model = stock.model(rng, "small", "small", "small", "lamp", high=high)
    if model is None or model.entry.size[1] > tall:
        return []
    return piece(rng, model, stock, lit=model.role == "lamp" and rng.random() < 0.6)


def laid(rng: np.random.Generator, place: LevelPlace, count: int, stock: Stock, crowd: float = 0.0) -> Parts:
    """Up to `count` small things on a level place that do not touch each other.

    crowd: 0 anywhere on it, 1 close to its middle.
    """
    half = np.array([place.right - place.left, place.front - place.back]) / 2
    middle = np.array([place.right + place.left, place.front + place.back]) / 2
    taken: list[tuple[float, float, float]] = []
    parts: Parts = []
    for _ in range(count):
        one = small_thing(rng, stock, min(0.62, 1.8 * float(half.min())), place.clearance * 0.95)
        if not one:
            continue
        low, high = bounds(one)
        radius = float(np.hypot(*(high - low)[[0, 2]]) / 2)
        room = np.maximum(half - 0.72 * radius, 0.0) * (1 - crowd * 0.6)
        for _ in range(14):
            x, z = middle + rng.uniform(-1, 1, 2) * room
            if all(np.hypot(x - a, z - b) > 0.74 * (radius + r) for a, b, r in taken):
                taken.append((x, z, radius))
                centred = placed(one, -(low + high) / 2 * [1, 0, 1])
                parts += placed(centred, (x, place.height, z), _turn(rng))
                break
    return parts


def _turn(rng: np.random.Generator) -> float:
    """Mostly about straight, as people put things; else anyhow."""
    return rng.normal(0, 0.35) if rng.random() < 0.6 else rng.uniform(0, 2 * np.pi)


def furnished_piece(rng: np.random.Generator, model: CatalogModel, stock: Stock, clutter: float) -> Parts:
    """A model with things on its level places, about `clutter` a square metre and place at least."""
    parts = piece(rng, model, stock)
    for place in model.places:
        area = (place.right - place.left) * (place.front - place.back)
        if place.clearance > 0.12 and place.height > 0.2 and rng.random() < 0.8:
            parts += laid(rng, place, int(min(rng.poisson(clutter * max(area, 0.25)), 7)), stock)
    return parts


def raised(parts: Parts, height: float) -> Parts:
    """The parts `height` metres higher."""
    return [replace(part, solid=s.moved(part.solid, (0, height, 0))) for part in parts]
