"""STL, binary and text."""

import struct

import numpy as np

from materialist.edits.insert.formats.content import MeshContent, MeshPart
from materialist.edits.insert.formats.source import MeshSource
from materialist.edits.insert.formats.text import line_blocks, parse_floats
from materialist.types import Array

HEADER = 84
"""Bytes before the first facet: a text, and how many facets follow."""
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("colour", "<u2")])


def read_stl(source: MeshSource) -> MeshContent:
    """The facets of an STL; their normals are computed anew. Raises InputError for damaged bytes and too many."""
    data = source.data
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= HEADER else 0
    fits = len(data) >= HEADER + count * FACET.itemsize
    exact = len(data) == HEADER + count * FACET.itemsize
    # Binary files may begin with "solid", too: the number of bytes decides.
    is_text = (
        data[:512].lstrip(b"\xef\xbb\xbf \t\r\n").lower().startswith(b"solid")
        and b"vertex" in data[:65536].lower()
    )
    if is_text and not exact:
        return _content(source, _text_corners(source))
    if not fits or count == 0:
        room = max(len(data) - HEADER, 0) // FACET.itemsize
        raise source.damaged(
            f"damaged: its header counts {count} facets, and it has bytes for {room}"
        )
    source.check("faces", count)
    facets = np.frombuffer(data, FACET, count, HEADER)
    content = _content(source, facets["corners"].reshape(-1, 3).copy())
    if facets["colour"].any():
        content.left_out.append("the colour of its facets")
    return content


def _content(source: MeshSource, corners: Array) -> MeshContent:
    faces = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    return MeshContent([MeshPart(corners, faces, name=source.path.stem)])


def _text_corners(source: MeshSource) -> Array:
    """[3 F, 3] float64."""
    blocks = [np.zeros((0, 3))]
    count = 0
    for lines in line_blocks(source, source.data):
        rows = [
            words for words in map(bytes.split, lines) if words and words[0].lower() == b"vertex"
        ]
        if any(len(words) != 4 for words in rows):
            raise source.damaged("a vertex has not three numbers")
        count += len(rows)
        source.check("faces", count // 3)
        numbers = parse_floats(source, [word for words in rows for word in words[1:]])
        blocks.append(numbers.reshape(-1, 3))
    if count % 3:
        raise source.damaged(f"it ends within a triangle: {count} vertices")
    return np.concatenate(blocks)
