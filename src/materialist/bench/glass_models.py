"""The ways to make an object glass that `bench glass` compares, each from the same maps of one view."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from materialist.bench.glass_scenes import DEPTH, Front, GlassScene, _light, _mesh, path_traced
from materialist.predict.refraction.thickness import Thickness
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


def inpainted_background(scene: GlassScene, photo: Array, gain: float = 1.0) -> Background:
    """What the photo [H, W, 3] linear shows around the object, continued behind it as `edit.background` does.

    Surfaces go on as planes, the picture by patches of its own; `gain` is the photo's exposure.
    """
    from materialist.color import linear_to_srgb
    from materialist.edit.behind import SKY, behind
    from materialist.edit.exemplar import exemplar_plan
    from materialist.edit.regular import regular_sources
    from materialist.geometry.membrane import membrane

    hole = _grown(scene.mask)
    depth = np.where(hole, 0, scene.behind.depth)
    normal = np.where(hole[..., None], [0, 0, 1], scene.behind.normal).astype(np.float32)
    label = np.full(hole.shape, SKY)
    if depth.any():
        plane = planes_of(scene, depth, normal)
        continued = behind(depth, normal, plane, hole, scene.front.depth, scene.camera)
        depth, normal, label = continued.depth, continued.normal, continued.label
    seen, anywhere = linear_to_srgb(photo * gain), np.ones_like(hole)
    told = regular_sources(seen, hole, anywhere, label, depth, scene.camera)
    plan = exemplar_plan(seen, hole, anywhere, label, told=told)
    picture = membrane(photo, ~hole) if plan is None else plan.fill(photo)
    return Background(np.where(hole[..., None], picture, photo).astype(np.float32), depth, normal)


def _grown(mask: Array) -> Array:
    """The mask and a rim of mixed pixels."""
    from scipy.ndimage import binary_dilation

    return binary_dilation(mask, np.ones((3, 3), bool))


def two_interface(
    scene: GlassScene, thickness: Array, behind: Background, envmap: Array, ior: float, back: str | Array = "mirrored"
) -> Array:
    """[H, W, 3] linear, inside the object's mask: the paper's model."""
    from materialist.edit.two_interface import two_interface as model

    front = scene.front
    return model(
        scene.camera, front.normal, front.depth, scene.mask, thickness, behind.depth, behind.picture, envmap, ior=ior,
        back=back,
    )  # fmt: skip


def closed_proxy(
    scene: GlassScene, found: Thickness, behind: Background, envmap: Array, ior: float, *, spp: int, seed: int = 0
) -> Array:
    """[H, W, 3] linear, inside the object's mask: a closed object before the background, path-traced.

    The background is a surface that glows as its picture does; what the picture does not show of its planes glows
    with the plane's mean. So the object's own shadow and caustics are left out.
    """
    from materialist.geometry.closed import closed_proxy as close

    front = scene.front
    shell = close(
        front.depth, front.normal, scene.mask, found.solid, scene.camera, behind=behind.depth, back=found.back
    )  # fmt: skip
    return before(scene, shell, behind, envmap, ior, spp=spp, seed=seed)


def before(
    scene: GlassScene, body: Any, behind: Background, envmap: Array, ior: float, *, spp: int, seed: int = 0
) -> Array:
    """[H, W, 3] linear, inside the object's mask: a closed body (vertices, faces, normals, uv) before the background.

    Denoised as `materialist glass` does, where the denoiser is installed.
    """
    mi = scene._mi
    description: dict[str, Any] = {"type": "scene", **_light(mi, envmap), **_backdrop(scene, behind)}
    description["object"] = _mesh(mi, body, {"type": "dielectric", "int_ior": ior, "ext_ior": 1.0})
    picture = path_traced(
        mi, description, scene.camera, depth=DEPTH["glass"], spp=spp, seed=seed, around=scene.mask
    )  # fmt: skip
    return np.where(scene.mask[..., None], _clean(picture, scene), 0)


def _clean(picture: Array, scene: GlassScene) -> Array:
    """[H, W, 3] without noise in the rectangle around the object."""
    from materialist.errors import SetupError
    from materialist.render.denoise import denoise

    rows, columns = np.flatnonzero(scene.mask.any(1)), np.flatnonzero(scene.mask.any(0))
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    part = np.ascontiguousarray(picture[window])
    try:
        clean = denoise(part, albedo=np.ones_like(part), normal=np.ascontiguousarray(scene.front.normal[window]))
    except SetupError:
        return picture
    whole = picture.copy()
    whole[window] = clean
    return whole


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


def thicknesses(scene: GlassScene, photo: Array, behind: Background) -> dict[str, Thickness]:
    """Thickness along the camera rays, and the normals of the back, by where they come from.

    'true', 'predicted' (what `materialist glass` takes by itself), 'network' (RefractionNet alone, where its weights
    are), 'symmetry'. Where the normals are None they are those of the thickness: 'true' leaves out what the true ones
    add. The upright direction comes from the floor of the background, where there is one.
    """
    from materialist.errors import WeightsError
    from materialist.geometry.half_turn import upright
    from materialist.geometry.symmetry import symmetric_thickness
    from materialist.predict.refraction import thickness
    from materialist.predict.refraction.choice import best_thickness

    front: Front = scene.front
    seen = (photo, scene.mask, front.normal, front.depth, scene.camera)
    up = upright(behind.depth, behind.normal, planes_of(scene, behind.depth, behind.normal), scene.camera)
    found = {
        "true": Thickness(front.thickness, front.thickness), "predicted": best_thickness(*seen, up=up).thickness
    }  # fmt: skip
    with suppress(WeightsError):  # the others still tell something
        found["network"] = thickness(*seen)
    mirrored = symmetric_thickness(front.depth, front.normal, scene.mask, scene.camera)
    return {**found, "symmetry": Thickness(mirrored, mirrored)}


def planes_of(scene: GlassScene, depth: Array, normal: Array) -> Array:
    """[H, W] int8: the plane of each pixel of what is around the object, -1 for none."""
    from materialist.geometry.planes import find_planes

    plane = np.full(depth.shape, -1, np.int8)
    if depth.any():
        for k, found in enumerate(find_planes(depth, normal, scene.camera)):
            plane[found.mask] = k
    return plane
