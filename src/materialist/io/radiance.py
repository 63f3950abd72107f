"""Radiance HDR pictures (.hdr): their header's colours, exposure and orientation, around OpenCV's decoder."""

import math
import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from materialist.errors import InputError
from materialist.io.bitmap import Decoded, levels_of, square_pixels
from materialist.io.colour_space import CIE_XYZ, REC709, Primaries, to_rec709, transformed

MAGIC = (b"#?RADIANCE", b"#?RGBE")
"""How such files begin."""
_HEAD_BYTES = 65536
_RESOLUTION = re.compile(rb"\n([-+])([XY]) (\d{1,9}) ([-+])([XY]) (\d{1,9})\n")


@dataclass(frozen=True)
class RadianceHeader:
    """What the lines before the pixels say."""

    variables: list[tuple[str, str]]
    """Names and values in the order of the file; factors may come more than once and multiply."""
    axes: tuple[str, str]
    """Direction of the scan lines' order and of the pixels in one, such as -Y and +X."""
    counts: tuple[int, int]
    """Scan lines, and pixels in one."""
    bytes: int

    @property
    def size(self) -> tuple[int, int]:
        """(width, height)."""
        return self.counts if "X" in self.axes[0] else self.counts[::-1]

    def values(self, name: str) -> list[str]:
        return [value for variable, value in self.variables if variable == name]


def radiance_header(path: Path) -> RadianceHeader:
    """The header of a file. Raises InputError where it has no size."""
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    size = _RESOLUTION.search(head)
    if size is None or size[2] == size[5]:
        raise InputError(f"{path} has no size in its Radiance header; export it again.")
    lines = head[: size.start()].decode("latin-1").split("\n")
    pairs = [
        (name.strip(), value.strip())
        for name, mark, value in (line.partition("=") for line in lines)
        if mark
    ]
    axes = ((size[1] + size[2]).decode(), (size[4] + size[5]).decode())
    return RadianceHeader(pairs, axes, (int(size[3]), int(size[6])), size.end())


def read_radiance(path: Path) -> Decoded:
    """The light in a Radiance picture: in linear Rec.709, upright, without its exposure. Raises InputError."""
    header = radiance_header(path)
    lines, length = header.counts
    # OpenCV knows one orientation and one format; the pixels of all are packed in the same way.
    plain = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {lines} +X {length}\n".encode()
    content = np.concatenate(
        [np.frombuffer(plain, np.uint8), np.fromfile(path, np.uint8, offset=header.bytes)]
    )
    # OpenCV writes a scratch file before it decodes.
    scratch = os.environ.get("OPENCV_TEMP_PATH", "/tmp")
    if os.path.isdir(scratch) and not os.access(scratch, os.W_OK):
        raise InputError(
            f"{path} cannot be decoded: {scratch} is read-only; set OPENCV_TEMP_PATH to another folder."
        )
    light = levels_of(content, path)[0]
    if light.dtype != np.float32:
        raise InputError(f"{path} is no Radiance picture that can be read; export it as EXR.")
    # --- Upright: scan lines from the top, pixels from the left ---
    light = light.swapaxes(0, 1) if "X" in header.axes[0] else light
    light = light[::-1] if "+Y" in header.axes else light
    light = np.array(light[:, ::-1] if "-X" in header.axes else light, order="C")
    notes: list[str] = []
    # --- Without exposure and colour correction, which the pixels already include ---
    factor = _product(header, "EXPOSURE", 1, notes) * _product(header, "COLORCORR", 3, notes)
    if (factor != 1).any():
        light /= factor.astype(np.float32)
    transformed(light, to_rec709(_primaries(header, notes)))
    if (_product(header, "GAMMA", 1, notes) != 1).any():
        notes.append(
            "The line GAMMA of the Radiance header is not used: the values are taken as light."
        )
    # --- Square pixels ---
    tall = _product(header, "PIXASPECT", 1, notes)[0]
    return square_pixels(Decoded(light, True, warnings=notes), 1 / tall, path)


def _product(header: RadianceHeader, name: str, count: int, notes: list[str]) -> np.ndarray:
    """[count] float64: all factors of that name multiplied; 1 where there is none."""
    total = np.ones(count)
    for text in header.values(name):
        total = total * _checked(name, text, count, np.ones(count), notes, _are_factors)
    return total


def _primaries(header: RadianceHeader, notes: list[str]) -> Primaries:
    if any("xyze" in text for text in header.values("FORMAT")):
        return CIE_XYZ
    for text in header.values("PRIMARIES")[-1:]:
        return tuple(_checked("PRIMARIES", text, 8, np.array(REC709), notes, _span_colours))
    return REC709


def _checked(
    name: str,
    text: str,
    count: int,
    default: np.ndarray,
    notes: list[str],
    is_valid: Callable[[np.ndarray], bool],
) -> np.ndarray:
    """`count` numbers of a header's line, or the default and a note."""
    try:
        numbers = np.array([float(part) for part in text.split()])
        if len(numbers) == count and is_valid(numbers):
            return numbers
    except ValueError:
        pass
    notes.append(
        f"The line {name}={text[:60]} of the Radiance header cannot be used; it is left out."
    )
    return default


def _are_factors(numbers: np.ndarray) -> bool:
    return all(math.isfinite(number) and 1e-12 < number < 1e12 for number in numbers)


def _span_colours(numbers: np.ndarray) -> bool:
    to_rec709(tuple(numbers))  # raises ValueError
    return True
