"""Where straight rays enter and leave a mesh (paper, Refraction Network Details: the optical path length d_GT)."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.buffers import floats
from materialist.camera import unit
from materialist.render.scene import shape
from materialist.render.variant import setup
from materialist.types import Array
from materialist_lab.procedural.objects.shapes import Solid, face_normals

MOST = 24
"""Surfaces that a ray is followed through."""
AHEAD = 2e-4
"""How far behind a surface the search for the next one begins; shapes are about 1 large."""


@dataclass(frozen=True)
class Paths:
    """Rays through one mesh; lengths are in units of each ray's direction."""

    first: Array
    """[N] float64 distance of the first surface, inf where there is none."""
    normal: Array
    """[N, 3] float64 shading normal there, outwards, not normalised."""
    last: Array
    """[N] distance of the last surface; as `first` where there is one alone."""
    exit_normal: Array
    """[N, 3] float64 shading normal at the last surface, not normalised."""
    material: Array
    """[N] length inside the material, told by which way the surfaces face: the walls of a hollow object."""

    @property
    def solid(self) -> Array:
        """[N] the paper's length through a solid object: from its first to its last surface."""
        return np.where(np.isfinite(self.first), self.last - self.first, 0)


def towards(normal: Array, direction: Array, sign: int) -> Array:
    """[N, 3] unit normals on the side of directions [N, 3] that `sign` says (-1: against them).

    What is seen faces the viewer, also where the shading normals of coarse triangles do not.
    """
    normal = unit(normal)
    return np.where(sign * np.sum(normal * direction, -1, keepdims=True) < 0, -normal, normal)


class ShapeTracer:
    """One mesh to be shot at."""

    def __init__(self, solid: Solid):
        setup()
        scene = {
            "type": "scene",
            "embree_use_robust_intersections": True,
            "shape": shape(mi, solid),
        }
        self._scene = mi.load_dict(scene)
        self._faces = solid.faces
        self._normals = solid.normals
        self._flat = face_normals(solid.vertices, solid.faces)

    def trace(self, origin: Array, direction: Array) -> Paths:
        """Follow straight rays (origin and direction [N, 3]) through everything they meet."""
        count = len(direction)
        first = np.full(count, np.inf)
        last = np.zeros(count)
        material = np.zeros(count)
        normal = np.zeros((count, 3))
        leaving = np.zeros((count, 3))
        depth = np.zeros(count, int)  # how many surfaces the ray is inside of
        alive = np.arange(count)
        at = np.zeros(count)
        step = AHEAD / np.linalg.norm(direction, axis=-1)
        for k in range(MOST):
            t, face, uv = self._nearest(
                origin[alive] + at[alive, None] * direction[alive], direction[alive]
            )
            hit = np.isfinite(t)
            alive = alive[hit]
            t = t[hit]
            face = face[hit]
            uv = uv[hit]
            if not len(alive):
                break
            reached = at[alive] + t
            leaving[alive] = self._shading(face, uv)
            if k == 0:
                first[alive], normal[alive] = reached, leaving[alive]
            # The way that the previous surface opened; nothing before the first.
            material[alive] += np.where((depth[alive] > 0) & (k > 0), reached - last[alive], 0)
            entering = np.sum(self._flat[face] * direction[alive], -1) < 0
            depth[alive] = np.maximum(depth[alive] + np.where(entering, 1, -1), 0)
            last[alive] = reached
            at[alive] = reached + step[alive]
        return Paths(first, normal, last, leaving, material)

    def _shading(self, face: Array, uv: Array) -> Array:
        """[n, 3] normals between the corners of faces [n]."""
        a, b, c = (self._normals[self._faces[face, k]] for k in range(3))
        return a * (1 - uv[:, :1] - uv[:, 1:]) + b * uv[:, :1] + c * uv[:, 1:]

    def _nearest(self, origin: Array, direction: Array) -> tuple[Array, Array, Array]:
        """Distance [n] (inf for none), face [n] and place in it [n, 2] (0 for none) of every ray's nearest surface."""
        start, way = (mi.Vector3f(*(floats(mi, c) for c in x.T)) for x in (origin, direction))
        ray = mi.Ray3f(mi.Point3f(start), way)
        preliminary = self._scene.ray_intersect_preliminary(ray, coherent=False)
        # Where nothing is hit, Mitsuba leaves face and place unwritten.
        hit = preliminary.is_valid()
        face = dr.select(hit, preliminary.prim_index, 0)
        uv = dr.select(hit, preliminary.prim_uv, 0)
        return np.array(preliminary.t, np.float64), np.array(face), np.array(uv, np.float64).T
