"""Photographed things with transparency around them, pasted into rendered pictures (Dwibedi et al. 2017)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from materialist.color import luminance, srgb_to_linear
from materialist.errors import InputError
from materialist.types import Array

ENDINGS = (".png", ".webp")


@dataclass(frozen=True)
class PasteSettings:
    """How cut-outs are placed; lengths in sides of the picture; tuned by eye."""

    max_cutouts: int = 4  # cut-outs in a picture, at least one
    again: float = 0.3  # share of cut-outs that are the last one once more: another of its kind is another thing
    size: tuple[float, float] = (0.15, 0.8)  # longer side, from and to
    turned: float = 12.0  # standard deviation of the rotation, degrees
    visible: float = 0.6  # least share of a cut-out that lies inside the picture
    # exponent by which its exposure follows its surroundings, from and to
    matched: tuple[float, float] = (0.3, 1.0)
    shaded: float = 0.35  # largest amplitude of a ramp of light across it
    shadow: float = 0.6  # share of cut-outs that darken what lies around and below them
    fewest_pixels: int = 48  # shorter side of a file that is used
    longest: int = 400  # longer side at which one is kept
    # share of opaque pixels above which a file is a picture with a frame, not a cut-out
    solid: float = 0.97


SETTINGS = PasteSettings()


def cutout_files(folder: Path) -> list[Path]:
    """The pictures of a folder and those inside it, sorted. Raises InputError where there are none."""
    paths = sorted(p for p in folder.rglob("*") if p.suffix.lower() in ENDINGS)
    if not paths:
        raise InputError(
            f"{folder} holds no {' or '.join(ENDINGS)} files; give a folder of things cut out."
        )
    return paths


def load_cutout(path: Path) -> Array | None:
    """[h, w, 4] float32 linear colour and opacity, without margins; None for a file without transparency or too small.

    Raises InputError for a file that cannot be read.
    """
    try:
        with Image.open(path) as file:
            picture = file.convert("RGBA")
            picture.thumbnail((SETTINGS.longest, SETTINGS.longest))
            pixels = np.asarray(picture)
    except (OSError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"{path} cannot be read ({error}); remove it.") from error
    opaque = pixels[..., 3] > 127
    if not opaque.any():
        return None
    rows, columns = (np.flatnonzero(opaque.any(axis)) for axis in (1, 0))
    inside = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    if min(opaque[inside].shape) < SETTINGS.fewest_pixels or opaque[inside].mean() > SETTINGS.solid:
        return None
    share = pixels[inside][..., 3:].astype(np.float32) / 255
    return np.concatenate([srgb_to_linear(pixels[inside][..., :3]), share], -1)


def paste(
    image: Array, thing: Array, cutouts: Sequence[Array], rng: np.random.Generator
) -> tuple[Array, Array]:
    """(image, thing) with some of the cut-outs [h, w, 4] in a picture [H, W, 3] linear and its map of things [H, W].

    Each is scaled, mirrored, turned, exposed as its surroundings are, shaded by a ramp, and often casts a soft shadow.
    Their numbers in the map follow those of the picture's own things.
    """
    image = image.astype(np.float32)
    thing = thing.copy()
    last = -1
    for _ in range(int(rng.integers(1, SETTINGS.max_cutouts + 1))):
        last = (
            last if last >= 0 and rng.random() < SETTINGS.again else int(rng.integers(len(cutouts)))
        )
        placed = _placed(cutouts[last], thing.shape, rng)
        colour = placed[..., :3]
        share = placed[..., 3]
        mask = share > 0.5
        if not mask.any():
            continue
        if rng.random() < SETTINGS.shadow:
            image *= _shadow(share, rng)[..., None]
        brightness = np.median(luminance(colour[mask] / share[mask][:, None]))
        around = np.median(
            luminance(image[cv2.dilate(mask.astype(np.uint8), np.ones((15, 15))) > 0])
        )
        gain = (max(float(around), 1e-3) / max(float(brightness), 1e-3)) ** rng.uniform(
            *SETTINGS.matched
        )
        gain = float(np.clip(gain, 0.1, 8)) * np.exp(rng.normal(0, 0.3)) * _ramp(thing.shape, rng)
        image = colour * gain[..., None] + image * (1 - share[..., None])
        thing[mask] = max(int(thing.max()), 0) + 1
    return image, thing


def _placed(cutout: Array, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """[H, W, 4] float32: a cut-out at a random place, colours times opacity."""
    height, width = shape
    rows, columns = cutout.shape[:2]
    longer = float(np.exp(rng.uniform(*np.log(SETTINGS.size)))) * max(shape)
    scale = longer / max(rows, columns)
    values = cutout * np.concatenate(
        [np.repeat(cutout[..., 3:], 3, -1), np.ones((rows, columns, 1))], -1
    )
    if scale < 1:  # warping does not average
        small = max(1, round(columns * scale)), max(1, round(rows * scale))
        values = cv2.resize(values.astype(np.float32), small, interpolation=cv2.INTER_AREA)
        rows = values.shape[0]
        columns = values.shape[1]
        scale = 1.0
    turn = cv2.getRotationMatrix2D((columns / 2, rows / 2), rng.normal(0, SETTINGS.turned), scale)
    half = np.array([columns, rows]) * scale / 2
    hidden = (1 - np.sqrt(SETTINGS.visible)) * 2 * half
    low = half - hidden
    high = np.array([width, height]) - half + hidden
    turn[:, 2] += rng.uniform(np.minimum(low, high), np.maximum(low, high)) - [
        columns / 2,
        rows / 2,
    ]
    if rng.random() < 0.5:
        values = values[:, ::-1]
    warped = cv2.warpAffine(
        np.ascontiguousarray(values, np.float32), turn, (width, height), flags=cv2.INTER_LINEAR
    )
    return np.asarray(warped)


def _ramp(shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """[H, W] factor that grows across the picture in a random direction, about 1."""
    rows, columns = np.indices(shape) / max(shape) - 0.5
    angle = rng.uniform(0, 2 * np.pi)
    strength = rng.uniform(0, SETTINGS.shaded)
    return 1 + 2 * strength * (rows * np.sin(angle) + columns * np.cos(angle))


def _shadow(share: Array, rng: np.random.Generator) -> Array:
    """[H, W] factor: a soft, shifted copy of opacity [H, W], dark."""
    side = max(share.shape)
    shift = np.array(
        [[1, 0, rng.normal(0, 0.03) * side], [0, 1, rng.uniform(0, 0.04) * side]], np.float32
    )
    moved = cv2.warpAffine(share, shift, (share.shape[1], share.shape[0]))
    soft = cv2.GaussianBlur(moved, (0, 0), rng.uniform(0.005, 0.04) * side)
    return 1 - rng.uniform(0.2, 0.7) * soft
