"""PLY meshes: what the elements of the file mean."""

from dataclasses import replace

import numpy as np

from materialist.color import srgb_to_linear
from materialist.edits.core.surfaces import uniform_surface
from materialist.edits.insert.formats.content import (
    MeshContent,
    MeshPart,
    Paint,
    mean_of_corners,
    strip_faces,
)
from materialist.edits.insert.formats.ply_file import PlyElement, read_elements
from materialist.edits.insert.formats.polygons import triangulated
from materialist.edits.insert.formats.source import MeshSource
from materialist.edits.insert.formats.textures import GREY, Textures
from materialist.types import Array

INDICES = ("vertex_indices", "vertex_index")
COLOURS = (
    ("red", "green", "blue"),
    ("diffuse_red", "diffuse_green", "diffuse_blue"),
    ("r", "g", "b"),
)
UVS = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
UNREAD = ("edge", "multi_texture_vertex", "multi_texture_face", "range_grid")
"""Elements that are left out with a word."""


def read_ply_mesh(source: MeshSource) -> MeshContent:
    """The faces of a PLY with its normals, texture coordinates (of vertices or corners) and colours.

    Colours are read as sRGB; whole numbers by the range of their type, floats in 0 to 1 or, where one exceeds 1, in 0
    to 255. The first texture that a comment names is laid on. Raises InputError for damaged bytes, and beyond the
    limits.
    """
    # --- Vertices, and faces as polygons or strips ---
    elements, textures = read_elements(source)
    vertex = elements.get("vertex")
    points = vertex.table(("x", "y", "z")) if vertex else None
    if vertex is None or points is None:
        raise source.damaged("it has no vertices")
    content = MeshContent(left_out=[f"its {name}" for name in UNREAD if name in elements])
    corners, places, polygon = _faces(source, elements, points)
    faces = corners[places]
    if not len(faces):
        return content
    # --- What lies on them: of vertices, or of the corners of faces ---
    colours = _face_colours(elements, faces, polygon)
    normals = vertex.table(("nx", "ny", "nz"))
    uv = _vertex_uv(vertex)
    wedge = _corner_uv(elements, len(corners))
    # Coordinates of corners: each corner becomes a vertex of its own.
    if wedge is not None:
        points = points[faces.ravel()]
        normals = None if normals is None else normals[faces.ravel()]
        uv = wedge[places.ravel()]
        faces = np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
    paint = _texture(source, textures, content) if textures and uv is not None else None
    if paint and colours is not None:
        content.left_out.append("its colours")
    content.parts.append(
        MeshPart(points, faces, paint, source.path.stem, normals, uv, None if paint else colours)
    )
    return content


def _faces(
    source: MeshSource, elements: dict[str, PlyElement], points: Array
) -> tuple[Array, Array, Array]:
    """(corners [C], triangles [F, 3] as positions among them, polygon [F] of each)."""
    face = elements.get("face")
    strips = elements.get("tristrips")
    lists = (
        next((face.lists[name] for name in INDICES if name in face.lists), None) if face else None
    )
    if lists is None and strips is not None:
        return _strips(source, strips, len(points))
    if lists is None:
        return np.zeros(0, np.int32), np.zeros((0, 3), np.int32), np.zeros(0, np.int32)
    counts, values = lists
    corners = _numbers(source, values, len(points))
    places, polygon = triangulated(source, points, counts, corners)
    return corners, places, polygon


def _strips(source: MeshSource, strips: PlyElement, points: int) -> tuple[Array, Array, Array]:
    """As `_faces`, of strips of triangles; -1 begins a new one."""
    lists = next((strips.lists[name] for name in INDICES if name in strips.lists), None)
    values = np.zeros(0, np.int32) if lists is None else lists[1]
    source.check("faces", len(values))
    stops = np.flatnonzero(np.append(values, -1) == -1)
    begins = np.append(0, stops[:-1] + 1)
    long = stops - begins >= 3
    places = [strip_faces(np.arange(begin, stop)) for begin, stop in zip(begins[long], stops[long])]
    used = np.concatenate([np.zeros((0, 3), np.int64), *places])
    corners = _numbers(source, np.where(values == -1, 0, values), points)
    return corners, used, np.arange(len(used))


def _numbers(source: MeshSource, values: Array, points: int) -> Array:
    """int32 numbers of vertices."""
    if len(values) and not (values.min() >= 0 and values.max() < points):  # also where one is NaN
        raise source.damaged("it has faces of vertices that do not exist")
    return values.astype(np.int32)


def _face_colours(elements: dict[str, PlyElement], faces: Array, polygon: Array) -> Array | None:
    """[F, 3] linear: those of the faces, or else the means of their vertices."""
    face = elements.get("face")
    of_polygons = _linear(face) if face else None
    if of_polygons is not None:
        return of_polygons[polygon]
    of_vertices = _linear(elements["vertex"])
    return None if of_vertices is None else mean_of_corners(of_vertices, faces)


def _linear(element: PlyElement) -> Array | None:
    """[n, 3] linear float32 colours of an element's rows."""
    names = next(
        (names for names in COLOURS if all(name in element.columns for name in names)), None
    )
    if names is None or not element.count:
        return None
    channels = []
    for name in names:
        values = element.columns[name]
        kind = element.kind(name)
        if kind == np.uint8:
            channels.append(srgb_to_linear(np.clip(values, 0, 255).astype(np.uint8)))
            continue
        top = np.iinfo(kind).max if kind == np.uint16 else 255
        whole = kind.kind != "f" or np.nanmax(values) > 1
        share = np.nan_to_num(values.astype(np.float32)) / np.float32(top if whole else 1)
        channels.append(srgb_to_linear(np.clip(share, 0, 1)))
    return np.stack(channels, -1)


def _vertex_uv(vertex: PlyElement) -> Array | None:
    """[V, 2] v DOWN."""
    uv = next((vertex.table(names) for names in UVS if names[0] in vertex.columns), None)
    return None if uv is None else uv * [1, -1] + [0, 1]


def _corner_uv(elements: dict[str, PlyElement], corners: int) -> Array | None:
    """[C, 2] v DOWN of every corner of every polygon, as MeshLab writes them."""
    lists = elements["face"].lists if "face" in elements else {}
    indices = next((lists[name] for name in INDICES if name in lists), None)
    if indices is None or "texcoord" not in lists:
        return None
    counts, values = lists["texcoord"]
    if not (counts == 2 * indices[0]).all():
        return None
    return values.astype(np.float64).reshape(corners, 2) * [1, -1] + [0, 1]


def _texture(source: MeshSource, names: list[str], content: MeshContent) -> str | None:
    """Key of the material of the first texture; None where it is not there."""
    pictures = Textures(source)
    data = source.folder.get(names[0])
    if data is not None:
        pictures.add(names[0], data)
    pixels = pictures.pixels(names[0])
    content.notes += pictures.notes()
    if len(names) > 1:
        content.left_out.append("its further textures")
    if pixels is None:
        return None
    surface = replace(uniform_surface(GREY, GREY, 0.0), albedo=srgb_to_linear(pixels))
    content.paints[names[0]] = Paint(surface)
    return names[0]
