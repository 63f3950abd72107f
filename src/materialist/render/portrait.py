"""Bodies on their own, at any resolution: what part of a pixel they cover, and how bright they are there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from materialist.types import Array, Body, Camera

GRID = 4
"""Rays along each side of a pixel."""
PAST = 1e-4
"""Part of the way to a body that is left for rays which start past what hides it."""
_RAYS = 2**20
"""Pixels looked at together: bounds the memory."""
_PATHS = 2**23
"""Paths traced together."""
Box = tuple[int, int, int, int]
"""Rows and columns (top, bottom, left, right) of a part of a picture, the ends excluded."""


@dataclass(frozen=True)
class Sight:
    """What rays through the pixels of a box see first, of some bodies; means over the rays that meet one."""

    share: Array
    """[h, w] float32 in [0, 1]: share of each pixel in which one of the bodies is seen."""
    albedo: Array
    """[h, w, 3] float32 in [0, 1]; 0 where none is seen. White for glass and mirrors, as denoisers want it."""
    normal: Array
    """[h, w, 3] float32, camera frame; 0 where none is seen."""
    depth: Array
    """[h, w] float32 planar, scene units; 0 where none is seen."""


def look(scene, camera: Camera, bodies: dict[str, Body], size: tuple[int, int], box: Box) -> Sight:
    """See `Sight`.

    Args:
        scene: a Mitsuba scene in which the bodies are shapes by these names (`RenderScene.mi_scene`).
        size: (H, W) of the whole picture. box: the part of it that is wanted.
    """
    top, bottom, left, right = box
    rows = max(1, _RAYS // max(right - left, 1))
    strips = [
        _strip(scene, camera, bodies, size, (first, min(first + rows, bottom), left, right))
        for first in range(top, bottom, rows)
    ]
    whole = lambda name: np.concatenate([getattr(strip, name) for strip in strips])  # noqa: E731
    return Sight(whole("share"), whole("albedo"), whole("normal"), whole("depth"))


def _strip(scene, camera: Camera, bodies: dict[str, Body], size: tuple[int, int], box: Box) -> Sight:
    """A few rows of `look`."""
    import drjit as dr
    import mitsuba as mi

    top, bottom, left, right = box
    h, w = bottom - top, right - left
    half = float(np.tan(np.radians(camera.fov) / 2))
    shapes = {shape.id(): shape for shape in scene.shapes()}
    row, column = (a.ravel().astype(np.float32) for a in np.mgrid[top:bottom, left:right])
    total = np.zeros((h * w, 8))
    for k in range(GRID * GRID):
        x = (mi.Float(column) + dr.opaque(mi.Float, (k % GRID + 0.5) / GRID)) / size[1] * 2 - 1
        y = 1 - (mi.Float(row) + dr.opaque(mi.Float, (k // GRID + 0.5) / GRID)) / size[0] * 2
        direction = mi.Vector3f(x * half, y * (half * camera.height / camera.width), -1)
        si = scene.ray_intersect(mi.Ray3f(mi.Point3f(0), dr.normalize(direction)))
        normal, uv, depth = np.array(si.sh_frame.n).T, np.array(si.uv).T, -np.array(si.p.z)
        for name, body in bodies.items():
            hit = np.array(si.is_valid() & (si.shape == mi.ShapePtr(shapes[name])))
            if hit.any():
                part = [np.ones((hit.sum(), 1)), _albedo(body, uv[hit]), normal[hit], depth[hit, None]]
                total[hit] += np.concatenate(part, 1)
    count = np.maximum(total[:, :1], 1)
    take = lambda v: np.ascontiguousarray(v.reshape(h, w, -1), np.float32)  # noqa: E731
    share = take(total[:, :1] / GRID**2)[..., 0]
    return Sight(share, take(total[:, 1:4] / count), take(total[:, 4:7] / count), take(total[:, 7:] / count)[..., 0])


def _albedo(body: Body, uv: Array) -> Array:
    """[n, 3] albedo at texture coordinates [n, 2], repeated; white where light goes on in one direction."""
    surface = body.surface
    h, w = surface.albedo.shape[:2]
    x, y = (np.floor(np.nan_to_num(uv[:, k]) * n).astype(np.int64) % n for k, n in ((0, w), (1, h)))
    clear = max(surface.transmission, float(surface.metallic.mean() * (surface.roughness.mean() < 0.2)))
    return surface.albedo[y, x] * (1 - clear) + clear


def only(scene, names: Sequence[str]):
    """The named shapes of a Mitsuba scene as a scene of their own, to see what hides them."""
    import mitsuba as mi

    chosen = {shape.id(): shape for shape in scene.shapes() if shape.id() in names}
    return mi.load_dict({"type": "scene", "embree_use_robust_intersections": True, **chosen})


def radiance(
    target, size: tuple[int, int], box: Box, *, spp: int, seed: int, max_depth: int, names: Sequence[str] | None = None,
    gap: float = np.inf,
) -> Array:  # fmt: skip
    """[h, w, 3] float32 linear: a part of the picture of a `RenderScene` at another resolution, path traced.

    names: of shapes; the mean is over the rays that meet one of them first, and 0 where none does. gap: what stands by
    more than this (scene units) before one of them hides it from no ray: its outline may be elsewhere in the photo.
    """
    mi, camera = target.mi, target.camera
    h, w = box[1] - box[0], box[3] - box[2]
    # Bounded wavefronts, and whole squares of samples, which suit the sampler.
    passes = max(1, -(-spp * h * w // _PATHS))
    each = int(np.ceil(np.sqrt(spp / passes))) ** 2
    integrator = mi.load_dict({"type": "path", "max_depth": max_depth})
    sampler = mi.load_dict({"type": "multijitter", "sample_count": each})
    total = np.zeros((h * w, 4))
    alone = only(target.mi_scene, names) if names is not None and np.isfinite(gap) else None
    for k in range(passes):
        sampler.seed((seed * 9973 + k) & 0xFFFFFFFF, h * w * each)
        total += _sums(target.mi_scene, camera, size, box, integrator, sampler, each, names, (alone, gap))
    mean = total[:, :3] / np.maximum(total[:, 3:], 1)
    return np.ascontiguousarray(mean.reshape(h, w, 3), np.float32)


def _sums(
    scene, camera: Camera, size: tuple[int, int], box: Box, integrator, sampler, each: int, names, behind
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
    counts = mi.Bool(names is None)
    if names is not None:
        first = scene.ray_intersect(ray)
        for one in scene.shapes():
            if one.id() in names:
                counts |= first.shape == mi.ShapePtr(one)
        alone, gap = behind
        if alone is not None:
            own = alone.ray_intersect(ray)
            past = ~counts & own.is_valid() & ((own.t - first.t) * -direction.z > gap)
            ray.o = dr.select(past, own.p - direction * (PAST * own.t), ray.o)
            counts |= past
    light = integrator.sample(scene, sampler, ray, None, counts)[0]
    sums = [dr.zeros(mi.Float, h * w) for _ in range(4)]
    for total, value in zip(sums, (light.x, light.y, light.z, mi.Float(1)), strict=True):
        dr.scatter_reduce(dr.ReduceOp.Add, total, value, pixel, counts)
    dr.eval(*sums)
    return np.stack([np.array(total) for total in sums], -1).astype(np.float64)
