"""The scene without one of its objects (paper, Background Inpainting): what was behind it, in maps, depth and photo."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from materialist.color import linear_to_srgb
from materialist.edits.core.notes import noted, warned
from materialist.edits.core.region import body_coverage
from materialist.edits.remove.amodal import going_on
from materialist.edits.remove.behind import Behind, behind, is_thing
from materialist.edits.remove.exemplar import Plan, exemplar_plan
from materialist.edits.remove.filled import laid, outline, with_hole
from materialist.edits.remove.hole import GROW, Hole, make_hole
from materialist.edits.remove.regular import regular_sources
from materialist.edits.remove.seamless import seamless
from materialist.errors import InputError
from materialist.geometry.membrane import membrane
from materialist.io.image import same_aspect
from materialist.types import Array, Camera, Materials, Photo, Scene

Inpaint = Callable[[Array, Array], Array]
"""inpaint(photo [H, W, 3] linear, hole [H, W] bool) -> [H, W, 3] linear picture without the hole."""


def without(
    scene: Scene, mask: Array, *, background: Array | str | Path | None = None, inpaint: Inpaint | None = None,
    grow: float = GROW, shadow: float | None = None, seed: int = 0, fitted: Scene | None = None,
) -> Scene:  # fmt: skip
    """The scene without the object under a mask: surfaces go on behind it, and so do materials and the photo.

    In the result `photo` and `rerender` are filled alike, from the same places: their difference is what the fit
    misses of the surroundings. `revealed.revealed` brings both into the composite.

    Args:
        mask: [H, W] bool, or weights in [0, 1], at working size.
        background: the true background, [h, w, 3] linear at working or native size and the exposure of the photo,
            or a file of that aspect, an EXR in the unit of the photo's file; it takes the place of inpainting, and
            its albedo is what makes the re-rendering equal to it.
        inpaint: another inpainter of the photo, used like a background (see `inpaint.diffusion`).
        grow: rim around the mask that is filled as well, as a part of the picture's longer side, in [0, 0.2]; wider
            where the object is out of focus.
        shadow: how far the surface it stands on is filled as well, as a part of the object's size, in [0, 2]; None:
            where its shadow and reflection are found (`cast.cast`). What the albedo kept of them goes with the object.
        seed: of the patch search.
        fitted: the scene before its edits: a given background is the photo's, in the light of the photo.

    Raises:
        InputError: a mask that is empty, of another size, all sky, or (nearly) all of the photo; a background of
            another aspect.
    """
    hole = make_hole(scene, mask, grow=grow, shadow=shadow)
    label = scene.geometry.plane_label.astype(np.int64)
    front = np.where(hole.object, scene.depth, 0)
    things = _things(scene, label, hole) if inpaint is None and background is None else []
    found = behind(scene.depth, scene.normal, label, hole.gone, front, scene.camera, things)
    features = looks(scene.materials.albedo, scene.photo.linear)
    photographed = replace(scene, bodies=(fitted or scene).bodies)  # what an edit puts there is not in the photo
    usable = body_coverage(photographed) == 0 if photographed.bodies else None
    plan = sources(features, hole.painted, found.label, found.depth, scene.camera, seed=seed, usable=usable)
    shown = _denoised(scene)
    picture, notes = _given(scene, background, inpaint, hole)
    if picture is None:
        materials, photo, rerender = _continued(scene, plan, hole, shown, found.label)
    else:
        materials, photo, rerender = _painted(scene, plan, hole, shown, picture, found.label)
    how = "background" if background is not None else ("inpainter" if inpaint else "patches")
    removed = replace(
        scene, materials=materials, depth=found.depth, normal=found.normal, geometry=_geometry(scene, found),
        photo=photo, rerender=rerender,
    )  # fmt: skip
    cast = "auto" if shadow is None else shadow
    what = {"filled_by": how, "pixels": int(hole.object.sum()), "grow": grow, "shadow": cast, "at": _middle(hole)}
    if photographed.bodies:
        removed = _with_bodies(removed, photographed, hole)
    if picture is not None:
        removed = _matched(removed, hole, picture, fitted or scene)
    return noted(warned(removed, *notes), "remove", what)


def _things(scene: Scene, label: Array, hole: Hole) -> list[tuple[Array, Array]]:
    """Things that the object hid in part: what is seen, and what is hidden of each, [H, W] bool."""
    from materialist.edits.select.select import select

    faces = [k for k in np.unique(label[label >= 0]) if is_thing((label == k) & ~hole.gone, hole.gone)]
    loose = ((label < 0) | np.isin(label, faces)) & (scene.depth > 0)
    inverse = 1 / np.where(scene.depth > 0, scene.depth, np.inf)
    front = np.where(hole.object, inverse, 0)

    def around(place: tuple[int, int]) -> Array:
        try:
            return select(scene, click=place) > 0.5
        except InputError:  # nothing is found there
            return np.zeros_like(loose)

    return going_on(loose, hole.gone, inverse, front, around)


def _middle(hole: Hole) -> list[int]:
    """[x, y] a pixel of the hole, as far from its border as there is one: it tells this hole from others."""
    from scipy.ndimage import distance_transform_edt

    far = distance_transform_edt(np.pad(hole.painted, 1))[1:-1, 1:-1]
    y, x = np.unravel_index(int(far.argmax()), far.shape)
    return [int(x), int(y)]


def looks(albedo: Array, photo: Array) -> Array:
    """[H, W, 6] sRGB of albedo and photo [H, W, 3] linear: places that fill a hole must be alike in both."""
    return np.concatenate([linear_to_srgb(albedo), linear_to_srgb(photo)], -1)


def sources(
    features: Array, hole: Array, label: Array, depth: Array, camera: Camera, *, seed: int = 0,
    usable: Array | None = None,
) -> Plan | None:  # fmt: skip
    """Where a hole [H, W] bool is filled from: patterns of planes go on; else `looks` must be alike, on a surface.

    `label`, `depth` [H, W]: surfaces in and around the hole (see `behind.Behind`); `usable` [H, W] bool: what may be
    copied, None for anything. None where nothing can be.
    """
    anywhere = np.ones(hole.shape, bool) if usable is None else usable
    paint = features[..., :3]  # the albedo of `looks`
    told = regular_sources(paint, features, hole, anywhere, label, depth, camera)
    return exemplar_plan(features, hole, anywhere, joined(label, hole), told=told, seed=seed)


def joined(label: Array, hole: Array) -> Array:
    """Labels [H, W] int where parts of a plane that do not reach the hole [H, W] bool are surfaces of their own.

    One plane may hold two things: the face of a die, and by accident a strip of the board behind it.
    """
    from skimage.measure import label as parts_of

    out = label.copy()
    for number in np.unique(label[hole & (label >= 0)]):
        parts = parts_of(label == number, connectivity=2)
        others = (parts > 0) & ~np.isin(parts, parts[hole])
        out[others] = out.max() + parts[others]
    return out


def filled(plan: Plan | None, maps: Array, hole: Array) -> Array:
    """[H, W, C] radiance or albedo with the hole filled: patches without seams, or a membrane where there are none."""
    return seamless(plan, maps) if plan is not None else membrane(maps, ~hole)


def _materials(scene: Scene, plan: Plan | None, hole: Array) -> Materials:
    old = scene.materials
    rest = np.stack([old.roughness, old.metallic], -1)
    rest = plan.fill(rest) if plan is not None else membrane(rest, ~hole)
    albedo = np.clip(filled(plan, old.albedo, hole), 0, 1)
    return Materials(albedo, *(np.ascontiguousarray(np.clip(part, 0, 1)) for part in (rest[..., 0], rest[..., 1])))


def _continued(
    scene: Scene, plan: Plan | None, hole: Hole, shown: Array, label: Array
) -> tuple[Materials, Photo, Array]:
    """Materials, photo and re-rendering filled with patches."""
    linear, rerender = (filled(plan, picture, hole.painted) for picture in (scene.photo.linear, shown))
    photo = with_hole(scene.photo, linear, hole.painted, plan, label)
    return _materials(scene, plan, hole.painted), photo, rerender.astype(np.float32)


def _painted(
    scene: Scene, plan: Plan | None, hole: Hole, shown: Array, picture: Array, label: Array
) -> tuple[Materials, Photo, Array]:
    """Materials, photo and re-rendering with a given picture [h, w, 3] in the hole.

    The light on the hidden surface is taken from the surroundings on the same surface: radiance over albedo.
    """
    inside = hole.painted[..., None]
    small = resized(picture, hole.painted.shape)
    materials = _materials(scene, plan, hole.painted)
    light = (shown.mean(-1) + 0.01) / (scene.materials.albedo.mean(-1) + 0.01)
    falling = np.zeros(light.shape, np.float32)
    for k in np.unique(label[hole.painted]):
        near = ~hole.painted & (label == k)
        falling = np.where(
            label == k, membrane(np.clip(light, 0.02, 50), near if near.any() else ~hole.painted), falling
        )
    albedo = np.where(inside, np.clip(small / np.maximum(falling, 0.02)[..., None], 0, 1), scene.materials.albedo)
    # A picture says nothing about shine: what it shows is taken as matt.
    rough = np.where(hole.painted, np.maximum(materials.roughness, 0.6), materials.roughness)
    metal = np.where(hole.painted, 0, materials.metallic).astype(np.float32)
    linear = np.where(inside, small, scene.photo.linear).astype(np.float32)
    share = outline(hole.painted, scene.photo.original.shape[:2])
    original = laid(resized(picture, share.shape), share, scene.photo.original)
    photo = replace(scene.photo, linear=linear, original=original)
    return Materials(albedo.astype(np.float32), rough.astype(np.float32), metal), photo, linear


def _with_bodies(removed: Scene, scene: Scene, hole: Hole) -> Scene:
    """The scene with its bodies in the filled photo and re-rendering again: they stand before what was taken away."""
    share = body_coverage(scene)
    if not (share[hole.painted] > 0).any():
        return removed
    photo, native = scene.photo, scene.photo.original.shape[:2]
    large = share if native == share.shape else _enlarged_share(scene, hole.painted & (share > 0), native)
    linear, rerender = (
        laid(old, share, new) for old, new in ((photo.linear, removed.photo.linear), (scene.rerender, removed.rerender))
    )
    original = laid(photo.original, large, removed.photo.original)
    return replace(removed, photo=replace(removed.photo, linear=linear, original=original), rerender=rerender)


def _enlarged_share(scene: Scene, where: Array, native: tuple[int, int]) -> Array:
    """[H0, W0] share of each native pixel in which a body is seen, near `where` [H, W] bool; 0 elsewhere."""
    from materialist.edits.core.renderer import EditRenderer

    box: list[int] = []
    for axis in (0, 1):
        (inside,), scale = np.nonzero(where.any(1 - axis)), native[axis] / where.shape[axis]
        box += [max(0, int((inside[0] - 1) * scale)), min(native[axis], int(np.ceil((inside[-1] + 2) * scale)))]
    large = np.zeros(native, np.float32)
    large[box[0] : box[1], box[2] : box[3]] = EditRenderer(scene).body_coverage_in(
        scene, native, (box[0], box[1], box[2], box[3])
    )
    return large


def _matched(removed: Scene, hole: Hole, picture: Array, fitted: Scene, *, spp: int = 24) -> Scene:
    """The scene with the albedo in the hole that makes it look like `picture` in the light of the fitted scene.

    One rendering says how far the guess was off; for a matt surface the radiance goes with the albedo.
    """
    from materialist.edits.core.renderer import EditRenderer, denoised

    known = replace(removed, envmap=fitted.envmap, lamps=fitted.lamps, bodies=fitted.bodies)
    renderer = EditRenderer(known)
    wanted = resized(picture, hole.painted.shape)
    for _ in range(2):
        render, _ = renderer.pair(known)
        seen = render(spp, 1)
        seen = denoised(seen, removed.materials.albedo, removed.normal)
        factor = np.clip((wanted + 0.005) / (seen + 0.005), 0.2, 5)
        albedo = np.where(hole.painted[..., None], known.materials.albedo * factor, known.materials.albedo)
        albedo = np.clip(albedo, 0, 1).astype(np.float32)
        known = replace(known, materials=replace(known.materials, albedo=albedo))
        renderer = EditRenderer(known)
    return replace(removed, materials=known.materials)


def _given(scene: Scene, background, inpaint: Inpaint | None, hole: Hole) -> tuple[Array | None, list[str]]:
    """([h, w, 3] linear picture of what is behind, if there is one; what is to be said of it)."""
    notes: list[str] = []
    if background is None and inpaint is None:
        return None, notes
    if background is not None and inpaint is not None:
        raise InputError("Give a background or an inpainter, not both.")
    if inpaint is not None:
        return np.asarray(inpaint(scene.photo.linear, hole.painted), np.float32), notes
    if isinstance(background, str | Path):
        from materialist.io.photo import decode_photo

        decoded = decode_photo(Path(background))
        notes = [f"The background {Path(background).name}: {note}" for note in decoded.warnings]
        background = decoded.linear * np.float32(2.0**scene.photo.stops if decoded.scene_linear else 1)
    picture = np.asarray(background, np.float32)
    shape = hole.painted.shape
    if picture.ndim != 3 or picture.shape[2] != 3 or not same_aspect(picture.shape, shape):
        raise InputError(
            f"The background is {' x '.join(map(str, picture.shape[1::-1]))} pixels, the photo {shape[1]} x {shape[0]} "
            "at working size; give the same view at the same proportions."
        )
    if not (np.isfinite(picture).all() and picture.min() >= 0):
        raise InputError("The background has negative or infinite values; give a linear or sRGB picture.")
    return picture, notes


def _geometry(scene: Scene, found: Behind):
    from materialist.geometry.build import build_geometry, completion_of
    from materialist.geometry.extents import read_extents

    options = scene.provenance
    return build_geometry(
        found.depth, found.normal, scene.camera, tau=float(options.get("tau", 6.0)),
        completion=completion_of(scene.geometry, options.get("completion")), extents=read_extents(options),
        seed=int(options.get("seed", 0) or 0),
    )  # fmt: skip


def _denoised(scene: Scene) -> Array:
    """[H, W, 3] the re-rendering without its noise, where the denoiser is installed."""
    from materialist.edits.core.renderer import denoised

    return denoised(scene.rerender, scene.materials.albedo, scene.normal)


def resized(picture: Array, shape: tuple[int, ...]) -> Array:
    """[h, w] or [h, w, C] at another size (rows, columns, ...), averaged when it shrinks."""
    import cv2

    if picture.shape[:2] == shape[:2]:
        return picture.copy()
    smaller = picture.shape[0] > shape[0]
    how = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(np.ascontiguousarray(picture, np.float32), shape[1::-1], interpolation=how))
