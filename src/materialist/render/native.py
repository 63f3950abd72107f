"""Some pixels of a picture, path traced, at the camera's resolution or another."""

from collections.abc import Sequence

import numpy as np

from materialist.buffers import integers
from materialist.render.coverage import Box, directions, pixel_numbers
from materialist.types import Array

_PATHS = 2**23
"""Paths traced together: bounds the memory."""


def radiance(
    target, size: tuple[int, ...], where: Box | Array, *, spp: int, seed: int, max_depth: int,
    names: Sequence[str] | None = None,
) -> Array:  # fmt: skip
    """[..., 3] float32 linear radiance of pixels of a `RenderScene`, path traced, with at least `spp` paths each.

    size: (H, W) of the whole picture. where: the pixels, in the order of the result, as of `pixel_numbers`.
    names: of shapes; the mean is then over the rays that meet one of them first, and 0 where none does.
    """
    mi, pixels = target.mi, pixel_numbers(size, where)
    # Bounded wavefronts, and whole squares of samples, which suit the sampler.
    passes = max(1, -(-spp * pixels.size // _PATHS))
    each = int(np.ceil(np.sqrt(spp / passes))) ** 2
    integrator = mi.load_dict({"type": "path", "max_depth": max_depth})
    sampler = mi.load_dict({"type": "multijitter", "sample_count": each})
    sampler.set_samples_per_wavefront(each)
    total = np.zeros((pixels.size, 4))
    for k in range(passes):
        sampler.seed((seed * 9973 + k) & 0xFFFFFFFF, pixels.size * each)
        total += _sums(target, size, pixels.ravel(), integrator, sampler, each, names)
    mean = total[:, :3] / np.maximum(total[:, 3:], 1)
    return np.ascontiguousarray(mean.reshape(*pixels.shape, 3), np.float32)


def _sums(
    target, size: tuple[int, ...], pixels: Array, integrator, sampler, each: int, names: Sequence[str] | None
) -> Array:  # fmt: skip
    """[n, 4]: of each pixel's rays that count, the sum of what they bring, and their number."""
    import drjit as dr

    mi, scene = target.mi, target.mi_scene
    # Numbers that differ from call to call are data, or every call would be compiled anew.
    slot = dr.arange(mi.UInt32, len(pixels) * each) // dr.opaque(mi.UInt32, each)
    inside = sampler.next_2d()
    way = directions(target.camera, size, dr.gather(mi.UInt32, integers(mi, pixels), slot), inside.x, inside.y)
    ray, counts = mi.RayDifferential3f(mi.Point3f(0), way), mi.Bool(True)
    if names is not None:
        first, counts = scene.ray_intersect_preliminary(ray), mi.Bool(False)
        for one in scene.shapes():
            if one.id() in names:
                counts |= first.shape == mi.ShapePtr(one)
    light = integrator.sample(scene, sampler, ray, None, counts)[0]
    sums = [dr.zeros(mi.Float, len(pixels)) for _ in range(4)]
    for total, value in zip(sums, (light.x, light.y, light.z, mi.Float(1)), strict=True):
        dr.scatter_reduce(dr.ReduceOp.Add, total, value, slot, counts)
    dr.eval(*sums)
    return np.stack([np.array(total) for total in sums], -1).astype(np.float64)
