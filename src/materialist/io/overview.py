"""The contact sheet: what a person looks at first."""

import textwrap
from typing import NamedTuple

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont, ImageOps

from materialist.color import srgb_levels
from materialist.io import display
from materialist.residual import shading_residual
from materialist.types import Array, Scene

_WIDTH = 1600
"""Width of the sheet, pixels; its height follows from the photo's shape."""
_MARGIN = 40
_GAP = 14
_CAPTION = 30
_HEADER = 74
_LINE = 24
_INK = (236, 236, 238)
_DIM = (150, 152, 158)
_PAPER = (24, 25, 28)
_FRAME = (36, 38, 42)
_AMBER = (232, 178, 92)
_MAX_WARNINGS = 6
"""How many are shown."""
_MAX_NAME = 44
"""Letters of the file's name."""


class _Tile(NamedTuple):
    """A picture [h, w, 3] uint8 with its caption, and the width over height of the frame it gets."""

    title: str
    note: str
    pixels: Array
    aspect: float


def overview(scene: Scene) -> Array:
    """[h, 1600, 3] uint8 sRGB: photo, re-rendering, error; the maps; light and geometry; and how it was made."""
    # --- Layout: every row fills the width, so that its height follows from its pictures ---
    rows = _rows(scene)
    footer = _footer(scene)
    inner = _WIDTH - 2 * _MARGIN
    heights = [
        round((inner - _GAP * (len(row) - 1)) / sum(tile.aspect for tile in row)) for row in rows
    ]
    height = (
        2 * _MARGIN + _HEADER + sum(h + _CAPTION + _GAP for h in heights) + _LINE * len(footer) + 20
    )
    # --- Header, rows of pictures, footer ---
    sheet = Image.new("RGB", (_WIDTH, height), _PAPER)
    draw = ImageDraw.Draw(sheet)
    _header(draw, scene)
    y = _MARGIN + _HEADER
    for row, tile_height in zip(rows, heights, strict=True):
        x = float(_MARGIN)
        for tile in row:
            right = x + tile_height * tile.aspect
            sheet.paste(
                _drawn(tile, min(round(right), _WIDTH - _MARGIN) - round(x), tile_height),
                (round(x), y),
            )
            x = right + _GAP
        y += tile_height + _CAPTION + _GAP
    draw.line([(_MARGIN, y + 2), (_WIDTH - _MARGIN, y + 2)], fill=_FRAME, width=2)
    for index, (text, colour) in enumerate(footer):
        draw.text((_MARGIN, y + 16 + _LINE * index), text, font=_font(16), fill=colour)
    return np.asarray(sheet)


def _rows(scene: Scene) -> list[list[_Tile]]:
    """Tiles by row; each row is stretched to the full width, so any photo shape fills the sheet."""
    aspect = float(np.clip(scene.camera.width / scene.camera.height, 0.4, 4))
    m = scene.materials
    photo = scene.photo
    geometry = scene.geometry
    quality = scene.report.metrics.get("rerender_psnr_path")
    score = "path traced" if quality is None else f"path traced, {quality:.1f} dB"
    known = scene.depth[scene.depth > 0]
    span = f"{known.min():.3g} to {known.max():.3g}" if len(known) else "none"
    continued = len(np.unique(geometry.plane_label[geometry.plane_label >= 0]))
    exposure = f"exposed by {photo.stops:+d} stops" if photo.stops else "as given"
    off = f"mean |difference| of sRGB x {display.ERROR_GAIN}"
    residual = shading_residual(photo.linear, scene.rerender)
    # --- The first row: how well the re-rendering agrees with the photo ---
    pictures = [
        ("Photo", exposure, srgb_levels(photo.linear)),
        ("Re-rendering", score, srgb_levels(scene.rerender)),
        ("Shading residual", "photo / re-rendering, grey is 1", display.factor(residual)),
        ("Error", off, display.error(photo.linear, scene.rerender)),
    ]
    notes = {name: f"mean {values.mean():.2f}" for name, values in vars(m).items()}
    notes |= {"normal": "camera frame", "depth": span}
    # --- The second row: what the photo was decomposed into ---
    maps = [
        (name.capitalize(), notes[name], pixels) for name, pixels in display.maps(scene).items()
    ]
    planes = f"{continued or 'none'} continued, {len(geometry.mesh.faces):,} triangles"
    # --- The last row: light and geometry ---
    last = [
        _Tile(
            "Environment map",
            f"brightest {scene.envmap.max():.3g}",
            display.light(scene.envmap),
            2.0,
        ),
        _Tile("Planes", planes, _labels(geometry.plane_label, photo.linear), aspect),
    ]
    rows = [[*pictures, *maps]] if aspect < 0.6 else [pictures, maps]
    return [*([_Tile(*tile, aspect) for tile in row] for row in rows), last]


def _footer(scene: Scene) -> list[tuple[str, tuple[int, int, int]]]:
    """Lines of text under the pictures: how it was made, how good it is, what to beware of."""
    metrics = scene.report.metrics
    options = scene.provenance
    parts = [f"Predictor {scene.prior.predictor}"]
    parts += [
        f"{key} {options[key]}" for key in ("engine", "preset", "completion") if key in options
    ]
    figures = {
        "rerender_psnr_path": "PSNR {:.2f} dB",
        "rerender_ssim_path": "SSIM {:.3f}",
        "total_seconds": "{:.0f} s",
        "peak_rss_mb": "peak {:.0f} MB",
    }
    parts += [text.format(metrics[key]) for key, text in figures.items() if key in metrics]
    # At most two lines a note, and at most `_MAX_WARNINGS` notes.
    lines = [("   ·   ".join(parts), _INK)]
    for warning in scene.warnings[:_MAX_WARNINGS]:
        lines += [(line, _AMBER) for line in textwrap.wrap(f"Note: {warning}", 190, max_lines=2)]
    if len(scene.warnings) > _MAX_WARNINGS:
        lines.append((f"and {len(scene.warnings) - _MAX_WARNINGS} more in report.json", _AMBER))
    return lines


def _header(draw: ImageDraw.ImageDraw, scene: Scene) -> None:
    camera = scene.camera
    photo = scene.photo
    draw.text((_MARGIN, _MARGIN - 10), photo.name[:_MAX_NAME], font=_font(34), fill=_INK)
    note = (
        f"{photo.original.shape[1]} x {photo.original.shape[0]} photo  ·  worked at {camera.width} x {camera.height}"
        f"  ·  {camera.fov:.1f}° wide ({photo.fov_source})"
    )
    draw.text((_WIDTH - _MARGIN, _MARGIN + 6), note, font=_font(18), fill=_DIM, anchor="ra")


def _drawn(tile: _Tile, width: int, height: int) -> Image.Image:
    """A tile in a frame of this size, its caption below; the texels of a coarse envmap stay to be seen."""
    # Enlarged texels stay squares: a coarse map is not to look smooth.
    picture = Image.fromarray(tile.pixels)
    coarse = min(width / picture.width, height / picture.height) > 6
    resampling = Image.Resampling.NEAREST if coarse else Image.Resampling.LANCZOS
    image = Image.new("RGB", (width, height + _CAPTION), _PAPER)
    image.paste(ImageOps.pad(picture, (width, height), resampling, _FRAME))
    draw = ImageDraw.Draw(image)
    draw.text((0, height + 8), tile.title, font=_font(17), fill=_INK)
    left = draw.textlength(tile.title + "   ", font=_font(17))
    draw.text((left, height + 10), tile.note, font=_font(15), fill=_DIM)
    return image


def _font(size: int) -> ImageFont.FreeTypeFont:
    return ImageFont.load_default(size)  # type: ignore[return-value]


def _labels(label: Array, linear: Array) -> Array:
    """Each plane [H, W] in a colour of its own over a dim grey photo [H, W, 3]."""
    # Steps of 67 in OpenCV's 180 degrees of hue put neighbouring numbers far apart.
    hue = (label.astype(np.int32) * 67 + 100) % 180
    colour = cv2.cvtColor(
        np.stack([hue, hue * 0 + 130, hue * 0 + 255], -1).astype(np.uint8), cv2.COLOR_HSV2RGB
    )
    dim = 0.25 + 0.6 * srgb_levels(linear).mean(-1, keepdims=True) / 255
    return display.to_bytes(np.where(label[..., None] >= 0, colour / 255 * dim, 0.6 * dim))
