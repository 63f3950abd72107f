"""A sheet of predicted maps beside the true ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from materialist.color import linear_to_srgb
from materialist.types import Array, Prediction

SIDE = 144
"""Pixels of a picture's longer side in the sheet."""


def strip(image: Array, *predictions: Prediction) -> Array:
    """The picture and, under each other, the maps of each prediction: one row of a sheet, uint8 RGB."""
    import cv2

    lines = [np.concatenate([linear_to_srgb(image), *maps_of(p)], 1) for p in predictions]
    joined = np.concatenate(lines, 0)
    factor = SIDE / max(image.shape[:2])
    size = (max(1, round(joined.shape[1] * factor)), max(1, round(joined.shape[0] * factor)))
    return cv2.resize((joined * 255 + 0.5).astype(np.uint8), size, interpolation=cv2.INTER_AREA)


def maps_of(prediction: Prediction) -> list[Array]:
    """Albedo, roughness, metallic, normal and depth as pictures [H, W, 3] in [0, 1]."""
    m = prediction.materials
    grey = lambda a: np.repeat(np.clip(a, 0, 1)[..., None], 3, -1)  # noqa: E731
    normal = np.clip(prediction.normal * 0.5 + 0.5, 0, 1) * (prediction.depth > 0)[..., None]
    return [linear_to_srgb(m.albedo), grey(m.roughness), grey(m.metallic), normal, grey(nearness(prediction.depth))]


def nearness(depth: Array) -> Array:
    """Inverse depth [H, W] stretched to [0, 1], so that near is bright; 0 where there is no surface."""
    known = depth > 0
    if not known.any():
        return np.zeros_like(depth)
    inverse = np.where(known, 1 / np.where(known, depth, 1), 0)
    low, high = np.percentile(inverse[known], [1, 99])
    return np.where(known, 0.1 + 0.9 * np.clip((inverse - low) / max(high - low, 1e-9), 0, 1), 0)


def write_sheet(strips: list[Array], path: Path) -> None:
    """Strips under each other as a PNG, written whole or not at all."""
    import cv2

    if not strips:
        return
    wide = max(s.shape[1] for s in strips)
    padded = [np.pad(s, ((0, 6), (0, wide - s.shape[1]), (0, 0))) for s in strips]
    picture = np.concatenate(padded, 0)
    partial = path.with_name(path.stem + ".part.png")
    cv2.imwrite(str(partial), np.ascontiguousarray(picture[..., ::-1]))
    partial.replace(path)
