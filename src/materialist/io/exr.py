"""OpenEXR files, through the reference library: float32 survives a round trip bit for bit."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from materialist.errors import InputError, OutputError
from materialist.plain import is_utf8
from materialist.types import Array

_GREY = ("Y", "V", "L", "Z", "depth")
_LIGHT = ("Y", "L")
"""Those of them that may be a photo."""
_PICTURES = ("beauty", "combined", "rgba", "rgb", "image", "final")
"""Names of the layer that is the picture, where there are several."""


def read_exr(path: str | Path, *, photo: bool = False) -> Array:
    """The picture in an EXR: [H, W, C] float32 for colour channels, [H, W] float32 for a single one.

    As a `photo` it is the first part and layer with colours, whatever lies beside them, else grey, with alpha as RGBA;
    a depth is none. As a map it is the first part's, and a lone channel goes before layers.
    Half and float pixels are both returned as float32; values are as stored (linear, unclipped, NaN kept).
    Raises InputError when the file is missing, is not an EXR, is damaged, or holds no picture we know how to read.
    """
    path = Path(path)
    with _opened(path, separate_channels=True) as file:
        parts = [
            {name: channel.pixels for name, channel in file.channels(k).items()}
            for k in range(len(file.parts) if photo else 1)
        ]
    chosen = next((part for part in parts if _coloured(_layers(part))), parts[0])
    return np.ascontiguousarray(_pick(chosen, path, photo), np.float32)


@contextmanager
def _opened(path: Path, **how: bool) -> Iterator[Any]:
    """An open EXR. Raises InputError, also for what goes wrong within."""
    if not path.is_file():
        raise InputError(f"There is no EXR file at {path}.")
    if not is_utf8(str(path)):
        raise InputError(f"The name {str(path)!r} is not UTF-8, and OpenEXR knows no others; rename it.")
    try:
        with OpenEXR.File(str(path), **how) as file:
            yield file
    except Exception as error:  # the bindings raise RuntimeError, ValueError or their own C++ types
        raise InputError(f"{path} is no readable EXR file (truncated or damaged): {str(error).rstrip('.')}.") from error


def exr_headers(path: Path) -> list[dict[str, Any]]:
    """The header of each part of an EXR, without its pixels. Raises InputError."""
    with _opened(path, header_only=True) as file:
        return [dict(part.header) for part in file.parts]


def exr_size(header: dict[str, Any]) -> tuple[int, int]:
    """(width, height) of a part."""
    low, high = (np.asarray(corner, np.int64) for corner in header["dataWindow"])
    return int(high[0] - low[0] + 1), int(high[1] - low[1] + 1)


def exr_bytes(path: Path) -> int:
    """Bytes of all channels of all parts once decoded, by their headers. Raises InputError, for deep pixels too."""
    headers = exr_headers(path)
    if any("deep" in str(header.get("type")) for header in headers):
        raise InputError(f"{path} holds deep pixels; save it as a plain picture.")
    return 4 * sum(math.prod(exr_size(header)) * len(header["channels"]) for header in headers)


def write_exr(path: str | Path, array: Array) -> None:
    """Write [H, W] (channel Y), [H, W, 3] (RGB) or [H, W, 4] (RGBA) as float32.

    Raises InputError for another shape, OutputError when the file cannot be written.
    """
    array = np.asarray(array)
    names = {2: "Y"}.get(array.ndim) or {(3, 3): "RGB", (3, 4): "RGBA"}.get((array.ndim, array.shape[-1]))
    if names is None:
        raise InputError(f"An EXR holds [H, W], [H, W, 3] or [H, W, 4]; this array is {list(array.shape)}.")
    pixels = np.ascontiguousarray(array, np.float32)
    if not is_utf8(str(path)):
        raise OutputError(f"The name {str(path)!r} is not UTF-8, and OpenEXR knows no others; give another.")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    try:
        with OpenEXR.File(header, {names: pixels}) as file:
            file.write(str(path))
    except Exception as error:  # see read_exr
        raise OutputError(f"{path} cannot be written: {error}") from error


def _layers(channels: dict[str, Array]) -> dict[str, dict[str, Array]]:
    """Layer -> channel -> half or float pixels; "" is what has no layer."""
    layers: dict[str, dict[str, Array]] = {"": {}}
    for name, pixels in channels.items():
        if pixels.dtype in (np.float16, np.float32):
            layer, _, part = name.rpartition(".")
            layers.setdefault(layer, {})[part.upper() if len(part) == 1 else part] = pixels
    return layers


def _coloured(layers: dict[str, dict[str, Array]]) -> list[str]:
    """Names of the layers with RGB, the plain one first, then those that are named as pictures are."""
    found = [layer for layer, parts in layers.items() if {"R", "G", "B"} <= set(parts)]
    return sorted(found, key=lambda layer: (layer != "", layer.rpartition(".")[2].lower() not in _PICTURES))


def _stacked(parts: dict[str, Array], names: str) -> Array:
    """[H, W, C] float32, with alpha where there is one."""
    return np.stack([parts[c].astype(np.float32) for c in (names + "A" if "A" in parts else names)], -1)


def _pick(channels: dict[str, Array], path: Path, photo: bool) -> Array:
    """The photo or the map among the channels of a part. Raises InputError where there is none."""
    layers = _layers(channels)
    plain, coloured = layers[""], _coloured(layers)
    grey = [name for name in (_LIGHT if photo else _GREY) if name in plain]
    if coloured and (photo or "" in coloured or not grey):
        return _stacked(layers[coloured[0]], "RGB")
    if grey:
        return _stacked(plain, 3 * grey[0]) if photo and "A" in plain else plain[grey[0]]
    known = [pixels for parts in layers.values() for name, pixels in parts.items() if not (photo and name in _GREY)]
    if len(channels) == len(known) == 1:
        return known[0]
    odd = [str(pixels.dtype) for pixels in channels.values() if pixels.dtype not in (np.float16, np.float32)]
    if odd:
        raise InputError(f"{path} holds {odd[0]} pixels; save it as half or float.")
    raise InputError(f"{path} has the channels {', '.join(sorted(channels)) or 'none'}; RGB or Y is needed.")
