"""A path tracer that splits at the first hit, for light without small bright sources.

Mitsuba's `path` spends three quarters of its rays beyond the first hit, where a quarter of the light and less of the
noise is, and half of its direct ones on sampling the light. Here one camera ray sends SPLIT diffuse directions and one
specular direction on their way, and all of a pixel's directions of a lobe form one lattice. Each of them goes on as a
path of its own: where light is hidden by a surface, that surface's light takes its place in the same stratum.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.transport.sampling import point
from materialist.types import Array, Camera

SPLIT = 2
"""Diffuse directions of a first hit; the specular lobe gets one."""
DEEPEST = 6
"""The largest path length that is traced this way: bounces are unrolled."""

# Generators of a Kronecker sequence in the plane (Roberts 2018).
_R2 = (0.7548776662466927, 0.5698402909980532)


def trace(scene: mi.Scene, camera: Camera, *, spp: int, seed: int, max_depth: int, hide_emitters: bool) -> Array:
    """[H, W, 3] radiance of a scene whose one emitter is an environment map and whose BSDFs are `materialist_disney`.

    Args:
        spp: camera rays per pixel; each counts for (SPLIT + 1) paths.
        seed: equal seeds give equal pictures.
        max_depth: path length, 2 (direct light) to DEEPEST.
        hide_emitters: leave pixels of the sky black.
    """
    lanes = camera.width * camera.height
    random: Any = mi.PCG32(size=lanes, initstate=mi.UInt64(seed))  # type: ignore[operator]
    corner, pixel = _corners(camera, lanes)
    total = _loop(scene, corner, pixel, random, dr.opaque(mi.UInt32, spp), max_depth - 1, not hide_emitters)
    dr.eval(total)
    return np.array(total).T.reshape(camera.height, camera.width, 3) / np.float32(spp)


@dr.syntax
def _loop(scene, corner, pixel, random, count, bounces: int, sky: bool):
    """Sum over `count` camera rays of every pixel."""
    jitter, diffuse, specular = _uniform(random), _uniform(random), _uniform(random)
    total = mi.Color3f(0)
    i = dr.zeros(mi.UInt32, dr.width(corner))
    while i < count:
        ray = _camera_ray(corner + pixel * _kronecker(i, jitter))
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=True)
        hit = si.is_valid()
        if dr.hint(sky, mode="scalar"):
            total += dr.select(hit, 0, radiance(scene, ray.d, ~hit))
        k = mi.UInt32(0)
        while k < SPLIT:
            sample = point(k * count + i, count * SPLIT, diffuse)
            total += _path(scene, si, 0, sample, hit, bounces, random) / SPLIT
            k += 1
        total += _path(scene, si, 1, point(i, count, specular), hit, bounces, random)
        i += 1
    return total


def _path(scene, si, component: int, sample, active, bounces: int, random):
    """Light along one direction of the BSDF's `component`, and by way of what stands there, over `bounces` rays."""
    context = mi.BSDFContext()
    context.component = component
    bs, weight = si.bsdf().sample(context, si, mi.Float(0.5), sample, active)
    total = mi.Color3f(0)
    for bounce in range(bounces):
        active = active & (bs.pdf > 0)
        ray = si.spawn_ray(si.to_world(bs.wo))
        if bounce == bounces - 1:
            escaped = active & ~scene.ray_test(ray, active)
        else:
            si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=active)
            escaped = active & ~si.is_valid()
        total = total + dr.select(escaped, weight * radiance(scene, ray.d, escaped), 0)
        if bounce < bounces - 1:
            active = active & si.is_valid()
            lobe, direction = random.next_float32(), _uniform(random)
            bs, value = si.bsdf().sample(mi.BSDFContext(), si, lobe, direction, active)
            weight = weight * value
    return total


def radiance(scene, direction, active):
    """Radiance (Color3f) of the environment from unit `direction`."""
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(direction))
    si.wi = -direction
    return mi.Color3f(scene.environment().eval(si, active))


def _corners(camera: Camera, lanes: int):
    """Top left corner of each pixel on the plane z = -1, and the step from there to its opposite corner."""
    lane = dr.arange(mi.UInt32, lanes)
    row, col = mi.Float(lane // camera.width), mi.Float(lane % camera.width)
    corner = mi.Point2f((col - camera.width / 2) / camera.focal, (camera.height / 2 - row) / camera.focal)
    dr.eval(corner)
    return corner, mi.Vector2f(dr.opaque(mi.Float, 1 / camera.focal), dr.opaque(mi.Float, -1 / camera.focal))


def _camera_ray(seen):
    """Ray through the point `seen` of the plane z = -1."""
    return mi.Ray3f(mi.Point3f(0), dr.normalize(mi.Vector3f(seen.x, seen.y, -1)))


def _kronecker(index, start):
    u, v = start.x + mi.Float(index) * _R2[0], start.y + mi.Float(index) * _R2[1]
    return mi.Point2f(u - dr.floor(u), v - dr.floor(v))


def _uniform(random):
    return mi.Point2f(random.next_float32(), random.next_float32())
