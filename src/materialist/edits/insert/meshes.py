"""Mesh files as bodies in a frame of their own: OBJ, PLY, STL, glTF and GLB, read by trimesh."""

import io
import json
import logging
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast
from urllib.parse import unquote

import numpy as np
import trimesh
from trimesh import Trimesh

from materialist.camera import unit
from materialist.color import srgb_to_linear
from materialist.edits.core.surfaces import edge_faults, uniform_surface
from materialist.edits.insert.mesh_material import GREY, Textures, coloured, gltf_surface, gltf_uv, mtl_surface
from materialist.errors import InputError
from materialist.geometry.boundary import joined_faces
from materialist.option_kinds import parse_colour
from materialist.types import Array, Body, Surface

FORMATS = (".obj", ".ply", ".stl", ".gltf", ".glb")
READ = ("KHR_materials_", "EXT_texture_webp", "KHR_texture_transform")
"""Beginnings of the glTF extensions that a file may require."""


@dataclass(frozen=True)
class MeshLimits:
    """Limits of the files that are read; tuned by eye."""

    faces: int = 2_000_000  # triangles; above it rendering runs out of memory on ordinary machines
    megabytes: float = 512.0  # size of the file
    texture: int = 4096  # pixels along the longer side of a texture; larger ones are shrunk
    crease: float = 40.0  # degrees: where a file has no normals, faces that meet at a sharper angle keep an edge


LIMITS = MeshLimits()


@dataclass(frozen=True, eq=False)
class MeshModel:
    """A thing to be put into a scene: its parts in one frame, +Y up, front to +Z, in the units of its file."""

    parts: tuple[Body, ...]
    """One for each mesh of the file, with one material."""
    name: str
    warnings: tuple[str, ...] = ()
    closed: bool = True
    """Whether its surface bounds a volume, as glass needs."""

    @property
    def vertices(self) -> Array:
        """[V, 3] float32 of all parts."""
        return np.concatenate([part.vertices for part in self.parts])


class MeshFolder:
    """The files beside a mesh, as trimesh asks for them (as much of its `Resolver` as its readers use).

    trimesh swallows the errors of a resolver, so this keeps them: `refused` are references that lead outside of the
    folder by a path, a link or an address, and are never opened; `missing` are files that are not there.
    """

    def __init__(self, folder: Path):
        self.folder = folder.resolve()
        self.opened: list[Path] = []
        self.refused: list[str] = []
        self.missing: list[str] = []

    def get(self, name: str) -> bytes:
        """The bytes of a file. Raises InputError for a reference outside of the folder, OSError for a missing file."""
        name = str(name).strip()
        path = self._inside(name)
        if path is None:
            self.refused.append(name)
            raise InputError(f"The reference {name} leads outside of {self.folder}.")
        try:
            data = path.read_bytes()
        except OSError:
            self.missing.append(name)
            raise
        self.opened.append(path)
        return data

    def _inside(self, name: str) -> Path | None:
        """The path of a reference, None when it leads outside. glTF's percent-encoding is decoded."""
        spelled = [one.replace("\\", "/") for one in (name, unquote(name))]
        if any(":" in one.split("/", 1)[0] or one.startswith("/") or "\0" in one for one in spelled):
            return None
        paths = [(self.folder / one).resolve() for one in spelled]
        if not all(path.is_relative_to(self.folder) for path in paths):
            return None
        return paths[0] if paths[0].is_file() else paths[1]

    __getitem__ = get


def read_model(path: str | Path, *, up: str = "auto") -> MeshModel:
    """Read a mesh file; the middle of its base becomes the origin.

    Nothing outside of the file's own folder is opened, whatever it refers to. Normals that are missing are computed,
    texture coordinates that are missing are 0, materials that are missing a grey. Base colours are decoded from sRGB;
    a transparent texture is taken as opaque. A closed mesh that is inside out is turned.

    up: axis of the file that points up, `y` or `z`; `auto`: z for STL, y for the others.
    Raises InputError: no such file, another format, damaged, without faces, beyond the limits, with vertices that are
    not finite, or with references that lead outside of its folder.
    """
    path = Path(path)
    if up not in ("auto", "y", "z"):
        raise InputError(f"The axis that points up is '{up}'; choose y, z or auto.")
    data, folder = _bytes(path), MeshFolder(path.parent)
    data, materials, left_out = _numbered(path, data)
    reader = _Reader(path, materials, left_out)
    parts = list(reader.parts(_parsed(path, data, folder)))
    if folder.refused:
        raise InputError(
            f"{path} refers to {folder.refused[0]}, outside of its folder, which is never followed; "
            "copy that file beside the mesh and name it there."
        )
    count = sum(len(part.faces) for part in parts)
    if count == 0:
        raise InputError(f"{path} has no triangles with an area; give a mesh with faces.")
    if count > LIMITS.faces:
        raise InputError(
            f"{path} has {count / 1e6:.1f} million triangles, more than {LIMITS.faces / 1e6:g} million; reduce it "
            "first (Blender: Modifier > Decimate; MeshLab: Quadric Edge Collapse Decimation)."
        )
    if up == "z" or (up == "auto" and path.suffix.lower() == ".stl"):
        turned = lambda v: np.stack([v[:, 0], v[:, 2], -v[:, 1]], -1)  # noqa: E731
        parts = [replace(part, vertices=turned(part.vertices), normals=turned(part.normals)) for part in parts]
    notes = [f"{path.name}: {what} is left out." for what in reader.left_out]
    lacking = [f"{name} is missing" for name in folder.missing] + ["a texture cannot be read"] * reader.textures.damaged
    return _checked(parts, path, notes + [f"{path.name}: {what}; a constant takes its place." for what in lacking])


def files_beside(path: Path) -> list[Path]:
    """Files that a mesh file refers to and that were opened for it; none for a file that cannot be read."""
    folder = MeshFolder(path.parent)
    try:
        _parsed(path, _bytes(path), folder)
    except InputError:
        return []
    return list(dict.fromkeys(folder.opened))


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
        notes = (*notes, f"{model.name} is not closed, so its glass has holes; close the mesh for a solid look.")
    return replace(model, parts=tuple(replace(part, surface=surface) for part in model.parts), warnings=notes)


def _bytes(path: Path) -> bytes:
    if path.suffix.lower() not in FORMATS:
        raise InputError(f"The mesh {path} ends in '{path.suffix}'; give one of {', '.join(FORMATS)}.")
    try:
        size = path.stat().st_size / 1e6
        if size > LIMITS.megabytes:
            raise InputError(f"The mesh {path} has {size:.0f} MB, more than {LIMITS.megabytes:g}; reduce it first.")
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"The mesh {path} cannot be read: {(error.strerror or str(error)).lower()}.") from error
    if not data:
        raise InputError(f"The mesh {path} is empty; give a file with faces.")
    if path.suffix.lower() == ".obj" and re.search(rb"(?m)^[ \t]*f[ \t][^\r\n]*-\d", data):
        # trimesh counts them from the end of the file, and not from their line.
        raise InputError(f"The mesh {path} counts its vertices backwards; export it again, from Blender for example.")
    return data


def _parsed(path: Path, data: bytes, folder: MeshFolder) -> Any:
    quiet = logging.getLogger("trimesh")
    level = quiet.level
    quiet.setLevel(logging.CRITICAL)  # its messages end in the sentences of this module
    try:
        return trimesh.load_scene(
            io.BytesIO(data), file_type=path.suffix[1:].lower(), resolver=cast(Any, folder), process=False,
            allow_remote=False,
        )  # fmt: skip
    except Exception as error:
        if folder.refused:
            return trimesh.Scene()  # the caller reports the reference
        if folder.missing:
            raise InputError(f"{path} needs {folder.missing[0]}, which is not beside it; add that file.") from error
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        if isinstance(error, ImportError | RecursionError):  # of what trimesh tries with bytes that it does not know
            reason = "damaged"
        raise InputError(f"{path} is not a readable {path.suffix[1:].upper()} mesh ({reason}).") from error
    finally:
        quiet.setLevel(level)


def _numbered(path: Path, data: bytes) -> tuple[bytes, dict[str, dict[str, Any]], list[str]]:
    """(a .gltf or .glb with numbers for the names of its materials, number -> material as the file has it, for the
    entries that trimesh leaves out, and what else is left out); names need be neither there nor unique.

    Bytes that are no glTF stay; trimesh refuses them. Raises InputError for a required extension that is not read.
    """
    if path.suffix.lower() not in (".gltf", ".glb"):
        return data, {}, []
    start, end, total = 0, len(data), 0
    try:
        if data[:4] == b"glTF":
            start, (total, length) = 20, struct.unpack_from("<II", data, 8)
            end = start + length
        header = json.loads(data[start:end])
        unread = [name for name in header.get("extensionsRequired", []) if not name.startswith(READ)]
        materials = {str(number): material for number, material in enumerate(header.get("materials", []))}
        header["materials"] = [material | {"name": number} for number, material in materials.items()]
        left_out = ["its lighting"] * ("KHR_lights_punctual" in header.get("extensions", {}))
        text = json.dumps(header).encode()
        sizes = struct.pack("<II", total + len(text) - (end - start), len(text)) if start else b""
        data = data[: min(start, 8)] + sizes + data[16:start] + text + data[end:]
    except (ValueError, TypeError, AttributeError, RecursionError, struct.error):
        return data, {}, []
    if unread:
        raise InputError(
            f"{path} needs the glTF extension {unread[0]}, which is not read; export it without (in Blender, without "
            "compression), or as OBJ or PLY."
        )
    return data, materials, left_out


class _Reader:
    """The meshes of a trimesh scene as bodies."""

    def __init__(self, path: Path, materials: dict[str, dict[str, Any]], left_out: list[str]):
        self.path, self.materials = path, materials
        self.textures = Textures(LIMITS.texture)
        self.left_out = left_out

    def parts(self, scene: Any) -> Iterator[Body]:
        """Its meshes as bodies where their nodes put them, about the middle of the base of all."""
        found = []
        for node in scene.graph.nodes_geometry:
            transform, name = scene.graph[node]
            mesh = scene.geometry[name]
            if getattr(mesh, "faces", None) is None or len(mesh.faces) == 0:
                continue
            if int(np.min(mesh.faces)) < 0 or int(np.max(mesh.faces)) >= len(mesh.vertices):
                raise InputError(f"{self.path} has faces of vertices that do not exist; export it again.")
            transform = np.asarray(transform, np.float64)
            vertices = np.asarray(mesh.vertices, np.float64) @ transform[:3, :3].T + transform[:3, 3]
            if not np.isfinite(vertices).all():
                raise InputError(
                    f"{self.path} has vertices that are NaN or infinite; repair it, in Blender for example."
                )
            found.append((mesh, transform, vertices, str(name)))
        if not found:
            return
        used = np.concatenate([vertices[np.unique(mesh.faces)] for mesh, _, vertices, _ in found])
        origin = (used.min(0) + used.max(0)) / 2  # in float64: scans lie far from their origin
        for mesh, transform, vertices, name in found:
            body = self._body(mesh, transform, vertices - origin, name)
            if len(body.faces):
                yield body

    def _body(self, mesh: Any, transform: Array, vertices: Array, name: str) -> Body:
        """One mesh with its vertices [V, 3] where they are."""
        faces = np.asarray(mesh.faces, np.int64)
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        kept = np.linalg.norm(np.cross(b - a, c - a), axis=-1) > 0
        faces = faces[kept, ::-1] if np.linalg.det(transform[:3, :3]) < 0 else faces[kept]
        given = getattr(mesh._cache, "cache", {}).get("vertex_normals")  # trimesh would compute others, without creases
        surface, uv, face_uv = self._paint(mesh, kept)
        uv = np.zeros((len(vertices), 2)) if uv is None else uv
        if given is not None and len(given) == len(vertices):
            normals = _unit(np.asarray(given, np.float64) @ np.linalg.pinv(transform[:3, :3]))
        else:
            corner = creased_normals(vertices, faces, LIMITS.crease).reshape(-1, 3)
            vertices, uv = vertices[faces.ravel()], uv[faces.ravel()]
            normals, faces = corner, np.arange(faces.size).reshape(-1, 3)
        if face_uv is not None:
            vertices, normals = vertices[faces.ravel()], normals[faces.ravel()]
            uv, faces = np.repeat(face_uv, 3, 0), np.arange(faces.size).reshape(-1, 3)
        # A vertex of no face must not count where the size is measured.
        used, number = np.unique(faces, return_inverse=True)
        take = lambda v: np.ascontiguousarray(v[used], np.float32)  # noqa: E731
        return Body(take(vertices), number.reshape(-1, 3).astype(np.int32), take(normals), take(uv), surface, name)

    def _paint(self, mesh: Any, kept: Array) -> tuple[Surface, Array | None, Array | None]:
        """(surface, uv [V, 2] with v DOWN, uv [F, 2] for each kept face where its colours are those of vertices)."""
        visual = mesh.visual
        if visual.kind in ("vertex", "face"):
            colours = np.asarray(visual.face_colors)[kept, :3].astype(np.float32) / 255
            linear = self.path.suffix.lower() in (".gltf", ".glb")  # glTF's colours of vertices are linear
            surface, face_uv = coloured(colours if linear else srgb_to_linear(colours))
            return surface, None, face_uv
        material = getattr(visual, "material", None)
        if material is None:
            return uniform_surface(GREY, GREY, 0.0), None, None
        said = self.materials.get(getattr(material, "name", ""), {})
        try:
            if hasattr(material, "metallicFactor"):
                surface, left_out = gltf_surface(material, said, self.textures)
            else:
                surface, left_out = mtl_surface(material, self.textures)
            uv = np.asarray(visual.uv, np.float64) if np.shape(visual.uv) == (len(mesh.vertices), 2) else None
            uv = None if uv is None else np.nan_to_num(gltf_uv(said, uv * [1, -1] + [0, 1]))
        except InputError:
            raise
        except Exception as error:  # a file may say anything
            raise InputError(f"{self.path} has a material that cannot be read: {error}; export it again.") from error
        if "color" in (getattr(visual, "vertex_attributes", None) or {}):
            left_out = [*left_out, "the colours of its vertices"]
        self.left_out += left_out
        return surface, uv, None


def creased_normals(vertices: Array, faces: Array, degrees: float) -> Array:
    """[F, 3, 3] unit normals of the corners of faces [F, 3]; faces that meet at a sharper angle keep an edge."""
    mesh = trimesh.Trimesh(vertices, faces, process=False, validate=False)
    mesh.merge_vertices()
    smooth = trimesh.graph.smooth_shade(mesh, angle=np.radians(degrees), facet_minarea=None)
    order = smooth.metadata.get("original_components")
    order = np.arange(len(faces)) if order is None else np.concatenate(order)
    normals = np.empty((len(faces), 3, 3))
    normals[order] = smooth.vertex_normals[smooth.faces]
    return _unit(normals)


def _checked(parts: list[Body], path: Path, notes: list[str]) -> MeshModel:
    """The model with its base at the origin, its faces to the outside, and warnings of what is wrong with it."""
    vertices, faces = joined_faces(parts)
    open_edges, crowded = edge_faults(vertices, faces)
    if crowded:
        notes.append(f"{path.name} is not manifold: {crowded} edges belong to three or more triangles.")
    base = np.array([0, vertices[:, 1].min(), 0], np.float32)
    parts = [replace(part, vertices=part.vertices - base) for part in parts]
    if not open_edges and not crowded and Trimesh(vertices, faces, process=False).volume < 0:
        parts = [
            replace(part, faces=np.ascontiguousarray(part.faces[:, ::-1]), normals=-part.normals) for part in parts
        ]
    return MeshModel(tuple(parts), path.stem, tuple(dict.fromkeys(notes)), open_edges == 0)


def _unit(vectors: Array) -> Array:
    """[..., 3] of length 1; up where there is no length."""
    return np.where(vectors.any(-1, keepdims=True), unit(vectors), [0.0, 1.0, 0.0])
