"""Wavefront OBJ, read a block of lines at a time."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import chain

import numpy as np

from materialist.color import srgb_to_linear
from materialist.edits.insert.formats.content import (
    MeshContent,
    MeshPart,
    compacted,
    mean_of_corners,
)
from materialist.edits.insert.formats.mtl import MtlLibrary
from materialist.edits.insert.formats.polygons import triangulated
from materialist.edits.insert.formats.source import MeshSource
from materialist.edits.insert.formats.text import line_blocks, parse_floats
from materialist.types import Array

NONE = -1
"""Number of a texture coordinate or a normal that a corner does not have."""
COLUMNS = {b"v": 3, b"vt": 2, b"vn": 3}
"""Lines of numbers -> how many are read of each, at least."""
LEFT_OUT = {
    b"l": "its lines and points",
    b"p": "its lines and points",
    b"curv": "its curves and curved surfaces",
    b"surf": "its curves and curved surfaces",
}


@dataclass
class _Lines:
    """What the lines of one block say, sorted by kind."""

    values: dict[bytes, list[list[bytes]]] = field(
        default_factory=lambda: {b"v": [], b"vt": [], b"vn": []}
    )
    """Words of vertices, texture coordinates and normals."""
    corners: list[bytes] = field(default_factory=list)
    """As in `3/1/2`, polygon after polygon."""
    counts: list[int] = field(default_factory=list)
    """Corners of each polygon."""
    before: list[tuple[int, int, int]] = field(default_factory=list)
    """How many vertices, texture coordinates and normals of this block come before each polygon."""


@dataclass
class _Obj:
    """The file as far as it is read."""

    values: dict[bytes, list[Array]] = field(
        default_factory=lambda: {b"v": [], b"vt": [], b"vn": []}
    )
    """Blocks of [n, 3] or [n, 6] (position, and colour), [n, 2] and [n, 3]; NaN for what a line does not have."""
    sizes: dict[bytes, int] = field(default_factory=lambda: {b"v": 0, b"vt": 0, b"vn": 0})
    corners: list[Array] = field(default_factory=list)
    """Blocks of [n, 3] int32: numbers of vertex, texture coordinate and normal, from 0."""
    counts: list[Array] = field(default_factory=list)
    polygons: int = 0
    triangles: int = 0
    materials: list[bytes] = field(default_factory=lambda: [b""])
    changes: list[tuple[int, int]] = field(default_factory=lambda: [(0, 0)])
    """(first polygon, number of its material)."""
    libraries: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def read_obj(source: MeshSource) -> MeshContent:
    """The faces of an OBJ, a part for each material; groups and smoothing groups are not kept.

    Colours behind the vertices are read as sRGB, in 0 to 1 or, where one exceeds 1, in 0 to 255.
    Raises InputError for damaged text, and beyond the limits.
    """
    obj = _Obj()
    for lines in line_blocks(source, source.data):
        _add(source, obj, _sorted_lines(source, obj, lines))
    content = MeshContent(left_out=list(dict.fromkeys(obj.left_out)))
    if obj.polygons:
        _fill(source, obj, content)
    return content


def _sorted_lines(source: MeshSource, obj: _Obj, lines: Sequence[bytes]) -> _Lines:
    block = _Lines()
    vertices, uvs, normals = block.values.values()
    for line in lines:
        words = line.split()
        if b"#" in line:
            words = _uncommented(words)
        if not words:
            continue
        # Sorted by kind; numbers are read later, all of a kind at once.
        kind = words[0]
        if kind in block.values:
            block.values[kind].append(words[1:])
        elif kind == b"f":
            corners = words[1:]
            block.corners += corners
            block.counts.append(len(corners))
            block.before.append((len(vertices), len(uvs), len(normals)))
        elif kind == b"usemtl":
            _use_material(source, obj, line.split(None, 1)[1:], obj.polygons + len(block.counts))
        elif kind == b"mtllib":
            obj.libraries += [
                library.decode("utf-8", "replace") for library in line.split(None, 1)[1:]
            ]
        elif kind in LEFT_OUT:
            obj.left_out.append(LEFT_OUT[kind])
    return block


def _uncommented(words: list[bytes]) -> list[bytes]:
    for k, word in enumerate(words):
        if word.startswith(b"#"):
            return words[:k]
    return words


def _use_material(source: MeshSource, obj: _Obj, name: list[bytes], polygon: int) -> None:
    key = name[0].strip() if name else b""
    if key not in obj.materials:
        obj.materials.append(key)
        source.check("materials", len(obj.materials))
    obj.changes.append((polygon, obj.materials.index(key)))


def _add(source: MeshSource, obj: _Obj, block: _Lines) -> None:
    """Add the numbers of a block, after a look at how many there are."""
    # --- Vertices, texture coordinates and normals as tables ---
    before = dict(obj.sizes)
    for kind, columns in COLUMNS.items():
        rows = block.values[kind]
        if rows:
            obj.sizes[kind] += len(rows)
            source.check("vertices", obj.sizes[kind])
            obj.values[kind].append(_table(source, rows, columns))
    if not block.counts:
        return
    # --- Polygons: the corners of each, counted from 1, or back from the line they stand on ---
    counts = np.array(block.counts, np.int32)
    obj.polygons += len(counts)
    obj.triangles += int(np.maximum(counts - 2, 0).sum())
    source.check("faces", obj.triangles)
    obj.counts.append(counts)
    numbers = _corner_numbers(source, block.corners)
    start = np.array(block.before, np.int64) + list(before.values())
    start = np.repeat(start, counts, axis=0)  # numbers below zero count back from their line
    numbers = np.where(numbers < 0, numbers + start, numbers - 1)
    numbers[numbers < 0] = NONE
    if (numbers[:, 0] == NONE).any() or (numbers >= 2**31).any():
        raise source.damaged("a face begins with a vertex that does not exist")
    obj.corners.append(numbers.astype(np.int32))


def _table(source: MeshSource, rows: list[list[bytes]], columns: int) -> Array:
    """[n, columns] float64 of lines of words, [n, 6] where vertices have colours; NaN where a line has fewer."""
    lengths = set(map(len, rows))
    if columns == 3 and max(lengths) >= 6:
        columns = 6
        rows = [row[:3] if len(row) < 6 else row for row in rows]  # x y z w
        lengths = set(map(len, rows))
    if lengths != {columns}:
        rows = [[*row, *[b"nan"] * columns][:columns] for row in rows]
    return parse_floats(source, list(chain.from_iterable(rows))).reshape(-1, columns)


def _corner_numbers(source: MeshSource, corners: list[bytes]) -> Array:
    """[n, 3] int64 of corners as in `3`, `3/1`, `3//2` or `3/1/2`, as the file counts; 0 for none."""
    # --- The usual case: all corners alike, so that one pass over the text splits them ---
    slashes = corners[0].count(b"/") if corners else 0
    text = b" ".join(corners)
    if slashes <= 2 and all(corner.count(b"/") == slashes for corner in corners):
        words = text.replace(b"//", b"/0/").replace(b"/", b" ").split()
        if len(words) == len(corners) * (slashes + 1):
            numbers = parse_floats(source, words).reshape(-1, slashes + 1)
            return _whole(source, np.pad(numbers, ((0, 0), (0, 2 - slashes))))
    # --- Mixed corners, one by one ---
    parts = [[*corner.split(b"/"), b"0", b"0"][:3] for corner in corners]
    return _whole(
        source,
        parse_floats(source, [word or b"0" for part in parts for word in part]).reshape(-1, 3),
    )


def _whole(source: MeshSource, numbers: Array) -> Array:
    if not (np.abs(numbers) < 2**31).all():
        raise source.damaged("a face has a number that is none")
    return numbers.astype(np.int64)


def _fill(source: MeshSource, obj: _Obj, content: MeshContent) -> None:
    """Make the parts of all that was read; empties the lists on the way."""
    # --- All blocks as one; every corner must have what it names ---
    tables = {kind: _joined_blocks(blocks, COLUMNS[kind]) for kind, blocks in obj.values.items()}
    corners = np.concatenate(obj.corners)
    obj.corners.clear()
    for column, table in enumerate(tables.values()):
        if len(corners) and corners[:, column].max() >= len(table):
            raise source.damaged(
                "a face has a vertex, texture coordinate or normal that does not exist"
            )
    positions = tables[b"v"][:, :3]
    colours = tables[b"v"][:, 3:] if tables[b"v"].shape[1] == 6 else None
    faces, polygon = triangulated(source, positions, np.concatenate(obj.counts), corners[:, 0])

    # --- The material of each triangle: that of the last `usemtl` before its polygon ---
    first, number = np.array(obj.changes, np.int64).T
    material = number[np.searchsorted(first, polygon, "right") - 1]
    used = np.unique(material)
    names = {int(k): obj.materials[k].decode("utf-8", "replace") for k in used}
    MtlLibrary(source, obj.libraries).paints(names.values(), content)
    # --- A part for each of them ---
    for k, name in names.items():
        paint = content.paints.get(name)
        chosen = corners[faces[material == k].ravel()]
        part = _part(chosen, positions, tables, None if paint else colours)
        if paint and part.uv is not None:
            part = replace(part, uv=paint.layout.placed(part.uv))
        content.parts.append(replace(part, paint=paint and name, name=name or source.path.stem))
    if content.paints and colours is not None:
        content.left_out.append("the colours of its vertices")


def _distinct(corners: Array) -> tuple[Array, Array]:
    """(number [n] int32 of each row among the different ones, where each of those is first) of rows [n, k]."""
    key = corners[:, 0].astype(np.int64)
    for column in range(1, corners.shape[1]):
        if column > 1:
            _, key = np.unique(key, return_inverse=True)  # keeps the product below within 64 bits
        key = key * (int(corners[:, column].max()) + 1) + corners[:, column]
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    return number.astype(np.int32), first


def _joined_blocks(blocks: list[Array], columns: int) -> Array:
    """The rows of all blocks, which are let go."""
    width = max((block.shape[1] for block in blocks), default=columns)
    table = np.full((sum(map(len, blocks)), width), np.nan)
    start = 0
    for block in blocks:
        table[start : start + len(block), : block.shape[1]] = block
        start += len(block)
    blocks.clear()
    return table


def _part(
    corners: Array, positions: Array, tables: dict[bytes, Array], colours: Array | None
) -> MeshPart:
    """The part of corners [3 F, 3]; corners that agree in everything become one vertex."""
    # Texture coordinates and normals count where all corners have them.
    has_uv = bool((corners[:, 1] != NONE).all())
    has_normals = bool((corners[:, 2] != NONE).all())
    if has_uv or has_normals:
        faces, first = _distinct(corners[:, [True, has_uv, has_normals]])
        vertex, uv, normal = corners[first].T
    else:
        faces, vertex = compacted(corners[:, 0], len(positions))
        uv = normal = vertex
    faces = faces.reshape(-1, 3)
    face_colours = None
    if colours is not None and np.isfinite(colours[vertex]).all():
        # Vertex colours have no standard: above 1 they are taken as levels of 255.
        scale = 255 if colours[vertex].max() > 1 else 1
        linear = srgb_to_linear(np.clip(colours[vertex] / scale, 0, 1))
        face_colours = mean_of_corners(linear, faces)
    return MeshPart(
        positions[vertex],
        faces,
        normals=tables[b"vn"][normal] if has_normals else None,
        uv=tables[b"vt"][uv] * [1, -1] + [0, 1] if has_uv else None,
        face_colours=face_colours,
    )
