"""Random physically plausible materials: which tile, which colours, which finish."""

import colorsys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar, cast

import numpy as np

from materialist.types import Array
from materialist_lab.procedural import tiles
from materialist_lab.procedural.relief import Relief

Colour = tuple[float, float, float]
Range = tuple[float, float]
Shade = tuple[float, Range, Range, Range]
"""Share, and ranges of hue, saturation and value (sRGB)."""


@dataclass(frozen=True, eq=False)
class ColourPicture:
    """A photographic texture; two are the same where they are one object."""

    pixels: Array
    """[h, w, 3] uint8: 255 times the square root of linear albedo, row 0 at the top."""


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
    picture: ColourPicture | None = None
    """Covers what the tile covers; the albedo is its colour times the first of `colours`."""
    emboss: float = 0.0
    """Height of the tile's relief, metres."""
    relief: Relief | None = None
    """Solid noise that bends the normals."""

    def row(self, shift: tuple[float, float], start: int = 0) -> Array:
        """[36] float32 as the path tracer reads it; `shift` moves the tile where the material leaves that open.

        start: place of the picture's first pixel in the buffer of all pictures, in units of 64 pixels.
        """
        c0, c1, c2 = self.colours
        r0, r1 = self.roughness
        m0, m1 = self.metallic
        # Texture coordinates are turned and divided by the size of a tile: s = (c u + s v) / repeat_u + offset.
        c = np.cos(self.turn)
        s = np.sin(self.turn)
        offset = shift if self.offset is None else self.offset
        height, width = (0, 0) if self.picture is None else self.picture.pixels.shape[:2]
        solid = [1.0, 1.0, 1.0, 0.0, 0.0] if self.relief is None else self.relief.row()
        return np.array(
            [
                # Rows 0 to 2: colours, with roughness and grain in the fourth place.
                *c0,
                r0,
                *c1,
                r1,
                *c2,
                self.grain,
                # Rows 3 and 4: metallic, and the map from (u, v) to the tile.
                m0,
                m1,
                c / self.repeat[0],
                s / self.repeat[0],
                -s / self.repeat[1],
                c / self.repeat[1],
                offset[0],
                offset[1],
                # Row 5: emission and the tile.
                *self.emission,
                float(self.tile),
                # Row 6: the picture, and the height of the tile's relief.
                start,
                width,
                height,
                self.emboss,
                # Rows 7 and 8: solid noise; the rest fills the row of four.
                *solid,
                0,
                0,
                0,
            ],
            np.float32,
        )


def hsv(h: float, s: float, v: float) -> Colour:
    """Linear colour of hue, saturation and value given in sRGB, as people name colours; kept within [0.02, 0.92]."""
    s, v = np.clip([s, v], 0, 1).tolist()
    srgb = np.array(colorsys.hsv_to_rgb(h % 1, s, v))
    # No real surface is darker than soot or brighter than fresh snow.
    return tuple(np.clip(srgb**2.2, 0.02, 0.92).tolist())


def near(rng: np.random.Generator, colour: Colour, low: float, high: float) -> Colour:
    """That colour, darker or lighter by a factor in [low, high], and a little off its hue."""
    factor = rng.uniform(low, high) * rng.uniform(0.92, 1.08, 3)
    return tuple(np.clip(np.array(colour) * factor, 0.015, 0.92).tolist())


def uniform(
    colour: Colour, roughness: float, metallic: float = 0.0, grain: float = 0.0
) -> Material:
    return Material(0, (colour,) * 3, grain, (roughness, roughness), (metallic, metallic))


ALL: Range = (0, 1)
ANY_COLOUR: tuple[Shade, ...] = (
    (0.4, (0.05, 0.15), (0, 0.12), (0.1, 0.95)),
    (0.3, (0.03, 0.13), (0.12, 0.6), (0.15, 0.9)),
    (0.2, ALL, (0.05, 0.4), (0.15, 0.9)),
    (0.1, ALL, (0.4, 0.97), (0.2, 0.95)),
)
"""Greys and browns mostly, as in photographs; saturated colours often enough, dark to light."""
PALE: Shade = (0.8, (0.05, 0.15), (0, 0.15), (0.5, 0.97))


T = TypeVar("T")


def pick(rng: np.random.Generator, options: Sequence[tuple[float, T]]) -> T:
    """One of several (share, option)."""
    shares = np.array([share for share, _ in options])
    return options[rng.choice(len(options), p=shares / shares.sum())][1]


def shade(rng: np.random.Generator, shades: tuple[Shade, ...] = ANY_COLOUR) -> Colour:
    """A colour from one of the ranges, any by default."""
    ranges = pick(rng, tuple((share, parts) for share, *parts in shades))
    return hsv(*(rng.uniform(*r) for r in ranges))


@dataclass(frozen=True)
class Finish:
    """A family of materials as ranges; a call draws one of them."""

    tiles: str
    """Kinds of tile, separated by spaces; one named twice is drawn twice as often."""
    base: tuple[Shade, ...] = ANY_COLOUR
    second: tuple[float, float, float] = (0, 1, 1)
    """(probability, from, to): with it the second colour is the first one times a factor; otherwise any colour."""
    third: tuple[float, float, float] | tuple[Shade, ...] = (0, 1, 1)
    """The same for the third colour, or ranges that it is drawn from."""
    grain: Range = (0, 0.1)
    roughness: tuple[tuple[float, float, float], ...] = ((1, 0.6, 0.6),)
    """(share, from, to) at 0 of the tile's roughness channel."""
    rougher: Range = (0, 0)
    """What is added to the roughness at 1 of that channel, from and to."""
    repeat: Range = (0.3, 1)
    """Metres that a tile covers, log-uniform."""
    stretch: Range = (1, 1)
    """Factor on the size along u, from and to."""
    quarter: bool = False
    """Whether the tile is turned by 90 degrees half of the time."""

    def __call__(self, rng: np.random.Generator) -> Material:
        # The order of the draws is part of every data set: a seed must keep its materials.
        first = shade(rng, self.base)
        ranges = tuple((share, (low, high)) for share, low, high in self.roughness)
        rough = rng.uniform(*pick(rng, ranges))
        # Log-uniform: halving a size is as likely as doubling it.
        size = float(np.exp(rng.uniform(*np.log(self.repeat))))
        number = tile(rng, str(rng.choice(self.tiles.split())))
        second = self._other(rng, first, self.second)
        third = self._other(rng, first, self.third)
        grain = rng.uniform(*self.grain)
        rougher = float(np.clip(rough + rng.uniform(*self.rougher), 0.06, 1))
        return Material(
            number,
            (first, second, third),
            grain,
            (rough, rougher),
            repeat=(size * rng.uniform(*self.stretch), size),
            turn=rng.choice([0, np.pi / 2]) if self.quarter else 0.0,
        )

    def _other(self, rng: np.random.Generator, first: Colour, spread: tuple) -> Colour:
        """The second or third colour: near the first one, or of its own."""
        if isinstance(spread[0], tuple):
            return shade(rng, spread)
        probability, low, high = spread
        return near(rng, first, low, high) if rng.random() < probability else shade(rng)


def tile(rng: np.random.Generator, kind: str) -> int:
    """The number of a tile of that kind."""
    where = tiles.bank()[1][kind]
    return int(rng.integers(where.start, where.stop))


# --- Ranges that several finishes share ---
SHINY_OR_MATT = ((0.5, 0.08, 0.35), (0.5, 0.35, 0.7))
TIMBER: tuple[Shade, ...] = ((1, (0.045, 0.105), (0.25, 0.7), (0.2, 0.88)),)
EARTH: tuple[Shade, ...] = ((1, (0.03, 0.14), (0, 0.4), (0.2, 0.8)),)
MORTAR: tuple[Shade, ...] = ((1, (0.1, 0.1), (0, 0.15), (0.25, 0.85)),)

# --- Walls and paint; most finishes are made here, and the rest varies one of them ---
wall_paint = Finish(
    "plain plain plain cloudy",
    base=(
        (0.5, (0.05, 0.17), (0, 0.18), (0.6, 0.97)),
        (0.35, ALL, (0, 0.18), (0.6, 0.97)),
        (0.15, ALL, (0.1, 0.5), (0.25, 0.85)),
    ),
    second=(1, 0.85, 1.05),
    third=(1, 0.6, 0.95),
    grain=(0, 0.12),
    roughness=((1, 0.45, 0.95),),
    rougher=(0.1, 0.1),
    repeat=(0.8, 3),
)
wallpaper = Finish(
    "ornament ornament ornament stripes stripes plaid",
    base=((0.6, (0.05, 0.17), (0.02, 0.35), (0.4, 0.95)), (0.4, ALL, (0.02, 0.4), (0.4, 0.95))),
    second=(0.7, 0.5, 0.95),
    rougher=(0.2, 0.2),
    repeat=(0.4, 1.5),
)
lacquer = Finish(
    "plain", second=(1, 1, 1), third=(1, 1, 1), grain=(0, 0.02), roughness=((1, 0.08, 0.5),)
)
"""Of any colour, dull or shiny."""
white_paint = replace(
    lacquer, base=((1, (0.08, 0.15), (0, 0.08), (0.82, 0.97)),), roughness=((1, 0.2, 0.6),)
)
plastic = replace(
    lacquer, base=(*ANY_COLOUR, (0.5, ALL, (0.6, 1), (0.3, 0.95))), roughness=SHINY_OR_MATT
)
# --- Wood ---
wood = Finish(
    "wood",
    base=TIMBER,
    second=(1, 0.35, 0.75),
    third=(1, 0.15, 0.4),
    grain=(0.1, 0.5),
    roughness=((0.45, 0.12, 0.35), (0.55, 0.4, 0.8)),
    rougher=(0.2, 0.2),
    repeat=(0.5, 1.4),
    stretch=(1, 2),
)
"""Pale, brown, red or nearly black timber, raw or varnished."""
floor_boards = replace(wood, tiles="planks", repeat=(0.9, 2.2))
# --- Tiles, stone, bricks ---
tiled = Finish(
    "tiling tiling tiling checker",
    base=(*ANY_COLOUR, PALE),
    second=(0.75, 0.75, 1.0),
    third=MORTAR,
    grain=(0, 0.2),
    roughness=((1, 0.06, 0.5),),
    rougher=(0.2, 0.8),
    repeat=(0.6, 3),
)
stone = Finish(
    "marble speckle cloudy",
    base=((1, (0.03, 0.16), (0, 0.25), (0.2, 0.92)),),
    second=(0.7, 0.3, 0.8),
    third=(0.7, 0.3, 0.8),
    grain=(0.1, 0.6),
    roughness=((0.5, 0.08, 0.4), (0.5, 0.5, 0.95)),
    rougher=(0.15, 0.15),
    repeat=(0.4, 2),
)
"""Marble, granite, terrazzo, concrete."""
brick = Finish(
    "bricks",
    base=(
        (0.8, (0.0, 0.09), (0.15, 0.7), (0.3, 0.85)),
        (0.2, (0.1, 0.1), (0.03, 0.03), (0.7, 0.92)),
    ),
    second=(1, 0.5, 1.0),
    third=MORTAR,
    grain=(0.3, 0.9),
    roughness=((1, 0.75, 0.75),),
    rougher=(0.2, 0.2),
    repeat=(0.6, 1.2),
)
# --- Cloth and pottery ---
woven = Finish(
    "weave",
    second=(0.5, 0.4, 0.9),
    grain=(0.1, 0.7),
    roughness=((1, 0.6, 1.0),),
    repeat=(0.08, 0.3),
)
printed_cloth = replace(woven, tiles="plain plain stripes plaid ornament cloudy", repeat=(0.2, 0.9))
ceramic = Finish(
    "plain plain plain stripes ornament cloudy",
    base=(*ANY_COLOUR, PALE),
    grain=(0, 0.15),
    roughness=((0.75, 0.06, 0.3), (0.25, 0.5, 0.9)),
    repeat=(0.1, 0.5),
    quarter=True,
)
"""Glazed pottery: white, coloured, decorated; matt clay now and then."""
# --- Outdoors ---
paved = Finish(
    "speckle speckle bricks bricks cloudy tiling tiling",
    base=EARTH,
    second=(1, 0.55, 1.1),
    third=(0.8, 0.35, 0.8),
    grain=(0.3, 1.1),
    roughness=((0.88, 0.7, 1.0), (0.12, 0.2, 0.5)),
    rougher=(0.1, 0.1),
    repeat=(1, 4),
)
grass = replace(
    paved,
    tiles="grass",
    base=((1, (0.14, 0.34), (0.3, 0.7), (0.25, 0.6)),),
    roughness=((1, 0.7, 1.0),),
)
facade = Finish(
    "facade",
    base=((0.85, (0.02, 0.16), (0, 0.5), (0.35, 0.95)), (0.15, ALL, (0, 0.9), (0.2, 0.9))),
    second=(0.5, 0.5, 1.5),
    third=((1, (0.5, 0.65), (0, 0.3), (0.1, 0.35)),),
    grain=(0.1, 0.5),
    roughness=((1, 0.7, 0.95),),
    rougher=(-0.8, -0.5),
    repeat=(5, 12),
)
"""House front with rows of dark or mirroring windows, which are smoother than the wall."""

METALS = (
    (0.91, 0.90, 0.88),
    (0.62, 0.61, 0.60),
    (0.95, 0.78, 0.36),
    (0.93, 0.65, 0.52),
    (0.78, 0.68, 0.46),
    (0.45, 0.44, 0.43),
)
"""Silver and aluminium, steel, gold, copper, brass, iron: linear reflectance at normal incidence."""


def fabric(rng: np.random.Generator) -> Material:
    return (woven if rng.random() < 0.3 else printed_cloth)(rng)


def ground(rng: np.random.Generator) -> Material:
    """Outdoor ground: asphalt, paving, grass, earth, gravel, sand, concrete."""
    return (grass if rng.random() < 0.2 else paved)(rng)


def metal(rng: np.random.Generator) -> Material:
    """Steel, aluminium, brass, copper, gold, iron: polished, brushed, or worn."""
    reflectance = np.array(METALS[rng.integers(len(METALS))])
    # A little darker than the pure metal: oxide, dirt, alloys.
    colour = cast(Colour, tuple((reflectance * rng.uniform(0.85, 1, 3)).tolist()))
    kind = str(rng.choice(["plain", "brushed", "rust"], p=[0.5, 0.35, 0.15]))
    material = Finish(
        kind,
        grain=(0, 0.3),
        roughness=((0.5, 0.05, 0.25), (0.5, 0.25, 0.6)),
        rougher=(0.1, 0.2),
        repeat=(0.1, 0.5),
        quarter=True,
    )(rng)
    # Corroded or painted over where the tile's first channel is 1.
    if kind == "rust":
        return replace(material, colours=(colour, *material.colours[1:]), metallic=(1.0, 0.0))
    return replace(material, colours=(colour,) * 3, metallic=(1.0, 1.0))


def light(rng: np.random.Generator, radiance: Colour) -> Material:
    """A luminous white surface of that radiance."""
    # Radiance is emission times albedo, and the albedo is 0.8.
    emission = cast(Colour, tuple((np.array(radiance) / 0.8).tolist()))
    return Material(tile(rng, "plain"), ((0.8, 0.8, 0.8),) * 3, 0.0, emission=emission)


Maker = Callable[[np.random.Generator], Material]


def one_of(rng: np.random.Generator, *makers: Callable[[np.random.Generator], T]) -> T:
    """What one of the makers makes, each as likely."""
    return makers[rng.integers(len(makers))](rng)
