"""The contact sheet: what a person looks at first."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from materialist.color import linear_to_srgb
from materialist.io import display
from materialist.metrics import psnr
from materialist.types import Array, Scene

if TYPE_CHECKING:
    from PIL import ImageDraw, ImageFont

WIDTH = 1600
"""Width of the sheet, pixels; its height follows from the photo's shape."""
_MARGIN, _GAP, _CAPTION, _HEADER = 40, 14, 30, 74
_INK, _DIM, _PAPER, _FRAME, _AMBER = (236, 236, 238), (150, 152, 158), (24, 25, 28), (36, 38, 42), (232, 178, 92)
_ERROR_GAIN = 4


@dataclass(frozen=True)
class _Tile:
    """A picture with its caption."""

    title: str
    note: str
    pixels: Array
    """[h, w, 3] uint8."""
    aspect: float
    """Width over height of the frame it gets."""


def overview(scene: Scene) -> Array:
    """[h, 1600, 3] uint8 sRGB: photo, re-rendering, error; the maps; light and geometry; and how it was made."""
    from PIL import Image, ImageDraw

    rows = _rows(scene)
    inner = WIDTH - 2 * _MARGIN
    heights = [round((inner - _GAP * (len(row) - 1)) / sum(tile.aspect for tile in row)) for row in rows]
    footer = _footer(scene)
    height = _MARGIN + _HEADER + sum(h + _CAPTION + _GAP for h in heights) + 24 * len(footer) + 20 + _MARGIN
    sheet = Image.new("RGB", (WIDTH, height), _PAPER)
    draw = ImageDraw.Draw(sheet)
    _draw_header(draw, scene)
    y = _MARGIN + _HEADER
    for row, tile_height in zip(rows, heights, strict=True):
        _draw_row(sheet, draw, row, y, tile_height)
        y += tile_height + _CAPTION + _GAP
    draw.line([(_MARGIN, y + 2), (WIDTH - _MARGIN, y + 2)], fill=_FRAME, width=2)
    for index, (text, colour) in enumerate(footer):
        draw.text((_MARGIN, y + 16 + 24 * index), text, font=_font(16), fill=colour)
    return np.asarray(sheet)


def _rows(scene: Scene) -> list[list[_Tile]]:
    """Tiles by row; each row is stretched to the full width, so any photo shape fills the sheet."""
    aspect = float(np.clip(scene.camera.width / scene.camera.height, 0.4, 4))
    stops = scene.photo.stops
    photo, again = linear_to_srgb(scene.photo.linear), linear_to_srgb(scene.rerender)
    materials = scene.materials
    quality = scene.report.metrics.get("rerender_psnr_path", psnr(scene.photo.linear, scene.rerender))

    def tile(title: str, note: str, pixels: Array, shape: float = aspect) -> _Tile:
        return _Tile(title, note, pixels, shape)

    pictures = [
        tile("Photo", "as given" if not stops else f"exposed by {stops:+d} stops", display.to_bytes(photo)),
        tile("Re-rendering", f"path traced, {quality:.1f} dB", display.to_bytes(again)),
        tile(
            "Error",
            f"mean |difference| of sRGB x {_ERROR_GAIN}",
            display.ramp(_ERROR_GAIN * np.abs(photo - again).mean(-1)),
        ),
    ]
    maps = [
        tile("Albedo", _mean(materials.albedo), display.to_bytes(linear_to_srgb(materials.albedo))),
        tile("Roughness", _mean(materials.roughness), display.grey(materials.roughness)),
        tile("Metallic", _mean(materials.metallic), display.grey(materials.metallic)),
        tile("Normal", "camera frame", display.normals(scene.normal)),
        tile("Depth", _range(scene.depth), _depth(scene.depth)),
    ]
    world = tile("Environment map", f"brightest {scene.envmap.max():.3g}", display.light(scene.envmap), 2.0)
    label = scene.geometry.plane_label
    planes = tile("Planes", _plane_note(label, len(scene.geometry.mesh.faces)), _labels(label, photo))
    return [[*pictures, *maps], [world, planes]] if aspect < 0.6 else [pictures, maps, [world, planes]]


def _footer(scene: Scene) -> list[tuple[str, tuple[int, int, int]]]:
    """Lines of text under the pictures: how it was made, how good it is, what to beware of."""
    metrics = scene.report.metrics
    parts = [f"Predictor {scene.prior.predictor}"]
    options = scene.provenance
    parts += [f"{key} {options[key]}" for key in ("engine", "preset", "completion") if key in options]
    for key, text in (
        ("rerender_psnr_path", "PSNR {:.2f} dB"),
        ("rerender_ssim_path", "SSIM {:.3f}"),
        ("total_seconds", "{:.0f} s"),
        ("peak_rss_mb", "peak {:.0f} MB"),
    ):
        if key in metrics:
            parts.append(text.format(metrics[key]))
    lines = [("   ·   ".join(parts), _INK)]
    warnings = dict.fromkeys((*scene.photo.warnings, *scene.prior.warnings, *scene.report.warnings))
    for warning in list(warnings)[:6]:
        lines += [(line, _AMBER) for line in textwrap.wrap(f"Note: {warning}", 190, max_lines=2)]
    if len(warnings) > 6:
        lines.append((f"and {len(warnings) - 6} more in report.json", _AMBER))
    return lines


def _draw_header(draw: ImageDraw.ImageDraw, scene: Scene) -> None:
    camera, photo = scene.camera, scene.photo
    name = (photo.path or "photo").replace("\\", "/").rsplit("/", 1)[-1]
    draw.text((_MARGIN, _MARGIN - 10), _shortened(name, _font(34), WIDTH // 2), font=_font(34), fill=_INK)
    native = f"{photo.original.shape[1]} x {photo.original.shape[0]}"
    note = (
        f"{native} photo  ·  worked at {camera.width} x {camera.height}  ·  {camera.fov:.1f}° wide ({photo.fov_source})"
    )
    draw.text((WIDTH - _MARGIN, _MARGIN + 6), note, font=_font(18), fill=_DIM, anchor="ra")


def _draw_row(sheet: object, draw: ImageDraw.ImageDraw, row: Sequence[_Tile], y: int, height: int) -> None:
    """One row of tiles, left to right over the full width, captions below."""
    x = float(_MARGIN)
    for tile in row:
        left, right = round(x), round(x + height * tile.aspect)
        right = min(right, WIDTH - _MARGIN) if tile is not row[-1] else WIDTH - _MARGIN
        draw.rectangle([left, y, right - 1, y + height - 1], fill=_FRAME)
        picture = _fitted(tile.pixels, right - left, height)
        corner = (left + (right - left - picture.width) // 2, y + (height - picture.height) // 2)
        sheet.paste(picture, corner)  # type: ignore[attr-defined]
        draw.text((left, y + height + 8), tile.title, font=_font(17), fill=_INK)
        used = draw.textlength(tile.title + "   ", font=_font(17))
        note = _shortened(tile.note, _font(15), right - left - used)
        draw.text((left + used, y + height + 10), note, font=_font(15), fill=_DIM)
        x += height * tile.aspect + _GAP


def _fitted(pixels: Array, width: int, height: int):  # type: ignore[no-untyped-def]
    """The picture scaled to fit a frame, keeping its shape unless it is within 2 % of the frame's."""
    from PIL import Image

    image = Image.fromarray(pixels)
    scale = min(width / image.width, height / image.height)
    size = (max(1, round(image.width * scale)), max(1, round(image.height * scale)))
    if abs(size[0] - width) <= 0.02 * width + 1 and abs(size[1] - height) <= 0.02 * height + 1:
        size = (width, height)
    coarse = size[0] > 6 * image.width  # a coarse envmap shows its texels
    return image.resize(size, Image.Resampling.NEAREST if coarse else Image.Resampling.LANCZOS)


def _font(size: int) -> ImageFont.FreeTypeFont:
    from PIL import ImageFont

    return ImageFont.load_default(size)  # type: ignore[return-value]


def _shortened(text: str, font: ImageFont.FreeTypeFont, width: float) -> str:
    """The text, cut with an ellipsis where it would run over its space."""
    if font.getlength(text) <= width:
        return text
    while text and font.getlength(text + "…") > width:
        text = text[:-1]
    return text + "…" if text else ""


def _depth(depth: Array) -> Array:
    """Near bright, far dark, by rank-safe inverse depth; sky in the frame's grey."""
    import cv2

    seen = depth > 0
    if not seen.any():
        return np.full((*depth.shape, 3), _FRAME, np.uint8)
    inverse = np.where(seen, 1 / np.where(seen, depth, 1), 0)
    low, high = np.percentile(inverse[seen], (1, 99))
    ramp = cv2.applyColorMap(display.to_bytes((inverse - low) / max(high - low, 1e-12)), cv2.COLORMAP_MAGMA)[..., ::-1]
    return np.where(seen[..., None], ramp, np.array(_FRAME, np.uint8))


def _labels(label: Array, photo: Array) -> Array:
    """Each plane in a colour of its own over a dim grey photo."""
    import cv2

    hue = (label.astype(np.int32) * 67 + 100) % 180
    colour = cv2.cvtColor(np.stack([hue, hue * 0 + 130, hue * 0 + 255], -1).astype(np.uint8), cv2.COLOR_HSV2RGB)
    dim = 0.25 + 0.6 * photo.mean(-1, keepdims=True)
    return display.to_bytes(np.where(label[..., None] >= 0, colour / 255 * dim, 0.6 * dim))


def _mean(values: Array) -> str:
    return f"mean {float(values.mean()):.2f}"


def _range(depth: Array) -> str:
    seen = depth[depth > 0]
    return f"{seen.min():.3g} to {seen.max():.3g}" if len(seen) else "none"


def _plane_note(label: Array, triangles: int) -> str:
    count = len(np.unique(label[label >= 0]))
    return f"{count or 'none'} continued, {triangles:,} triangles"
