"""Meshes of a scene package: `mesh.ply`, and the bodies `bodies/N.ply` with their maps.

The PLY is written and read here and not by a mesh library, because every float comes back bit for bit with the pixel
and the plane of each face.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from materialist.errors import SceneError
from materialist.io.atomic import writing
from materialist.io.exr import write_exr
from materialist.io.manifest import MAPS, package_map
from materialist.types import Body, Mesh, Surface

_FACE = np.dtype(
    [("count", "u1"), ("vertex_indices", "<i4", 3), ("pixel", "<i4"), ("plane", "<i2")]
)

_SURFACE_KEYS = ("transmission", "ior", "tint", "emission", "glass_roughness")
"""What scene.json says of the surface of a body."""
_HEADER = """\
ply
format binary_little_endian 1.0
comment materialist scene mesh: camera frame, -Z ahead, +Y up
comment s = u to the right, t = v DOWN (image rows), pixel centres at ((column + 0.5) / W, (row + 0.5) / H)
comment pixel = row-major index of the pixel the face carries; plane = -1 depth surface, k continuation of plane k
element vertex {vertices}
property float x
property float y
property float z
property float nx
property float ny
property float nz
property float s
property float t
element face {faces}
property list uchar int vertex_indices
property int pixel
property short plane
end_header
"""


def write_ply(path: str | Path, mesh: Mesh) -> None:
    """Write the mesh; texture coordinate t is Mesh.uv's v unchanged (DOWN), so that it stays exact."""
    vertices = np.concatenate([mesh.vertices, mesh.normals, mesh.uv], -1).astype("<f4")  # [V, 8]
    faces = np.empty(len(mesh.faces), _FACE)
    faces["count"] = 3
    faces["vertex_indices"] = mesh.faces
    faces["pixel"] = mesh.face_pixel
    faces["plane"] = mesh.face_plane
    # The whole header is fixed but for two numbers, so that reading can compare it.
    header = _HEADER.format(vertices=len(vertices), faces=len(faces)).encode()
    with writing(path):
        Path(path).write_bytes(header + vertices.tobytes() + faces.tobytes())


def read_ply(path: str | Path, pixels: int | None = None) -> Mesh:
    """Read a mesh that `write_ply` wrote, for a photo of `pixels`. Raises SceneError for a damaged or foreign PLY."""
    path = Path(path)
    with path.open("rb") as file:
        head, mark, _ = file.read(2048).partition(b"end_header\n")
        header_counts = re.findall(rb"^element \w+ (\d{1,10})$", head, re.MULTILINE)
        counts = [int(count) for count in header_counts]
        if (
            len(counts) != 2
            or head + mark != _HEADER.format(vertices=counts[0], faces=counts[1]).encode()
        ):
            raise SceneError(
                f"The mesh {path} was not written by this program; the scene package is damaged."
            )
        # --- Sizes: exactly as many bytes as the header promises ---
        split = counts[0] * 32  # bytes of eight floats
        if path.stat().st_size != len(head + mark) + split + counts[1] * _FACE.itemsize:
            raise SceneError(f"The mesh {path} is truncated; save the scene again.")
        file.seek(len(head + mark))
        vertices = np.frombuffer(file.read(split), "<f4").reshape(-1, 8)
        faces = np.frombuffer(file.read(), _FACE)
    # --- Values: a damaged file must not crash the renderer later ---
    corners = faces["vertex_indices"]
    if (faces["count"] != 3).any() or not np.isfinite(vertices).all():
        raise SceneError(
            f"The mesh {path} has faces that are no triangles, or vertices that are NaN; it is damaged."
        )
    if corners.size and not 0 <= corners.min() <= corners.max() < len(vertices):
        raise SceneError(f"The mesh {path} has faces of vertices that do not exist; it is damaged.")
    pixel = faces["pixel"]
    if pixels is not None and pixel.size and not 0 <= pixel.min() <= pixel.max() < pixels:
        raise SceneError(f"The mesh {path} has faces of pixels that do not exist; it is damaged.")
    positions, normals, uv = (
        np.array(part, np.float32, order="C") for part in np.split(vertices, [3, 6], axis=1)
    )
    return Mesh(
        positions,
        corners.astype(np.int32),
        normals,
        uv,
        pixel.astype(np.int32),
        faces["plane"].astype(np.int16),
    )


def write_bodies(folder: Path, bodies: Sequence[Body]) -> list[dict[str, Any]]:
    """Write the files below the package `folder`; returns the entries for scene.json."""
    (folder / "bodies").mkdir()
    entries: list[dict[str, Any]] = []
    for k, body in enumerate(bodies):
        surface = body.surface
        write_ply(folder / "bodies" / f"{k}.ply", body.mesh)
        for name in MAPS[:3]:
            write_exr(folder / "bodies" / f"{k}.{name}.exr", getattr(surface, name))
        entries.append({"name": body.name, **{key: getattr(surface, key) for key in _SURFACE_KEYS}})
    return entries


def read_bodies(folder: Path, entries: Sequence[dict[str, Any]]) -> tuple[Body, ...]:
    """The bodies of the package `folder`. Raises SceneError where a file is missing or damaged."""
    bodies = []
    for k, entry in enumerate(entries):
        mesh = read_ply(folder / f"bodies/{k}.ply")
        albedo, roughness, metallic = (
            package_map(folder / f"bodies/{k}.{name}.exr") for name in MAPS[:3]
        )
        # Channels: the renderer would crash on others.
        if (albedo.shape[2:], roughness.ndim, metallic.ndim) != ((3,), 2, 2):
            raise SceneError(
                f"The maps of body {k} have other channels than they need; the package is damaged."
            )
        # A key may be missing, or null: then the surface has its default.
        values: dict[str, Any] = {
            key: _number_or_colour(entry[key])
            for key in _SURFACE_KEYS
            if entry.get(key) is not None
        }
        surface = Surface(albedo, roughness, metallic, **values)
        bodies.append(
            Body(mesh.vertices, mesh.faces, mesh.normals, mesh.uv, surface, str(entry["name"]))
        )
    return tuple(bodies)


def _number_or_colour(value: Any) -> float | tuple[float, float, float]:
    """A number, or a colour from a list of three."""
    if not isinstance(value, list):
        return float(value)
    r, g, b = (float(channel) for channel in value)
    return r, g, b
