"""A photograph from a file: decoded, upright, linear, at working size, with its camera."""

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import cv2
import numpy as np

from materialist.errors import InputError, SetupError
from materialist.install import install_command
from materialist.io.bitmap import MIN_SIDE, Decoded
from materialist.io.decode import decode
from materialist.io.exif import horizontal_fov
from materialist.options import InvertOptions
from materialist.spelling import spelled
from materialist.types import Array, Camera, Photo

DEFAULT_FOV = 35.0
"""Horizontal field of view, degrees, when nothing better is known (the paper's)."""
HDR_CLIP = 10.0
"""Upper bound of HDR input (paper, appendix "Handling HDR Images"), in units of an ordinary photo's white."""
BLACK = 1e-3
"""Share of the brightest value up to which an HDR photo's pixel is black, and says nothing of its exposure."""
BRIGHT = 0.9
"""Where the 97th percentile of an HDR photo's brightest channel belongs."""
CLIPPED = 1e-3
"""Share of pixels at 1, the brightest value, from which a scene-linear file is a clipped picture."""
MIDDLE = 0.05
"""The median, where that would leave it darker: a bright window must not make the room black."""

EXAMPLES = {
    "coffee": ("coffee.png", "Pikolo Espresso Bar, photo by Rachel Michetti, CC0"),
    "cat": ("chelsea.png", "Chelsea the cat, photo by Stefan van der Walt, CC0"),
    "astronaut": ("astronaut.png", "Eileen Collins, NASA, public domain"),
    "rocket": ("rocket.jpg", "Launch of DSCOVR, SpaceX, public domain"),
}
"""Name -> (file in skimage/data, credit) of photographs with a stated free licence, which scikit-image carries."""
PREFIX = "example:"


@spelled
def read_photo(
    path: str | Path, *, size: int = 512, fov: float | str | None = None, layer: str | None = None
) -> Photo:
    """Read PATH (or `example:NAME`) as a Photo whose longer side is `size` pixels, or fewer where the file has fewer.

    `fov` is the horizontal field of view in degrees, in (1, 170); None or "auto" takes it from EXIF, else 35.
    `layer` names the layer or part of an EXR that is the photo; None chooses by their names.
    Display files (PNG, JPEG, ...) give values in [0, 1]. Scene-linear ones (EXR, HDR, float TIFF), of any unit, are
    exposed as an ordinary photo is, by whole stops, so that no digit is lost (`Photo.stops`); at working size they are
    clipped to [0, 10] (paper, appendix "Handling HDR Images"). Shrinking is an area average in linear light.

    Raises InputError, in one sentence, for anything that is not a photograph that can be inverted: a missing, empty,
    damaged, too small, too large, too long, constant, or non-finite one; SetupError for RAW without rawpy.
    """
    checked = InvertOptions(size=size, fov="auto" if fov is None else fov)
    angle = None if checked.fov == "auto" else float(checked.fov)  # type: ignore[arg-type]
    name = str(path)
    file = example_path(name) if name.startswith(PREFIX) else Path(path)
    decoded = decode_photo(file, layer)
    # --- Exposure: an HDR file has any unit; whole stops lose no digit ---
    hdr = decoded.scene_linear and not _is_clipped(decoded.linear)
    stops = _stops(_working(decoded.linear, size)) if hdr else 0
    original = decoded.exposed(stops)
    height, width = original.shape[:2]
    linear = _working(original, size)
    warnings = list(decoded.warnings)
    if width == 2 * height:
        warnings.append(
            "The picture is 2:1 like a 360-degree panorama; it is treated as an ordinary photo, so crop a view from it."
        )
    if stops:
        warnings.append(
            f"The HDR photo is exposed by {stops:+d} stops; EXR pictures made of it have its own unit."
        )
    _require_content(linear, name)
    # --- The limits of a working picture ---
    if hdr and float(linear.max()) > HDR_CLIP:
        warnings.append(
            f"HDR values above {HDR_CLIP * 2.0**-stops:.3g} are clipped at working size."
        )
        linear = np.minimum(linear, np.float32(HDR_CLIP))
    # --- The camera: the option, else EXIF, else the paper's 35 degrees ---
    from_exif = horizontal_fov(decoded.tags, width, height)
    source = "option" if angle else "exif" if from_exif else "default"
    camera = Camera(linear.shape[1], linear.shape[0], angle or from_exif or DEFAULT_FOV)
    return Photo(
        linear,
        camera,
        original,
        hdr,
        source,
        name,
        file.read_bytes(),
        tuple(warnings),
        stops=stops,
        layer=decoded.layer,
    )


def exposed(photo: Photo) -> Photo:
    """An HDR photo from memory, in any unit, as `read_photo` would have exposed it; any other as it is."""
    if not photo.hdr or photo.source is not None or photo.stops:
        return photo
    stops = _stops(photo.linear)
    factor = np.float32(2.0**stops)
    linear = np.minimum(factor * photo.linear, np.float32(HDR_CLIP))
    return replace(photo, linear=linear, original=factor * photo.original, stops=stops)


def _is_clipped(linear: Array) -> bool:
    """Whether a picture ends at 1 on more than CLIPPED of its pixels: as a display file does."""
    value = linear.max(-1)
    return float(value.max()) == 1 and float((value == 1).mean()) > CLIPPED


def _stops(linear: Array) -> int:
    """Whole stops that bring an HDR picture [H, W, 3] to about the exposure of an ordinary photograph.

    The 97th percentile of what is not black comes near BRIGHT, or the median near MIDDLE where that asks for more.
    """
    value = linear.max(-1)
    # A sun is no scale: values are cut at ten times the 99th percentile.
    value = np.minimum(value, HDR_CLIP * float(np.percentile(value, 99)) or value.max())
    bright, middle = np.percentile(value[value >= BLACK * value.max()], (97, 50))
    if bright <= 0:
        return 0
    return int(np.clip(np.round(np.log2(max(BRIGHT / bright, MIDDLE / middle))), -60, 60))


def decode_photo(file: Path, layer: str | None = None) -> Decoded:
    """The file, or one layer of an EXR, at native size with values a photograph may have: finite, >= 0.

    Raises InputError otherwise.
    """
    decoded = decode(file, layer)
    pixels = decoded.linear
    if decoded.scene_linear:
        broken = ~np.isfinite(pixels).all(-1)
        if broken.any():
            row, column = np.argwhere(broken)[0]
            raise InputError(
                f"{file} has {int(broken.sum())} pixels that are NaN or infinite (first at column {column}, "
                f"row {row}); repair them in the program that wrote it."
            )
        if (pixels < 0).any():
            decoded.warnings.append("Negative values are set to 0.")
            np.maximum(pixels, 0, out=pixels)
    return decoded


def _working(original: Array, size: int) -> Array:
    """[H, W, 3] with the longer side at most `size`: area average of linear light, never an enlargement.

    Pixels stay square: of a long photo the shorter side has MIN_SIDE pixels, and the longer one more than `size`.
    """
    height, width = original.shape[:2]
    scale = max(size / max(height, width), MIN_SIDE / min(height, width))
    if scale >= 1:
        return original
    target = (round(width * scale), round(height * scale))
    return np.asarray(cv2.resize(original, target, interpolation=cv2.INTER_AREA))


def _require_content(linear: Array, name: str) -> None:
    low = float(linear.min())
    high = float(linear.max())
    if high <= 1e-4:
        raise InputError(f"{name} is entirely black; there is no light in it to explain.")
    if np.ptp(linear.reshape(-1, 3), axis=0).max() <= 1e-3 * high or high - low <= 1e-4:
        raise InputError(f"{name} is one flat colour; there is nothing in it to explain.")


def example_path(name: str) -> Path:
    """Where `example:NAME` lies on disk. Raises InputError for an unknown name, SetupError without scikit-image."""
    key = name.removeprefix(PREFIX)
    if key not in EXAMPLES:
        raise InputError(f"There is no example photo {key!r}; choose one of {', '.join(EXAMPLES)}.")
    spec = find_spec("skimage")  # the package is located, not imported: importing it takes a while
    path = Path(spec.origin).parent / "data" / EXAMPLES[key][0] if spec and spec.origin else None
    if path is None or not path.is_file():
        raise SetupError(
            f"The example photos come with scikit-image: {install_command('--force-reinstall', 'scikit-image')}"
        )
    return path
