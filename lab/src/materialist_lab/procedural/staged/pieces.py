"""Models as parts of a scene: finished, lit, and laid with other things."""

from dataclasses import replace

import cv2
import numpy as np

from materialist.types import Array
from materialist_lab.procedural import materials as m
from materialist_lab.procedural.catalog.cache import CatalogModel, as_roots
from materialist_lab.procedural.catalog.support import LevelPlace
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.staged.finishes import finish, pictured, style
from materialist_lab.procedural.staged.stock import Stock
from materialist_lab.procedural.world import Parts, ScenePart, bounds, one_thing, orb, placed

GLOW = (4.0, 60.0)
"""Radiance of what glows in a lamp, log-uniform; the light of a day is about 1."""


def piece(
    rng: np.random.Generator, model: CatalogModel, stock: Stock, *, lit: bool = False
) -> Parts:
    """A model as one thing at the origin, in materials of its own. lit: its lamps shine."""
    variant = style(rng)
    finished: dict[tuple[object, ...], m.Material] = {}
    parts: Parts = []
    glow = np.exp(rng.uniform(*np.log(GLOW))) * np.array(
        [1.0, rng.uniform(0.6, 0.95), rng.uniform(0.3, 0.9)]
    )
    for solid, look, picture in zip(model.solids, model.looks, model.pictures):
        if look.family == "screen" and picture is None and rng.random() < 0.5:
            parts.append(ScenePart(solid, _screen(rng, solid, stock)))
            continue
        key = (look, id(picture))
        if key not in finished:
            shines = lit and look.family == "bulb"
            finished[key] = (
                m.light(rng, tuple(glow)) if shines else finish(rng, look, picture, variant, stock)
            )
        parts.append(ScenePart(solid, finished[key]))
    if lit and not any(look.family == "bulb" for look in model.looks):
        width, _, depth = model.entry.size
        for x, y, z in model.entry.lights[:3]:
            parts.append(
                orb((x - width / 2, y, z - depth / 2), 0.035, m.light(rng, tuple(3 * glow)), 12)
            )
    return one_thing(parts)


def _screen(rng: np.random.Generator, solid: s.Solid, stock: Stock) -> m.Material:
    """A screen that shows a photograph, lit or printed, or is off."""
    low = solid.uv.min(0)
    high = solid.uv.max(0)
    width, height = np.maximum(high - low, 1e-3)
    picture = stock.printed(rng, float(width / height)) if 0.3 < width / height < 3.5 else None
    if picture is None:
        return m.uniform((0.02, 0.02, 0.025), 0.08)
    shown = pictured(picture, np.ones(3), 0.15)
    glow = rng.uniform(0.5, 3.0) if rng.random() < 0.5 else 0.0
    # The picture fits the range of the screen's texture coordinates once, its upper edge up.
    repeat = (float(width), float(-height))
    offset = (float(-low[0] / width), float(high[1] / height))
    return replace(shown, repeat=repeat, offset=offset, emission=(glow, glow, glow))


def small_thing(rng: np.random.Generator, stock: Stock, high: float, tall: float = 1.0) -> Parts:
    """Something to stand on a table or shelf, not longer than `high` nor taller than `tall` metres."""
    model = stock.model(rng, "small", "small", "small", "lamp", high=high)
    if model is None or model.entry.size[1] > tall:
        return []
    return piece(rng, model, stock, lit=model.role == "lamp" and rng.random() < 0.6)


def laid(
    rng: np.random.Generator, place: LevelPlace, count: int, stock: Stock, crowd: float = 0.0
) -> Parts:
    """Up to `count` small things on a level place that do not touch each other.

    crowd: 0 anywhere on it, 1 close to its middle.
    """
    half = np.array([place.right - place.left, place.front - place.back]) / 2
    middle = np.array([place.right + place.left, place.front + place.back]) / 2
    taken: list[tuple[float, float, float]] = []
    parts: Parts = []
    for _ in range(count):
        item = small_thing(rng, stock, min(0.62, 1.8 * float(half.min())), place.clearance * 0.95)
        if not item:
            continue
        # The circle around its box, of which it fills about three quarters.
        low, high = bounds(item)
        radius = float(np.hypot(*(high - low)[[0, 2]]) / 2)
        room = np.maximum(half - 0.72 * radius, 0.0) * (1 - crowd * 0.6)
        # A few tries at a free place; a thing that fits nowhere is left out.
        for _ in range(14):
            x, z = middle + rng.uniform(-1, 1, 2) * room
            if all(np.hypot(x - a, z - b) > 0.74 * (radius + r) for a, b, r in taken):
                taken.append((x, z, radius))
                centred = placed(item, -(low + high) / 2 * [1, 0, 1])
                parts += placed(centred, (x, place.height, z), _turn(rng))
                break
    return parts


def _turn(rng: np.random.Generator) -> float:
    """Mostly about straight, as people put things; else anyhow."""
    return rng.normal(0, 0.35) if rng.random() < 0.6 else rng.uniform(0, 2 * np.pi)


def furnished_piece(
    rng: np.random.Generator, model: CatalogModel, stock: Stock, clutter: float
) -> Parts:
    """A model with things on its level places, about `clutter` a square metre and place at least."""
    parts = piece(rng, model, stock, lit=model.role == "lamp" and rng.random() < 0.6)
    for place in model.places:
        # Poisson counts: some places stay empty, some are crowded.
        area = (place.right - place.left) * (place.front - place.back)
        if place.clearance > 0.12 and place.height > 0.2 and rng.random() < 0.8:
            parts += laid(rng, place, int(min(rng.poisson(clutter * max(area, 0.25)), 7)), stock)
    return parts


def backdrop_of(
    rng: np.random.Generator, stock: Stock, level: float, min_share: float, blur: float = 0.0
) -> Array | None:
    """[h, w, 3] linear radiance of a part of a photograph, about `level`; None where there is no photograph.

    The part is at least `min_share` of the shorter side. It is blurred by `blur` pixels of 256.
    """
    part = stock.crop(rng, 1.0, 256, min_share)
    if part is None:
        return None
    linear = (as_roots(part) / 255.0).astype(np.float32) ** 2
    soft = cv2.GaussianBlur(linear, (0, 0), blur) if blur > 0 else linear
    # Its mean about the level of the light, a stop up or down.
    mean = max(float(soft.mean()), 1e-3)
    return soft * np.float32(level * np.exp(rng.normal(0, 0.5)) / mean)
