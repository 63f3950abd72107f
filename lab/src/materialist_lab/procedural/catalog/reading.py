"""Reads one model of a catalogue: OBJ, MTL and pictures become solids of true size, one for each material."""

import io
import logging
import zipfile
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import trimesh
from PIL import Image
from trimesh.resolvers import ZipResolver

from materialist.camera import unit
from materialist.errors import InputError
from materialist.types import Array
from materialist_lab.procedural.catalog.archive import CatalogEntry
from materialist_lab.procedural.catalog.creases import creased
from materialist_lab.procedural.catalog.look import CatalogLook, catalog_look
from materialist_lab.procedural.objects.shapes import Solid, face_normals, joined


@dataclass(frozen=True)
class ReadingSettings:
    """Limits of what is taken from a catalogue; tuned by eye."""

    faces: int = 60_000  # triangles of a model; finer ones are left out (21 of 820)
    picture: int = 512  # pixels along the longer side of a picture
    # radians: where a file has no normals, faces that meet at a sharper angle keep an edge
    crease: float = 0.7
    glass: float = 0.35  # share of the surface that may be clear; it is left out
    holes: float = 0.12  # share of the surface that may have holes painted in its picture


SETTINGS = ReadingSettings()


@dataclass(frozen=True)
class ModelParts:
    """A model as it is read."""

    solids: list[Solid]
    """In metres, the middle of the base at the origin, the back to -Z."""
    looks: list[CatalogLook]
    pictures: dict[str, Array]
    """Name -> [h, w, 3] uint8 sRGB."""


def read_catalog_model(
    file: zipfile.ZipFile, entry: CatalogEntry, s: ReadingSettings = SETTINGS
) -> ModelParts:
    """The model of an entry, from its archive. Raises InputError where it cannot be used: the reason in words."""
    pieces = _pieces(file, entry)
    solids: list[Solid] = []
    looks: list[CatalogLook] = []
    pictures: dict[str, Array] = {}
    # Areas, in the file's units: of glass, of holes, of everything.
    clear = 0.0
    holed = 0.0
    whole = 0.0
    for piece in pieces:
        area = float(piece.area)
        whole += area
        look, painted = _material(piece, entry, pictures, s)
        # Glass is left out: the tracer knows opaque surfaces only.
        if look.clear:
            clear += area
            continue
        solid = _solid(piece, s)
        if painted is not None:
            solid, mixed = _without_holes(solid, painted)
            holed += mixed
        if len(solid.faces):
            solids.append(solid)
            looks.append(look)
    # --- What cannot be used ---
    if clear > s.glass * whole:
        raise InputError("it is of glass")
    if not solids or whole <= 0:
        raise InputError("it has no faces")
    if holed > s.holes * whole:
        raise InputError("its picture has holes")
    if sum(len(solid.faces) for solid in solids) > s.faces:
        raise InputError("it has too many faces")
    # --- Size, texture coordinates where there is no picture ---
    solids = _fitted(solids, entry)
    textured = [bool(look.picture) for look in looks]
    return ModelParts(
        [
            solid if has_picture else from_the_sides(solid)
            for solid, has_picture in zip(solids, textured)
        ],
        looks,
        pictures,
    )


def _pieces(file: zipfile.ZipFile, entry: CatalogEntry) -> list[trimesh.Trimesh]:
    folder = entry.path.rpartition("/")[0]
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    try:
        data = file.read(entry.path)
        resolver = ZipResolver(
            {name: file.read(name) for name in _beside(file, folder)}, namespace=folder
        )
        loaded = trimesh.load(
            io.BytesIO(data), file_type="obj", resolver=resolver, process=False, group_material=True
        )
    # Readers of OBJ raise anything on files that somebody else wrote.
    except Exception as error:
        raise InputError(f"it cannot be read ({type(error).__name__}: {error})") from error
    meshes = list(loaded.geometry.values()) if isinstance(loaded, trimesh.Scene) else [loaded]
    return [mesh for mesh in meshes if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces)]


def _beside(file: zipfile.ZipFile, folder: str) -> list[str]:
    return [
        name
        for name in file.namelist()
        if name.startswith(f"{folder}/") and not name.endswith(("/", ".obj"))
    ]


def _material(
    piece: trimesh.Trimesh, entry: CatalogEntry, pictures: dict[str, Array], s: ReadingSettings
) -> tuple[CatalogLook, Array | None]:
    """(look, opacity [h, w] in [0, 1] where the picture is transparent anywhere); adds to `pictures`."""
    material: Any = getattr(piece.visual, "material", None)
    mtl = dict(getattr(material, "kwargs", None) or {})
    image = getattr(material, "image", None)
    uv = getattr(piece.visual, "uv", None)
    name = str(getattr(material, "name", "") or "")
    if image is None or uv is None:
        return catalog_look(name, mtl, "", None), None
    # --- The picture, shrunk; pieces that share one share it here, too ---
    small = image.convert("RGBA")
    small.thumbnail((s.picture, s.picture), Image.Resampling.BOX)
    pixels = np.asarray(small)
    key = f"{entry.key}-{len(pictures)}"
    same = next(
        (k for k, known in pictures.items() if np.array_equal(known, pixels[..., :3])), None
    )
    pictures[same or key] = np.ascontiguousarray(pixels[..., :3])
    # --- Its mean colour, for the look ---
    opacity = pixels[..., 3] / 255.0
    linear = (pixels[..., :3][opacity > 0.5] / 255.0) ** 2.2
    mean = tuple(linear.mean(0).tolist()) if len(linear) else (0.5, 0.5, 0.5)
    return catalog_look(name, mtl, same or key, mean), opacity if (opacity < 0.5).any() else None  # type: ignore[arg-type]


def _solid(piece: trimesh.Trimesh, s: ReadingSettings) -> Solid:
    """The faces of a piece; texture coordinates as in the file, 0 where it has none."""
    vertices = np.asarray(piece.vertices, float)
    faces = np.asarray(piece.faces, np.int32)
    area = np.linalg.norm(face_normals(vertices, faces), axis=-1)
    # Faces without area have no normal.
    faces = faces[area > 1e-14 * max(float(np.ptp(vertices, axis=0).max()), 1e-9) ** 2]
    stored_uv = getattr(piece.visual, "uv", None)
    uv = None if stored_uv is None else np.nan_to_num(np.asarray(stored_uv, float))
    if "vertex_normals" in piece._cache.cache:
        normals = unit(np.nan_to_num(np.asarray(piece.vertex_normals, float)))
    else:
        source, faces, normals = creased(vertices, faces, s.crease)
        vertices = vertices[source]
        uv = None if uv is None else uv[source]
    return Solid(vertices, faces, normals, np.zeros((len(vertices), 2)) if uv is None else uv)


def from_the_sides(solid: Solid) -> Solid:
    """The solid with texture coordinates in metres, on each face along the axis that it faces most."""
    vertices = solid.vertices
    faces = solid.faces
    axis = np.abs(face_normals(vertices, faces)).argmax(-1)
    _, group = np.unique(faces.astype(np.int64) * 3 + axis[:, None], return_inverse=True)
    group = group.reshape(-1, 3)
    count = int(group.max(initial=-1)) + 1
    source = np.zeros(count, int)
    facing = np.zeros(count, int)
    source[group], facing[group] = faces, axis[:, None]
    other = np.array([[2, 1], [0, 2], [0, 1]])[facing]
    uv = np.take_along_axis(vertices[source], other, -1)
    return Solid(vertices[source], group.astype(np.int32), solid.normals[source], uv)


def _without_holes(solid: Solid, opacity: Array) -> tuple[Solid, float]:
    """(the faces whose picture is opaque, area of those that are so in part)."""
    corners = solid.uv[solid.faces]
    weights = np.random.default_rng(0).dirichlet((1, 1, 1), 24)
    place = np.einsum("kc,fcx->fkx", weights, corners) % 1
    h, w = opacity.shape
    column = (place[..., 0] * w).astype(int).clip(0, w - 1)
    row = ((1 - place[..., 1]) * h).astype(int).clip(0, h - 1)
    share = (opacity[row, column] > 0.5).mean(1)
    area = np.linalg.norm(face_normals(solid.vertices, solid.faces), axis=-1) / 2
    mixed = (share > 0.08) & (share < 0.92)
    return replace(solid, faces=solid.faces[share > 0.5]), float(area[mixed].sum())


def _fitted(solids: list[Solid], entry: CatalogEntry) -> list[Solid]:
    """The solids turned and stretched to the size of the entry."""
    turn = np.array(entry.turn).reshape(3, 3) if len(entry.turn) == 9 else np.eye(3)
    solids = [
        replace(solid, vertices=solid.vertices @ turn.T, normals=solid.normals @ turn.T)
        for solid in solids
    ]
    # Only vertices that faces use tell the size.
    used = joined(solids)
    corners = used.vertices[used.faces.ravel()]
    low = corners.min(0)
    high = corners.max(0)
    scale = np.array(entry.size) / np.maximum(high - low, 1e-9)
    # A flat model keeps its thickness in proportion.
    scale = np.where(high - low < 1e-6 * (high - low).max(), np.median(scale), scale)
    base = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return [
        replace(
            solid, vertices=(solid.vertices - base) * scale, normals=unit(solid.normals / scale)
        )
        for solid in solids
    ]
