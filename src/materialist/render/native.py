"""A part of a picture, path traced at another resolution than the camera's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from materialist.render.coverage import Box
from materialist.types import Array, Camera

_PATHS = 2**23
"""Paths traced together: bounds the memory."""


def only(scene, names: Sequence[str]):
    """The named shapes of a Mitsuba scene as a scene of their own, to see what hides them."""
    import mitsuba as mi

    chosen = {shape.id(): shape for shape in scene.shapes() if shape.id() in names}
    return mi.load_dict({"type": "scene", "embree_use_robust_intersections": True, **chosen})


def radiance(
    target, size: tuple[int, int], box: Box, *, spp: int, seed: int, max_depth: int, names: Sequence[str]
) -> Array:  # fmt: skip
    """[h, w, 3] float32 linear: a part of the picture of a `RenderScene` at another resolution, path traced.

    names: of shapes; the mean is over the rays that meet one of them first, and 0 where none does.
    """
    mi, camera = target.mi, target.camera
    h, w = box[1] - box[0], box[3] - box[2]
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
    scene, camera: Camera, size: tuple[int, int], box: Box, integrator, sampler, each: int, names: Sequence[str]
) -> Array:  # fmt: skip
    """[h * w, 4]: of each pixel's rays that count, the sum of what they bring, and their number."""
    import drjit as dr
    import mitsuba as mi

    top, bottom, left, right = box
    h, w = bottom - top, right - left
    half = float(np.tan(np.radians(camera.fov) / 2))
    pixel = dr.arange(mi.UInt32, h * w * each) // each
    inside = sampler.next_2d()
    # The sides of the working size are rounded, so at the upper and lower rim this may be off by half a pixel of it.
    x = (mi.Float(pixel % w) + left + inside.x) / size[1] * 2 - 1
    y = 1 - (mi.Float(pixel // w) + top + inside.y) / size[0] * 2
    direction = dr.normalize(mi.Vector3f(x * half, y * (half * camera.height / camera.width), -1))
    ray = mi.RayDifferential3f(mi.Point3f(0), direction)
    counts, first = mi.Bool(False), scene.ray_intersect_preliminary(ray)
    for one in scene.shapes():
        if one.id() in names:
            counts |= first.shape == mi.ShapePtr(one)
    light = integrator.sample(scene, sampler, ray, None, counts)[0]
    sums = [dr.zeros(mi.Float, h * w) for _ in range(4)]
    for total, value in zip(sums, (light.x, light.y, light.z, mi.Float(1)), strict=True):
        dr.scatter_reduce(dr.ReduceOp.Add, total, value, pixel, counts)
    dr.eval(*sums)
    return np.stack([np.array(total) for total in sums], -1).astype(np.float64)
