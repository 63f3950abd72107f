"""What trimesh takes wrong in an .obj: polygons that bulge inwards, numbers counted from the end, several libraries."""

from __future__ import annotations

import re
from collections import defaultdict

import numpy as np

from materialist.edits.insert.mesh_folder import LIBRARY, TOGETHER, MeshFolder
from materialist.types import Array

POLYGON = re.compile(rb"(?m)^[ \t]*f(?:[ \t]+[^\s#]+){4,}|^[ \t]*f[ \t][^\r\n]*-")
"""A line of a face that may need another spelling: more than three corners, or numbers counted from the end."""
STRAIGHT = 1e-6
"""A corner bulges inwards where its sine exceeds this, relative to the polygon's area."""


def prepared(data: bytes, folder: MeshFolder) -> bytes:
    """The bytes of an .obj with faces of three corners where a fan would be wrong, and one library of materials.

    trimesh cuts polygons into fans about their first corner, reads the first `mtllib` alone, and as one name, and takes
    negative numbers from the end of the file, not from their line. Bytes that cannot be read so come back as they are.
    """
    data = _one_library(data, folder)
    if POLYGON.search(data) is None:
        return data
    lines = re.sub(rb"\\\r?\n", b" ", data).replace(b"\r\n", b"\n").split(b"\n")
    try:
        return b"\n".join(_spelled(lines))
    except (ValueError, IndexError):
        return data


def _one_library(data: bytes, folder: MeshFolder) -> bytes:
    """The bytes with one `mtllib`, for trimesh reads the first line alone, and as one name."""
    names = folder.libraries(data)
    if len(names) < 2:
        return data
    folder.together[TOGETHER] = names
    return b"mtllib " + TOGETHER.encode() + b"\n" + LIBRARY.sub(b"", data)


def _spelled(lines: list[bytes]) -> list[bytes]:
    """The lines with absolute numbers, and concave polygons as triangles."""
    points: list[list[float]] = []
    counts = [0, 0, 0]  # v, vt, vn so far
    wide: dict[int, list[tuple[int, list[bytes]]]] = defaultdict(list)
    for k, line in enumerate(lines):
        words = line.split(b"#", 1)[0].split()
        if not words:
            continue
        if words[0] in (b"v", b"vt", b"vn"):
            counts[(b"v", b"vt", b"vn").index(words[0])] += 1
            if words[0] == b"v":
                points.append([float(word) for word in words[1:4]])
        elif words[0] == b"f":
            corners = words[1:]
            if b"-" in line:
                corners = [_absolute(corner, counts) for corner in corners]
                lines[k] = b"f " + b" ".join(corners)
            if len(corners) > 3:
                wide[len(corners)].append((k, corners))
    places = np.asarray(points, np.float64).reshape(-1, 3)
    for faces in wide.values():
        number = np.array([[int(corner.split(b"/")[0]) - 1 for corner in corners] for _, corners in faces])
        if number.min() < 0:
            raise IndexError("a face has a corner of number 0")
        for row in np.flatnonzero(_concave(places[number])):
            k, corners = faces[row]
            triangles = _cut(places[number[row]])
            if len(triangles):
                lines[k] = b"\n".join(b"f " + b" ".join(corners[i] for i in triangle) for triangle in triangles)
    return lines


def _absolute(corner: bytes, counts: list[int]) -> bytes:
    """A corner such as -1/-1/-1 with numbers from the beginning of the file."""
    parts = [int(part) if part else None for part in corner.split(b"/")]
    counted = [n if n is None or n > 0 else counts[k] + 1 + n for k, n in enumerate(parts)]
    return b"/".join(b"" if n is None else b"%d" % n for n in counted)


def _concave(corners: Array) -> Array:
    """[F] whether polygons [F, n, 3] have a corner that bulges inwards."""
    normal = _normal(corners)
    ahead = np.roll(corners, -1, 1) - corners
    turn = np.cross(ahead, np.roll(ahead, -1, 1))
    return ((turn * normal[:, None]).sum(-1) < -STRAIGHT * (normal**2).sum(-1)[:, None]).any(1)


def _normal(corners: Array) -> Array:
    """[F, 3] twice the area of polygons [F, n, 3] along their normals (Newell)."""
    centred = corners - corners.mean(1, keepdims=True)
    return np.cross(centred, np.roll(centred, -1, 1)).sum(1)


def _cut(corners: Array) -> Array:
    """[T, 3] corners of triangles that fill a polygon [n, 3], turning as it does; none where it has no area."""
    import mapbox_earcut

    normal = _normal(corners[None])[0]
    length = np.linalg.norm(normal)
    if length == 0:
        return np.zeros((0, 3), int)
    axes = np.linalg.svd(normal[None] / length)[2][1:]  # two directions across the normal
    axes = axes if np.cross(axes[0], axes[1]) @ normal > 0 else axes[::-1]
    flat = np.ascontiguousarray((corners - corners.mean(0)) @ axes.T)
    found = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], np.uint32)).reshape(-1, 3).astype(int)
    a, b, c = (flat[found[:, k]] for k in range(3))
    turns = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    return np.where((turns < 0)[:, None], found[:, ::-1], found)
