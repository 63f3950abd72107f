"""Pixels of a picture, at the camera's resolution or another: what is met first there, and radiance, path traced."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from materialist.buffers import floats, integers
from materialist.camera import project
from materialist.geometry.silhouette import Box, area, within
from materialist.render.variant import recording
from materialist.types import Array, Body, Camera

GRID = 4
"""Rays along each side of a pixel."""
_RAYS = 2**20
"""Rays that look for bodies together: bounds the memory."""
_PATHS = 2**23
"""Paths traced together unless the caller says otherwise, likewise."""


@dataclass(frozen=True)
class Coverage:
    """Where rays through the pixels of a box meet some bodies first."""

    share: Array
    """[h, w] float32 in [0, 1]: the share of each pixel in which one of the bodies is seen."""
    depth: Array
    """[h, w] float32 planar, scene units, the mean over the rays that meet one; 0 where none is seen."""


@dataclass(frozen=True)
class FirstHits(Coverage):
    """What they meet there; means over the rays that meet one."""

    albedo: Array
    """[h, w, 3] float32 in [0, 1]; 0 where none is seen. White for glass and mirrors, as denoisers want it."""
    normal: Array
    """[h, w, 3] float32, camera frame; 0 where none is seen."""


def only(scene, names: Sequence[str]):
    """The named shapes of a Mitsuba scene as a scene of their own, to see what hides them."""
    import mitsuba as mi

    # Robust intersections: rays along the edge of two triangles must not slip through.
    chosen = {shape.id(): shape for shape in scene.shapes() if shape.id() in names}
    return mi.load_dict({"type": "scene", "embree_use_robust_intersections": True, **chosen})


def first_hits(
    scene,
    camera: Camera,
    bodies: Mapping[str, Body | None],
    size: tuple[int, ...],
    box: Box | None = None,
) -> FirstHits:
    """See `FirstHits`; of a Mitsuba scene (`RenderScene.mi_scene`).

    bodies: by the names of their shapes; None for one without a material, as lamps, which is taken as white.
    size: (H, W) of the whole picture. box: the part of it that is wanted, None for all.
    """

    def surfaces(strip: Box) -> Array:
        return _surfaces(scene, camera, bodies, size, strip)

    values = _by_strips(surfaces, 8, scene, camera, bodies, size, box)
    # Of the 8 channels of `_surfaces`: share, depth, albedo, normal.
    channels = (values[..., 0], values[..., 7], values[..., 1:4], values[..., 4:7])
    return FirstHits(*(np.ascontiguousarray(channel) for channel in channels))


def coverage(
    scene, camera: Camera, names: Collection[str], size: tuple[int, ...], box: Box | None = None
) -> Coverage:
    """See `Coverage`; of the named shapes, otherwise as `first_hits`, of which it takes a third of the time."""

    def hits(strip: Box) -> Array:
        return _hits(scene, camera, names, size, strip)

    values = _by_strips(hits, 2, scene, camera, names, size, box)
    return Coverage(*(np.ascontiguousarray(values[..., k]) for k in (0, 1)))


def _by_strips(
    traced: Callable[[Box], Array],
    channels: int,
    scene,
    camera: Camera,
    names: Collection[str],
    size: tuple[int, ...],
    box: Box | None,
) -> Array:
    """[h, w, channels] float32: what `traced` gives of a part of the picture, some rows at a time."""
    whole = box or (slice(0, size[0]), slice(0, size[1]))
    # --- Only the part of the picture where the bodies can be ---
    rows, columns = _around(scene, camera, names, size, whole)
    values = np.zeros((*(side.stop - side.start for side in whole), channels), np.float32)
    inside = values[within((rows, columns), whole)]
    # --- Some rows at a time, so that the rays fit into memory ---
    step = max(1, _RAYS // GRID**2 // max(columns.stop - columns.start, 1))
    for first in range(rows.start, rows.stop, step) if area((rows, columns)) else ():
        strip = slice(first, min(first + step, rows.stop))
        inside[first - rows.start : strip.stop - rows.start] = traced((strip, columns))
    return values


def _around(scene, camera: Camera, names: Collection[str], size: tuple[int, ...], box: Box) -> Box:
    """The part of a box where shapes may be seen: around the corners of their bounds; all of it where one is behind."""
    # The projected corners of a box bound the projection of what is in it.
    bounds = [shape.bbox() for shape in scene.shapes() if shape.id() in names]
    corners = np.array([list(product(*zip(b.min, b.max))) for b in bounds], float).reshape(-1, 3)
    at, depth = project(corners, camera)
    if (depth <= 0).any():
        return box
    # --- Their bounds in rows and columns, from working pixels to those of `size` ---
    sides = []
    for side, n, working, places in zip(box, size, (camera.height, camera.width), at.T[::-1]):
        places = places * n / working
        margin = 2 * max(1.0, n / working)  # the sides of the working size are rounded
        low, high = (
            np.clip([places.min() - margin, places.max() + margin], side.start, side.stop)
            if len(places)
            else (side.start, side.start)
        )
        sides.append(slice(int(np.floor(low)), int(np.ceil(high))))
    return sides[0], sides[1]


def _hits(scene, camera: Camera, names: Collection[str], size: tuple[int, ...], box: Box) -> Array:
    """[h, w, 2] share and depth of a few rows."""
    import drjit as dr
    import mitsuba as mi

    pixel = pixel_numbers(size, box)
    # --- The rays of one pixel after the other, so that they are summed where they are traced ---
    rays = GRID**2
    slot = dr.arange(mi.UInt32, pixel.size * rays)
    place = slot % rays
    x, y = ((mi.Float(way) + 0.5) / GRID for way in (place % GRID, place // GRID))
    way = directions(
        camera, size, dr.gather(mi.UInt32, integers(mi, pixel.ravel()), slot // rays), x, y
    )
    # --- Rays that meet one of the shapes first, and their planar depth -z t ---
    met = scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(0), way))
    known = mi.Bool(False)
    for shape in scene.shapes():
        if shape.id() in names:
            known |= met.shape == mi.ShapePtr(shape)
    known &= met.is_valid()
    values = [dr.select(known, value, 0) for value in (mi.Float(1), -way.z * met.t)]
    dr.eval(values)
    # --- By pixel: the share of its rays, and the mean depth of those that hit ---
    count, depth = (np.array(dr.block_sum(value, rays)) for value in values)
    means = np.stack([count / rays, depth / np.maximum(count, 1)], -1)
    return means.reshape(*pixel.shape, 2)


def _surfaces(
    scene, camera: Camera, bodies: Mapping[str, Body | None], size: tuple[int, ...], box: Box
) -> Array:
    """[h, w, 8] share, albedo, normal and depth of a few rows."""
    import drjit as dr
    import mitsuba as mi

    pixel = pixel_numbers(size, box)
    # --- A grid of rays in each pixel, all against the whole scene: what is hidden is not seen ---
    row, column, _ = np.indices((GRID, GRID, pixel.size)).reshape(3, -1)
    x, y = (floats(mi, (place + 0.5) / GRID) for place in (column, row))
    way = directions(camera, size, integers(mi, np.tile(pixel.ravel(), GRID**2)), x, y)
    si = scene.ray_intersect(mi.Ray3f(mi.Point3f(0), way))
    dr.eval(si)  # or each of the following would trace the rays again
    normal = np.array(si.sh_frame.n).T
    uv = np.array(si.uv).T
    depth = -np.array(si.p.z)
    # --- What the rays meet, body by body ---
    shapes = {shape.id(): shape for shape in scene.shapes()}
    sums = np.zeros((len(depth), 8))
    for name in bodies.keys() & shapes:
        body = bodies[name]
        hit = np.array(si.is_valid() & (si.shape == mi.ShapePtr(shapes[name])))
        albedo = np.ones((hit.sum(), 3)) if body is None else _albedo(body, uv[hit])
        sums[hit] = np.concatenate(
            [np.ones((hit.sum(), 1)), albedo, normal[hit], depth[hit, None]], 1
        )
    # --- Means over the rays that meet one; the share over all rays ---
    means = sums.reshape(GRID**2, pixel.size, 8).sum(0)
    means[:, 1:] /= np.maximum(means[:, :1], 1)
    means[:, 0] /= GRID**2
    return means.reshape(*pixel.shape, 8)


def pixel_numbers(size: tuple[int, ...], where: Box | Array) -> Array:
    """Row-major numbers of some pixels of a picture of `size`: [h, w] of a box, [N] of a mask [H, W] bool."""
    if isinstance(where, np.ndarray):
        return np.flatnonzero(where).astype(np.uint32)
    rows, columns = (np.arange(n, dtype=np.uint32)[side] for n, side in zip(size, where))
    return rows[:, None] * np.uint32(size[1]) + columns


def directions(camera: Camera, size: tuple[int, ...], pixel: Any, x: Any, y: Any) -> Any:
    """Unit directions through pixels of a picture by their numbers (UInt32), at places x, y in [0, 1] inside of them.

    The sides of the working size are rounded, so at the upper and lower rim this may be off by half a pixel of it.
    """
    import drjit as dr
    import mitsuba as mi

    half = float(np.tan(np.radians(camera.fov) / 2))
    # Numbers of one photo or call are data: as literals they would have the kernel compiled anew.
    width = dr.opaque(mi.UInt32, size[1])
    columns = dr.opaque(mi.Float, size[1])
    rows = dr.opaque(mi.Float, size[0])
    half_width = dr.opaque(mi.Float, half)
    half_height = dr.opaque(mi.Float, half * camera.height / camera.width)
    across = (mi.Float(pixel % width) + x) / columns * 2 - 1
    up = 1 - (mi.Float(pixel // width) + y) / rows * 2
    return dr.normalize(mi.Vector3f(across * half_width, up * half_height, -1))


def _albedo(body: Body, uv: Array) -> Array:
    """[n, 3] albedo at texture coordinates [n, 2], repeated; white where light goes on in one direction."""
    surface = body.surface
    h, w = surface.albedo.shape[:2]
    # The nearest texel; where uv is not a number, the first one.
    x = np.floor(np.nan_to_num(uv[:, 0]) * w).astype(np.int64) % w
    y = np.floor(np.nan_to_num(uv[:, 1]) * h).astype(np.int64) % h
    # A denoiser is guided by what is seen in a mirror, not by the colour of the mirror.
    clear = max(
        surface.transmission, float(surface.metallic.mean() * (surface.roughness.mean() < 0.2))
    )
    return surface.albedo[y, x] * (1 - clear) + clear


def radiance(
    target,
    size: tuple[int, ...],
    where: Box | Array,
    *,
    spp: int,
    seed: int,
    max_depth: int,
    names: Sequence[str] | None = None,
    unseen: Sequence[str] = (),
    at_once: int = _PATHS,
) -> Array:
    """[..., 3] float32 linear radiance of pixels of a `RenderScene`, path traced, with at least `spp` paths each.

    size: (H, W) of the whole picture. where: a box, or a mask [H, W] bool, whose pixels come in rows [N, 3]. Paths have
    random numbers by seed and pixel, whatever else of the picture is traced.
    names: of shapes; the mean is then over the rays that meet one of them first, and 0 where none does.
    unseen: of shapes; rays that meet one of them first do not count. They still cast shadows and are reflected.
    at_once: paths traced together; the random numbers follow from it, too.
    """
    mi = target.mi
    masked = isinstance(where, np.ndarray)
    pixels = pixel_numbers(size, np.s_[:, :] if masked else where)
    traced = np.asarray(where if masked else np.ones(pixels.shape, bool)).ravel()
    # --- One integrator and one sampler for all strips ---
    paths = stratified(spp)
    total = np.zeros((pixels.size, 4))
    integrator = mi.load_dict({"type": "path", "max_depth": max_depth})
    sampler = mi.load_dict({"type": "multijitter", "sample_count": paths})
    sampler.set_samples_per_wavefront(paths)
    pixels_at_once = max(1, at_once // paths)  # bounded wavefronts
    # Strips are numbered over the whole picture, so that a pixel's seed does not depend on the
    # mask.
    for k, first in enumerate(range(0, pixels.size, pixels_at_once)):
        strip = slice(first, min(first + pixels_at_once, pixels.size))
        if traced[strip].any():
            sampler.seed((seed * 9973 + k) & 0xFFFFFFFF, (strip.stop - first) * paths)
            total[strip] = _sums(
                target,
                size,
                pixels.ravel()[strip],
                traced[strip],
                integrator,
                sampler,
                paths,
                names,
                unseen,
            )
    # --- Mean over the paths that count ---
    mean = (total[:, :3] / np.maximum(total[:, 3:], 1)).astype(np.float32)
    return mean[traced] if masked else mean.reshape(*pixels.shape, 3)


def stratified(spp: int) -> int:
    """The least number of samples >= `spp` that the multijitter sampler can lay out in a grid, as it would round."""
    rows = int(np.sqrt(spp))
    return rows * -(-spp // rows)


def _sums(
    target,
    size: tuple[int, ...],
    pixels: Array,
    traced: Array,
    integrator,
    sampler,
    paths: int,
    names: Sequence[str] | None,
    unseen: Sequence[str],
) -> Array:
    """[n, 4]: of the wanted pixels' rays that count, the sum of what they bring, and their number."""
    import drjit as dr

    mi = target.mi
    scene = target.mi_scene
    # Numbers that differ from call to call are data, or every call would be compiled anew.
    slot = dr.arange(mi.UInt32, len(pixels) * paths) // dr.opaque(mi.UInt32, paths)
    # --- Primary rays: a random place in each pixel for every path ---
    inside = sampler.next_2d()
    way = directions(
        target.camera, size, dr.gather(mi.UInt32, integers(mi, pixels), slot), inside.x, inside.y
    )
    ray = mi.RayDifferential3f(mi.Point3f(0), way)
    counts = dr.gather(mi.UInt32, integers(mi, traced), slot) != 0
    # --- With names, rays count by the shape that they meet first ---
    if names is not None or unseen:
        first = scene.ray_intersect_preliminary(ray)
        named = mi.Bool(False)
        for shape in scene.shapes():
            if shape.id() in (unseen if names is None else names):
                named |= first.shape == mi.ShapePtr(shape)
        counts &= named if names is not None else ~named
    # --- Radiance along the paths, summed by pixel ---
    with recording():
        light = integrator.sample(scene, sampler, ray, None, counts)[0]
        values = [dr.select(counts, value, 0) for value in (light.x, light.y, light.z, mi.Float(1))]
    dr.eval(values)  # together, or each sum would trace the paths again
    return np.stack([np.array(dr.block_sum(value, paths)) for value in values], -1).astype(
        np.float64
    )
