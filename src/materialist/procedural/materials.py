"""Random physically plausible materials: which tile, which colours, which finish."""

from __future__ import annotations

import colorsys
from dataclasses import dataclass, replace

import numpy as np

from materialist.procedural import tiles
from materialist.types import Array

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Material:
    """What a surface is made of; colours are linear Rec.709 albedo in [0, 1]."""

    tile: int
    """Number in `tiles.bank()`."""
    colours: tuple[Colour, Colour, Colour]
    grain: float = 0.1
    """Strength of the tile's brightness channel: albedo times exp(grain (g - 0.5))."""
    roughness: tuple[float, float] = (0.6, 0.6)
    """At 0 and 1 of the tile's roughness channel."""
    metallic: tuple[float, float] = (0.0, 0.0)
    """At 0 and 1 of the tile's first channel."""
    repeat: tuple[float, float] = (1.0, 1.0)
    """Metres that one tile covers, along u and v."""
    turn: float = 0.0
    """Rotation of the tile, radians."""
    emission: Colour = (0.0, 0.0, 0.0)
    """Radiance is emission times albedo, on the front side."""
    offset: tuple[float, float] | None = None
    """Shift in tiles; None for a shift of its own for every surface."""
    surface: bool = True
    """False for pictures of the distance (a view behind a window): no label is given there."""

    def row(self, shift: tuple[float, float]) -> Array:
        """[28] float32 as the path tracer reads it; `shift` moves the tile where the material leaves that open."""
        c, s = np.cos(self.turn), np.sin(self.turn)
        (c0, c1, c2), (r0, r1), (m0, m1) = self.colours, self.roughness, self.metallic
        offset = shift if self.offset is None else self.offset
        return np.array(
            [*c0, r0, *c1, r1, *c2, self.grain, m0, m1, c / self.repeat[0], s / self.repeat[0], -s / self.repeat[1],
             c / self.repeat[1], offset[0], offset[1], *self.emission, float(self.tile), float(self.surface), 0, 0, 0],
            np.float32,
        )  # fmt: skip


def hsv(h: float, s: float, v: float) -> Colour:
    """Linear colour of hue, saturation and value given in sRGB, as people name colours; kept within [0.02, 0.92]."""
    srgb = np.array(colorsys.hsv_to_rgb(h % 1, min(max(s, 0), 1), min(max(v, 0), 1)))
    return tuple(np.clip(srgb**2.2, 0.02, 0.92).tolist())


def _tile(rng: np.random.Generator, kind: str) -> int:
    where = tiles.bank()[1][kind]
    return int(rng.integers(where.start, where.stop))


def _near(rng: np.random.Generator, colour: Colour, low: float, high: float) -> Colour:
    """That colour, darker or lighter by a factor, and a little off its hue."""
    factor = rng.uniform(low, high) * rng.uniform(0.92, 1.08, 3)
    return tuple(np.clip(np.array(colour) * factor, 0.015, 0.92).tolist())


def any_colour(rng: np.random.Generator) -> Colour:
    """Greys and beiges often, saturated colours often enough, dark to light."""
    kind = rng.random()
    if kind < 0.3:
        return hsv(rng.uniform(0.05, 0.15), rng.uniform(0, 0.12), rng.uniform(0.15, 0.95))
    if kind < 0.55:
        return hsv(rng.uniform(0.03, 0.13), rng.uniform(0.12, 0.6), rng.uniform(0.2, 0.9))
    if kind < 0.8:
        return hsv(rng.random(), rng.uniform(0.1, 0.5), rng.uniform(0.2, 0.9))
    return hsv(rng.random(), rng.uniform(0.5, 0.97), rng.uniform(0.25, 0.95))


def wall_paint(rng: np.random.Generator) -> Material:
    """Painted plaster: pale as a rule, deep colours now and then."""
    if rng.random() < 0.78:
        colour = hsv(rng.choice([rng.uniform(0.05, 0.17), rng.random()]), rng.uniform(0, 0.18), rng.uniform(0.7, 0.97))
    else:
        colour = hsv(rng.random(), rng.uniform(0.15, 0.65), rng.uniform(0.25, 0.85))
    kind = str(rng.choice(["plain", "cloudy"], p=[0.75, 0.25]))
    other, dark = _near(rng, colour, 0.85, 1.05), _near(rng, colour, 0.6, 0.95)
    r = rng.uniform(0.45, 0.95)
    return Material(
        _tile(rng, kind), (colour, other, dark), rng.uniform(0, 0.12), (r, min(r + 0.1, 1)), repeat=_span(rng, 0.8, 3)
    )


def _span(rng: np.random.Generator, low: float, high: float) -> tuple[float, float]:
    """A square tile size, log-uniform."""
    size = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    return size, size


def wallpaper(rng: np.random.Generator) -> Material:
    """Printed paper: ornaments, stripes, spots."""
    base = hsv(rng.random(), rng.uniform(0.02, 0.5), rng.uniform(0.4, 0.95))
    kind = str(rng.choice(["ornament", "stripes", "spots", "plaid"], p=[0.5, 0.3, 0.1, 0.1]))
    second = _near(rng, base, 0.5, 0.95) if rng.random() < 0.7 else any_colour(rng)
    return Material(
        _tile(rng, kind), (base, second, any_colour(rng)), rng.uniform(0, 0.1), (0.6, 0.8), repeat=_span(rng, 0.4, 1.5)
    )


def wood(rng: np.random.Generator, kind: str = "wood", gloss: bool | None = None) -> Material:
    """Pale, brown, red or nearly black timber, raw or varnished."""
    value = rng.uniform(0.2, 0.88)
    base = hsv(rng.uniform(0.045, 0.105), rng.uniform(0.25, 0.7), value)
    gloss = rng.random() < 0.45 if gloss is None else gloss
    r = rng.uniform(0.12, 0.35) if gloss else rng.uniform(0.4, 0.8)
    repeat = _span(rng, 0.5, 1.4) if kind == "wood" else _span(rng, 0.9, 2.2)
    return Material(
        _tile(rng, kind), (base, _near(rng, base, 0.35, 0.75), _near(rng, base, 0.15, 0.4)), rng.uniform(0.1, 0.5),
        (r, min(r + 0.2, 1)), repeat=(repeat[0] * rng.uniform(1, 2), repeat[1]),
    )  # fmt: skip


def floor_boards(rng: np.random.Generator) -> Material:
    """Parquet, boards or laminate."""
    return wood(rng, "planks")


def tiled(rng: np.random.Generator) -> Material:
    """Ceramic tiles with joints, chequered or of one colour."""
    kind = str(rng.choice(["tiling", "checker"], p=[0.75, 0.25]))
    base = any_colour(rng) if rng.random() < 0.5 else hsv(0.1, rng.uniform(0, 0.15), rng.uniform(0.5, 0.95))
    second = any_colour(rng) if kind == "checker" else _near(rng, base, 0.75, 1.0)
    r = rng.uniform(0.06, 0.5)
    joint = hsv(0.1, 0.05, rng.uniform(0.25, 0.85))
    return Material(
        _tile(rng, kind),
        (base, second, joint),
        rng.uniform(0, 0.2),
        (r, rng.uniform(0.5, 0.9)),
        repeat=_span(rng, 0.6, 3),
    )


def stone(rng: np.random.Generator) -> Material:
    """Marble, granite, terrazzo, concrete."""
    kind = str(rng.choice(["marble", "speckle", "cloudy"]))
    base = hsv(rng.uniform(0.03, 0.16), rng.uniform(0, 0.25), rng.uniform(0.2, 0.92))
    dark = _near(rng, base, 0.3, 0.8) if rng.random() < 0.7 else hsv(0.1, 0.1, rng.uniform(0.3, 0.95))
    r = rng.uniform(0.08, 0.4) if rng.random() < 0.5 else rng.uniform(0.5, 0.95)
    return Material(
        _tile(rng, kind), (base, dark, any_colour(rng) if kind == "speckle" else dark), rng.uniform(0.1, 0.6),
        (r, min(r + 0.15, 1)), repeat=_span(rng, 0.4, 2),
    )  # fmt: skip


def brick(rng: np.random.Generator) -> Material:
    """Brickwork, bare or painted, with joints."""
    base = hsv(rng.uniform(0.0, 0.09), rng.uniform(0.15, 0.7), rng.uniform(0.3, 0.85))
    if rng.random() < 0.2:
        base = hsv(0.1, 0.03, rng.uniform(0.7, 0.92))
    joint = hsv(0.1, rng.uniform(0, 0.15), rng.uniform(0.35, 0.85))
    return Material(
        _tile(rng, "bricks"), (base, _near(rng, base, 0.5, 1.0), joint), rng.uniform(0.3, 0.9), (0.75, 0.95),
        repeat=_span(rng, 0.6, 1.2),
    )  # fmt: skip


def fabric(rng: np.random.Generator) -> Material:
    """Upholstery, curtains, table cloths, clothes."""
    kind = str(rng.choice(["weave", "plain", "stripes", "plaid", "ornament", "spots", "cloudy"],
                          p=[0.3, 0.22, 0.12, 0.1, 0.12, 0.06, 0.08]))  # fmt: skip
    base = any_colour(rng)
    second = _near(rng, base, 0.4, 0.9) if rng.random() < 0.5 else any_colour(rng)
    repeat = _span(rng, 0.08, 0.3) if kind == "weave" else _span(rng, 0.2, 0.9)
    r = rng.uniform(0.6, 1.0)
    return Material(_tile(rng, kind), (base, second, any_colour(rng)), rng.uniform(0.1, 0.7), (r, r), repeat=repeat)


def rug(rng: np.random.Generator, width: float, depth: float) -> Material:
    """A carpet of that size in metres, its tile fitted once."""
    base = any_colour(rng)
    second = any_colour(rng) if rng.random() < 0.6 else _near(rng, base, 0.4, 0.8)
    r = rng.uniform(0.8, 1.0)
    return Material(_tile(rng, "carpet"), (base, second, any_colour(rng)), rng.uniform(0.2, 0.9), (r, r),
                    repeat=(width, depth), offset=(0.5, 0.5))  # fmt: skip


_METALS = ((0.91, 0.90, 0.88), (0.62, 0.61, 0.60), (0.95, 0.78, 0.36), (0.93, 0.65, 0.52), (0.78, 0.68, 0.46),
           (0.45, 0.44, 0.43))  # fmt: skip


def metal(rng: np.random.Generator) -> Material:
    """Steel, aluminium, brass, copper, gold, iron: polished, brushed, or worn."""
    colour = tuple((np.array(_METALS[rng.integers(len(_METALS))]) * rng.uniform(0.85, 1, 3)).clip(0, 0.95).tolist())
    kind = str(rng.choice(["plain", "brushed", "rust"], p=[0.5, 0.35, 0.15]))
    r = rng.uniform(0.05, 0.25) if rng.random() < 0.5 else rng.uniform(0.25, 0.6)
    if kind == "rust":
        paint = any_colour(rng) if rng.random() < 0.5 else hsv(0.05, 0.7, rng.uniform(0.25, 0.5))
        return Material(_tile(rng, kind), (colour, paint, _near(rng, paint, 0.5, 0.8)), 0.3, (r, rng.uniform(0.5, 0.9)),
                        (1.0, 0.0), _span(rng, 0.15, 0.6))  # fmt: skip
    return Material(_tile(rng, kind), (colour, colour, colour), rng.uniform(0, 0.25), (r, min(r + 0.15, 1)), (1.0, 1.0),
                    _span(rng, 0.1, 0.5), turn=float(rng.choice([0, np.pi / 2])))  # fmt: skip


def ceramic(rng: np.random.Generator) -> Material:
    """Glazed pottery: white, coloured, decorated; matt clay now and then."""
    base = hsv(rng.uniform(0.05, 0.15), rng.uniform(0, 0.15), rng.uniform(0.75, 0.97))
    base = base if rng.random() < 0.4 else any_colour(rng)
    kind = str(rng.choice(["plain", "stripes", "ornament", "spots", "cloudy"], p=[0.5, 0.15, 0.15, 0.1, 0.1]))
    r = rng.uniform(0.06, 0.3) if rng.random() < 0.75 else rng.uniform(0.5, 0.9)
    return Material(_tile(rng, kind), (base, any_colour(rng), any_colour(rng)), rng.uniform(0, 0.15), (r, r),
                    repeat=_span(rng, 0.1, 0.5), turn=float(rng.choice([0, np.pi / 2])))  # fmt: skip


def plastic(rng: np.random.Generator) -> Material:
    """Coloured plastic or lacquer, shiny or matt."""
    base = any_colour(rng) if rng.random() < 0.5 else hsv(rng.random(), rng.uniform(0.6, 1), rng.uniform(0.3, 0.95))
    r = rng.uniform(0.08, 0.35) if rng.random() < 0.5 else rng.uniform(0.35, 0.7)
    return Material(_tile(rng, "plain"), (base, base, base), rng.uniform(0, 0.08), (r, r), repeat=_span(rng, 0.3, 1))


def printed(rng: np.random.Generator, width: float, height: float) -> Material:
    """A poster, book cover, label or painting fitted once to that size in metres, its upper edge up."""
    kind = str(rng.choice(["picture", "print", "ornament", "cloudy", "spots"], p=[0.5, 0.2, 0.1, 0.1, 0.1]))
    r = rng.uniform(0.15, 0.7)
    paper = hsv(0.12, rng.uniform(0, 0.2), rng.uniform(0.8, 0.97)) if kind == "print" else any_colour(rng)
    return Material(_tile(rng, kind), (paper, any_colour(rng), any_colour(rng)), rng.uniform(0.1, 0.9), (r, r),
                    repeat=(width, -height), offset=(0.5, 0.5))  # fmt: skip


def foliage(rng: np.random.Generator) -> Material:
    """Leaves, fresh or autumnal."""
    hue = rng.uniform(0.2, 0.38) if rng.random() < 0.8 else rng.uniform(0.02, 0.16)
    base = hsv(hue, rng.uniform(0.3, 0.8), rng.uniform(0.2, 0.65))
    r = rng.uniform(0.35, 0.7)
    return Material(_tile(rng, "leaf"), (base, _near(rng, base, 0.5, 1.3), _near(rng, base, 1.0, 1.6)),
                    rng.uniform(0.2, 0.6), (r, r), repeat=_span(rng, 0.1, 0.3))  # fmt: skip


def ground(rng: np.random.Generator) -> Material:
    """Outdoor ground: asphalt, paving, grass, earth, gravel, sand, concrete."""
    kind = str(rng.choice(["speckle", "paving", "grass", "cloudy", "bricks", "tiling"],
                          p=[0.25, 0.25, 0.2, 0.15, 0.1, 0.05]))  # fmt: skip
    if kind == "grass":
        base = hsv(rng.uniform(0.14, 0.34), rng.uniform(0.3, 0.7), rng.uniform(0.25, 0.6))
    else:
        base = hsv(rng.uniform(0.03, 0.14), rng.uniform(0, 0.4), rng.uniform(0.2, 0.8))
    r = rng.uniform(0.7, 1.0) if rng.random() < 0.88 else rng.uniform(0.2, 0.5)
    second = _near(rng, base, 0.55, 1.1)
    third = _near(rng, base, 0.35, 0.8) if rng.random() < 0.7 else _near(rng, base, 1, 1.8)
    return Material(_tile(rng, kind), (base, second, third), rng.uniform(0.3, 1.1), (r, min(r + 0.1, 1)),
                    repeat=_span(rng, 1.0, 4))  # fmt: skip


def facade(rng: np.random.Generator) -> Material:
    """House front with rows of dark or mirroring windows."""
    wall = hsv(rng.uniform(0.02, 0.16), rng.uniform(0, 0.5), rng.uniform(0.35, 0.95))
    if rng.random() < 0.15:
        wall = any_colour(rng)
    glass = hsv(rng.uniform(0.5, 0.65), rng.uniform(0, 0.3), rng.uniform(0.1, 0.35))
    return Material(_tile(rng, "facade"), (wall, hsv(0.1, 0.05, rng.uniform(0.3, 0.95)), glass), rng.uniform(0.1, 0.5),
                    (rng.uniform(0.7, 0.95), rng.uniform(0.06, 0.2)), repeat=_span(rng, 5, 12))  # fmt: skip


def skin(rng: np.random.Generator) -> Material:
    """Skin of any tone."""
    base = hsv(rng.uniform(0.03, 0.08), rng.uniform(0.3, 0.6), rng.uniform(0.3, 0.95))
    r = rng.uniform(0.4, 0.65)
    return Material(_tile(rng, "plain"), (base, base, base), 0.1, (r, r), repeat=(0.3, 0.3))


def light(rng: np.random.Generator, emission: Colour, *, surface: bool = True) -> Material:
    """A luminous white surface of that radiance."""
    white = (0.8, 0.8, 0.8)
    scaled = tuple((np.array(emission) / 0.8).tolist())
    return Material(_tile(rng, "plain"), (white,) * 3, 0.0, (0.6, 0.6), emission=scaled, surface=surface)


_OBJECTS = ((ceramic, 0.2), (plastic, 0.2), (metal, 0.26), (wood, 0.11), (fabric, 0.07), (stone, 0.07),
            (wall_paint, 0.09))  # fmt: skip


def any_object(rng: np.random.Generator) -> Material:
    """What a movable thing may be made of, at a scale that suits 10 to 40 centimetres."""
    makers, shares = zip(*_OBJECTS)
    material = makers[rng.choice(len(makers), p=np.array(shares))](rng)
    shrink = rng.uniform(0.15, 0.5) if max(material.repeat) > 0.5 else 1.0
    return replace(material, repeat=(material.repeat[0] * shrink, material.repeat[1] * shrink))
