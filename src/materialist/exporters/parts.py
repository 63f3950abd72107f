"""The scene as the other programs want it: meshes with one material each."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from materialist.errors import InputError
from materialist.geometry.build import part, rebuilt
from materialist.types import Array, Camera, Geometry, Materials, Mesh, Scene, Surface

_NEUTRAL = ((0.5, 0.5, 0.5), 0.5, 0.0)
"""Albedo, roughness and metallic of a plane that no pixel lies on, as the renderer has it."""


@dataclass(frozen=True)
class Part:
    """A mesh and its material: the depth surface with the maps, a continued plane with their mean, or a body."""

    name: str
    mesh: Mesh
    """Faces of this part alone; uv as everywhere: u right, v DOWN."""
    materials: Materials
    """Maps [H, W], looked up by uv without filtering; [1, 1] for a constant."""
    surface: Surface | None = None
    """For a body: its own material, whose maps repeat and are filtered."""

    @property
    def prefix(self) -> str:
        """What the names of its maps begin with, where they are files."""
        return "" if self.name == "surface" else f"{self.name}_"

    @property
    def constant(self) -> bool:
        """Whether one value stands for the whole part."""
        return self.materials.roughness.size == 1


def scene_parts(scene: Scene, max_triangles: int | None = None) -> list[Part]:
    """The depth surface, then the continued planes, with the materials the renderer gives them.

    max_triangles: rebuild the mesh from a coarser depth map where the scene's has more triangles than this; the
        texture keeps its size. None: the scene's own mesh.
    Raises InputError for a mesh without a depth surface, and where so few triangles do not show the scene.
    """
    geometry = scene.geometry
    if not (geometry.mesh.face_plane == -1).any():
        raise InputError(
            "The mesh has no depth surface to export; give a depth map with some values above 0."
        )
    materials = scene.materials
    if max_triangles is not None and len(geometry.mesh.faces) > max_triangles:
        geometry, materials = _reduced(scene, max_triangles)
    planes = [int(k) for k in np.unique(geometry.mesh.face_plane) if k >= 0]
    constants = [
        Part(f"plane{k}", part(geometry.mesh, k), _mean(materials, geometry.plane_label == k))
        for k in planes
    ]
    return [Part("surface", part(geometry.mesh, -1), scene.materials), *constants]


def body_parts(scene: Scene) -> list[Part]:
    """A part for every body of the scene, named `body0`, `body1`, ..."""
    return [
        Part(f"body{k}", body.mesh, _one_size(body.surface), body.surface)
        for k, body in enumerate(scene.bodies)
    ]


def farthest(parts: list[Part]) -> float:
    """Distance of the farthest vertex from the camera, scene units."""
    return max(float(np.linalg.norm(part.mesh.vertices, axis=1).max()) for part in parts)


def one_roughness(part: Part) -> Materials:
    """The part's maps for formats in which glass and the opaque share have one roughness: their mean, by share."""
    surface = part.surface
    if surface is None or surface.transmission == 0:
        return part.materials
    share = np.float32(surface.transmission)
    mixed = (1 - share) * part.materials.roughness + share * np.float32(surface.interface_roughness)
    return replace(part.materials, roughness=mixed.astype(np.float32))


def _one_size(surface: Surface) -> Materials:
    """The maps at the size of the largest, by repetition of texels."""
    maps = (surface.albedo, surface.roughness, surface.metallic)
    height, width = (max(m.shape[axis] for m in maps) for axis in (0, 1))

    def grown(values: Array) -> Array:
        rows = np.arange(height) * values.shape[0] // height
        columns = np.arange(width) * values.shape[1] // width
        return np.ascontiguousarray(values[np.ix_(rows, columns)])

    return Materials(*(grown(values) for values in maps))


def _mean(materials: Materials, members: Array) -> Materials:
    """[1, 1] mean of the maps over the pixels [H, W] of a plane."""
    values: Iterable[Any] = _NEUTRAL
    if members.any():
        values = [maps[members].mean(0, dtype=np.float64) for maps in vars(materials).values()]
    return Materials(*(np.asarray(value, np.float32)[None, None] for value in values))


def _reduced(scene: Scene, most: int) -> tuple[Geometry, Materials]:
    """Geometry of a coarser depth map with at most `most` triangles, and the maps at its size."""
    camera = scene.camera
    factor = np.sqrt(most / len(scene.geometry.mesh.faces))
    for _ in range(12):
        width, height = (max(2, round(size * factor)) for size in (camera.width, camera.height))
        # Every n-th pixel, not a mean: a mean across an edge is a depth that nothing has.
        rows = ((np.arange(height) + 0.5) * camera.height / height).astype(int)
        columns = ((np.arange(width) + 0.5) * camera.width / width).astype(int)
        pick = np.ix_(rows, columns)
        coarse = Camera(width, height, camera.fov)
        if not (scene.depth[pick] > 0).any():
            break
        geometry = rebuilt(scene, scene.depth[pick], scene.normal[pick], coarse)
        if len(geometry.mesh.faces) <= most:
            m = scene.materials
            maps = Materials(m.albedo[pick], m.roughness[pick], m.metallic[pick])
            # On the photo's frame: the coarse picture's sides are rounded, so its pixels are not quite square.
            stretch = np.array(
                [1, (camera.height / camera.width) / (height / width), 1], np.float32
            )
            mesh = replace(geometry.mesh, vertices=geometry.mesh.vertices * stretch)
            return replace(geometry, mesh=mesh), maps
        # Triangles grow with the square of the factor; 5 % less so that it ends.
        factor *= 0.95 * np.sqrt(min(1.0, most / len(geometry.mesh.faces)))
    raise InputError(f"The scene cannot be shown with {most} triangles; allow more.")
