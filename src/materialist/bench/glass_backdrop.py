"""What stands behind the object of `bench glass`, as one picture of it tells: meshes that reflect the light.

They are lit, and do not glow: so the glass casts its shadow and its caustics on them, as in a fitted scene.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from materialist.bench.glass_scenes import DEPTH, GlassScene, _light, _mesh, path_traced
from materialist.geometry.extents import PlaneExtent
from materialist.types import Array

SPP = 256
"""Paths a pixel from which the light that falls on the surfaces is read, denoised."""
ROUNDS = 3
"""Times the albedo is corrected: light goes to and fro between surfaces."""
BRIGHTEST = 0.95
"""Largest albedo found."""


@dataclass(frozen=True)
class Background:
    """What is taken to be behind the object."""

    picture: Array
    """[H, W, 3] linear radiance."""
    depth: Array
    """[H, W] planar, 0 for sky."""
    normal: Array
    """[H, W, 3] unit."""
    albedo: Array
    """[H, W, 3] linear, in [0, 1], with which a rendering under the scene's light shows `picture`."""
    ends: tuple[PlaneExtent, ...] = ()
    """Where its walls end beyond the picture, if light tells."""


def wall_ends(scene: GlassScene, photo: Array) -> tuple[PlaneExtent, ...]:
    """Where walls end as `invert` finds it from the exposed photo [H, W, 3] linear in [0, 1] and the true maps."""
    from materialist.fit.plane_extents import find_extents
    from materialist.fit.settings import preset
    from materialist.types import Materials, Prediction

    there, flat = scene.mask[..., None], np.ones(scene.mask.shape, np.float32)
    truth = Prediction(
        Materials(scene.albedo, flat, 0 * flat),
        np.where(there, scene.front.normal, scene.behind.normal).astype(np.float32),
        np.where(scene.mask, scene.front.depth, scene.behind.depth).astype(np.float32),
        "truth",
    )
    if not (truth.depth > 0).any():
        return ()
    found = find_extents(photo, truth, scene.camera, preset("default"))
    return found.ends if found else ()


def albedo_of(
    scene: GlassScene, depth: Array, normal: Array, picture: Array, envmap: Array, ends: tuple[PlaneExtent, ...] = (),
    things: dict[str, Any] | None = None,
) -> Array:  # fmt: skip
    """[H, W, 3] diffuse albedo with which the surfaces of the maps, path-traced under envmap, look like `picture`.

    `things` are Mitsuba objects that stand before them, in the picture, too.
    """
    from materialist.render.denoise import denoise

    albedo = np.full(picture.shape, 0.5, np.float32)
    for _ in range(ROUNDS if depth.any() else 0):
        seen = lit(scene, depth, normal, albedo, envmap, things, ends=ends, length=DEPTH["diffuse"], spp=SPP)
        with suppress_missing():
            seen = denoise(seen, albedo=albedo, normal=normal)
        albedo = np.clip(albedo * picture / np.maximum(seen, 1e-6), 0, BRIGHTEST).astype(np.float32)
    return albedo


def lit(
    scene: GlassScene, depth: Array, normal: Array, albedo: Array, envmap: Array, things: dict[str, Any] | None = None,
    *, ends: tuple[PlaneExtent, ...] = (), length: int, spp: int, seed: int = 0, around: Array | None = None,
) -> Array:  # fmt: skip
    """[H, W, 3] linear: Mitsuba objects before the surfaces of the maps, by paths of `length` at most."""
    surfaces = _surfaces(scene, depth, normal, albedo, ends)
    description = {"type": "scene", **_light(scene._mi, envmap), **surfaces, **(things or {})}
    return path_traced(scene._mi, description, scene.camera, depth=length, spp=spp, seed=seed, around=around)


def suppress_missing():
    """A context in which a missing denoiser is passed over: the picture stays as it is."""
    from materialist.errors import SetupError

    return suppress(SetupError)


def _surfaces(
    scene: GlassScene, depth: Array, normal: Array, albedo: Array, ends: tuple[PlaneExtent, ...]
) -> dict[str, Any]:
    """The maps' surfaces, planes going on beyond the picture with their mean albedo."""
    from materialist.buffers import tensor
    from materialist.geometry.build import build_geometry
    from materialist.render.scene import part

    if not depth.any():
        return {}
    geometry, found = build_geometry(depth, normal, scene.camera, extents=ends), {}
    for k in np.unique(geometry.mesh.face_plane):
        paint = albedo if k < 0 else np.broadcast_to(albedo[geometry.plane_label == k].mean(0), (2, 2, 3))
        texture = {"type": "bitmap", "data": tensor(scene._mi, paint), "raw": True, "wrap_mode": "clamp"}
        surface = {"type": "diffuse", "reflectance": texture}
        found[f"backdrop{int(k) + 1}"] = _mesh(scene._mi, part(geometry.mesh, int(k)), surface)
    return found
