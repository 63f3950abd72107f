"""The ways to make an object glass that `bench glass` compares, each from the same maps of one view."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np

from materialist.bench.glass_backdrop import Background, albedo_of, lit, suppress_missing
from materialist.bench.glass_scenes import DEPTH, Front, GlassScene, _mesh, _paint
from materialist.geometry.extents import PlaneExtent
from materialist.predict.refraction.thickness import Thickness
from materialist.types import Array


def true_background(scene: GlassScene, room: Array, envmap: Array, ends: tuple[PlaneExtent, ...] = ()) -> Background:
    """The room as it is, its picture [H, W, 3] rendered without the object."""
    depth, normal = scene.behind.depth, scene.behind.normal
    return Background(room, depth, normal, albedo_of(scene, depth, normal, room, envmap, ends), ends)


def inpainted_background(
    scene: GlassScene, photo: Array, envmap: Array, gain: float = 1.0, ends: tuple[PlaneExtent, ...] = ()
) -> Background:
    """What the photo [H, W, 3] linear shows around the object, continued behind it as `edits.remove` does.

    Surfaces go on as planes, the picture and the albedo by patches of their own; `gain` is the photo's exposure. The
    albedo is found with the object there, closed as the photo tells, so that its shadow is not part of it.
    """
    from materialist.edits.remove.behind import SKY, behind
    from materialist.edits.remove.filling import filled, filling_plan

    hole = _grown(scene.mask)
    depth = np.where(hole, 0, scene.behind.depth)
    normal = np.where(hole[..., None], [0, 0, 1], scene.behind.normal).astype(np.float32)
    label, things = np.full(hole.shape, SKY), None
    if depth.any():
        plane = planes_of(scene, depth, normal)
        continued = behind(depth, normal, plane, hole, scene.front.depth, scene.camera)
        depth, normal, label = continued.depth, continued.normal, continued.label
        found = predicted(scene, np.clip(photo * gain, 0, 1), depth, normal)
        grey = _paint(scene._mi, scene.item.albedo)
        things = {"object": _mesh(scene._mi, body(scene, found, depth), grey)}
    albedo = albedo_of(scene, depth, normal, photo, envmap, ends, things)
    plan = filling_plan(albedo, np.clip(photo * gain, 0, 1), hole, label, depth, scene.camera)
    exposed, albedo = (filled(plan, x, hole) for x in (photo * gain, albedo))
    return Background(np.where(hole[..., None], exposed / gain, photo).astype(np.float32), depth, normal, albedo, ends)


def _grown(mask: Array) -> Array:
    """The mask and a rim of mixed pixels."""
    from scipy.ndimage import binary_dilation

    return binary_dilation(mask, np.ones((3, 3), bool))


def two_interface(
    scene: GlassScene, found: Thickness, behind: Background, envmap: Array, ior: float, *, papers_back: bool = False
) -> Array:
    """[H, W, 3] linear, inside the object's mask: the two-interface model.

    The normals of the back are the known ones, or with `papers_back` the opposite of the front's.
    """
    from materialist.edits.glass.two_interface import Behind, back_of
    from materialist.edits.glass.two_interface import two_interface as model
    from materialist.options import Glass

    front, beyond = scene.front, Behind(behind.picture, behind.depth, envmap)
    back = None if papers_back else back_of(front.depth, scene.mask, found.solid, found.back, scene.camera)
    return model(scene.camera, front.normal, front.depth, scene.mask, found.solid, beyond, Glass(ior=ior), back)


def closed_proxy(
    scene: GlassScene, found: Thickness, behind: Background, envmap: Array, ior: float, *, spp: int, seed: int = 0
) -> Array:
    """[H, W, 3] linear, inside the object's mask: a closed object before the background, path-traced."""
    return before(scene, body(scene, found, behind.depth), behind, envmap, ior, spp=spp, seed=seed)


def body(scene: GlassScene, found: Thickness, depth: Array) -> Any:
    """The closed object of a thickness, before what stands behind it at planar `depth` [H, W]."""
    from materialist.solids.closed import closed_proxy

    if found.revolution is not None:
        return found.revolution.body(scene.camera)
    front, mask = scene.front, scene.mask
    return closed_proxy(front.depth, front.normal, mask, found.solid, scene.camera, behind=depth, back=found.back)


def before(
    scene: GlassScene, body: Any, behind: Background, envmap: Array, ior: float, *, spp: int, seed: int = 0
) -> Array:
    """[H, W, 3] linear, inside the object's mask: a closed body (vertices, faces, normals, uv) before the background.

    Denoised as `materialist glass` does, where the denoiser is installed.
    """
    things = {"object": _mesh(scene._mi, body, {"type": "dielectric", "int_ior": ior, "ext_ior": 1.0})}
    picture = lit(
        scene, behind.depth, behind.normal, behind.albedo, envmap, things,
        ends=behind.ends, length=DEPTH["glass"], spp=spp, seed=seed, around=scene.mask,
    )  # fmt: skip
    return np.where(scene.mask[..., None], _clean(picture, scene), 0)


def _clean(picture: Array, scene: GlassScene) -> Array:
    """[H, W, 3] without noise in the rectangle around the object."""
    from materialist.render.denoise import denoise

    rows, columns = np.flatnonzero(scene.mask.any(1)), np.flatnonzero(scene.mask.any(0))
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    part = np.ascontiguousarray(picture[window])
    whole = picture.copy()
    with suppress_missing():
        normal = np.ascontiguousarray(scene.front.normal[window])
        whole[window] = denoise(part, albedo=np.ones_like(part), normal=normal)
    return whole


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
    from materialist.predict.refraction import thickness
    from materialist.solids.symmetry import symmetric_thickness

    front: Front = scene.front
    best = predicted(scene, photo, behind.depth, behind.normal)
    found = {"true": Thickness(front.thickness, front.thickness), "predicted": best}
    with suppress(WeightsError):  # the others still tell something
        found["network"] = thickness(photo, scene.mask, front.normal, front.depth, scene.camera)
    mirrored = symmetric_thickness(front.depth, front.normal, scene.mask, scene.camera)
    return {**found, "symmetry": Thickness(mirrored, mirrored)}


def predicted(scene: GlassScene, photo: Array, depth: Array, normal: Array) -> Thickness:
    """What `materialist glass` takes for the thickness of the object in an exposed photo, before maps of the rest."""
    from materialist.predict.refraction import best_thickness
    from materialist.solids.finder import upright

    up = upright(normal, planes_of(scene, depth, normal))
    front = scene.front
    return best_thickness(photo, scene.mask, front.normal, front.depth, scene.camera, up=up, behind=depth)


def planes_of(scene: GlassScene, depth: Array, normal: Array) -> Array:
    """[H, W] int8: the plane of each pixel of what is around the object, -1 for none."""
    from materialist.geometry.planes import find_planes

    plane = np.full(depth.shape, -1, np.int8)
    if depth.any():
        for k, found in enumerate(find_planes(depth, normal, scene.camera)):
            plane[found.mask] = k
    return plane
