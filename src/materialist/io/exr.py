"""OpenEXR files, through the reference library: float32 survives a round trip bit for bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from materialist.errors import InputError, OutputError
from materialist.plain import is_utf8
from materialist.types import Array

_GREY = ("Y", "V", "L", "Z", "y", "depth")
_PICTURES = ("beauty", "combined", "rgba", "rgb", "image", "final")
"""Names of the layer that is the picture, where there are several."""


def read_exr(path: str | Path) -> Array:
    """The picture in an EXR: [H, W, C] float32 for colour channels, [H, W] float32 for a single one.

    Half and float pixels are both returned as float32; values are as stored (linear, unclipped, NaN kept).
    Raises InputError when the file is missing, is not an EXR, is damaged, or holds no picture we know how to read.
    """
    import OpenEXR

    path = Path(path)
    if not path.is_file():
        raise InputError(f"There is no EXR file at {path}.")
    if not is_utf8(str(path)):
        raise InputError(f"The name {str(path)!r} is not UTF-8, and OpenEXR knows no others; rename it.")
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: channel.pixels for name, channel in file.channels().items()}
    except Exception as error:  # the bindings raise RuntimeError, ValueError or their own C++ types
        raise InputError(
            f"{path} is not a readable EXR file (truncated or damaged): {str(error).rstrip('.')}."
        ) from error
    array = _pick(channels, path)
    return np.ascontiguousarray(array, np.float32)


def write_exr(path: str | Path, array: Array, half: bool = False) -> None:
    """Write [H, W] (channel Y), [H, W, 3] (RGB) or [H, W, 4] (RGBA) as float32, or as float16 with `half`.

    Raises InputError for another shape, OutputError when the file cannot be written.
    """
    import OpenEXR

    array = np.asarray(array)
    names = {2: "Y"}.get(array.ndim) or {(3, 3): "RGB", (3, 4): "RGBA"}.get((array.ndim, array.shape[-1]))
    if names is None:
        raise InputError(f"An EXR holds [H, W], [H, W, 3] or [H, W, 4]; this array is {list(array.shape)}.")
    pixels = np.ascontiguousarray(array, np.float16 if half else np.float32)
    if not is_utf8(str(path)):
        raise OutputError(f"The name {str(path)!r} is not UTF-8, and OpenEXR knows no others; give another.")
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    try:
        with OpenEXR.File(header, {names: pixels}) as file:
            file.write(str(path))
    except Exception as error:  # see read_exr
        raise OutputError(f"{path} cannot be written: {error}") from error


def _pick(channels: dict[str, Array], path: Path) -> Array:
    """The picture among the channels: plain RGB(A), then grey, then a layer with RGB(A), the one named so first."""
    odd = [name for name, pixels in channels.items() if pixels.dtype not in (np.float16, np.float32)]
    layers: dict[str, dict[str, Array]] = {}
    for name in [name for name in channels if name not in odd]:
        layer, _, part = name.rpartition(".")
        layers.setdefault(layer, {})[part.upper() if len(part) == 1 else part] = channels[name]
    coloured = [layer for layer, parts in layers.items() if {"R", "G", "B"} <= set(parts)]
    named = sorted(coloured, key=lambda layer: layer.rpartition(".")[2].lower() not in _PICTURES)
    if "" not in coloured:
        for name in _GREY:
            if name in channels and name not in odd:
                return channels[name]
    for layer in ["", *named] if "" in coloured else named:
        parts = layers[layer]
        return np.stack([parts[c].astype(np.float32) for c in ("RGBA" if "A" in parts else "RGB")], -1)
    if len(channels) == 1 and not odd:
        return next(iter(channels.values()))
    if odd:
        raise InputError(f"{path} holds {channels[odd[0]].dtype} pixels; save it as half or float.")
    raise InputError(f"{path} has the channels {', '.join(sorted(channels)) or 'none'}; RGB or Y is needed.")
