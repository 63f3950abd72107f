"""The ways to make an object glass that `bench glass` compares, each from the same maps of one view."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from materialist.bench.glass_scenes import DEPTH, Front, GlassScene, _light, _mesh, path_traced
from materialist.types import Array


@dataclass(frozen=True)
class Background:
    """What is taken to be behind the object."""

    picture: Array
    """[H, W, 3] linear radiance."""
    depth: Array
    """[H, W] planar, 0 for sky."""
    normal: Array
    """[H, W, 3] unit."""


def true_background(scene: GlassScene, room: Array) -> Background:
    """The room as it is, its picture [H, W, 3] rendered without the object."""
    return Background(room, scene.behind.depth, scene.behind.normal)


def inpainted_background(scene: GlassScene, photo: Array) -> Background:
    """What the photo [H, W, 3] linear shows around the object, continued behind it.

    The picture by Telea's method, inverse depth by the plane through what surrounds the object below and beside it,
    whichever of floor and wall is nearer.
    """
    import cv2

    from materialist.color import linear_to_srgb, srgb_to_linear

    hole = cv2.dilate(scene.mask.astype(np.uint8), np.ones((3, 3), np.uint8))
    scale = max(float(photo.max()), 1e-6)
    encoded = np.round(linear_to_srgb(photo / scale) * 255).astype(np.uint8)
    filled = srgb_to_linear(cv2.inpaint(encoded, hole, 5, cv2.INPAINT_TELEA).astype(np.float32) / 255) * scale
    picture = np.where(hole[..., None] > 0, filled, photo).astype(np.float32)
    depth, normal = _continued(scene, hole > 0)
    return Background(picture, depth, normal)


def _continued(scene: GlassScene, hole: Array) -> tuple[Array, Array]:
    """Depth [H, W] and normals [H, W, 3] of the visible background, its planes continued into the hole."""
    from materialist.camera import pixel_rays
    from materialist.geometry.planes import find_planes

    seen = np.where(hole, 0, scene.behind.depth)
    if not seen.any():
        return seen, scene.behind.normal
    rays = pixel_rays(scene.camera).astype(np.float64)
    best = np.full(hole.shape, np.inf)
    normal = np.where(hole[..., None], [0, 0, 1], scene.behind.normal).astype(np.float32)
    for plane in find_planes(seen, normal, scene.camera):
        rows, columns = np.nonzero(plane.mask)
        points = (rays[rows, columns] * seen[rows, columns, None]).astype(np.float64)
        centre = points.mean(0)
        n = np.linalg.svd(points[:: max(1, len(points) // 2000)] - centre, full_matrices=False)[2][2]
        n = n if n @ centre < 0 else -n
        along = rays @ n
        depth = np.where(along < -1e-6, (n @ centre) / np.minimum(along, -1e-6), np.inf)
        nearer = hole & (depth > 0) & (depth < best)
        best[nearer], normal[nearer] = depth[nearer], n
    filled = np.where(hole, np.where(np.isfinite(best), best, 0), seen)
    return filled.astype(np.float32), normal


def two_interface(
    scene: GlassScene, thickness: Array, behind: Background, envmap: Array, ior: float, back: str = "mirrored"
) -> Array:
    """[H, W, 3] linear, inside the object's mask: the paper's model."""
    from materialist.edit.two_interface import two_interface as model

    front = scene.front
    return model(
        scene.camera, front.normal, front.depth, scene.mask, thickness, behind.depth, behind.picture, envmap, ior=ior,
        back=back,
    )  # fmt: skip


def closed_proxy(
    scene: GlassScene, thickness: Array, behind: Background, envmap: Array, ior: float, *, spp: int, seed: int = 0
) -> Array:
    """[H, W, 3] linear, inside the object's mask: a closed object before the background, path-traced.

    The background is a surface that glows as its picture does; what the picture does not show of its planes glows
    with the plane's mean. So the object's own shadow and caustics are left out.
    """
    from materialist.geometry.closed import closed_proxy as close

    mi, front = scene._mi, scene.front
    shell = close(front.depth, front.normal, scene.mask, thickness, scene.camera)
    description: dict[str, Any] = {"type": "scene", **_light(mi, envmap), **_backdrop(scene, behind)}
    description["object"] = _mesh(mi, shell, {"type": "dielectric", "int_ior": ior, "ext_ior": 1.0})
    picture = path_traced(
        mi, description, scene.camera, depth=DEPTH["glass"], spp=spp, seed=seed, around=scene.mask
    )  # fmt: skip
    return np.where(scene.mask[..., None], picture, 0)


def _backdrop(scene: GlassScene, behind: Background) -> dict[str, Any]:
    """The background as glowing meshes."""
    from materialist.geometry.build import build_geometry
    from materialist.render.buffers import tensor
    from materialist.render.scene import part

    mi = scene._mi
    if not behind.depth.any():
        return {}
    geometry = build_geometry(behind.depth, behind.normal, scene.camera)
    black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    found = {}
    for k in np.unique(geometry.mesh.face_plane):
        if k < 0:
            glow = behind.picture
        else:
            members = geometry.plane_label == k
            glow = np.broadcast_to(behind.picture[members].mean(0), (2, 2, 3))
        texture = {"type": "bitmap", "data": tensor(mi, glow), "raw": True, "wrap_mode": "clamp"}
        mesh = _mesh(mi, part(geometry.mesh, int(k)), black, {"type": "area", "radiance": texture})
        found[f"backdrop{int(k) + 1}"] = mesh
    return found


def plain_background(scene: GlassScene, behind: Background) -> Array:
    """[H, W, 3] linear: no refraction at all, the background as it is."""
    return np.where(scene.mask[..., None], behind.picture, 0).astype(np.float32)


def thicknesses(scene: GlassScene, photo: Array) -> dict[str, Array]:
    """[H, W] thickness along the camera rays by where it comes from: 'true', 'predicted', 'symmetry'."""
    from materialist.errors import WeightsError
    from materialist.geometry.symmetry import symmetric_thickness
    from materialist.predict.refraction import thickness

    front: Front = scene.front
    found = {"true": front.thickness}
    try:
        guess = thickness(photo, scene.mask, front.normal, front.depth, scene.camera)
        found["predicted"] = guess.solid
    except WeightsError:
        pass  # the other two still tell something
    found["symmetry"] = symmetric_thickness(front.depth, front.normal, scene.mask, scene.camera)
    return found
