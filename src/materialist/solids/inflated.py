"""A body inflated from its outline: smooth and round, front and back alike.

Its half thickness h over the outline is that of a membrane under pressure: h^2 = 4 u, where u has Laplacian -1 inside
and is 0 on the outline. A circle gives a ball; a box, a pebble. Glass shows every fault of its normals, and predicted
normals are too flat and too uneven to bend light as a body does; an outline is known well.
"""

from dataclasses import dataclass

import numpy as np
import pyamg
from scipy.sparse import coo_matrix, csr_matrix, diags

from materialist.camera import pixel_rays, unit
from materialist.geometry.silhouette import silhouette_field, spacing, surface_in
from materialist.solids.symmetry import robust_plane
from materialist.types import Array, Camera

_TOLERANCE = 1e-6
"""Residual at which the membrane is solved, share of its first one."""
_NEAREST = 0.1
"""Least distance from a pixel's centre to the outline, pixels."""
_MARGIN = 10
"""Pixels beyond the frame for which the outline goes on, more than the distance field sees."""
_COARSEST = 500
"""Unknowns that multigrid solves directly."""


@dataclass(frozen=True)
class Inflated:
    """Front and back of the body, on the pixels of its outline; other pixels have the maps' front and no thickness."""

    depth: Array
    """[H, W] planar depth of the front, scene units."""
    normal: Array
    """[H, W, 3] unit, outwards, of the front."""
    thickness: Array
    """[H, W] float32 length of the camera rays inside, scene units."""
    back: Array
    """[H, W, 3] unit, outwards, of the back."""


def inflated(depth: Array, normal: Array, mask: Array, camera: Camera) -> Inflated:
    """The body inflated from the outline of a mask, where the depth map has its front.

    depth: [H, W] planar, scene units, 0 = none. normal: [H, W, 3] unit, kept outside the mask.
    mask: [H, W] bool or weights: one object; what the frame cuts goes on beyond it.
    Raises InputError for maps of different sizes, or a mask without any surface.
    """
    inside = surface_in(mask, depth, camera)
    rays = pixel_rays(camera).astype(np.float64)
    # --- The half thickness, in pixels, and its slopes ---
    pressed = _membrane(inside)
    half = 2 * np.sqrt(pressed)
    down, right = np.gradient(pressed)
    # h has the slopes 2 grad u / h: times h they stay finite on the outline.
    facing = np.stack([-2 * right, 2 * down, half], -1)

    # --- Normals: in the frame of the ray through its middle ---
    toward = -unit(rays[inside].mean(0))
    across = unit(np.cross([0.0, 1.0, 0.0], toward))
    axes = np.stack([across, np.cross(toward, across), toward])
    front = np.where(inside[..., None], unit(facing @ axes), normal)
    back = np.where(inside[..., None], unit(facing * [1, 1, -1] @ axes), -normal)

    # --- Depth: the middle between front and back lies in a plane ---
    share = half * spacing(rays)  # of its depth
    bulge = share * np.median((depth / np.maximum(1 - share, 0.1))[inside])
    middle = 1 / (depth + bulge)[inside]
    a, b, c = robust_plane(rays[inside][:, 0], rays[inside][:, 1], middle, np.ones(len(middle)))
    # The plane stays between the nearest and the farthest of what it is fitted to.
    plane = np.clip(a + b * rays[..., 0] + c * rays[..., 1], middle.min(), middle.max())
    length = np.linalg.norm(rays, axis=-1)
    nearest = np.where(inside, 1 / plane - bulge / length, depth)
    thickness = np.where(inside, 2 * bulge, 0).astype(np.float32)
    return Inflated(nearest, front, thickness, back)


def _membrane(inside: Array) -> Array:
    """[H, W] u >= 0, pixels squared: Laplacian -1 inside [H, W] bool, 0 outside; level where the frame cuts it."""
    # --- The unknowns, and their distance to the outline ---
    count = int(inside.sum())
    index = np.cumsum(inside.ravel()).reshape(inside.shape) - 1
    margin = np.s_[_MARGIN:-_MARGIN, _MARGIN:-_MARGIN]
    distance = silhouette_field(np.pad(inside, _MARGIN, mode="edge"))[margin]
    # --- The five-point Laplacian; beyond the frame the membrane goes on as at its edge ---
    diagonal = np.zeros(inside.shape)
    starts: list[Array] = []
    ends: list[Array] = []
    for near, far in (np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:]):
        both = inside[near] & inside[far]
        starts += [index[near][both], index[far][both]]
        ends += [index[far][both], index[near][both]]
        for one, other in ((near, far), (far, near)):
            # Next to the outline the slope is that to the outline, which is nearer than the neighbour.
            part = distance[one] / np.maximum(distance[one] - distance[other], 1e-6)
            to_outline = 1 / np.clip(part, _NEAREST, 1)
            diagonal[one] += np.where(inside[other], 1, to_outline) * inside[one]
    places = np.concatenate(starts), np.concatenate(ends)
    links = coo_matrix((-np.ones(len(places[0])), places), (count, count))
    # --- Solved ---
    # A mask without any outline has no largest thickness: the pull back bounds it.
    system = csr_matrix(links + diags(diagonal[inside] + 1e-3 / count))
    multigrid = pyamg.ruge_stuben_solver(system, max_coarse=_COARSEST, coarse_solver="splu")
    values = np.zeros(inside.shape)
    values[inside] = np.maximum(multigrid.solve(np.ones(count), tol=_TOLERANCE), 0)
    return values
