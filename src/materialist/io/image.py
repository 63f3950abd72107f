"""Pictures out (sRGB PNG, linear EXR), and maps and masks in."""

from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from materialist.color import srgb_levels
from materialist.errors import InputError
from materialist.io.atomic import ensure_writable, whole_file, writing
from materialist.io.bitmap import MAX_PIXELS, stored_pixels
from materialist.io.decode import image_size
from materialist.io.exr import read_exr, write_exr
from materialist.types import Array

COLOURED = 0.2
"""Share of coloured pixels, neither black nor bright, from which a picture is a photo and no mask."""
BLACK = 0.1
WHITE = 0.9
"""Brightness up to which a pixel of a mask is black, and from which it is white."""

COMPRESSION = 3
"""Of PNG files: a tenth larger than at the usual 6, and written in a third of the time."""


def write_png(path: str | Path, picture: Array) -> None:
    """Write RGB [H, W, 3] or grey [H, W] as an 8-bit PNG: uint8 as it is, linear values clipped and sRGB-encoded.

    Raises OutputError when the file cannot be written.
    """
    with writing(path):
        Image.fromarray(picture if picture.dtype == np.uint8 else srgb_levels(picture)).save(
            path, format="PNG", compress_level=COMPRESSION
        )


def write_image(
    path: str | Path, linear: Array, *, deep: bool = False, force: bool = False
) -> None:
    """Write linear RGB [H, W, 3] to PATH.png (sRGB) or PATH.exr (linear float32), whole or not at all.

    `deep` PNG have 16 bits a channel, others 8. Raises OutputError when the file exists and `force` is not given, or
    cannot be written; InputError for another suffix.
    """
    ensure_image_writable(path, force=force)
    with whole_file(path, force) as temporary:
        if deep and temporary.suffix == ".png":
            temporary.write_bytes(
                cv2.imencode(".png", srgb_levels(linear, np.uint16)[..., ::-1])[1].tobytes()
            )
        else:
            (write_exr if temporary.suffix == ".exr" else write_png)(temporary, linear)


def ensure_image_writable(path: str | Path, *, force: bool = False) -> None:
    """Check, before hours of work, that write_image will accept PATH; raises OutputError or InputError."""
    if Path(path).suffix.lower() not in (".png", ".exr"):
        raise InputError(
            f"The output {path} must end in .png (for looking) or .exr (linear, for further work)."
        )
    ensure_writable(path, force, None)


def read_map(path: str | Path) -> Array:
    """A data map, [H, W] or [H, W, 3] float32: EXR as stored; PNG and friends scaled to [0, 1], never colour-decoded.

    Alpha is dropped. Raises InputError when the file is missing or unreadable.
    """
    return _with_alpha(path)[0]


def _with_alpha(path: str | Path) -> tuple[Array, Array | None]:
    """The values as `read_map` has them, and alpha [H, W] in [0, 1] where there is one."""
    path = Path(path)
    if path.suffix.lower() == ".exr":
        array = read_exr(path)
        alpha = array[..., 3] if array.ndim == 3 and array.shape[-1] == 4 else None
        return (array[..., :3] if array.ndim == 3 else array), alpha
    if not path.is_file():
        raise InputError(f"There is no map at {path}.")
    _check_pixels(path)
    colour, alpha = stored_pixels(path)
    # Whole numbers by their largest level; floats as they are.
    scale = np.float32({"uint8": 255, "uint16": 65535}.get(colour.dtype.name, 1))
    array = (
        np.ascontiguousarray(colour if colour.shape[2] == 3 else colour[..., 0], np.float32) / scale
    )
    return array, None if alpha is None else alpha[..., 0] / scale


def _check_pixels(path: Path) -> None:
    """Refuse more pixels than a photo may have, by the header. What has none `stored_pixels` refuses."""
    try:
        width, height = image_size(path)
    except Exception:  # decoders raise anything
        return
    if width * height > MAX_PIXELS:
        raise InputError(
            f"{path} is {width} x {height} pixels; the limit is {MAX_PIXELS / 1e6:.0f} megapixels: shrink it."
        )


def same_aspect(a: tuple[int, ...], b: tuple[int, ...]) -> bool:
    """Whether a picture of shape `a` (H, W, ...) has the proportions of one at working size `b`.

    A pixel of slack on the shorter side of `b`: working sizes are rounded.
    """
    return abs(a[1] / a[0] - b[1] / b[0]) <= 1.5 * b[1] / b[0] / min(b[:2])


def read_mask(
    path: str | Path, shape: tuple[int, int], native: tuple[int, int] | None = None
) -> Array:
    """A region as [H, W] bool of `shape` = (H, W): white (> 0.5) is inside, what is transparent is outside.

    Of an object that was cut out, with transparency around it, all that is opaque is inside, whatever its colours.
    The file may have the working size `shape`, or the photo's `native` (H0, W0), or any size of that aspect ratio;
    it is area-averaged to `shape`. Raises InputError for another aspect ratio, an empty mask, or a colour photo.
    """
    mask = _marked(*_with_alpha(path), path)
    if mask.shape != shape:
        sizes = f"{shape[1]} x {shape[0]}" + (f" or {native[1]} x {native[0]}" if native else "")
        if not same_aspect(mask.shape, shape):
            raise InputError(
                f"The mask {path} is {mask.shape[1]} x {mask.shape[0]} pixels, the photo {sizes}."
            )
        # An area mean: a pixel is inside where more than half of it is.
        mask = cv2.resize(mask, shape[::-1], interpolation=cv2.INTER_AREA)
    inside = mask > 0.5
    if not inside.any():
        raise InputError(
            f"The mask {path} is empty: no pixel is brighter than half at working size."
        )
    return inside


def _marked(values: Array, alpha: Array | None, path: str | Path) -> Array:
    """How far each pixel is inside, [H, W] in [0, 1]: by brightness, or by the alpha of a cut-out object."""
    brightness = values.max(-1) if values.ndim == 3 else values
    # Masks are black and white; a photo has colours in between.
    between = (brightness > BLACK) & (brightness < WHITE)
    shown = None if alpha is None else alpha > 0.5
    if alpha is None or shown is None or shown.all() or not shown.any():
        if values.ndim == 3 and ((np.ptp(values, axis=-1) > 0.05) & between).mean() > COLOURED:
            raise InputError(
                f"{path} is a colour picture, not a mask; paint what is inside white, and all else black."
            )
        return np.asarray(brightness if alpha is None else brightness * alpha, np.float32)
    # What is shown is a mask itself where it is black and white; else it is the object.
    opaque = brightness[shown]
    is_painted = (
        (opaque <= BLACK).any() and (opaque >= WHITE).any() and between[shown].mean() <= COLOURED
    )
    return np.asarray(brightness * alpha if is_painted else alpha, np.float32)
