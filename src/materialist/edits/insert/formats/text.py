"""Text files a block of lines at a time, so that no list holds the whole of one."""

from collections.abc import Iterator, Sequence

import numpy as np

from materialist.edits.insert.formats.source import MeshSource
from materialist.types import Array

BLOCK = 1 << 20
"""Bytes that are split into lines at a time; their tokens take about 30 times as much."""


def line_blocks(source: MeshSource, data: bytes, start: int = 0) -> Iterator[list[bytes]]:
    """The lines of a text from `start`; any line ends, a byte order mark, lines continued by a backslash."""
    if data[start : start + 3] == b"\xef\xbb\xbf":
        start += 3
    rest = b""
    for begin in range(start, len(data), BLOCK):
        text = rest + data[begin : begin + BLOCK]
        half_end = b"\r" if text.endswith(b"\r") and begin + BLOCK < len(data) else b""
        text = text[: len(text) - len(half_end)]
        text = text.replace(b"\r\n", b"\n").replace(b"\r", b"\n").replace(b"\\\n", b" ")
        lines = text.split(b"\n")
        rest = lines.pop() + half_end
        source.check("line_bytes", len(rest))
        yield lines
    yield [rest]


def parse_floats(source: MeshSource, tokens: Sequence[bytes]) -> Array:
    """[n] float64 of words. Raises InputError for a word that is no number."""
    try:
        return np.array(tokens, np.float64) if tokens else np.zeros(0)
    except ValueError as error:
        raise source.damaged(str(error)) from error
