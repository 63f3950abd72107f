"""Everything the later stages need to know about the scene's shape, in one call."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from materialist.errors import InputError
from materialist.geometry.backs import backs_of
from materialist.geometry.boundary import depth_to_mesh
from materialist.geometry.completion import complete, join, structural
from materialist.geometry.creases import split_creases
from materialist.geometry.ends import Ends
from materialist.geometry.inflate import inflated
from materialist.geometry.objects import find_objects
from materialist.geometry.planes import find_planes
from materialist.geometry.rims import set_back_rims
from materialist.types import Array, Camera, Geometry, Mesh

COMPLETIONS = ("planes,backs", "floors,backs", "planes", "none")
"""What can be added to what the picture shows: continued planes and backs of objects, the same with walls (planes that
do not face up) ending at the frame, planes alone, nothing."""


def build_geometry(
    depth: Array,
    normal: Array,
    camera: Camera,
    *,
    tau: float = 6.0,
    completion: str = "planes",
    ends: Sequence[Ends] = (),
    seed: int = 0,
) -> Geometry:
    """Mesh of the depth map (paper, Mesh Reconstruction), with the dominant planes continued where nothing is seen.

    depth: [H, W] planar scene units, 0 = none. normal: [H, W, 3] unit, camera frame. tau: degrees in (0, 90).
    completion: one of `COMPLETIONS`. ends: where continued walls end, if that is known.
    Raises InputError for maps or options that cannot be used.
    """
    if completion not in COMPLETIONS:
        raise InputError(f"Completion is '{completion}'; choose one of {', '.join(map(repr, COMPLETIONS))}.")
    bare = depth_to_mesh(depth, normal, camera, tau=tau)
    mesh, label = _completed(bare, depth, normal, camera, completion, ends, seed)
    return Geometry(split_creases(mesh, depth, normal), label)


def _completed(
    mesh: Mesh, depth: Array, normal: Array, camera: Camera, completion: str, ends: Sequence[Ends], seed: int
) -> tuple[Mesh, Array]:
    """The mesh of a depth map with what its picture does not show, and the plane of each pixel [H, W] int8."""
    label = np.full((camera.height, camera.width), -1, np.int8)  # [H, W]
    if completion == "none":
        return mesh, label
    planes = find_planes(depth, normal, camera, seed=seed)
    for k, plane in enumerate(planes):
        label[plane.mask] = k
    bounds = structural(planes, depth, camera)
    taken = np.logical_or.reduce([label < -1, *(plane.mask for plane in bounds)])  # [H, W] bool
    objects = find_objects(mesh, depth, normal, taken) if completion.endswith("backs") else None
    walls = completion != "floors,backs"
    if objects is None or not (objects.label >= 0).any():
        return complete(mesh, planes, depth, camera, walls=walls, ends=ends), label
    thickness = inflated(objects, depth, 1 / camera.focal)  # [H, W] scene units
    mesh = set_back_rims(mesh, objects, thickness, depth, normal, camera)
    backs = backs_of(mesh, objects, thickness, depth, bounds)
    return join([complete(mesh, planes, depth, camera, walls=walls, ends=ends), backs]), label


def completion_of(geometry: Geometry, told: str | None = None) -> str:
    """Which of `COMPLETIONS` a geometry was built with: what a scene's provenance has `told`, else read off its mesh.

    A mesh without objects has no backs, and one without walls does not tell whether there were any.
    """
    if told in COMPLETIONS:
        return told
    mesh = geometry.mesh
    corners = mesh.vertices[mesh.faces[mesh.face_plane < 0]].astype(np.float64)  # [F, 3, 3]
    away = (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * corners[:, 0]).sum(-1)
    # Seen from the camera, a back turns the other way than everything else.
    if (away > 1e-9 * np.abs(away).max(initial=0)).any():
        return "planes,backs"
    return "planes" if (mesh.face_plane >= 0).any() else "none"
