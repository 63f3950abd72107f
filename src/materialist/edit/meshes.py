"""Mesh files as bodies in a frame of their own: OBJ, PLY, STL, glTF and GLB, with their textures."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from materialist.edit.mesh_folder import FORMATS, MAX_FACES, MeshFolder, claimed_faces
from materialist.edit.mesh_material import constant, from_colours, surface_of
from materialist.edit.mesh_shape import creased_normals, edge_faults, volume
from materialist.errors import InputError
from materialist.types import Array, Body


@dataclass(frozen=True, eq=False)
class Model:
    """A thing to be put into a scene: its parts in one frame, +Y up, front to +Z, in the units of its file."""

    parts: tuple[Body, ...]
    """One for each material."""
    name: str
    warnings: tuple[str, ...] = ()
    closed: bool = True
    """Whether its surface bounds a volume, as glass needs."""

    @property
    def vertices(self) -> Array:
        """[V, 3] float32 of all parts."""
        return np.concatenate([part.vertices for part in self.parts])


def read_model(path: str | Path, *, up: str = "auto") -> Model:
    """Read a mesh file.

    Nothing outside of the file's own folder is opened, whatever it refers to. Normals that are missing are computed
    (edges of more than 40 degrees stay), texture coordinates that are missing are 0, materials that are missing a
    grey. Base colours are decoded from sRGB; a transparent texture is taken as opaque.

    Args:
        up: axis of the file that points up, `y` or `z`; `auto`: z for STL, y for the others.

    Raises:
        InputError: no such file, another format, damaged, without faces, of more than 2 million triangles, with
            vertices that are not finite, or with references that lead outside of its folder.
    """
    path = Path(path)
    if up not in ("auto", "y", "z"):
        raise InputError(f"The axis that points up is '{up}'; choose y, z or auto.")
    data = _bytes(path)
    folder = MeshFolder(path.parent)
    pieces = list(_pieces(_parsed(path, data, folder), folder))
    if folder.refused:
        raise InputError(
            f"{path} refers to {folder.refused[0]}, outside of its folder, which is never followed; "
            "copy that file beside the mesh and name it there."
        )
    count = sum(len(piece.faces) for piece in pieces)
    if count == 0:
        raise InputError(f"{path} has no triangles; give a mesh with faces.")
    _check_size(path, count)
    if not all(np.isfinite(piece.vertices).all() for piece in pieces):
        raise InputError(f"{path} has vertices that are NaN or infinite; repair the mesh, in Blender for example.")
    if (up == "z") or (up == "auto" and path.suffix.lower() == ".stl"):
        pieces = [_z_up(piece) for piece in pieces]
    return _checked(Model(tuple(pieces), path.stem), path, folder)


def repainted(model: Model, material: str) -> Model:
    """The model in another material: `as-is`, `glass`, `mirror`, a linear "R,G,B" or "#rrggbb". Raises InputError.

    Glass is smooth with an index of 1.5; the mirror's albedo is 0.95; a colour is dielectric with roughness 0.5.
    """
    from materialist.edit.material import parse_colour

    if material == "as-is":
        return model
    if material == "glass":
        surface = constant(1.0, 0.0, 0.0, transmission=1.0, ior=1.5)
    elif material == "mirror":
        surface = constant(0.95, 0.03, 1.0)
    else:
        try:
            surface = constant(parse_colour(material), 0.5, 0.0)
        except InputError as error:
            raise InputError(
                f"The material is {material!r}; give as-is, glass, mirror, R,G,B in [0, 1], or #rrggbb."
            ) from error
    notes = model.warnings
    if material == "glass" and not model.closed:
        notes = (*notes, f"{model.name} is not closed, so its glass has holes; close the mesh for a solid look.")
    return replace(model, parts=tuple(replace(part, surface=surface) for part in model.parts), warnings=notes)


def _bytes(path: Path) -> bytes:
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"The mesh {path} ends in '{path.suffix}'; give one of {', '.join(FORMATS)}.")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"The mesh {path} cannot be read: {(error.strerror or str(error)).lower()}.") from error
    if not data:
        raise InputError(f"The mesh {path} is empty; give a file with faces.")
    _check_size(path, claimed_faces(path, data))
    return data


def _check_size(path: Path, count: int) -> None:
    if count > MAX_FACES:
        raise InputError(
            f"{path} has {count / 1e6:.1f} million triangles, more than {MAX_FACES // 10**6} million; reduce it first "
            "(Blender: Modifier > Decimate; MeshLab: Quadric Edge Collapse Decimation)."
        )


def _parsed(path: Path, data: bytes, folder: MeshFolder) -> Any:
    """trimesh's scene of the file."""
    import io

    import trimesh

    quiet = logging.getLogger("trimesh")
    level = quiet.level
    quiet.setLevel(logging.CRITICAL)  # what it has to say ends in our own sentence
    try:
        return trimesh.load_scene(
            io.BytesIO(data), file_type=path.suffix[1:].lower(), resolver=cast(Any, folder), process=False,
            allow_remote=False,
        )  # fmt: skip
    except Exception as error:
        if folder.refused:
            return trimesh.Scene()  # the caller tells
        if folder.missing:
            raise InputError(f"{path} needs {folder.missing[0]}, which is not beside it; add that file.") from error
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"{path} is not a readable {path.suffix[1:].upper()} mesh ({reason}).") from error
    finally:
        quiet.setLevel(level)


def _pieces(scene: Any, folder: MeshFolder) -> Iterator[Body]:
    """The meshes of trimesh's scene, each where its node puts it."""
    for number, node in enumerate(scene.graph.nodes_geometry):
        transform, name = scene.graph[node]
        mesh = scene.geometry[name]
        if getattr(mesh, "faces", None) is None or len(mesh.faces) == 0:
            continue
        if int(np.min(mesh.faces)) < 0 or int(np.max(mesh.faces)) >= len(mesh.vertices):
            raise InputError(f"The mesh part {name} has faces of vertices that do not exist; export it again.")
        yield _piece(mesh, np.asarray(transform, np.float64), f"{name or number}", folder)


def _piece(mesh: Any, transform: Array, name: str, folder: MeshFolder) -> Body:
    vertices = np.asarray(mesh.vertices, np.float64) @ transform[:3, :3].T + transform[:3, 3]
    faces = np.asarray(mesh.faces, np.int32)
    given = getattr(mesh._cache, "cache", {}).get("vertex_normals")  # trimesh would compute others, without creases
    turn = np.linalg.inv(transform[:3, :3]).T if np.linalg.det(transform[:3, :3]) else np.eye(3)
    if np.linalg.det(transform[:3, :3]) < 0:
        faces = faces[:, ::-1]
    faces = faces[_area(vertices, faces) > 0] if np.isfinite(vertices).all() else faces
    if given is not None and len(given) == len(vertices):
        normals = _unit(np.asarray(given, np.float64) @ turn.T)
    else:
        normals = None
    uv, surface, faces, vertices, normals = _painted(mesh, vertices, faces, normals, folder)
    if normals is None and len(faces) and np.isfinite(vertices).all():
        corners = creased_normals(vertices, faces).reshape(-1, 3)
        own = np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
        vertices, uv, normals, faces = vertices[faces.ravel()], uv[faces.ravel()], corners, own
    elif normals is None:
        normals = np.tile([0.0, 1.0, 0.0], (len(vertices), 1))
    take = lambda a: np.ascontiguousarray(a, np.float32)  # noqa: E731
    return Body(take(vertices), np.ascontiguousarray(faces), take(normals), take(uv), surface, name)


def _painted(mesh: Any, vertices: Array, faces: Array, normals: Array | None, folder: MeshFolder) -> tuple:
    """(uv [V, 2] with v DOWN, surface, faces, vertices, normals); colours of vertices become a texel a face."""
    visual = mesh.visual
    if visual.kind in ("vertex", "face") and len(faces) == len(mesh.faces):
        colours = np.asarray(visual.face_colors)[:, :3]
        surface, texel = from_colours(colours)
        own = np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
        flat = faces.ravel()
        return np.repeat(texel, 3, 0), surface, own, vertices[flat], None if normals is None else normals[flat]
    uv = getattr(visual, "uv", None)
    surface = surface_of(getattr(visual, "material", None), folder)
    if uv is None or np.shape(uv) != (len(vertices), 2):
        uv = np.zeros((len(vertices), 2))
    uv = np.nan_to_num(np.asarray(uv, np.float64))
    return np.stack([uv[:, 0], 1 - uv[:, 1]], -1), surface, faces, vertices, normals


def _checked(model: Model, path: Path, folder: MeshFolder) -> Model:
    """The model with its faces to the outside, and warnings of what is wrong with it."""
    corners = np.cumsum([0, *(len(part.vertices) for part in model.parts)])
    vertices = model.vertices
    faces = np.concatenate([part.faces + first for part, first in zip(model.parts, corners)])
    if not np.ptp(vertices[faces], axis=(0, 1)).max() > 0:
        raise InputError(f"{path} has no triangles with an area; give a mesh with faces.")
    open_edges, crowded = edge_faults(vertices, faces)
    notes = [f"{path.name}: {name} is missing; a constant takes its place." for name in dict.fromkeys(folder.missing)]
    notes += [f"{path.name}: a texture cannot be read; a constant takes its place."] * bool(folder.damaged)
    if crowded:
        notes.append(f"{path.name} is not manifold: {crowded} edges belong to three or more triangles.")
    parts = model.parts
    if not open_edges and not crowded and volume(vertices, faces) < 0:
        parts = tuple(replace(p, faces=np.ascontiguousarray(p.faces[:, ::-1]), normals=-p.normals) for p in parts)
    return replace(model, parts=parts, warnings=tuple(notes), closed=open_edges == 0)


def _z_up(body: Body) -> Body:
    turn = lambda v: np.ascontiguousarray(np.stack([v[:, 0], v[:, 2], -v[:, 1]], -1))  # noqa: E731
    return replace(body, vertices=turn(body.vertices), normals=turn(body.normals))


def _area(vertices: Array, faces: Array) -> Array:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=-1)


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > 1e-12, vectors / np.maximum(length, 1e-12), [0.0, 1.0, 0.0])
