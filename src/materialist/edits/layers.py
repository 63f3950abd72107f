"""What a compositor wants beside a picture: albedo, light by lobe, normals, depth, places and things."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from materialist.camera import unproject
from materialist.edits.core.renderer import EditRenderer
from materialist.errors import InputError
from materialist.io.out.encode import check_image_output
from materialist.io.out.layers import write_layers
from materialist.spelling import spelled
from materialist.types import Array, Camera, Scene

RAYS = (48, 12)
"""Diffuse and specular rays a pixel that the light of the layers is gathered by; as previews have them."""


@spelled
def save_layers(
    path: str | Path,
    scene: Scene,
    picture: Array | None = None,
    *,
    device: str = "auto",
    force: bool = False,
) -> tuple[str, ...]:
    """Write PATH.exr of several parts: a picture of a scene, and what is known of each of its pixels.

    Parts: `beauty` (the picture), `albedo`, `diffuse` and `specular` (the light that the surface gives off by each
    lobe), `residual` (beauty - diffuse - specular: what the scene does not explain, the sky, and what bodies show), `N`
    (unit, camera frame), `Z` (planar depth, scene units, 0 for none), `position` (camera frame), and where there are
    bodies `CryptoObject00`, ... They are linear Rec.709, in the unit of an HDR photo.

    Args:
        scene: the scene that the picture shows, edited or not.
        picture: [H, W, 3] linear Rec.709, a composite or a rendering; None: the photo.

    Returns notes. Raises InputError for another suffix, or a picture of another shape; OutputError as `save_image`.
    """
    # --- The picture that the layers are of ---
    check_image_output(path, force=force)
    if Path(path).suffix.lower() != ".exr":
        raise InputError(f"{path} cannot have layers; give a name that ends in .exr.")
    beauty = scene.photo.original if picture is None else np.asarray(picture, np.float32)
    if beauty.ndim != 3 or beauty.shape[2] != 3:
        raise InputError(f"The picture is {list(beauty.shape)}; give linear RGB [H, W, 3].")
    size = beauty.shape[:2]
    # --- What is known of each pixel, at the picture's size and in the unit of the photo's file ---
    diffuse, specular = (_large(light, size) for light in _lobes(scene, beauty, device))
    surface = _surface(scene, size, device)
    unit = np.float32(2.0**-scene.photo.stops)
    layers = {
        "beauty": unit * beauty,
        "albedo": surface["albedo"],
        "diffuse": unit * diffuse,
        "specular": unit * specular,
        "residual": unit * (beauty - diffuse - specular),
        "N": surface["N"],
        "Z": surface["Z"],
        "position": surface["position"],
    }
    write_layers(path, layers, _things(scene, size, device), force=force)
    if not scene.bodies and not scene.lamps:
        return ()
    return (
        "Light by lobe is that of the photo's surface; what bodies and lamps add is in the residual.",
    )


def _lobes(scene: Scene, picture: Array, device: str) -> tuple[Array, Array]:
    """Diffuse and specular radiance [H, W, 3] of the photo's surface at working size, without noise."""
    from materialist.render.variant import setup

    setup(device)
    import torch

    from materialist.bsdf.disney import base_reflectance, quadratic
    from materialist.buffers import placed
    from materialist.fit.engine import TransportEngine
    from materialist.transport.cache import CacheSettings
    from materialist.transport.shading import specular_at

    shape = scene.depth.shape
    materials = scene.materials
    passed_on = cv2.resize(np.maximum(picture, 0), shape[::-1], interpolation=cv2.INTER_AREA)
    # The picture itself is the light that surfaces pass on: it holds the edit's own bounces.
    engine = TransportEngine(
        scene.geometry, scene.camera, passed_on, seed=0, cache=CacheSettings(*RAYS)
    )
    tables = engine.tables(scene.envmap)
    # --- The maps of the surface pixels ---
    pixels = engine.cache.pixels
    maps = (
        materials.albedo.reshape(-1, 3),
        materials.roughness.ravel(),
        materials.metallic.ravel(),
    )
    albedo, roughness, metallic = (placed(np.ascontiguousarray(values[pixels])) for values in maps)
    # --- The two terms of the shading, apart: A (1 - M) (D0 + D1 R + D2 R^2), and C_0 S0 + S1 ---
    with torch.no_grad():
        metal = metallic[:, None]
        rough = roughness[:, None]
        diffuse = albedo * (1 - metal) * quadratic(tables.diffuse.split(3, -1), rough)
        s0, s1 = specular_at(tables, roughness).split(3, -1)
        specular = base_reflectance(albedo, metal) * s0 + s1
    return (
        _scattered(diffuse.cpu().numpy(), pixels, shape),
        _scattered(specular.cpu().numpy(), pixels, shape),
    )


def _scattered(values: Array, pixels: Array, shape: tuple[int, ...]) -> Array:
    """Values [P, 3] of some pixels as a picture [H, W, 3], 0 elsewhere."""
    flat = np.zeros((shape[0] * shape[1], 3), np.float32)
    flat[pixels] = values
    return flat.reshape(*shape, 3)


def _large(values: Array, size: tuple[int, ...], nearest: bool = False) -> Array:
    """[H, W, ...] brought to another size; `nearest` mixes no two surfaces."""
    if values.shape[:2] == size:
        return values
    kind = cv2.INTER_NEAREST_EXACT if nearest else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(values, size[::-1], interpolation=kind))


def _surface(scene: Scene, size: tuple[int, int], device: str) -> dict[str, Array]:
    """Albedo, normals, depth and places of what is seen first, of the photo's surface or a body."""
    albedo = _large(scene.materials.albedo, size)
    normal = _large(scene.normal, size, nearest=True)
    depth = _large(scene.depth, size, nearest=True)
    if scene.bodies:
        from materialist.render.pixels import first_hits

        bodies = {f"body{k}": body for k, body in enumerate(scene.bodies)}
        sight = first_hits(_built(scene, device), scene.camera, bodies, size)
        # Albedo mixes at silhouettes; a normal or a depth between two surfaces belongs to neither.
        share = sight.share[..., None]
        albedo = share * sight.albedo + (1 - share) * albedo
        seen = sight.share > 0.5
        normal = np.where(seen[..., None], sight.normal, normal)
        depth = np.where(seen, sight.depth, depth)
    camera = Camera(size[1], size[0], scene.camera.fov)
    return {"albedo": albedo, "N": normal, "Z": depth, "position": unproject(depth, camera)}


def _things(scene: Scene, size: tuple[int, int], device: str) -> dict[str, Array]:
    """Coverage [H, W] of each body, by a name that no other has."""
    from materialist.render.pixels import coverage

    shares: dict[str, Array] = {}
    built = _built(scene, device) if scene.bodies else None
    for k, body in enumerate(scene.bodies):
        # Layers of one name would overwrite each other.
        name = body.name if body.name not in shares else f"{body.name} {k + 1}"
        shares[name] = coverage(built, scene.camera, [f"body{k}"], size).share
    return shares


def _built(scene: Scene, device: str):
    """The Mitsuba scene of the surface and the bodies."""
    return (
        EditRenderer(replace(scene, lamps=()), device=device)
        .render_scene(replace(scene, lamps=()))
        .mi_scene
    )
