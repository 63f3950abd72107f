"""A hole of a photo filled with pieces of the rest of it, by the library PyPatchMatch (Barnes et al. 2009).

Patches are matched from a small size of the whole picture to its full one, so that borders of things and of surfaces
go on through the hole. They come from the surfaces that go on there or from nearby, not from other things, and a
guide prefers those of the same surface.
"""

import hashlib
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.errors import MaterialistError, SetupError
from materialist.geometry.membrane import membrane
from materialist.geometry.silhouette import grown
from materialist.install import install_command
from materialist.io.atomic import write_whole
from materialist.predict import resample
from materialist.types import Array


@dataclass(frozen=True)
class PatchSettings:
    """How a hole is filled; tuned on 6 photos by eye, 10 photos with an object pasted in and 6 made ones."""

    max_side: int = 768  # longer side at which patches are matched; more: finer, slower
    radius: float = 1 / 150  # of a patch, in longer sides, at least 2 pixels; more: longer edges
    max_distance: float = 0.4  # from the hole, in its sizes, from where anything may be copied
    guide_weight: float = 0.25  # beside the patches' colours; more: less from other surfaces
    guide_step: float = 0.1  # of the guide from one surface to the next
    floor: float = 0.05  # radiance: HDR values differ by sums below, by ratios above; by eye


SETTINGS = PatchSettings()
_LOCK = threading.Lock()
"""The library has one seed for all threads."""
_FOLDER: ContextVar[Path | None] = ContextVar("fillings", default=None)
_MAY_FILL: ContextVar[bool] = ContextVar("may_fill", default=True)


class NotFilled(MaterialistError):
    """A hole that would have to be filled, within `remembered_alone`."""


def patched(photo: Array, hole: Array, usable: Array, label: Array, seed: int = 0) -> Array:
    """[h, w, 3] float32 linear: a photo [H0, W0, 3] with the hole [H, W] bool filled, at its size or `max_side`.

    usable [H, W] bool: what may be copied. label: [H, W] int: the surface of a pixel, as `behind.HiddenGeometry`, in
    the hole that which is hidden. Raises SetupError without a working library.
    """
    native = photo.shape[:2]
    scale = min(1.0, SETTINGS.max_side / max(native))
    shape = tuple(max(1, round(n * scale)) for n in native)
    picture = resample.values(photo, shape)
    # --- What may be copied: surfaces that go on behind, and what is near ---
    near = grown(hole, max(8, round(SETTINGS.max_distance * float(np.sqrt(hole.sum())))))
    behind = np.unique(label[hole])
    planes = behind[behind >= 0]  # the rest is many things
    usable = usable & (near | np.isin(label, planes if planes.size else behind))
    gap = resample.values(hole.astype(np.float32), shape) > 0
    excluded = resample.values((~usable & ~hole).astype(np.float32), shape) > 0
    excluded &= ~gap
    # --- 8-bit levels, as the library wants them; 0 is left to say that no patch fitted ---
    top = max(1.0, float(picture.max()))
    levels = np.maximum(np.round(255 * _encoded(picture, top)), 1).astype(np.uint8)
    surface = resample.values((SETTINGS.guide_step * label).astype(np.float32), shape)
    guide = np.stack([surface, 0 * surface, 0 * surface], -1)
    filled = _kept(levels, gap, excluded, guide, seed).astype(np.float32) / 255
    # --- Where no patch fitted, a smooth surface ---
    plain = gap & (filled == 0).all(-1)
    if plain.any():
        filled = np.where(plain[..., None], membrane(filled, ~gap & ~excluded), filled)
    return np.where(gap[..., None], _decoded(filled, top), picture).astype(np.float32)


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


def _kept(levels: Array, gap: Array, excluded: Array, guide: Array, seed: int) -> Array:
    """`_inpainted`, once for equal arguments where fillings are remembered."""
    folder = _FOLDER.get()
    if folder is None:
        return _inpainted(levels, gap, excluded, guide, seed)
    # By content: whatever made the hole, equal holes are filled alike.
    digest = hashlib.sha256(repr((seed, SETTINGS, levels.shape)).encode())
    for array in (levels, gap, excluded, guide):
        digest.update(array.tobytes())
    file = folder / f"filling-{digest.hexdigest()[:32]}.png"
    if file.is_file():
        filled = cv2.imread(str(file), cv2.IMREAD_COLOR)
        if filled is not None and filled.shape == levels.shape:
            return np.asarray(filled)
    if not _MAY_FILL.get():
        raise NotFilled("What was hidden has to be filled first.")
    filled = _inpainted(levels, gap, excluded, guide, seed)
    write_whole(file, cv2.imencode(".png", filled)[1].tobytes())
    return filled


def _inpainted(levels: Array, gap: Array, excluded: Array, guide: Array, seed: int) -> Array:
    """uint8 levels [h, w, 3] with `gap` [h, w] bool filled, nothing of it from `excluded` [h, w] bool."""
    try:
        import patchmatch

        radius = max(2, round(SETTINGS.radius * max(gap.shape)))
        with _LOCK:
            patchmatch.set_random_seed(seed)
            return np.asarray(
                patchmatch.inpaint_regularity(
                    levels,
                    gap,
                    guide,
                    global_mask=excluded,
                    patch_size=radius,
                    guide_weight=SETTINGS.guide_weight,
                )
            )
    except (ImportError, RuntimeError) as error:
        raise SetupError(
            f"Filling what was hidden needs the package PyPatchMatch ({error}); install it with: "
            f"{install_command('--force-reinstall', '--no-deps', 'PyPatchMatch')}, or give a background."
        ) from error
