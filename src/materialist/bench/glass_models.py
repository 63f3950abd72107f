"""What `bench glass` compares: backgrounds, thicknesses and models of glass, each from the maps of one view.

Backgrounds are meshes that reflect the light: they are lit, and do not glow, so that the glass casts its shadow and its
caustics on them, as in a fitted scene.
"""

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
from scipy.ndimage import binary_dilation

from materialist.bench.glass_scenes import PROTOCOL, GlassScene, painted
from materialist.buffers import tensor
from materialist.edits.core.renderer import denoised
from materialist.edits.glass import two_interface as interfaces
from materialist.edits.remove.behind import behind as continued_behind
from materialist.edits.remove.patches import patched
from materialist.edits.remove.remove import carried
from materialist.errors import WeightsError
from materialist.geometry.build import build_geometry, part
from materialist.geometry.planes import find_planes, upright
from materialist.geometry.silhouette import window
from materialist.options import Glass
from materialist.predict.refraction.thickness import Thickness, best_thickness, thickness
from materialist.render.scene import shape
from materialist.solids.closed import closed_proxy
from materialist.solids.symmetry import symmetric_thickness
from materialist.types import Array


@dataclass(frozen=True)
class Case:
    """One object under one light with one index of refraction; pictures [H, W, 3] are linear radiance."""

    scene: GlassScene
    envmap: Array
    photo: Array
    """The object grey."""
    truth: Array
    """The object glass."""
    gain: float
    """Exposure of all pictures of the case."""
    ior: float
    name: str
    spp: int = 16
    """Paths a pixel of the predictions."""


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


def true_background(scene: GlassScene, room: Array, envmap: Array) -> Background:
    """The room as it is, its picture [H, W, 3] rendered without the object."""
    depth, normal = scene.behind.depth, scene.behind.normal
    return Background(room, depth, normal, _albedo(scene, depth, normal, room, envmap))


def inpainted_background(scene: GlassScene, photo: Array, envmap: Array, gain: float = 1.0) -> Background:
    """What the photo [H, W, 3] linear shows around the object, continued behind it as `edits.remove` does.

    Surfaces go on as planes, the picture by patches, the albedo with it; `gain` is the photo's exposure. The albedo
    is found with the object there, closed as the photo tells, so that its shadow is not part of it.
    """
    hole = binary_dilation(scene.mask, np.ones((3, 3), bool))  # with the rim of mixed pixels
    depth = np.where(hole, 0, scene.behind.depth)
    normal = np.where(hole[..., None], [0, 0, 1], scene.behind.normal).astype(np.float32)
    label, things = np.zeros(hole.shape, int), None
    if depth.any():
        plane = _planes(scene, depth, normal)
        continued = continued_behind(depth, normal, plane, hole, scene.front.depth, scene.camera)
        depth, normal, label = continued.depth, continued.normal, continued.label
        found = _predicted(scene, np.clip(photo * gain, 0, 1), depth, normal)
        things = {"object": shape(mi, _body(scene, found, depth), painted(scene.item.albedo))}
    albedo = _albedo(scene, depth, normal, photo, envmap, things)
    filled = patched(np.clip(photo * gain, 0, 1), hole, ~hole, depth, label)
    shown = np.where(hole[..., None], filled / gain, photo).astype(np.float32)
    return Background(shown, depth, normal, np.minimum(carried(albedo, filled, hole), 1))


def _albedo(
    scene: GlassScene, depth: Array, normal: Array, picture: Array, envmap: Array,
    things: dict[str, Any] | None = None,
) -> Array:  # fmt: skip
    """[H, W, 3] diffuse albedo with which the surfaces of the maps, path-traced under envmap, look like `picture`.

    `things` are Mitsuba objects that stand before them, in the picture, too.
    """
    albedo = np.full(picture.shape, 0.5, np.float32)
    for _ in range(PROTOCOL.albedo_rounds if depth.any() else 0):
        surfaces = Background(picture, depth, normal, albedo)
        seen = lit(scene, surfaces, envmap, things, length=PROTOCOL.diffuse_length, spp=PROTOCOL.albedo_spp)
        seen = denoised(seen, albedo, normal)
        albedo = np.clip(albedo * picture / np.maximum(seen, 1e-6), 0, PROTOCOL.brightest_albedo).astype(np.float32)
    return albedo


def lit(
    scene: GlassScene, behind: Background, envmap: Array, things: dict[str, Any] | None = None, *, length: int,
    spp: int, cropped: bool = False,
) -> Array:  # fmt: skip
    """[H, W, 3] linear: Mitsuba objects before a background, whose planes go on with their mean albedo, path-traced.

    Paths have `length` segments at most; `cropped` as in `GlassScene.trace`.
    """
    shapes: dict[str, Any] = {}
    if behind.depth.any():
        geometry = build_geometry(behind.depth, behind.normal, scene.camera)
        for k in np.unique(geometry.mesh.face_plane):
            mean = behind.albedo[geometry.plane_label == k].mean(0) if k >= 0 else None
            paint = behind.albedo if mean is None else np.broadcast_to(mean, (2, 2, 3))
            texture = {"type": "bitmap", "data": tensor(mi, paint), "raw": True, "wrap_mode": "clamp"}
            surface = {"type": "diffuse", "reflectance": texture}
            shapes[f"backdrop{int(k) + 1}"] = shape(mi, part(geometry.mesh, int(k)), surface)
    return scene.trace({**shapes, **(things or {})}, envmap, length=length, spp=spp, cropped=cropped)


def two_interface(case: Case, found: Thickness, behind: Background, *, papers_back: bool = False) -> Array:
    """[H, W, 3] linear, inside the object's mask: the two-interface model.

    The normals of the back are the known ones, or with `papers_back` the opposite of the front's.
    """
    camera, front, mask = case.scene.camera, case.scene.front, case.scene.mask
    beyond = interfaces.Backdrop(behind.picture, behind.depth, case.envmap)
    material = Glass(ior=case.ior, model="two-interface", back="same" if papers_back else "found")
    return interfaces.two_interface(camera, front.normal, front.depth, mask, found.solid, beyond, material, found.back)


def closed(case: Case, found: Thickness, behind: Background) -> Array:
    """[H, W, 3] linear, inside the object's mask: a closed object before the background, path-traced."""
    return before(case, _body(case.scene, found, behind.depth), behind)


def before(case: Case, body: Any, behind: Background) -> Array:
    """[H, W, 3] linear, inside the object's mask: a closed body (vertices, faces, normals, uv) before the background.

    Denoised as `materialist glass` does, where the denoiser is installed.
    """
    scene = case.scene
    things = {"object": shape(mi, body, {"type": "dielectric", "int_ior": case.ior, "ext_ior": 1.0})}
    length = PROTOCOL.glass_length
    picture = lit(scene, behind, case.envmap, things, length=length, spp=case.spp, cropped=True)
    box = window(scene.mask)
    seen, normal = np.ascontiguousarray(picture[box]), np.ascontiguousarray(scene.front.normal[box])
    picture[box] = denoised(seen, np.ones_like(seen), normal)
    return np.where(scene.mask[..., None], picture, 0)


def _body(scene: GlassScene, found: Thickness, depth: Array) -> Any:
    """The closed object of a thickness, before what stands behind it at planar `depth` [H, W]."""
    if found.revolution is not None:
        return found.revolution.body(scene.camera)
    front, mask = scene.front, scene.mask
    return closed_proxy(front.depth, front.normal, mask, found.solid, scene.camera, behind=depth, back=found.back)


def thicknesses(scene: GlassScene, photo: Array, behind: Background) -> dict[str, Thickness]:
    """Thickness along the camera rays, and the normals of the back, by where they come from.

    'true', 'predicted' (what `materialist glass` takes by itself), 'network' (RefractionNet alone, where its weights
    are), 'symmetry'. Where the normals are None they are those of the thickness: 'true' leaves out what true ones add.
    """
    front = scene.front
    best = _predicted(scene, photo, behind.depth, behind.normal)
    found = {"true": Thickness(front.thickness, front.thickness), "predicted": best}
    with suppress(WeightsError):  # the others still tell something
        found["network"] = thickness(photo, scene.mask, front.normal, front.depth, scene.camera)
    mirrored = symmetric_thickness(front.depth, front.normal, scene.mask, scene.camera)
    return {**found, "symmetry": Thickness(mirrored, mirrored)}


def _predicted(scene: GlassScene, photo: Array, depth: Array, normal: Array) -> Thickness:
    """What `materialist glass` takes for the thickness of the object in an exposed photo, before maps of the rest."""
    up, front = upright(normal, _planes(scene, depth, normal)), scene.front
    return best_thickness(photo, scene.mask, front.normal, front.depth, scene.camera, up=up, behind=depth)


def _planes(scene: GlassScene, depth: Array, normal: Array) -> Array:
    """[H, W] int8: the plane of each pixel of what is around the object, -1 for none."""
    plane = np.full(depth.shape, -1, np.int8)
    for k, found in enumerate(find_planes(depth, normal, scene.camera) if depth.any() else ()):
        plane[found.mask] = k
    return plane
