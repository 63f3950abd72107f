"""OpenEXR files of several parts, with the names that compositors know."""

import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from materialist import __version__
from materialist.errors import OutputError
from materialist.io.atomic import whole_file
from materialist.io.native import name_problem
from materialist.types import Array

LINEAR_REC709 = "lin_rec709_scene"
"""Of the Color Interop Forum: linear Rec.709 light."""
DATA = "data"
HALVES = ("albedo", "diffuse", "specular", "residual", "N")
"""Parts of 16 bits a channel: eleven bits of precision are enough to look at, and half as much to store."""
_AXES = ("N", "position")
_RANKS = 2
"""Things of a pixel that one part of a cryptomatte holds."""


def write_layers(
    path: str | Path,
    layers: Mapping[str, Array],
    things: Mapping[str, Array] | None = None,
    *,
    force: bool = False,
) -> None:
    """Write [H, W, 3] and [H, W] arrays of one size as the parts of an EXR, the first of them the picture.

    The first part has plain channels R, G, B; the others are named by part and channel (`albedo.R`, `N.X`, `Z`).
    things: name -> [H, W] coverage in [0, 1], written as a cryptomatte (Friedman and Jones, specification 1.2.0).
    Raises OutputError.
    """
    if problem := name_problem(path):
        raise OutputError(problem)
    parts = [_part(name, values, plain=k == 0) for k, (name, values) in enumerate(layers.items())]
    parts += _cryptomatte(things) if things else []
    with whole_file(path, force) as temporary:
        try:
            with OpenEXR.File(parts) as file:
                file.write(str(temporary))
        except (
            Exception
        ) as error:  # the bindings raise RuntimeError, ValueError or their own C++ types
            raise OutputError(f"{temporary} cannot be written: {error}") from error


def _part(name: str, values: Array, *, plain: bool) -> Any:
    pixels = np.asarray(values, np.float32)
    if name in HALVES:
        pixels = np.clip(pixels, -65504, 65504).astype(np.float16)
    if pixels.ndim == 2:
        channels = {name: np.ascontiguousarray(pixels)}
    else:
        prefix = "" if plain else f"{name}."
        letters = "XYZ" if name in _AXES else "RGB"
        channels = {
            f"{prefix}{c}": np.ascontiguousarray(pixels[..., k]) for k, c in enumerate(letters)
        }
    is_colour = pixels.ndim == 3 and name not in _AXES
    return OpenEXR.Part(
        _header(colorInteropID=LINEAR_REC709 if is_colour else DATA), channels, name
    )


def _header(**attributes: str) -> dict[str, Any]:
    return {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "software": f"Materialist {__version__}",
        **attributes,
    }


# Cryptomatte


def _cryptomatte(things: Mapping[str, Array]) -> list[Any]:
    """The preview part and the parts of ids and coverage, each pixel's things by their coverage."""
    names = list(things)
    coverage = np.stack([np.asarray(share, np.float32) for share in things.values()])
    # --- Of each pixel the things by their coverage, the largest first ---
    order = np.argsort(-coverage, 0, kind="stable")
    shares = np.take_along_axis(coverage, order, 0)
    ids = np.array([cryptomatte_id(name) for name in names], np.float32)[order]
    ids = np.where(shares > 0, ids, np.float32(0))
    # --- What the specification asks of the header ---
    key = f"{murmur3(b'CryptoObject'):08x}"[:7]
    manifest = {
        name: f"{struct.unpack('<I', struct.pack('<f', cryptomatte_id(name)))[0]:08x}"
        for name in names
    }
    facts = {
        f"cryptomatte/{key}/name": "CryptoObject",
        f"cryptomatte/{key}/hash": "MurmurHash3_32",
        f"cryptomatte/{key}/conversion": "uint32_to_float32",
        f"cryptomatte/{key}/manifest": json.dumps(manifest),
    }
    # --- Two ranks a part: id and coverage in R, G and B, A ---
    parts = []
    for level in range(-(-len(names) // _RANKS)):
        channels = {}
        for slot, (id_channel, share_channel) in enumerate((("R", "G"), ("B", "A"))):
            rank = _RANKS * level + slot
            empty = np.zeros(coverage.shape[1:], np.float32)
            part = f"CryptoObject{level:02d}"
            channels[f"{part}.{id_channel}"] = ids[rank].copy() if rank < len(names) else empty
            channels[f"{part}.{share_channel}"] = (
                shares[rank].copy() if rank < len(names) else empty
            )
        parts.append(
            OpenEXR.Part(
                _header(colorInteropID=DATA, **facts), channels, f"CryptoObject{level:02d}"
            )
        )
    return parts


def cryptomatte_id(name: str) -> float:
    """The hash of a name as a float that is neither infinite, NaN nor denormal (specification, "uint32_to_float32")."""
    number = murmur3(name.encode("utf-8"))
    if (number >> 23) & 255 in (0, 255):
        # Flip the lowest bit of the exponent, as the specification says.
        number ^= 1 << 23
    return float(struct.unpack("<f", struct.pack("<I", number))[0])


def murmur3(content: bytes) -> int:
    """MurmurHash3 of 32 bits (Appleby) with seed 0, by which cryptomattes name things."""
    whole = len(content) - len(content) % 4
    state = 0
    for (block,) in struct.iter_unpack("<I", content[:whole]):
        state = (_rotated(state ^ _scrambled(block), 13) * 5 + 0xE6546B64) & 0xFFFFFFFF
    state ^= _scrambled(int.from_bytes(content[whole:], "little")) ^ len(content)
    state = ((state ^ state >> 16) * 0x85EBCA6B) & 0xFFFFFFFF
    state = ((state ^ state >> 13) * 0xC2B2AE35) & 0xFFFFFFFF
    return state ^ state >> 16


def _scrambled(block: int) -> int:
    return (_rotated((block * 0xCC9E2D51) & 0xFFFFFFFF, 15) * 0x1B873593) & 0xFFFFFFFF


def _rotated(number: int, places: int) -> int:
    return (number << places | number >> (32 - places)) & 0xFFFFFFFF
