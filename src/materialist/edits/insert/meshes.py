"""Mesh files as bodies in a frame of their own: OBJ, PLY, STL, glTF and GLB, with their textures."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from materialist.color import srgb_to_linear
from materialist.edits.core.surfaces import uniform_surface
from materialist.edits.core.topology import edge_faults
from materialist.edits.insert import mesh_gltf, mesh_obj
from materialist.edits.insert.mesh_folder import FORMATS, MAX_FACES, MeshFolder, claimed_faces
from materialist.edits.insert.mesh_material import GREY, surface_of, texels
from materialist.edits.insert.mesh_shape import creased_normals, inside_out
from materialist.errors import InputError
from materialist.types import Array, Body, Surface

DISTANT = 16.0
"""A mesh whose middle is further from its origin than so many times its size is moved there (georeferenced scans)."""


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
    read = _Reader(path, folder)
    if path.suffix.lower() in (".gltf", ".glb"):
        data, read.materials = mesh_gltf.prepared(path, data)
        read.linear = True
    elif path.suffix.lower() == ".obj":
        data = mesh_obj.prepared(data, folder)
    pieces = list(read.pieces(_parsed(path, data, folder)))
    if folder.refused:
        raise InputError(
            f"{path} refers to {folder.refused[0]}, outside of its folder, which is never followed; "
            "copy that file beside the mesh and name it there."
        )
    count = sum(len(piece.faces) for piece in pieces)
    if count == 0:
        raise InputError(f"{path} has no triangles; give a mesh with faces.")
    _check_size(path, count)
    if (up == "z") or (up == "auto" and path.suffix.lower() == ".stl"):
        pieces = [_z_up(piece) for piece in pieces]
    return _checked(Model(tuple(pieces), path.stem), path, folder, read.left_out())


def repainted(model: Model, material: str) -> Model:
    """The model in another material: `as-is`, `glass`, `mirror`, a linear "R,G,B" or "#rrggbb". Raises InputError.

    Glass is smooth with an index of 1.5; the mirror's albedo is 0.95; a colour is dielectric with roughness 0.5.
    """
    from materialist.option_kinds import parse_colour

    if material == "as-is":
        return model
    if material == "glass":
        surface = uniform_surface(1.0, 0.0, 0.0, transmission=1.0, ior=1.5)
    elif material == "mirror":
        surface = uniform_surface(0.95, 0.03, 1.0)
    else:
        try:
            surface = uniform_surface(np.asarray(parse_colour(material)), 0.5, 0.0)
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


class _Reader:
    """The meshes of a file as bodies."""

    def __init__(self, path: Path, folder: MeshFolder):
        self.path, self.folder = path, folder
        self.materials: list[dict[str, Any]] = []
        """Those of a glTF file, which trimesh knows by their number (see `mesh_gltf.prepared`)."""
        self.linear = False
        """Whether colours of vertices are linear, as glTF's are."""
        self.unpainted = 0
        """Parts whose colours of vertices are not shown."""

    def left_out(self) -> list[str]:
        """What of the file is not shown, in words."""
        return (
            mesh_gltf.left_out(self.materials)
            + sorted(self.folder.left_out)
            + ["the colours of its vertices"] * bool(self.unpainted)
        )

    def pieces(self, scene: Any) -> Iterator[Body]:
        """The meshes of trimesh's scene, each where its node puts it."""
        found = []
        for number, node in enumerate(scene.graph.nodes_geometry):
            transform, name = scene.graph[node]
            mesh = scene.geometry[name]
            if getattr(mesh, "faces", None) is None or len(mesh.faces) == 0:
                continue
            if int(np.min(mesh.faces)) < 0 or int(np.max(mesh.faces)) >= len(mesh.vertices):
                raise InputError(f"The mesh part {name} has faces of vertices that do not exist; export it again.")
            transform = np.asarray(transform, np.float64)
            vertices = np.asarray(mesh.vertices, np.float64) @ transform[:3, :3].T + transform[:3, 3]
            if not np.isfinite(vertices).all():
                raise InputError(
                    f"{self.path} has vertices that are NaN or infinite; repair it, in Blender for example."
                )
            found.append((mesh, transform, vertices, f"{name or number}"))
        origin = _origin([vertices[np.unique(mesh.faces)] for mesh, _, vertices, _ in found])
        for mesh, transform, vertices, name in found:
            yield self.piece(mesh, transform, vertices - origin, name)

    def piece(self, mesh: Any, transform: Array, vertices: Array, name: str) -> Body:
        """One mesh with its vertices [V, 3] where they are."""
        faces = np.asarray(mesh.faces, np.int32)
        given = getattr(mesh._cache, "cache", {}).get("vertex_normals")  # trimesh would compute others, no creases
        turn = np.linalg.inv(transform[:3, :3]).T if np.linalg.det(transform[:3, :3]) else np.eye(3)
        kept = _area(vertices, faces) > 0
        if np.linalg.det(transform[:3, :3]) < 0:
            faces = faces[:, ::-1]
        normals = None
        if given is not None and len(given) == len(vertices):
            normals = _unit(np.asarray(given, np.float64) @ turn.T)
        uv, surface, colours = self.paint(mesh, len(vertices), kept)
        faces = faces[kept]
        if colours is not None or normals is None:  # every corner is a vertex of its own
            flat = faces.ravel()
            normals = creased_normals(vertices, faces).reshape(-1, 3) if normals is None else normals[flat]
            uv = uv[flat] if colours is None else np.repeat(colours, 3, 0)
            vertices, faces = vertices[flat], np.arange(faces.size, dtype=np.int32).reshape(-1, 3)
        # A vertex of no face is nowhere, and must not count where the size is measured.
        used, number = np.unique(faces, return_inverse=True)
        take = lambda a: np.ascontiguousarray(a[used], np.float32)  # noqa: E731
        faces = number.reshape(-1, 3).astype(np.int32)
        return Body(take(vertices), faces, take(normals), take(uv), surface, name)

    def paint(self, mesh: Any, count: int, kept: Array) -> tuple[Array, Surface, Array | None]:
        """(uv [V, 2] with v DOWN, surface, uv [F, 2] of a texel for each face of those `kept`, where they have one)."""
        visual = mesh.visual
        places: Array | None
        if visual.kind in ("vertex", "face"):
            colours = np.asarray(visual.face_colors)[kept, :3].astype(np.float32) / 255
            texture, places = texels(colours if self.linear else srgb_to_linear(colours))
            return np.zeros((count, 2)), replace(uniform_surface(GREY, GREY, 0.0), albedo=texture), places
        material = getattr(visual, "material", None)
        said = self.said(material)
        surface = surface_of(material, self.folder, (said.get("pbrMetallicRoughness") or {}).get("baseColorFactor"))
        uv = getattr(visual, "uv", None)
        uv = np.zeros((count, 2)) if uv is None or np.shape(uv) != (count, 2) else np.asarray(uv, np.float64)
        uv = np.nan_to_num(uv)
        uv = np.stack([uv[:, 0], 1 - uv[:, 1]], -1)
        places = None
        shades = self.shades(visual, mesh, kept)
        if shades is not None and surface.albedo.size == 3 and surface.roughness.size == surface.metallic.size == 1:
            texture, places = texels(shades)
            surface = replace(surface, albedo=np.clip(texture * surface.albedo, 0, 1).astype(np.float32))
        elif shades is not None:
            self.unpainted += 1
        return mesh_gltf.tiled(uv, said), mesh_gltf.extended(surface, said), places

    def said(self, material: Any) -> dict[str, Any]:
        """What the glTF file says of a material of trimesh's."""
        name = str(getattr(material, "name", None))
        return self.materials[int(name)] if name.isdigit() and int(name) < len(self.materials) else {}

    @staticmethod
    def shades(visual: Any, mesh: Any, kept: Array) -> Array | None:
        """[F, 3] linear colours of faces that multiply those of a material (glTF's COLOR_0); None for white or none."""
        colours = getattr(visual, "vertex_attributes", {}).get("color")
        if colours is None or len(colours) != len(mesh.vertices):
            return None
        colours = np.asarray(colours)[:, :3].astype(np.float64) / (255 if colours.dtype == np.uint8 else 1)
        return None if (colours > 0.998).all() else np.clip(colours[mesh.faces[kept]].mean(1), 0, 1)


def _origin(clouds: list[Array]) -> Array:
    """[3] what is taken off all vertices: their middle, where single precision would not tell them apart there."""
    if not clouds:
        return np.zeros(3)
    points = np.concatenate(clouds)
    if not len(points) or not np.isfinite(points).all():
        return np.zeros(3)
    low, high = points.min(0), points.max(0)
    middle = (low + high) / 2
    return middle if np.abs(middle).max() > DISTANT * (high - low).max() else np.zeros(3)


def _checked(model: Model, path: Path, folder: MeshFolder, left_out: list[str]) -> Model:
    """The model with its faces to the outside, and warnings of what is wrong with it."""
    corners = np.cumsum([0, *(len(part.vertices) for part in model.parts)])
    vertices = model.vertices
    faces = np.concatenate([part.faces + first for part, first in zip(model.parts, corners)])
    if not np.ptp(vertices[faces], axis=(0, 1)).max() > 0:
        raise InputError(f"{path} has no triangles with an area; give a mesh with faces.")
    open_edges, crowded = edge_faults(vertices, faces)
    notes = [f"{path.name}: {name} is missing; a constant takes its place." for name in dict.fromkeys(folder.missing)]
    notes += [f"{path.name}: a texture cannot be read; a constant takes its place."] * bool(folder.damaged)
    notes += [f"{path.name}: {', '.join(left_out)} left out."] * bool(left_out)
    if crowded:
        notes.append(f"{path.name} is not manifold: {crowded} edges belong to three or more triangles.")
    turned = np.split(inside_out(vertices, faces), np.cumsum([len(part.faces) for part in model.parts])[:-1])
    parts = tuple(_turned(part, which) for part, which in zip(model.parts, turned))
    return replace(model, parts=parts, warnings=tuple(notes), closed=open_edges == 0)


def _turned(body: Body, which: Array) -> Body:
    """The body with those of its faces [F] the other way round; they share no corner with others."""
    if not which.any():
        return body
    faces, normals = body.faces.copy(), body.normals.copy()
    faces[which] = faces[which][:, ::-1]
    corners = np.unique(faces[which])
    normals[corners] = -normals[corners]
    return replace(body, faces=np.ascontiguousarray(faces), normals=normals)


def _z_up(body: Body) -> Body:
    turn = lambda v: np.ascontiguousarray(np.stack([v[:, 0], v[:, 2], -v[:, 1]], -1))  # noqa: E731
    return replace(body, vertices=turn(body.vertices), normals=turn(body.normals))


def _area(vertices: Array, faces: Array) -> Array:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.linalg.norm(np.cross(b - a, c - a), axis=-1)


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > 1e-12, vectors / np.maximum(length, 1e-12), [0.0, 1.0, 0.0])
