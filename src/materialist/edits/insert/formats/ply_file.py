"""The elements of a PLY file as arrays, whatever they mean."""

import struct
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from materialist.edits.insert.formats.source import MeshSource
from materialist.edits.insert.formats.text import line_blocks, parse_floats
from materialist.types import Array

HEADER_BYTES = 1 << 16
"""Longest header that is looked for."""
TYPES = {
    "char": "i1",
    "int8": "i1",
    "uchar": "u1",
    "uint8": "u1",
    "short": "i2",
    "int16": "i2",
    "ushort": "u2",
    "uint16": "u2",
    "int": "i4",
    "int32": "i4",
    "uint": "u4",
    "uint32": "u4",
    "float": "f4",
    "float32": "f4",
    "double": "f8",
    "float64": "f8",
}
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}
CHUNK = 1 << 20
"""Bytes that are gathered in one go."""


@dataclass(frozen=True)
class PlyProperty:
    """A line of the header."""

    name: str
    type: str
    """Numpy's, as declared."""
    stored: np.dtype
    """As it stands in the bytes: numbers of text were made float64."""
    stored_count: np.dtype | None = None
    """That of the length before a list; None for one number."""

    @property
    def least_bytes(self) -> int:
        """Bytes that it takes at least."""
        return (self.stored_count or self.stored).itemsize


@dataclass
class PlyElement:
    """The rows of an element of the file."""

    name: str
    count: int
    properties: list[PlyProperty] = field(default_factory=list)
    columns: dict[str, Array] = field(default_factory=dict)
    """Property -> [count] numbers."""
    lists: dict[str, tuple[Array, Array]] = field(default_factory=dict)
    """Property -> ([count] lengths, the numbers of all lists)."""

    def table(self, names: Sequence[str]) -> Array | None:
        """[count, n] float64 of properties; None where one is missing."""
        if not all(name in self.columns for name in names):
            return None
        return np.stack([self.columns[name] for name in names], -1).astype(np.float64)

    def kind(self, name: str) -> np.dtype:
        """Type of a property as declared."""
        return np.dtype(
            next(declared.type for declared in self.properties if declared.name == name)
        )


def read_elements(source: MeshSource) -> tuple[dict[str, PlyElement], list[str]]:
    """(elements by name, names of texture files). Raises InputError where the bytes are not what the header says."""
    elements, textures, order, start = _header(source)
    if order:
        data = np.frombuffer(source.data, np.uint8)
    else:
        data = _text_numbers(source, start)
        start = 0
    for element in elements.values():
        _check_size(source, element, len(data) - start)
        start = _read(source, data, start, element)
    return elements, textures


def _header(source: MeshSource) -> tuple[dict[str, PlyElement], list[str], str, int]:
    """(elements, texture files, byte order or nothing for text, where the header ends)."""
    # --- The text up to the line `end_header`, whichever way lines end ---
    head, mark, rest = source.data[:HEADER_BYTES].partition(b"end_header")
    if not head.startswith(b"ply") or not mark:
        raise source.damaged("it has no PLY header")
    end = len(head) + len(mark)
    end += 2 if rest[:2] == b"\r\n" else 1
    # --- Elements and their properties, in the order in which their bytes come ---
    elements: dict[str, PlyElement] = {}
    textures: list[str] = []
    order = None
    for line in head.decode("latin-1").splitlines()[1:]:
        words = line.split()
        match words:
            case ["format", name, *_]:
                order = ORDERS.get(name)
            case ["comment", "TextureFile", *_]:
                textures.append(line.split(None, 2)[2].strip())
            case ["element", name, count] if (
                count.isascii() and count.isdigit() and name not in elements
            ):
                elements[name] = PlyElement(name, int(count[:18]))
            case ["property", *_] if elements and order is not None:
                list(elements.values())[-1].properties.append(_property(source, words[1:], order))
            case ["element" | "property", *_]:
                raise source.damaged(f"the line '{line[:80]}' of its header")
    if order is None:
        raise source.damaged("its header names no format that is known")
    return elements, textures, order, end


def _property(source: MeshSource, words: list[str], order: str) -> PlyProperty:
    try:
        *_, kind, name = words
        stored = np.dtype(order + TYPES[kind]) if order else np.dtype("f8")
        if len(words) == 2:
            return PlyProperty(name, TYPES[kind], stored)
        mark, length, _, _ = words
        counts = np.dtype(order + TYPES[length]) if order else np.dtype("f8")
        if mark != "list" or TYPES[length].startswith("f"):
            raise KeyError(mark)
        return PlyProperty(name, TYPES[kind], stored, counts)
    except (KeyError, ValueError) as error:
        raise source.damaged(f"the property '{' '.join(words)[:80]}' of its header") from error


def _text_numbers(source: MeshSource, start: int) -> Array:
    """The numbers of a text as the bytes of float64."""
    blocks = [np.zeros(0)]
    for lines in line_blocks(source, source.data, start):
        blocks.append(parse_floats(source, b" ".join(lines).split()))
    return np.concatenate(blocks).view(np.uint8)


def _check_size(source: MeshSource, element: PlyElement, room: int) -> None:
    """Raise InputError for more rows than bytes, before any memory is taken for them."""
    if element.name == "vertex":
        source.check("vertices", element.count)
    if element.name == "face":
        source.check("faces", element.count)
    least = element.count * sum(declared.least_bytes for declared in element.properties)
    if least > room:
        raise source.damaged(
            f"damaged: its header counts {element.count} of '{element.name[:40]}', at least {least} bytes, and {room} "
            "bytes are left"
        )


def _read(source: MeshSource, data: Array, start: int, element: PlyElement) -> int:
    """Fill the element with its rows, which begin at `start`; returns where they end."""
    if not element.properties or not element.count:
        return start
    table = _uniform(data, start, element)
    if table is None:
        return _ragged(source, data, start, element)
    for declared in element.properties:
        values = table[declared.name]
        if declared.stored_count is None:
            element.columns[declared.name] = values
        else:
            element.lists[declared.name] = (
                table[_length(declared)].astype(np.int64),
                values.ravel(),
            )
    return start + table.nbytes


def _length(listed: PlyProperty) -> str:
    return f"length of {listed.name}"


def _uniform(data: Array, start: int, element: PlyElement) -> Array | None:
    """[count] rows where all are as long as the first, as those of triangles are; None where they are not."""
    fields: list[tuple] = []
    offset = start
    for declared in element.properties:
        if declared.stored_count is None:
            fields.append((declared.name, declared.stored))
            offset += declared.stored.itemsize
            continue
        # The first row tells the lengths; whether all rows have them is checked at the end.
        length = _number(data, offset, declared.stored_count)
        offset += declared.stored_count.itemsize + length * declared.stored.itemsize
        if not 0 <= length <= 255 or offset > len(data):
            return None
        fields += [
            (_length(declared), declared.stored_count),
            (declared.name, declared.stored, (length,)),
        ]
    # --- All rows at once, if the file has room for them ---
    try:
        rows = np.dtype(fields)
    except ValueError:  # a name twice
        return None
    if len(data) - start < rows.itemsize * element.count:
        return None
    table = np.frombuffer(data.data, rows, element.count, start)
    lengths = [
        table[_length(declared)]
        for declared in element.properties
        if declared.stored_count is not None
    ]
    return table if all((length == length[0]).all() for length in lengths) else None


def _number(data: Array, offset: int, kind: np.dtype) -> int:
    """A whole number of the bytes; -1 where there is none."""
    if offset + kind.itemsize > len(data):
        return -1
    value = float(np.frombuffer(data.data, kind, 1, offset)[0])
    return int(value) if 0 <= value < 2**31 else -1


def _ragged(source: MeshSource, data: Array, start: int, element: PlyElement) -> int:
    """Fill an element whose lists differ in length, row by row."""
    # --- Walk the rows: where each value begins, and how many there are ---
    starts = [array("q") for _ in element.properties]
    lengths = [array("q") for _ in element.properties]
    formats = [
        declared.stored_count and struct.Struct(_struct(declared.stored_count))
        for declared in element.properties
    ]
    sizes = [declared.stored.itemsize for declared in element.properties]
    bytes_ = data.data
    end = start
    try:
        for _ in range(element.count):
            for k, counts in enumerate(formats):
                length = 1
                if counts:
                    length = int(counts.unpack_from(bytes_, end)[0])
                    end += counts.size
                if length < 0:
                    raise ValueError("negative")
                starts[k].append(end)
                lengths[k].append(length)
                end += length * sizes[k]
            if end > len(data):
                raise ValueError("beyond the end")
    except (struct.error, ValueError, OverflowError) as error:
        row = len(starts[0])
        raise source.damaged(
            f"damaged: row {row} of '{element.name[:40]}' does not end within the file"
        ) from error
    # --- Gather each property from all rows ---
    for k, declared in enumerate(element.properties):
        begin = np.frombuffer(starts[k], np.int64)
        size = np.frombuffer(lengths[k], np.int64)
        values = _gathered(data, begin, size, declared.stored)
        if declared.stored_count is None:
            element.columns[declared.name] = values
        else:
            element.lists[declared.name] = (size, values)
    return end


def _struct(kind: np.dtype) -> str:
    order = ">" if kind.byteorder == ">" else "<"
    return order + kind.char


def _gathered(data: Array, begin: Array, lengths: Array, kind: np.dtype) -> Array:
    """The numbers of lists that begin at these bytes, one list after the other."""
    values = np.empty(int(lengths.sum()), kind)
    place = np.cumsum(lengths) - lengths
    # Lists of one length are gathered together, as rows of a table.
    for length in np.unique(lengths[lengths > 0]):
        rows = np.flatnonzero(lengths == length)
        width = int(length) * kind.itemsize
        step = max(CHUNK // width, 1)
        for first in range(0, len(rows), step):
            chosen = rows[first : first + step]
            part = np.ascontiguousarray(data[begin[chosen, None] + np.arange(width)])
            values[place[chosen, None] + np.arange(length)] = part.view(kind)
    return values
