"""One thing, seen from close by with a long lens: before black, white or a blurred photograph, or on a ground."""

import numpy as np

from materialist.types import Array
from materialist_lab.procedural import materials as m
from materialist_lab.procedural.catalog.support import LevelPlace
from materialist_lab.procedural.objects import shapes as s
from materialist_lab.procedural.staged import studio_light
from materialist_lab.procedural.staged.finishes import covered
from materialist_lab.procedural.staged.pieces import backdrop_of, laid, piece
from materialist_lab.procedural.staged.sculptures import sculpture
from materialist_lab.procedural.staged.stock import Stock
from materialist_lab.procedural.world import (
    Parts,
    ScenePart,
    World,
    bounds,
    look,
    orbit,
    placed,
    through_lens,
)

SUBJECTS = (
    "small",
    "small",
    "small",
    "small",
    "chair",
    "sofa",
    "thing",
    "thing",
    "storage",
    "lamp",
    "person",
    "person",
    "vehicle",
    "outdoor",
    "shelf",
    "table",
    "bed",
    "wall",
)
"""Roles of single things, one named twice as often as one named once."""


def single(rng: np.random.Generator, stock: Stock) -> World:
    """A thing or a sculpture under a hard lamp in the dark, or in soft light."""
    # --- The camera: mostly a long lens, so far away that the thing fills the picture ---
    parts = _subject(rng, stock)
    low, high = bounds(parts)
    size = float(np.linalg.norm(high - low))
    fov = rng.uniform(9, 26) if rng.random() < 0.75 else rng.uniform(26, 50)
    up = np.radians(rng.uniform(-8, 50) if rng.random() < 0.7 else rng.uniform(0, 20))
    turn = rng.uniform(-np.pi, np.pi) if rng.random() < 0.25 else rng.normal(0, 0.5)
    fill = rng.uniform(0.65, 1.4)
    distance = size / 2 / np.tan(np.radians(fov) / 2) / fill
    target = (low + high) / 2 + rng.normal(0, 0.05, 3) * (high - low)
    around = orbit(target, distance, turn, up, fov)
    view = look(around.position, target, fov, rng.normal() * 0.05)
    view = through_lens(rng, view, distance, 0.2)
    # --- Light ---
    to_camera = (around.position - target) / distance
    hard = rng.random() < 0.65
    envmap = (
        studio_light.hard_lamps(rng, to_camera) if hard else studio_light.soft_light(rng, stock)
    )
    # --- Ground or backdrop; from below, a ground would hide the thing ---
    ground = m.pick(rng, ((0.45, "none"), (0.25, "sweep"), (0.3, "flat")))
    if up < np.radians(4):
        ground = "none"
    if ground != "none":
        parts = parts + _ground(rng, stock, ground, low, high, turn)
    backdrop = None
    if ground == "none":
        backdrop = _backdrop(rng, stock, float(np.mean(envmap)), black=0.7 if hard else 0.25)
    return World(parts, envmap, view, kind="single", backdrop=backdrop)


def _subject(rng: np.random.Generator, stock: Stock) -> Parts:
    """A sculpture, a few things together, or a model."""
    draw = rng.random()
    if draw < 0.45:
        return sculpture(rng, stock)
    # Stocks without models have sculptures in their place.
    if draw < 0.6:
        place = LevelPlace(0.0, -0.3, 0.3, -0.2, 0.2, 10.0)
        parts = laid(rng, place, int(rng.integers(2, 6)), stock, crowd=1.0)
        return parts or sculpture(rng, stock)
    model = stock.model(rng, str(rng.choice(SUBJECTS)))
    if model is None:
        return sculpture(rng, stock)
    return placed(piece(rng, model, stock), (0, 0, 0))


def _ground(
    rng: np.random.Generator, stock: Stock, kind: str, low: Array, high: Array, turn: float
) -> Parts:
    """A wide ground under the thing; a sweep bends up behind it."""
    reach = float((high - low).max())
    half = 14 * reach
    y = low[1] - 0.001 * reach
    material = _cloth(rng, stock, reach)
    if kind == "flat":
        sheet = s.sheet((-half, y, half), (2 * half, 0, 0), (0, 0, -2 * half), 1)
        return [ScenePart(sheet, material)]
    # A quarter circle between the level part and the upright one, turned to face the camera.
    t = np.linspace(0, np.pi / 2, 20)
    start = rng.uniform(0.7, 1.6) * reach
    bend = rng.uniform(0.4, 1.2) * reach
    curve = np.stack([-start - bend * np.sin(t), y + bend * (1 - np.cos(t)), 0 * t], -1)
    line = np.concatenate([[[half, y, 0]], curve, [[-start - bend, y + half, 0]]])
    sweep = s.band(line, 2 * half, flip=True)
    return [ScenePart(s.moved(sweep, turn=turn - np.pi / 2), material)]


def _cloth(rng: np.random.Generator, stock: Stock, reach: float) -> m.Material:
    """Paper, cloth, wood, stone, or a glossy dark plate."""
    draw = rng.random()
    # Black, grey or white; glossy or matt.
    if draw < 0.4:
        greys = [rng.uniform(0.02, 0.08), rng.uniform(0.1, 0.5), rng.uniform(0.6, 0.88)]
        grey = float(rng.choice(greys))
        rough = float(rng.choice([rng.uniform(0.06, 0.25), rng.uniform(0.4, 1.0)]))
        return m.uniform((grey,) * 3, rough)
    if draw < 0.7:
        family = str(rng.choice(["wood", "cloth", "stone"]))
        picture = stock.texture(rng, family)
        if picture is not None:
            return covered(rng, picture, max(rng.uniform(0.3, 1.2), reach), family)
    return m.one_of(rng, m.wood, m.fabric, m.stone, m.lacquer)


def _backdrop(rng: np.random.Generator, stock: Stock, level: float, black: float) -> Array:
    """[h, w, 3] linear radiance behind everything: black, white, grey, or a photograph out of focus."""
    draw = rng.random()
    if draw < black:
        return np.zeros((4, 4, 3), np.float32)
    if draw < black + 0.12:
        return np.full((4, 4, 3), level * float(np.exp(rng.normal(0.5, 0.5))), np.float32)
    blur = float(np.exp(rng.uniform(np.log(1.5), np.log(16))))
    picture = backdrop_of(rng, stock, level, 0.3, blur)
    # Grey without photographs.
    if picture is None:
        return np.full((4, 4, 3), level * rng.uniform(0.05, 1), np.float32)
    return picture
