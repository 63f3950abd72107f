"""New bodies at the photo's native resolution: their own radiance and a soft matte, for the composite."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from materialist.edits.composite.upsample import matte
from materialist.edits.core.renderer import EditRenderer, denoised, is_relit, new_lamps, path_depth
from materialist.edits.core.surfaces import PHOTO_GLASS, PHOTO_LIGHT, uniform_surface
from materialist.types import Array, Body, Scene


@dataclass(frozen=True)
class NativeSettings:
    """Resolution and paths of the native-resolution layer."""

    pixels: int = 1_500_000
    """Largest number of pixels that are traced; a larger layer is traced smaller and enlarged (derived: time)."""
    fewest_paths: int = 32
    """Paths a native pixel, at least, as the denoiser needs (tuned by eye)."""
    most_paths: int = 4
    """Paths a native pixel, at most, in multiples of those of the picture (derived: time)."""
    margin: int = 4
    """Native pixels around the bodies that the denoiser sees (tuned by eye)."""
    contact: float = 0.05
    """Share of a body's extent up to which a surface before it is the ground it stands on (tuned by eye)."""
    lamp_contact: float = 2.0
    """The same of lamps, which a surface cuts (tuned by eye)."""


SETTINGS = NativeSettings()
NOWHERE = np.zeros((0, 3), np.float32)
LAMP = Body(NOWHERE, NOWHERE.astype(np.int32), NOWHERE, NOWHERE[:, :2], uniform_surface(1.0, 1.0, 0.0), "lamp")
"""What stands for a lamp where its albedo is asked for."""


@dataclass(frozen=True)
class NativeLayer:
    """The new bodies of an edit, as the photo would show them."""

    inside: Array
    """[H, W] float32 in [0, 1]: share of each pixel of working size that they cover."""
    share: Array
    """[H0, W0] float32: the same of each native pixel."""
    picture: Array
    """[H0, W0, 3] float32 linear: their radiance, of nothing else; 0 away from them."""


def new_bodies(scene: Scene, edited: Scene) -> list[str]:
    """Names of the shapes of bodies that `edited` has and `scene` has not, and whose outline is not in the photo.

    The photo's own lights and what is turned to glass in it have the outline that the photo shows.
    """
    new = {f"body{k}": body for k, body in enumerate(edited.bodies) if body not in scene.bodies}
    return [name for name, body in new.items() if not body.name.startswith((PHOTO_LIGHT, PHOTO_GLASS))]


def native_layer(renderer: EditRenderer, edited: Scene, *, spp: int, seed: int, clean: bool) -> NativeLayer | None:
    """Trace the bodies and lamps that are new in `edited` at native size; None where the camera sees none of them.

    Bodies that take the place of a surface of the photo are left to the photo's own outlines. Under another light
    every lamp counts as new: it stays as bright as it was, and what changes beside it must not colour its rim.
    """
    scene = renderer.scene
    lamps = [f"lamp{k}" for k in range(len(edited.lamps))]
    if not is_relit(scene, edited):
        lamps = new_lamps(scene, edited)
    names = new_bodies(scene, edited) + lamps
    return (
        _traced(renderer.render_scene(renderer.lit(edited, edited)), scene, edited, names, spp, seed, clean)
        if names
        else None
    )


def _traced(
    target: Any, scene: Scene, edited: Scene, names: list[str], spp: int, seed: int, clean: bool
) -> NativeLayer | None:
    """The named bodies of a `RenderScene` as a layer."""
    from materialist.render.coverage import first_hits
    from materialist.render.native import only, radiance

    camera, native = scene.camera, scene.photo.original.shape[:2]
    working = (camera.height, camera.width)
    bodies = {f"body{k}": body for k, body in enumerate(edited.bodies)}
    bodies |= {f"lamp{k}": LAMP for k in range(len(edited.lamps))}
    chosen = {name: bodies[name] for name in names}
    small = first_hits(target.mi_scene, camera, chosen, working, (0, working[0], 0, working[1]))
    if not small.share.any():
        return None
    box = _box(small.share, native)
    sight = first_hits(target.mi_scene, camera, chosen, native, box)
    alone = first_hits(only(target.mi_scene, names), camera, chosen, native, box)
    factor = min(1.0, np.sqrt(SETTINGS.pixels / ((box[1] - box[0]) * (box[3] - box[2]))))
    size = (max(2, round(native[0] * factor)), max(2, round(native[1] * factor)))
    part = _scaled(box, native, size)
    # As many paths as a picture of working size has, on the part that the bodies take.
    pixels = (part[1] - part[0]) * (part[3] - part[2])
    paths = max(SETTINGS.fewest_paths, min(SETTINGS.most_paths * spp, spp * working[0] * working[1] // pixels))
    # A lamp that touches a surface is cut by it, not hidden by a thing before it.
    contact = SETTINGS.lamp_contact if all(name.startswith("lamp") for name in names) else SETTINGS.contact
    gap = contact * _extent(alone)
    depth = path_depth(edited)
    options: dict[str, Any] = {"spp": paths, "seed": seed, "max_depth": depth, "names": names, "gap": gap}
    picture = radiance(target, size, part, **options)
    guide = sight if size == native else first_hits(target.mi_scene, camera, chosen, size, part)
    picture = spread(picture)
    if clean:
        picture = denoised(picture, guide.albedo, guide.normal)
    picture = _enlarged(picture, sight.share.shape)
    share = np.zeros(native, np.float32)
    whole = np.zeros((*native, 3), np.float32)
    rows, columns = slice(*box[:2]), slice(*box[2:])
    share[rows, columns] = _behind_things(sight, alone, scene, box, gap)
    whole[rows, columns] = np.where(share[rows, columns, None] > 0, picture, 0)
    bright = any(max(bodies[name].surface.emission) > 1 or name.startswith("lamp") for name in names)
    return NativeLayer(_around(small.share) if bright else small.share, share, whole)


def _around(share: Array) -> Array:
    """Its largest value within a pixel: a corner of what glows, too small to be looked up, outshines its pixel."""
    import cv2

    return np.asarray(cv2.dilate(share, np.ones((3, 3), np.uint8)))


def _box(share: Array, native: tuple[int, int]) -> tuple[int, int, int, int]:
    """The native rows and columns around what is covered at working size."""
    edges = []
    for axis in (0, 1):
        places = np.flatnonzero(share.any(1 - axis))
        scale = native[axis] / share.shape[axis]
        edges += [
            max(0, int(np.floor((places[0] - 1) * scale)) - SETTINGS.margin),
            min(native[axis], int(np.ceil((places[-1] + 2) * scale)) + SETTINGS.margin),
        ]
    return edges[0], edges[1], edges[2], edges[3]


def _scaled(box: tuple[int, int, int, int], native: tuple[int, int], size: tuple[int, int]):
    """The box in a picture of another size."""
    y, x = size[0] / native[0], size[1] / native[1]
    top, left = int(box[0] * y), int(box[2] * x)
    bottom, right = max(top + 1, round(box[1] * y)), max(left + 1, round(box[3] * x))
    return top, min(bottom, size[0]), left, min(right, size[1])


def _enlarged(picture: Array, shape: tuple[int, int]) -> Array:
    import cv2

    if picture.shape[:2] == shape:
        return picture
    return np.asarray(cv2.resize(picture, shape[::-1], interpolation=cv2.INTER_LINEAR), np.float32)


def _behind_things(
    sight: Any, alone: Any, scene: Scene, box: tuple[int, int, int, int], gap: float
) -> Array:  # fmt: skip
    """[h, w] share of the bodies, with the photo's own silhouettes where a thing in it stands `gap` before them.

    The mesh has the steps of working pixels there; `upsample.matte` finds the thing's outline in the photo.
    """
    import cv2

    native = scene.photo.original.shape[:2]
    rows, columns = slice(*box[:2]), slice(*box[2:])
    enlarge = lambda v: cv2.resize(v, native[::-1], interpolation=cv2.INTER_NEAREST)[rows, columns]  # noqa: E731
    nearer = alone.depth - enlarge(scene.depth)
    hidden = (alone.share > sight.share + 0.05) & (nearer > gap)
    if not hidden.any():
        return sight.share
    scale = max(native[0] / scene.depth.shape[0], 1.0)
    kernel = np.ones((2 * int(np.ceil(2 * scale)) + 1,) * 2, np.uint8)
    near = cv2.dilate(hidden.astype(np.uint8), kernel) > 0
    whole = np.zeros(native, np.float32)
    whole[rows, columns] = spread(alone.depth)
    depth = spread(cv2.resize(whole, scene.depth.shape[::-1], interpolation=cv2.INTER_NEAREST))
    thing = (scene.depth > 0) & (scene.depth < depth - gap)
    cut = alone.share * (1 - matte(thing, scene.photo.original)[rows, columns])
    return np.where(near, cut, sight.share).astype(np.float32)


def _extent(alone: Any) -> float:
    """How deep bodies seen alone are, scene units; a flat one that faces the camera has some depth, too."""
    if not (alone.depth > 0).any():
        return 1e-9
    size = float(alone.depth.max() - alone.depth[alone.depth > 0].min()) + 1e-9
    return max(size, float(alone.depth.max()) * float(np.sqrt((alone.share > 0).mean())) * 0.05)


def spread(values: Array) -> Array:
    """[h, w] or [h, w, 3] with every 0 replaced by the nearest other value."""
    from scipy import ndimage

    none = values == 0 if values.ndim == 2 else (values == 0).all(-1)
    if none.all():
        return values
    return values[tuple(ndimage.distance_transform_edt(none, return_distances=False, return_indices=True))]
