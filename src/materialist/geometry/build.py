"""Everything the later stages need to know about the scene's shape, in one call."""

from __future__ import annotations

import numpy as np

from materialist.errors import InputError
from materialist.geometry.boundary import depth_to_mesh
from materialist.geometry.completion import complete
from materialist.geometry.planes import find_planes
from materialist.types import Array, Camera, Geometry


def build_geometry(
    depth: Array, normal: Array, camera: Camera, *, tau: float = 6.0, completion: str = "planes", seed: int = 0
) -> Geometry:
    """Mesh of the depth map (paper, Mesh Reconstruction), with the dominant planes continued where nothing is seen.

    depth: [H, W] planar scene units, 0 = none. normal: [H, W, 3] unit, camera frame. tau: degrees in (0, 90).
    completion: "planes" or "none". Raises InputError for maps or options that cannot be used.
    """
    if completion not in ("planes", "none"):
        raise InputError(f"Completion is '{completion}'; choose 'planes' or 'none'.")
    mesh = depth_to_mesh(depth, normal, camera, tau=tau)
    label = np.full((camera.height, camera.width), -1, np.int8)  # [H, W]
    if completion == "none":
        return Geometry(mesh, label)
    planes = find_planes(depth, normal, camera, seed=seed)
    for k, plane in enumerate(planes):
        label[plane.mask] = k
    return Geometry(complete(mesh, planes, depth, camera), label)
