"""Everything the later stages need to know about the scene's shape, in one call."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from materialist.errors import InputError
from materialist.geometry.boundary import depth_to_mesh
from materialist.geometry.completion import complete
from materialist.geometry.creases import split_creases
from materialist.geometry.ends import Ends
from materialist.geometry.planes import find_planes
from materialist.types import Array, Camera, Geometry

COMPLETIONS = ("planes", "floors", "none")
"""What can be added to what the picture shows: the dominant planes continued, the same with walls (planes that do not
face up) ending at the frame, nothing."""
SYNONYMS = {"planes,backs": "planes", "floors,backs": "floors"}
"""Names of older scenes and scripts, whose objects had backs."""


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
    completion: one of `COMPLETIONS` or `SYNONYMS`. ends: where continued walls end, if that is known.
    Raises InputError for maps or options that cannot be used.
    """
    completion = completion_named(completion)
    mesh = depth_to_mesh(depth, normal, camera, tau=tau)
    label = np.full((camera.height, camera.width), -1, np.int8)  # [H, W] plane of each pixel
    if completion != "none":
        planes = find_planes(depth, normal, camera, seed=seed)
        for k, plane in enumerate(planes):
            label[plane.mask] = k
        mesh = complete(mesh, planes, depth, camera, walls=completion == "planes", ends=ends)
    return Geometry(split_creases(mesh, depth, normal), label)


def completion_named(name: str) -> str:
    """One of `COMPLETIONS` for its name or a synonym of it; InputError for any other name."""
    found = SYNONYMS.get(name, name)
    if found not in COMPLETIONS:
        raise InputError(f"Completion is '{name}'; choose one of {', '.join(map(repr, COMPLETIONS))}.")
    return found


def completion_of(geometry: Geometry, told: str | None = None) -> str:
    """The completion a geometry was built with: what a scene's provenance has `told`, else read off its mesh."""
    found = SYNONYMS.get(told or "", told)
    if found in COMPLETIONS:
        return found
    return "planes" if (geometry.mesh.face_plane >= 0).any() else "none"
