"""A hole of a photo filled by MI-GAN (Sargsyan et al. 2023), a network that has learnt from photographs of places.

It reads a square around the hole at 512 pixels. What stands at the hole's border tells it most: a mask that misses a
chair's leg leaves the leg.
"""

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.errors import MaterialistError
from materialist.geometry.membrane import membrane
from materialist.geometry.silhouette import grown
from materialist.io.atomic import write_whole
from materialist.predict import resample
from materialist.predict.onnx import run
from materialist.types import Array

NETWORK = Path(__file__).with_name("migan.onnx")
"""The network that ships with the package; docs/training.md says where it comes from."""


@dataclass(frozen=True)
class FillingSettings:
    """How a hole is filled; by eye."""

    max_side: int = 1024  # longer side of the photo that the network's square is cut from
    min_side: int = 512  # longer side that it is enlarged to where it is smaller
    least_side: int = 4  # shorter side that the network reads; derived: it fails below
    # sides about which the picture is mirrored (rows, columns) for one answer each
    mirrored: tuple[tuple[int, ...], ...] = ((), (0,), (1,), (0, 1))
    floor: float = 0.05  # radiance: HDR values differ by sums below, by ratios above
    rim: float = 0.1  # around a hole in an HDR photo, longer sides: there the range is measured
    brightest: float = 99.0  # percentile there that is white: a lamp would leave few levels


SETTINGS = FillingSettings()
_FOLDER: ContextVar[Path | None] = ContextVar("fillings", default=None)
_MAY_FILL: ContextVar[bool] = ContextVar("may_fill", default=True)


class NotFilled(MaterialistError):
    """A hole that would have to be filled, within `remembered_alone`."""


def filled(photo: Array, hole: Array, usable: Array) -> Array:
    """[h, w, 3] float32 linear: a photo [H0, W0, 3] with the hole [H, W] bool filled, at its size or `max_side`.

    usable [H, W] bool: what the filling may be guessed from. Raises SetupError, WeightsError: see `onnx.run`.
    """
    # --- The photo and the hole, at most `max_side` pixels long ---
    native = photo.shape[:2]
    scale = min(1.0, SETTINGS.max_side / max(native))
    shape = tuple(max(1, round(n * scale)) for n in native)
    picture = resample.values(photo, shape)
    gap = resample.values(hole.astype(np.float32), shape) > 0
    unknown = gap | (resample.values((~usable).astype(np.float32), shape) > 0)
    # --- 8-bit levels, as the network reads them ---
    # Area means of white are a little above 1.
    top = _white(picture, gap, unknown) if photo.max() > 1 else 1.0
    levels = np.round(255 * _encoded(np.minimum(picture, top), top)).astype(np.uint8)
    painted = _decoded(_kept(levels, unknown).astype(np.float32) / 255, top)
    return np.where(gap[..., None], painted, picture).astype(np.float32)


def _white(picture: Array, gap: Array, unknown: Array) -> float:
    """The radiance of the highest level, at least 1, in an HDR picture [h, w, 3]; what is taken away says nothing."""
    rim = grown(gap, max(1, round(SETTINGS.rim * max(gap.shape)))) & ~unknown
    if not rim.any():
        return 1.0
    return max(1.0, float(np.percentile(picture[rim].max(-1), SETTINGS.brightest)))


def _encoded(linear: Array, top: float) -> Array:
    """Values in [0, 1] as the eye compares them; of HDR logarithms."""
    floor = SETTINGS.floor
    return linear_to_srgb(linear) if top <= 1 else np.log1p(linear / floor) / np.log1p(top / floor)


def _decoded(values: Array, top: float) -> Array:
    floor = SETTINGS.floor
    return srgb_to_linear(values) if top <= 1 else floor * np.expm1(values * np.log1p(top / floor))


@contextmanager
def remembered(folder: Path) -> Iterator[None]:
    """Within it a hole that was filled before is not filled anew: fillings are kept as files of a folder."""
    token = _FOLDER.set(folder)
    try:
        yield
    finally:
        _FOLDER.reset(token)


@contextmanager
def remembered_alone() -> Iterator[None]:
    """Within it a hole that was not filled before raises NotFilled: filling takes seconds."""
    token = _MAY_FILL.set(False)
    try:
        yield
    finally:
        _MAY_FILL.reset(token)


def _kept(levels: Array, unknown: Array) -> Array:
    """`_inpainted`, once for equal arguments where fillings are remembered."""
    folder = _FOLDER.get()
    if folder is None:
        return _inpainted(levels, unknown)
    # By content: whatever made the hole, equal holes are filled alike.
    digest = hashlib.sha256(repr((SETTINGS, levels.shape)).encode())
    for array in (levels, unknown):
        digest.update(array.tobytes())
    file = folder / f"filling-{digest.hexdigest()[:32]}.png"
    if file.is_file():
        kept = cv2.imread(str(file), cv2.IMREAD_COLOR)
        if kept is not None and kept.shape == levels.shape:
            return np.asarray(kept)
    if not _MAY_FILL.get():
        raise NotFilled("What was hidden has to be filled first.")
    painted = _inpainted(levels, unknown)
    write_whole(file, cv2.imencode(".png", painted)[1].tobytes())
    return painted


def _inpainted(levels: Array, unknown: Array) -> Array:
    """uint8 levels [h, w, 3] with `unknown` [h, w] bool filled.

    The network sees the picture and its mirror images; of its answers the one nearest to their mean is taken. What only
    one of them has, as a thing that nothing around hints at, is an accident.
    """
    # --- What is too thin goes on beyond its sides ---
    height, width = unknown.shape
    more = [(0, max(0, SETTINGS.least_side - n)) for n in (height, width)]
    levels = np.pad(levels, [*more, (0, 0)], mode="edge")
    unknown = np.pad(unknown, more, mode="edge")
    size = unknown.shape[::-1]
    # --- The network's borders of the hole are soft: nothing of the old colours may be left there ---
    spanned = np.asarray(membrane(levels.astype(np.float32), ~unknown))
    smooth = np.clip(np.rint(np.where(unknown[..., None], spanned, levels)), 0, 255)
    # --- Its square is not smaller than the picture ---
    scale = -(-SETTINGS.min_side // max(size))
    large = (size[0] * scale, size[1] * scale)
    picture = cv2.resize(smooth.astype(np.uint8), large, interpolation=cv2.INTER_CUBIC)
    small = np.where(unknown, 0, 255).astype(np.uint8)
    known = np.asarray(cv2.resize(small, large, interpolation=cv2.INTER_NEAREST))
    # --- The answer on which most of them agree ---
    answers = []
    for axes in SETTINGS.mirrored:
        answer = np.flip(_answer(np.flip(picture, axes), np.flip(known, axes)), axes)
        answer = np.ascontiguousarray(answer)
        answers.append(np.asarray(cv2.resize(answer, size, interpolation=cv2.INTER_AREA)))
    inside = np.stack([answer[unknown] for answer in answers]).astype(np.float32)
    apart = ((inside - inside.mean(0)) ** 2).mean((1, 2))
    return np.ascontiguousarray(answers[int(apart.argmin())][:height, :width])


def _answer(picture: Array, known: Array) -> Array:
    """MI-GAN's filling of a picture [h, w, 3] uint8 where `known` [h, w] uint8 is 0."""
    channels_first = np.ascontiguousarray(np.moveaxis(picture, -1, 0))
    mask = np.ascontiguousarray(known)
    painted = run(NETWORK, {"image": channels_first[None], "mask": mask[None, None]})[0]
    return np.asarray(np.moveaxis(painted[0], 0, -1))
