"""OpenEXR files, through the reference library: float32 survives a round trip bit for bit."""

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from materialist.errors import InputError, OutputError
from materialist.io.bitmap import MAX_PIXELS
from materialist.io.native import name_problem, unprinted
from materialist.types import Array

LARGEST_BYTES = 12 * MAX_PIXELS
"""Most bytes of all channels of a file together, as float32."""
GREY = ("Y", "V", "L", "Z", "depth")
"""Channels that are a grey map."""
_PICTURES = (
    "rgba",
    "rgb",
    "beauty",
    "combined",
    "composite",
    "final",
    "image",
    "main",
    "c",
    "ci",
    "color",
    "colour",
    *("render", "default"),
)
"""Words in the name of the layer that is the picture, where there are several; the first are the surest."""
# Names of render passes, as Blender, Arnold, V-Ray, RenderMan and Nuke write them.
_DATA = frozenset(
    (
        "albedo",
        "normal",
        "normals",
        "n",
        "ns",
        "ng",
        "position",
        "positions",
        "p",
        "pworld",
        "pref",
        "point",
        "depth",
        "z",
        "zdepth",
        "distance",
        "vector",
        "vectors",
        "motion",
        "velocity",
        "speed",
        "uv",
        "st",
        "mist",
        "ao",
        "occlusion",
        "id",
        "ids",
        "index",
        "mask",
        "matte",
        "object",
        "objects",
        "holdout",
        "tangent",
        "diff",
        "diffuse",
        "gloss",
        "glossy",
        "spec",
        "specular",
        "reflection",
        "reflect",
        "refraction",
        "refract",
        "trans",
        "transmission",
        "sss",
        "subsurface",
        "volume",
        "sheen",
        "coat",
        "emission",
        "emit",
        "emissive",
        "env",
        "environment",
        "background",
        "shadow",
        "shadows",
        "direct",
        "indirect",
        "dir",
        "ind",
        "gi",
        "col",
        "lighting",
        "illumination",
        "filter",
        "roughness",
        "metallic",
        "metalness",
        "variance",
        "samples",
        "noise",
        "basecolor",
        "base",
        "debug",
        "facing",
        "wire",
        "wireframe",
        "thickness",
        "curvature",
        "light",
    )
)
"""Words in the names of layers that are no picture, though they have colours."""


def read_exr(path: str | Path) -> Array:
    """The map in an EXR: [H, W, C] float32 for colour channels, [H, W] float32 for a single one.

    It is the first part's, and a lone channel goes before layers; a photo is chosen otherwise (`exr_photo`). It covers
    the display window, with 0 where the file has no data. Half and float pixels are both returned as float32; values
    are as stored (linear, unclipped, NaN kept).
    Raises InputError when the file is missing, is not an EXR, is damaged, or holds no picture we know how to read.
    """
    path = Path(path)
    check_exr(path)
    with opened_exr(path, separate_channels=True) as file:
        header = dict(file.parts[0].header)
        channels = {name: channel.pixels for name, channel in file.channels(0).items()}
    return displayed(np.ascontiguousarray(_pick(channels, path), np.float32), header, path)


@contextmanager
def opened_exr(path: Path, **settings: bool) -> Iterator[Any]:
    """An open EXR. Raises InputError, also for what goes wrong within."""
    if not path.is_file():
        raise InputError(f"There is no EXR file at {path}.")
    if problem := name_problem(path):
        raise InputError(problem)
    try:
        with unprinted():
            file = OpenEXR.File(str(path), **settings)
        with file:
            yield file
    except Exception as error:  # the bindings raise RuntimeError, ValueError or their own C++ types
        raise InputError(
            f"{path} is no readable EXR file (truncated or damaged): {str(error).rstrip('.')}."
        ) from error


def exr_headers(path: Path) -> list[dict[str, Any]]:
    """The header of each part of an EXR, without its pixels. Raises InputError."""
    with opened_exr(path, header_only=True) as file:
        return [dict(part.header) for part in file.parts]


def exr_window(header: dict[str, Any], name: str) -> tuple[int, int, int, int]:
    """Left, top, width and height of a part's dataWindow or displayWindow, pixels."""
    low, high = (np.asarray(corner, np.int64) for corner in header[name])
    return int(low[0]), int(low[1]), int(high[0] - low[0] + 1), int(high[1] - low[1] + 1)


def exr_size(header: dict[str, Any]) -> tuple[int, int]:
    """(width, height) of a part's picture: of its display window, or of its data where they are more."""
    return max(
        (exr_window(header, name)[2:] for name in ("displayWindow", "dataWindow")), key=math.prod
    )


def exr_bytes(path: Path) -> int:
    """Bytes of all channels of all parts once decoded, by their headers. Raises InputError, for deep pixels too."""
    headers = exr_headers(path)
    if any("deep" in str(header.get("type")) for header in headers):
        raise InputError(f"{path} holds deep pixels; save it as a plain picture.")
    return 4 * sum(math.prod(exr_size(header)) * len(header["channels"]) for header in headers)


def check_exr(path: Path) -> None:
    """Refuse a file that takes too much memory, before its pixels are decoded: the library decodes all channels."""
    if (total := exr_bytes(path)) > LARGEST_BYTES:
        raise InputError(
            f"{path} holds {total / 1e9:.1f} GB in all its channels; the limit is {LARGEST_BYTES / 1e9:.1f}: save its "
            "picture alone."
        )


def displayed(pixels: Array, header: dict[str, Any], path: Path) -> Array:
    """Pixels [H, W, ...] of the data window, cut to the display window; 0 where the file has no data.

    Raises InputError where the two windows have nothing in common.
    """
    left, top, wide, high = exr_window(header, "displayWindow")
    data_left, data_top, data_wide, data_high = exr_window(header, "dataWindow")
    # --- The overlap of both windows ---
    x0 = max(left, data_left)
    x1 = min(left + wide, data_left + data_wide)
    y0 = max(top, data_top)
    y1 = min(top + high, data_top + data_high)
    if x0 >= x1 or y0 >= y1:
        raise InputError(f"{path} has no data in its display window; export it again.")
    inside = pixels[y0 - data_top : y1 - data_top, x0 - data_left : x1 - data_left]
    if inside.shape[:2] == (high, wide):
        return np.ascontiguousarray(inside)
    # --- The display window, black where the file has no data ---
    out = np.zeros((high, wide, *pixels.shape[2:]), pixels.dtype)
    out[y0 - top : y1 - top, x0 - left : x1 - left] = inside
    return out


def write_exr(
    path: str | Path, array: Array, attributes: dict[str, str | float] | None = None
) -> None:
    """Write [H, W] (channel Y), [H, W, 3] (RGB) or [H, W, 4] (RGBA) as float32, with attributes in its header.

    Raises InputError for another shape, OutputError when the file cannot be written.
    """
    array = np.asarray(array)
    names = {2: "Y"}.get(array.ndim) or {(3, 3): "RGB", (3, 4): "RGBA"}.get(
        (array.ndim, array.shape[-1])
    )
    if names is None:
        raise InputError(
            f"An EXR holds [H, W], [H, W, 3] or [H, W, 4]; this array is {list(array.shape)}."
        )
    pixels = np.ascontiguousarray(array, np.float32)
    if problem := name_problem(path):
        raise OutputError(problem)
    # ZIP loses nothing.
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    header |= attributes or {}
    try:
        with OpenEXR.File(header, {names: pixels}) as file:
            file.write(str(path))
    except Exception as error:  # see read_exr
        raise OutputError(f"{path} cannot be written: {error}") from error


def layers_of(channels: dict[str, Array]) -> dict[str, dict[str, Array]]:
    """Layer -> channel -> half or float pixels; "" is what has no layer."""
    layers: dict[str, dict[str, Array]] = {"": {}}
    for name, pixels in channels.items():
        if pixels.dtype in (np.float16, np.float32):
            layer, _, part = name.rpartition(".")
            layers.setdefault(layer, {})[part.upper() if len(part) <= 2 else part] = pixels
    return layers


def stacked_channels(parts: dict[str, Array], names: str) -> Array:
    """[H, W, C] float32, with alpha where there is one; each channel leaves `parts`, which bounds the memory."""
    # Filled channel by channel, so that only one copy of the picture exists.
    order = names + "A" if "A" in parts else names
    out: Array = np.empty((*parts[order[0]].shape, len(order)), np.float32)
    for index, name in enumerate(order):
        out[..., index] = parts.pop(name)
    return out


def no_picture(channels: dict[str, Array], path: Path) -> InputError:
    """The error of a file without a picture."""
    odd = [
        str(pixels.dtype)
        for pixels in channels.values()
        if pixels.dtype not in (np.float16, np.float32)
    ]
    if odd:
        return InputError(f"{path} holds {odd[0]} pixels; save it as half or float.")
    return InputError(
        f"{path} has the channels {', '.join(sorted(channels)) or 'none'}; RGB or Y is needed."
    )


def picture_rank(name: str) -> tuple[bool, int]:
    """How much a layer's or a part's name says that it is the picture: the least is the most.

    Names that say data (normals, albedo, one kind of light) come last, unknown ones before them.
    """
    # Words of names such as `ViewLayer.DiffCol` or `beauty_pass`.
    words = [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)]
    places = [_PICTURES.index(word) for word in words if word in _PICTURES]
    is_data = any(word in _DATA or word.startswith("crypto") for word in words)
    return is_data, min(places, default=len(_PICTURES))


def _pick(channels: dict[str, Array], path: Path) -> Array:
    """The map among the channels of a part. Raises InputError where there is none."""
    layers = layers_of(channels)
    plain = layers[""]
    coloured = [layer for layer, parts in layers.items() if {"R", "G", "B"} <= set(parts)]
    grey = [name for name in GREY if name in plain]
    if coloured and ("" in coloured or not grey):
        return stacked_channels(
            layers[min(coloured, key=lambda layer: (layer != "", picture_rank(layer)))], "RGB"
        )
    if grey:
        return plain[grey[0]]
    known = [pixels for parts in layers.values() for pixels in parts.values()]
    if len(channels) == len(known) == 1:
        return known[0]
    raise no_picture(channels, path)
