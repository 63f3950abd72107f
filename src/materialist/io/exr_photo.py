"""The photo in an EXR: which part and layer it is, in linear Rec.709, at its display window, with square pixels."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenEXR

from materialist.errors import InputError
from materialist.io.bitmap import Decoded, check_size, light_and_alpha, square_pixels
from materialist.io.colour_space import (
    ACES_AP0,
    CIE_XYZ,
    REC709,
    Primaries,
    rgb_to_xyz,
    to_rec709,
    transformed,
)
from materialist.io.exr import (
    GREY,
    check_exr,
    displayed,
    exr_window,
    layers_of,
    no_picture,
    opened_exr,
    picture_rank,
    stacked_channels,
)
from materialist.types import Array

PLAIN = "RGB"
"""What channels without a layer are called."""
_LIGHT = ("Y", "L")
"""Grey channels that may be a photo."""
_RGB = ("R", "G", "B")
_XYZ = ("X", "Y", "Z")
_LUMINANCE_CHROMA = ("Y", "RY", "BY")
"""Channels that are colours together."""
_SHOWN = 8
"""Layers that a note names."""


@dataclass(frozen=True)
class _Layer:
    """A layer that could be the photo."""

    name: str
    part: int
    channels: dict[str, Array]
    grey: str | None
    """Its only channel; None where it has colours."""
    is_plain: bool
    """Whether it is the file's only part's own channels."""

    @property
    def rank(self) -> tuple[Any, ...]:
        """The photo has the least: plain channels, then layers that are called a picture, unknown ones, data."""
        is_data, place = picture_rank(self.name)
        return (is_data and not self.is_plain, self.grey is not None, not self.is_plain, place)


def read_exr_photo(path: Path, wished: str | None = None) -> Decoded:
    """The photo in an EXR, or the layer `wished`, as light; notes say what was chosen and assumed.

    Raises InputError where there is none, for a layer that is not there, and for more data than memory should hold.
    """
    check_exr(path)
    with opened_exr(path, separate_channels=True) as file:
        headers = [dict(part.header) for part in file.parts]
        names = [str(part.name() or "") for part in file.parts]
        parts = [
            {name: channel.pixels for name, channel in file.channels(k).items()}
            for k in range(len(names))
        ]
    if not any(parts):  # the library says so on stderr alone
        raise InputError(f"{path} is no readable EXR file (truncated or damaged); export it again.")
    layers = [
        layer for k in range(len(parts)) for layer in _layers(names[k], k, parts[k], len(parts))
    ]
    if not layers:
        raise no_picture(
            {name: pixels for channels in parts for name, pixels in channels.items()}, path
        )
    chosen = (
        min(layers, key=lambda layer: layer.rank)
        if wished is None
        else _named(layers, wished, path)
    )
    several = len(layers) > 1
    notes = [_choice(layers, chosen)] if several else []
    # --- Its pixels: linear Rec.709, at the display window, square ---
    header = headers[chosen.part]
    check_size(*exr_window(header, "displayWindow")[2:], path)
    del parts, layers  # the pixels of the others
    decoded = square_pixels(
        _light(chosen, header, path, notes), float(header.get("pixelAspectRatio", 1)), path
    )
    decoded.layer = chosen.name if several else None
    return decoded


def _layers(part_name: str, part: int, channels: dict[str, Array], parts: int) -> list[_Layer]:
    """The layers of a part that have colours, or light alone."""
    # --- All layers that could be the photo, and the one that is ---
    layers = []
    for layer, values in layers_of(channels).items():
        is_plain = parts == 1 and not layer
        # Named layers of X, Y and Z are places, not colours.
        colours = any(set(names) <= set(values) for names in (_RGB, _LUMINANCE_CHROMA))
        colours |= is_plain and set(_XYZ) <= set(values)
        grey = next((name for name in _LIGHT if name in values), None)
        if not colours and grey is None and len(channels) == len(values) == 1:
            grey = next((name for name in values if name not in GREY), None)
        if colours or grey:
            name = _full_name(part_name if parts > 1 else "", layer)
            layers.append(_Layer(name, part, values, None if colours else grey, is_plain))
    return layers


def _full_name(part: str, layer: str) -> str:
    """The part's name, and the layer's where it says more."""
    if part and layer and not (layer == part or layer.startswith(f"{part}.")):
        return f"{part}.{layer}"
    return layer or part or PLAIN


def _named(layers: Sequence[_Layer], name: str, path: Path) -> _Layer:
    """The layer of that name, whatever the case, or of that end of its name. Raises InputError."""
    small = name.casefold()
    same = [layer for layer in layers if layer.name.casefold() == small]
    ending = [layer for layer in layers if layer.name.casefold().endswith(f".{small}")]
    if same or len(ending) == 1:
        return [*same, *ending][0]
    raise InputError(
        f"{path} has no layer '{name}'; choose one of {', '.join(layer.name for layer in layers)}."
    )


def _choice(layers: Sequence[_Layer], chosen: _Layer) -> str:
    shown = ", ".join(layer.name for layer in layers[:_SHOWN])
    more = f" and {len(layers) - _SHOWN} more" if len(layers) > _SHOWN else ""
    return f"The EXR has the layers {shown}{more}; {chosen.name} is taken as the photo (option: layer)."


def _light(layer: _Layer, header: dict[str, Any], path: Path, notes: list[str]) -> Decoded:
    """The light and alpha of a layer in linear Rec.709, at the display window."""
    primaries = _primaries(header, notes)
    # --- Channels to RGB: grey, RGB, CIE XYZ, or luminance and chroma ---
    if layer.grey:
        grey = np.asarray(layer.channels[layer.grey], np.float32)
        pixels = np.repeat(grey[..., None], 3, -1)
        if "A" in layer.channels:
            pixels = np.concatenate([pixels, layer.channels["A"][..., None].astype(np.float32)], -1)
    elif "R" in layer.channels:
        pixels = stacked_channels(layer.channels, "RGB")
    elif set(_XYZ) <= set(layer.channels):
        primaries = CIE_XYZ
        pixels = stacked_channels(layer.channels, "XYZ")
        notes.append("The channels X, Y and Z are taken as CIE XYZ.")
    else:
        pixels = _from_luminance(layer.channels, primaries, exr_window(header, "dataWindow")[2:])
    # --- On the display window, with alpha laid on, in linear Rec.709 ---
    pixels = displayed(pixels, header, path)
    alpha = pixels[..., 3:] if pixels.shape[-1] == 4 else None
    if alpha is None:
        _note_border(header, notes)
    light = np.ascontiguousarray(pixels[..., :3])
    return light_and_alpha(transformed(light, to_rec709(primaries)), alpha, notes)


def _primaries(header: dict[str, Any], notes: list[str]) -> Primaries:
    """What a part's header says of its colours: chromaticities, or the name of a colour space; else Rec.709."""
    # --- Chromaticities before the name of a space; a name that is not known gets a note ---
    identity = str(header.get("colorInteropID", "") or "")
    stated = header.get("chromaticities")
    if stated is None and identity:
        convert = getattr(OpenEXR, "colorInteropIDToChromaticities", None)  # of OpenEXR 3.5
        stated = convert(identity) if convert and identity.startswith("lin_") else None
        if stated is None and identity not in ("unknown", "data"):
            notes.append(
                f"The EXR states the colour space {identity}, which is not known; it is taken as Rec.709."
            )
    if stated is None and header.get("acesImageContainerFlag"):
        notes.append("The EXR is marked as an ACES container: its colours are taken as ACES2065-1.")
        return ACES_AP0
    if stated is None:
        return REC709
    # Usable only where their matrix has an inverse: `rgb_to_xyz` raises otherwise.
    try:
        primaries = tuple(float(value) for value in stated)
        rgb_to_xyz(primaries)
    except (TypeError, ValueError) as error:
        notes.append(
            f"The chromaticities of the EXR cannot be used ({error}); it is taken as Rec.709."
        )
        return REC709
    return primaries


def _from_luminance(
    channels: dict[str, Array], primaries: Primaries, size: tuple[int, int]
) -> Array:
    """[H, W, 3 or 4] float32 RGB of luminance Y and chroma RY = (R - Y) / Y, BY = (B - Y) / Y (OpenEXR, ImfRgbaYca)."""
    y, ry, by = (_full(channels[name], size) for name in ("Y", "RY", "BY"))
    red = (ry + 1) * y
    blue = (by + 1) * y
    # Y = w_r R + w_g G + w_b B, solved for G.
    weights = rgb_to_xyz(primaries)[1].astype(np.float32)
    green = (y - red * weights[0] - blue * weights[2]) / weights[1]
    alpha = [_full(channels["A"], size)] if "A" in channels else []
    return np.stack([red, green, blue, *alpha], -1)


def _full(channel: Array, size: tuple[int, int]) -> Array:
    """A channel at (width, height): one that has every second sample is interpolated between its samples."""
    values = np.asarray(channel, np.float32)
    if values.shape == size[::-1]:
        return values
    steps = (math.ceil(size[0] / values.shape[1]), math.ceil(size[1] / values.shape[0]))
    # Samples of subsampled channels lie on the first of each group of pixels.
    between = np.array([[1 / steps[0], 0, 0], [0, 1 / steps[1], 0]], np.float32)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(
        cv2.warpAffine(values, between, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    )


def _note_border(header: dict[str, Any], notes: list[str]) -> None:
    """Say where the display window has no data."""
    left, top, wide, high = exr_window(header, "displayWindow")
    data_left, data_top, data_wide, data_high = exr_window(header, "dataWindow")
    covers = data_left <= left and data_top <= top
    if not (covers and data_left + data_wide >= left + wide and data_top + data_high >= top + high):
        notes.append(
            "The EXR's data does not fill its display window; the rest of the photo is black."
        )
