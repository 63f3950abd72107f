"""Mesh files as bodies in a frame of their own: OBJ, PLY, STL, glTF and GLB."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from materialist.camera import unit
from materialist.edits.core.surfaces import edge_faults, uniform_surface
from materialist.edits.insert.formats.content import MeshContent, MeshPart, Paint, joined_part
from materialist.edits.insert.formats.gltf import read_gltf
from materialist.edits.insert.formats.limits import MeshLimits
from materialist.edits.insert.formats.obj import read_obj
from materialist.edits.insert.formats.ply import read_ply_mesh
from materialist.edits.insert.formats.source import MeshSource
from materialist.edits.insert.formats.stl import read_stl
from materialist.edits.insert.formats.textures import GREY
from materialist.edits.insert.normals import area_vectors, creased_normals
from materialist.edits.insert.wrapping import wrapped
from materialist.errors import InputError
from materialist.geometry.boundary import joined_faces
from materialist.option_kinds import parse_colour
from materialist.types import Array, Body, Surface

LIMITS = MeshLimits()
READERS = {
    ".obj": read_obj,
    ".ply": read_ply_mesh,
    ".stl": read_stl,
    ".gltf": read_gltf,
    ".glb": read_gltf,
}
MAX_UV = 1e6
"""Texture coordinates beyond are cut off: as float32 they could not tell pixels apart."""


@dataclass(frozen=True, eq=False)
class MeshModel:
    """A thing to be put into a scene: its parts in one frame, +Y up, front to +Z, in the units of its file."""

    parts: tuple[Body, ...]
    """One for each material of the file; two where only some of its meshes have normals."""
    name: str
    warnings: tuple[str, ...] = ()
    closed: bool = True
    """Whether its surface bounds a volume, as glass needs."""

    @property
    def vertices(self) -> Array:
        """[V, 3] float32 of all parts."""
        return np.concatenate([part.vertices for part in self.parts])


def read_model(path: str | Path, *, up: str = "auto") -> MeshModel:
    """Read a mesh file; the middle of its base becomes the origin.

    Nothing outside of the file's own folder is opened, whatever it refers to. Normals that are missing are computed,
    texture coordinates that are missing are 0, materials that are missing a grey. Base colours are decoded from sRGB;
    a transparent texture is taken as opaque. A closed mesh that is inside out is turned. What the file has beyond
    that is named in the model's `warnings`.

    up: axis of the file that points up, `y` or `z`; `auto`: z for STL, y for the others.
    Raises InputError: no such file, another format, damaged, without faces, beyond the limits, with vertices that are
    not finite, or with references that lead outside of its folder.
    """
    path = Path(path)
    if up not in ("auto", "y", "z"):
        raise InputError(f"The axis that points up is '{up}'; choose y, z or auto.")
    source = MeshSource(path, LIMITS)
    # Numbers of damaged files may overflow; what is not finite is refused afterwards.
    with np.errstate(over="ignore", invalid="ignore"):
        content = READERS[source.suffix](source)
        parts = _bodies(source, content)
    if up == "z" or (up == "auto" and source.suffix == ".stl"):
        parts = [
            replace(p, vertices=_upright(p.vertices), normals=_upright(p.normals)) for p in parts
        ]
    # --- Notes on what the model has not ---
    missing = [f"{name} is missing; a constant takes its place." for name in source.folder.missing]
    left_out = [f"{thing} is left out." for thing in content.left_out]
    notes = [f"{path.name}: {note}" for note in left_out + missing + content.notes]
    return _checked(parts, path, list(dict.fromkeys(notes)))


def files_beside(path: Path) -> list[Path]:
    """Files that a mesh file refers to and that were opened for it; none for a file that cannot be read."""
    try:
        source = MeshSource(path, LIMITS)
        with np.errstate(over="ignore", invalid="ignore"):
            READERS[source.suffix](source)
    except InputError:
        return []
    return list(dict.fromkeys(source.folder.opened))


def repainted(model: MeshModel, material: str) -> MeshModel:
    """The model in another material: `as-is`, `glass`, `mirror`, a linear "R,G,B" or "#rrggbb".

    Glass is smooth with an index of 1.5; the mirror's albedo is 0.95; a colour is dielectric with roughness 0.5.
    """
    if material == "as-is":
        return model
    if material == "glass":
        surface = uniform_surface(1.0, 0.0, 0.0, transmission=1.0, ior=1.5)
    elif material == "mirror":
        surface = uniform_surface(0.95, 0.03, 1.0)
    else:
        surface = uniform_surface(np.asarray(parse_colour(material)), 0.5, 0.0)
    notes = model.warnings
    if material == "glass" and not model.closed:
        notes = (
            *notes,
            f"{model.name} is not closed, so its glass has holes; close the mesh for a solid look.",
        )
    return replace(
        model, parts=tuple(replace(part, surface=surface) for part in model.parts), warnings=notes
    )


def _bodies(source: MeshSource, content: MeshContent) -> list[Body]:
    """The parts of a file as bodies about the middle of all, one for each material."""
    # --- One part for each material, as far as their data can be joined ---
    groups: dict[tuple, list[MeshPart]] = {}
    for part in content.parts:
        key = (part.paint, part.face_colours is None, part.normals is None)
        groups.setdefault(key, []).append(part)
    content.parts.clear()
    parts = []
    for group in groups.values():
        part = _without_empty(source, joined_part(group))
        group.clear()  # each was copied
        if len(part.faces):
            parts.append(part)
    if not parts:
        raise InputError(f"{source.path} has no triangles with an area; give a mesh with faces.")
    # --- All about one middle, so that float32 is exact enough ---
    low = np.min([part.vertices.min(0) for part in parts], axis=0)
    high = np.max([part.vertices.max(0) for part in parts], axis=0)
    origin = (low + high) / 2  # in float64: scans lie far from their origin
    grey = Paint(uniform_surface(GREY, GREY, 0.0))
    bodies = []
    while parts:
        part = parts.pop(0)
        part = replace(part, vertices=(part.vertices - origin).astype(np.float32))
        smooth = _with_normals(part, source.limits.crease)
        bodies.append(_body(source, content, smooth, content.paints.get(part.paint, grey)))
    return bodies


def _without_empty(source: MeshSource, part: MeshPart) -> MeshPart:
    """The part without triangles of no area, and without vertices of no triangle; they would count in its size."""
    # --- Vertices that some triangle has must be numbers ---
    faces = part.faces
    used = np.zeros(len(part.vertices), bool)
    used[faces.ravel()] = True
    if not np.isfinite(part.vertices[used]).all():
        raise InputError(
            f"{source.path} has vertices that are NaN or infinite; repair it, in Blender for example."
        )
    # Triangles of no area have no normal.
    kept = area_vectors(part.vertices, faces).any(1)
    if kept.all() and used.all():
        return replace(part, vertices=part.vertices.astype(np.float64, copy=False))
    # --- Numbered anew, without those of no triangle ---
    used[:] = False
    used[faces[kept].ravel()] = True
    number = np.cumsum(used, dtype=np.int32) - 1

    def chosen(values: Array | None) -> Array | None:
        return None if values is None else values[used]

    return replace(
        part,
        vertices=part.vertices[used].astype(np.float64),
        faces=number[faces[kept]],
        normals=chosen(part.normals),
        uv=chosen(part.uv),
        pieces=chosen(part.pieces),
        face_colours=None if part.face_colours is None else part.face_colours[kept],
    )


def _with_normals(part: MeshPart, crease: float) -> MeshPart:
    """The part with unit normals; where it has none, its vertices are divided at creases."""
    if part.normals is not None:
        return replace(part, normals=_unit(part.normals).astype(np.float32))
    # A vertex for each place and each side of a crease.
    number, normals = creased_normals(part.vertices, part.faces, crease, part.pieces)
    key = number.ravel().astype(np.int64)
    if part.uv is not None:  # vertices at one place that differ in texture stay apart
        key = key * len(part.vertices) + part.faces.ravel()
    _, first, faces = np.unique(key, return_index=True, return_inverse=True)
    vertex = part.faces.ravel()[first]
    return replace(
        part,
        vertices=part.vertices[vertex],
        faces=faces.reshape(-1, 3).astype(np.int32),
        normals=_unit(normals[number.ravel()[first]]).astype(np.float32),
        uv=None if part.uv is None else part.uv[vertex],
    )


def _body(source: MeshSource, content: MeshContent, part: MeshPart, paint: Paint) -> Body:
    """A part with normals as a body."""
    vertices = part.vertices
    faces = part.faces.astype(np.int32)
    normals = part.normals
    assert normals is not None
    # Colours of faces: each face has a texel, and so three vertices, of its own.
    if part.face_colours is not None:
        surface, of_face = coloured(paint.surface, part.face_colours)
        corners = faces.ravel()
        faces = np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
        uv = np.repeat(of_face, 3, 0)
        return Body(vertices[corners], faces, normals[corners], uv, surface, part.name)
    # A texture of the file: finite coordinates, and the repeating kind of texture.
    uv = np.zeros((len(vertices), 2)) if part.uv is None else part.uv
    uv = np.clip(np.nan_to_num(uv), -MAX_UV, MAX_UV)
    surface, uv, exact = wrapped(
        paint.surface, uv, faces, paint.layout.wrap, source.limits.texture_pixels
    )
    if not exact:
        content.notes.append(
            "a clamped texture is cut off where its coordinates lie far outside of it."
        )
    return Body(
        vertices, np.ascontiguousarray(faces), normals, uv.astype(np.float32), surface, part.name
    )


def coloured(surface: Surface, colours: Array) -> tuple[Surface, Array]:
    """(the surface with a texture of one texel a face, uv [F, 2] of each face's texel) of linear colours [F, 3]."""
    # A square texture: one row of many thousand texels would exceed what renderers take.
    side = max(1, int(np.ceil(np.sqrt(len(colours)))))
    texture = np.zeros((side * side, 3), np.float32)
    texture[: len(colours)] = np.clip(np.nan_to_num(colours), 0, 1)
    number = np.arange(len(colours))
    uv = (np.stack([number % side, number // side], -1) + 0.5) / side
    return replace(surface, albedo=texture.reshape(side, side, 3)), uv.astype(np.float32)


def _checked(parts: list[Body], path: Path, notes: list[str]) -> MeshModel:
    """The model with its base at the origin, its faces to the outside, and warnings of what is wrong with it."""
    vertices, faces = joined_faces(parts)
    open_edges, crowded = edge_faults(vertices, faces)
    if crowded:
        notes.append(
            f"{path.name} is not manifold: {crowded} edges belong to three or more triangles."
        )
    base = np.array([0, vertices[:, 1].min(), 0], np.float32)
    parts = [replace(part, vertices=part.vertices - base) for part in parts]
    if not open_edges and not crowded and _volume(vertices, faces) < 0:
        parts = [
            replace(part, faces=np.ascontiguousarray(part.faces[:, ::-1]), normals=-part.normals)
            for part in parts
        ]
    return MeshModel(tuple(parts), path.stem, tuple(notes), open_edges == 0)


def _volume(vertices: Array, faces: Array) -> float:
    """Volume of a closed mesh; negative where its faces look inside."""
    areas = area_vectors(vertices, faces)
    return float(np.einsum("ij,ij->", areas, vertices[faces[:, 0]].astype(np.float64))) / 6


def _upright(vectors: Array) -> Array:
    """[n, 3] of an axis +Z up in +Y up."""
    return np.stack([vectors[:, 0], vectors[:, 2], -vectors[:, 1]], -1)


def _unit(vectors: Array) -> Array:
    """[..., 3] of length 1; up where there is no length."""
    return np.where(vectors.any(-1, keepdims=True), unit(vectors), [0.0, 1.0, 0.0])
