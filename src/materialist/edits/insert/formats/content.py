"""What the readers give: triangles with their materials, in the axes and units of the file."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from materialist.geometry.boundary import joined_faces
from materialist.types import Array, Surface


@dataclass(frozen=True)
class TextureLayout:
    """Where a texture lies on a mesh."""

    uv_set: int = 0
    """Number of the file's texture coordinates."""
    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    """Radians; see KHR_texture_transform."""
    scale: tuple[float, float] = (1.0, 1.0)
    wrap: tuple[str, str] = ("repeat", "repeat")
    """What lies outside of [0, 1] along u and v: `repeat`, `mirror` or `clamp`."""

    def placed(self, uv: Array) -> Array:
        """uv [V, 2], v DOWN, under the transform."""
        cos = np.cos(self.rotation)
        sin = np.sin(self.rotation)
        return uv * self.scale @ np.array([[cos, -sin], [sin, cos]]) + self.offset


@dataclass(frozen=True, eq=False)
class Paint:
    """A material of a file."""

    surface: Surface
    layout: TextureLayout = field(default_factory=TextureLayout)


@dataclass(frozen=True, eq=False)
class MeshPart:
    """Triangles with one material."""

    vertices: Array
    """[V, 3] float, finite or not."""
    faces: Array
    """[F, 3] whole numbers below V."""
    paint: Any = None
    """Key of its material; None for the grey of a file that says nothing."""
    name: str = "mesh"
    normals: Array | None = None
    """[V, 3] of any length."""
    uv: Array | None = None
    """[V, 2] v DOWN, as the layout of its material places them."""
    face_colours: Array | None = None
    """[F, 3] linear; they take the place of the material's albedo."""
    pieces: Array | None = None
    """[V] number of the mesh that a vertex belongs to, where the part was joined of several; edges stay between."""


@dataclass
class MeshContent:
    """All that is shown of a file."""

    parts: list[MeshPart] = field(default_factory=list)
    paints: dict[Any, Paint] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    """What the file has and the model has not, as in "its normal map"."""
    notes: list[str] = field(default_factory=list)
    """What differs from the file, as sentences without the file's name."""


def compacted(corners: Array, count: int) -> tuple[Array, Array]:
    """(numbers [n] int32 of the corners [n] among the used, the used [V] in order) of `count` vertices."""
    if count > 4 * len(corners):  # a few of many
        rows, places = np.unique(corners, return_inverse=True)
        return places.astype(np.int32), rows
    used = np.zeros(count, bool)
    used[corners] = True
    number = np.cumsum(used, dtype=np.int32) - 1
    return number[corners], np.flatnonzero(used)


def joined_part(parts: list[MeshPart]) -> MeshPart:
    """Parts of one material as one; all of them have normals, or none, and all have colours, or none."""
    if len(parts) == 1:
        return parts[0]
    sizes = [len(part.vertices) for part in parts]
    uv = None
    if any(part.uv is not None for part in parts):
        uv = np.concatenate(
            [np.zeros((n, 2)) if p.uv is None else p.uv for p, n in zip(parts, sizes)]
        )
    return MeshPart(
        *joined_faces(parts),
        parts[0].paint,
        parts[0].name,
        None if parts[0].normals is None else np.concatenate([part.normals for part in parts]),
        uv,
        None
        if parts[0].face_colours is None
        else np.concatenate([part.face_colours for part in parts]),
        np.repeat(np.arange(len(parts), dtype=np.int32), sizes),
    )


def mean_of_corners(colours: Array, faces: Array) -> Array:
    """[F, 3] float32 mean of the colours [V, 3] of each face's corners."""
    mean = colours[faces[:, 0]].astype(np.float32)
    for k in (1, 2):
        mean += colours[faces[:, k]]
    return mean / 3


def strip_faces(corners: Array) -> Array:
    """[n - 2, 3] triangles of a strip of corners [n]; every other one is turned, so that all face one way."""
    faces = np.stack([corners[:-2], corners[1:-1], corners[2:]], -1)
    faces[1::2] = faces[1::2, ::-1]
    return faces


def fan_faces(corners: Array) -> Array:
    """[n - 2, 3] triangles of a fan of corners [n] about the first."""
    return np.stack(
        [np.broadcast_to(corners[:1], len(corners) - 2), corners[1:-1], corners[2:]], -1
    )
