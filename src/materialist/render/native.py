"""A part of a picture, path traced at another resolution than the camera's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from materialist.geometry.silhouette import area
from materialist.render.coverage import Box, directions
from materialist.types import Array, Camera

_PATHS = 2**23
"""Paths traced together: bounds the memory."""


def radiance(
    target, size: tuple[int, ...], box: Box, *, spp: int, seed: int, max_depth: int, names: Sequence[str]
) -> Array:  # fmt: skip
    """[h, w, 3] float32 linear: a part of the picture of a `RenderScene` at another resolution, path traced.

    names: of shapes; the mean is over the rays that meet one of them first, and 0 where none does.
    """
    mi, camera = target.mi, target.camera
    h, w = (side.stop - side.start for side in box)
    # Bounded wavefronts, and whole squares of samples, which suit the sampler.
    passes = max(1, -(-spp * h * w // _PATHS))
    each = int(np.ceil(np.sqrt(spp / passes))) ** 2
    integrator = mi.load_dict({"type": "path", "max_depth": max_depth})
    sampler = mi.load_dict({"type": "multijitter", "sample_count": each})
    total = np.zeros((h * w, 4))
    for k in range(passes):
        sampler.seed((seed * 9973 + k) & 0xFFFFFFFF, h * w * each)
        total += _sums(target.mi_scene, camera, size, box, integrator, sampler, each, names)
    mean = total[:, :3] / np.maximum(total[:, 3:], 1)
    return np.ascontiguousarray(mean.reshape(h, w, 3), np.float32)


def _sums(
    scene, camera: Camera, size: tuple[int, ...], box: Box, integrator, sampler, each: int, names: Sequence[str]
) -> Array:  # fmt: skip
    """[h * w, 4]: of each pixel's rays that count, the sum of what they bring, and their number."""
    import drjit as dr
    import mitsuba as mi

    count = area(box)
    pixel, inside = dr.arange(mi.UInt32, count * each) // each, sampler.next_2d()
    ray = mi.RayDifferential3f(mi.Point3f(0), directions(camera, size, box, pixel, inside.x, inside.y))
    counts, first = mi.Bool(False), scene.ray_intersect_preliminary(ray)
    for one in scene.shapes():
        if one.id() in names:
            counts |= first.shape == mi.ShapePtr(one)
    light = integrator.sample(scene, sampler, ray, None, counts)[0]
    sums = [dr.zeros(mi.Float, count) for _ in range(4)]
    for total, value in zip(sums, (light.x, light.y, light.z, mi.Float(1)), strict=True):
        dr.scatter_reduce(dr.ReduceOp.Add, total, value, pixel, counts)
    dr.eval(*sums)
    return np.stack([np.array(total) for total in sums], -1).astype(np.float64)
