"""A path tracer that splits at the first hit, for light without suns.

Mitsuba's `path` spends three quarters of its rays beyond the first hit, where a quarter of the light and less of the
noise is. Here one camera ray sends SPLIT diffuse directions and one specular direction on their way, and all of a
pixel's directions of a lobe form one lattice. Each of them goes on as a path of its own: where light is hidden by a
surface, that surface's light takes its place in the same stratum. Where some light stands out, one more ray from every
hit goes towards it (`render.light_sampling`), and each direction counts by the balance heuristic.
"""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.render.light_sampling import LightSampler
from materialist.transport.sampling import R2, point
from materialist.types import Array, Camera

SPLIT = 2
"""Diffuse directions of a first hit; the specular lobe gets one."""
ALL = 0xFFFFFFFF
"""Component of a BSDF context: every lobe."""
DEEPEST = 6
"""The largest path length that is traced this way: bounces are unrolled."""


def trace(
    scene: mi.Scene, camera: Camera, lights: LightSampler | None, *, spp: int, seed: int, max_depth: int
) -> Array:
    """[H, W, 3] radiance of a scene whose one emitter is an environment map and whose BSDFs are `materialist_disney`.

    Args:
        lights: directions that every hit sends a ray to; None: scattered ones alone.
        spp: camera rays per pixel; each counts for SPLIT + 1 paths, and one more with `lights`.
        seed: equal seeds give equal pictures.
        max_depth: path length, 2 (direct light) to DEEPEST.
    """
    lane = dr.arange(mi.UInt32, camera.width * camera.height)
    corner, pixel = _corners(camera, lane)
    random: Any = mi.PCG32(size=camera.width * camera.height, initstate=mi.UInt64(seed))  # type: ignore[operator]
    shifts = tuple(_uniform(random) for _ in range(4))  # the starts of a pixel's lattices, which all its rays share
    dr.eval(shifts, random)
    total = _loop(scene, lights, corner, pixel, shifts, random, dr.opaque(mi.UInt32, spp), max_depth - 1)
    dr.eval(total)
    picture = np.array(total).T / np.float32(spp)
    return np.ascontiguousarray(picture.reshape(camera.height, camera.width, 3))


@dr.syntax
def _loop(scene, lights, corner, pixel, shifts, random, count, bounces: int):
    """Sum over `count` camera rays of every pixel."""
    jitter, diffuse, specular, lamp = shifts
    total = mi.Color3f(0)
    i = dr.zeros(mi.UInt32, dr.width(corner))
    while i < count:
        ray = _camera_ray(corner + pixel * _kronecker(i, jitter))
        si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=True)
        hit = si.is_valid()
        total += dr.select(hit, 0, radiance(scene, ray.d, ~hit))
        if dr.hint(lights is not None, mode="scalar"):
            total += _direct(scene, lights, si, ((0, SPLIT), (1, 1)), point(i, count, lamp), hit)
        k = mi.UInt32(0)
        while k < SPLIT:
            sample = point(k * count + i, count * SPLIT, diffuse)
            total += _path(scene, lights, si, 0, sample, hit, bounces, random) / SPLIT
            k += 1
        total += _path(scene, lights, si, 1, point(i, count, specular), hit, bounces, random)
        i += 1
    return total


def _path(scene, lights, si, component: int, sample, active, bounces: int, random):
    """Light along one direction of the BSDF's `component`, and by way of what stands there, over `bounces` rays."""
    context = mi.BSDFContext()
    context.component = component
    bs, weight = si.bsdf().sample(context, si, mi.Float(0.5), sample, active)
    found = (SPLIT if component == 0 else 1) * bs.pdf
    total = mi.Color3f(0)
    for bounce in range(bounces):
        active = active & (found > 0)
        ray = si.spawn_ray(si.to_world(bs.wo))
        if bounce == bounces - 1:
            escaped = active & ~scene.ray_test(ray, active)
        else:
            si = scene.ray_intersect(ray, mi.RayFlags.All, coherent=False, active=active)
            escaped = active & ~si.is_valid()
        balance = mi.Float(1) if lights is None else found / (found + lights.pdf(ray.d, escaped))
        total = total + dr.select(escaped, balance * weight * radiance(scene, ray.d, escaped), 0)
        if bounce < bounces - 1:
            active = active & si.is_valid()
            if lights is not None:
                total += weight * _direct(scene, lights, si, ((ALL, 1),), _uniform(random), active)
            lobe, direction = random.next_float32(), _uniform(random)
            bs, value = si.bsdf().sample(mi.BSDFContext(), si, lobe, direction, active)
            found = bs.pdf
            weight = weight * value
    return total


def _direct(scene, lights, si, components, sample, active):
    """Light from one direction of `lights`, by those of the BSDF's (component, directions that it scatters itself)."""
    context, bsdf = mi.BSDFContext(), si.bsdf()
    direction, density = lights.sample(sample)
    local = si.to_local(direction)
    weight = mi.Color3f(0)
    for component, count in components:
        context.component = component
        value, pdf = bsdf.eval_pdf(context, si, local, active)
        weight += value / (density + count * pdf)
    active = active & (dr.max(weight) > 0)
    lit = active & ~scene.ray_test(si.spawn_ray(direction), active)
    return dr.select(lit, weight * radiance(scene, direction, lit), 0)


def radiance(scene, direction, active):
    """Radiance (Color3f) of the environment from unit `direction`."""
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(direction))
    si.wi = -direction
    return mi.Color3f(scene.environment().eval(si, active))


def _corners(camera: Camera, lane):
    """Top left corner of each pixel on the plane z = -1, and the step from there to its opposite corner."""
    row, col = mi.Float(lane // camera.width), mi.Float(lane % camera.width)
    corner = mi.Point2f((col - camera.width / 2) / camera.focal, (camera.height / 2 - row) / camera.focal)
    dr.eval(corner)
    return corner, mi.Vector2f(dr.opaque(mi.Float, 1 / camera.focal), dr.opaque(mi.Float, -1 / camera.focal))


def _camera_ray(seen):
    """Ray through the point `seen` of the plane z = -1."""
    return mi.Ray3f(mi.Point3f(0), dr.normalize(mi.Vector3f(seen.x, seen.y, -1)))


def _kronecker(index, start):
    u, v = start.x + mi.Float(index) * R2[0], start.y + mi.Float(index) * R2[1]
    return mi.Point2f(u - dr.floor(u), v - dr.floor(v))


def _uniform(random):
    return mi.Point2f(random.next_float32(), random.next_float32())
