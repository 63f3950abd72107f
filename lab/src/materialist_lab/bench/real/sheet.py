"""A contact sheet of one photo: what was predicted, what was fitted, and the truth, under each other."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from materialist.color import srgb_levels
from materialist.io import display
from materialist.types import Array
from materialist_lab.bench.real.photos import RealPhoto
from materialist_lab.metrics.maps import best_scale

WIDTH = 360
CAPTION = 26
GAP = 8
TEXT = 15
"""Pixels: a tile's width, the line below it, the gap between tiles, the height of the text."""
PAPER = (24, 25, 28)
INK = (220, 220, 224)


@dataclass(frozen=True)
class SheetRow:
    """One row: a picture and the maps that go with it; what is None stays empty."""

    name: str
    title: str
    """Of the picture."""
    picture: Array | None
    """[H, W, 3] linear."""
    albedo: Array | None
    normal: Array | None = None
    depth: Array | None = None


def truth_row(real: RealPhoto) -> SheetRow:
    """What was measured; the picture is the photo under another light."""
    picture = None if real.other is None else real.other.picture
    return SheetRow(
        real.source, "under the other light", picture, real.albedo, real.normal, real.depth
    )


def sheet(real: RealPhoto, rows: Sequence[SheetRow]) -> Array:
    """[h, w, 3] uint8 sRGB of rows, the truth last.

    Albedos and pictures have the factor that their figures have; depths have one range.
    """
    # The last row is the truth.
    target = rows[-1].picture
    lines = []
    for row, depth in zip(rows, _depths([row.depth for row in rows]), strict=True):
        line = {
            row.title: _aligned(row.picture, target, real.inside),
            "albedo": _aligned(row.albedo, real.albedo, real.inside),
            "normals": None if row.normal is None else display.normal_colours(row.normal),
            "depth": depth,
        }
        lines.append({f"{row.name}: {title}": pixels for title, pixels in line.items()})
    return _drawn(lines, real.photo.linear.shape[0] / real.photo.linear.shape[1])


def _drawn(lines: Sequence[dict[str, Array | None]], aspect: float) -> Array:
    """[h, w, 3] uint8: pictures with their titles, a line under each other; aspect: height / width."""
    # --- The grid ---
    tile = (WIDTH, max(1, round(WIDTH * aspect)))
    across = WIDTH + GAP
    down = tile[1] + CAPTION
    size = (GAP + across * max(map(len, lines)), GAP + down * len(lines))
    image = Image.new("RGB", size, PAPER)
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(TEXT)
    # --- Tiles with their captions; empty places stay dark ---
    for row, line in enumerate(lines):
        for column, (title, pixels) in enumerate(line.items()):
            if pixels is None:
                continue
            left = GAP + column * across
            top = GAP + row * down
            small = cv2.resize(pixels, tile, interpolation=cv2.INTER_AREA)
            image.paste(Image.fromarray(small), (left, top))
            draw.text((left, top + tile[1] + 4), title, font=font, fill=INK)
    return np.asarray(image)


def _aligned(linear: Array | None, true: Array | None, inside: Array) -> Array | None:
    """[H, W, 3] uint8 of a linear picture, with the factor that brings it nearest to the true one."""
    if linear is None:
        return None
    if true is not None:
        # The scale of albedo and of another light is not known.
        scale = best_scale(np.minimum(linear, 1), np.minimum(true, 1), inside)
        linear = linear * np.float32(scale)
    return srgb_levels(linear)


def _depths(maps: Sequence[Array | None]) -> list[Array | None]:
    """Each depth [H, W] as a picture, all in one range: brought to the last one, the truth, by the median."""
    known = [depth for depth in maps if depth is not None]
    if not known:
        return [None for _ in maps]
    true = known[-1]
    factors = [_median_factor(depth, true) for depth in known]
    # One picture for all: they share their range of colours.
    joined = np.concatenate(
        [depth * np.float32(f) for depth, f in zip(known, factors, strict=True)], 1
    )
    shown = iter(np.split(display.depths(joined), len(known), 1))
    return [None if depth is None else next(shown) for depth in maps]


def _median_factor(depth: Array, true: Array) -> float:
    both = (depth > 0) & (true > 0)
    return float(np.median(true[both] / depth[both])) if both.any() else 1.0
