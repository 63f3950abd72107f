"""The smallest camera RAW file: an uncompressed DNG of a colour filter array."""

import struct
from pathlib import Path
from typing import Any

import numpy as np

_FORMAT = {1: "B", 2: "B", 3: "H", 4: "I", 5: "II", 10: "ii"}
_XYZ_TO_SRGB = [3.2404542, -1.5371385, -0.4985314, -0.969266, 1.8760108, 0.041556, 0.0556434, -0.2040259, 1.0572252]


def write_dng(path: Path, mosaic: np.ndarray, focal_35mm: int) -> None:
    """Write [H, W] values in 0 .. 65535, RGGB, of a camera whose primaries are sRGB and whose white balance is 1."""
    height, width = mosaic.shape
    data = mosaic.astype("<u2").tobytes()
    exif: dict[int, tuple[int, Any]] = {41989: (3, [focal_35mm])}
    main: dict[int, tuple[int, Any]] = {
        254: (4, [0]), 256: (4, [width]), 257: (4, [height]), 258: (3, [16]), 259: (3, [1]), 262: (3, [32803]),
        271: (2, b"Test\0"), 272: (2, b"Camera\0"), 273: (4, [0]), 274: (3, [1]), 277: (3, [1]), 278: (4, [height]),
        279: (4, [len(data)]), 284: (3, [1]), 33421: (3, [2, 2]), 33422: (1, bytes([0, 1, 1, 2])), 34665: (4, [0]),
        50706: (1, bytes([1, 4, 0, 0])), 50708: (2, b"Test Camera\0"), 50717: (4, [65535]),
        50721: (10, [part for v in _XYZ_TO_SRGB for part in (round(v * 10000), 10000)]), 50728: (5, [1] * 6),
        50778: (3, [21]),
    }  # fmt: skip
    start = 8 + len(_directory(main, 8))
    main[34665] = (4, [start])
    main[273] = (4, [start + len(_directory(exif, start))])
    path.write_bytes(b"II*\0\x08\0\0\0" + _directory(main, 8) + _directory(exif, start) + data)


def _directory(tags: dict[int, tuple[int, Any]], start: int) -> bytes:
    """A TIFF directory at `start`, with the values that do not fit in it right behind."""
    entries, behind = b"", b""
    end = start + 2 + 12 * len(tags) + 4
    for tag, (kind, values) in sorted(tags.items()):
        packed = b"".join(struct.pack("<" + _FORMAT[kind][0], value) for value in values)
        count = len(values) // len(_FORMAT[kind])
        if len(packed) > 4:
            place = struct.pack("<I", end + len(behind))
            behind += packed + b"\0" * (len(packed) % 2)
        else:
            place = packed.ljust(4, b"\0")
        entries += struct.pack("<HHI", tag, kind, count) + place
    return struct.pack("<H", len(tags)) + entries + b"\0\0\0\0" + behind
