"""A picture of what is behind the object, given or made by an inpainter: read, put into the hole, and fitted."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from materialist.edits.core.renderer import EditRenderer, denoised
from materialist.edits.remove.filling import filled_materials
from materialist.edits.remove.hole import Hole
from materialist.edits.remove.inpaint import inpainter
from materialist.edits.remove.native import laid, outline, resized
from materialist.edits.remove.patches import Plan
from materialist.errors import InputError
from materialist.io.image import same_aspect
from materialist.options import Removal
from materialist.types import Array, Materials, Photo, Scene


def given_picture(scene: Scene, options: Removal, hole: Hole) -> tuple[Array | None, list[str]]:
    """([h, w, 3] linear picture of what is behind, None for none; warnings of its file)."""
    background, inpaint = options.background, options.inpaint
    notes: list[str] = []
    if background is None and inpaint is None:
        return None, notes
    if background is not None and inpaint is not None:
        raise InputError("Give a background or an inpainter, not both.")
    if inpaint is not None:
        if isinstance(inpaint, str):
            inpaint = inpainter(inpaint, seed=options.seed, device=options.device)
        return np.asarray(inpaint(scene.photo.linear, hole.painted), np.float32), notes
    if isinstance(background, str | Path):
        from materialist.io.photo import decode_photo

        decoded = decode_photo(Path(background))
        notes = [f"The background {Path(background).name}: {note}" for note in decoded.warnings]
        background = decoded.over(1.0) * np.float32(2.0**scene.photo.stops if decoded.scene_linear else 1)
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


def with_picture(scene: Scene, plan: Plan | None, hole: Hole, picture: Array) -> tuple[Materials, Photo, Array]:
    """Materials, photo and re-rendering with a picture [h, w, 3] linear in the hole.

    A picture says nothing about shine: what it shows is matt. The albedo is a first guess, see `matched`.
    """
    inside = hole.painted[..., None]
    old = filled_materials(plan, scene.materials, hole.painted)
    rough = np.where(hole.painted, np.maximum(old.roughness, 0.6), old.roughness).astype(np.float32)
    metal = np.where(hole.painted, 0, old.metallic).astype(np.float32)
    albedo = np.where(inside, np.maximum(old.albedo, 0.05), old.albedo).astype(np.float32)
    linear = np.where(inside, resized(picture, hole.painted.shape), scene.photo.linear).astype(np.float32)
    share = outline(hole.painted, scene.photo.original.shape[:2])
    original = laid(resized(picture, share.shape), share, scene.photo.original)
    return Materials(albedo, rough, metal), replace(scene.photo, linear=linear, original=original), linear


def matched(removed: Scene, hole: Hole, picture: Array, fitted: Scene, *, spp: int = 24) -> Scene:
    """The scene with the albedo in the hole that makes it look like `picture` [h, w, 3] in the fitted scene's light.

    A rendering says how far a guess is off; for a matt surface the radiance goes with the albedo.
    """
    known = replace(removed, envmap=fitted.envmap, lamps=fitted.lamps, bodies=fitted.bodies)
    wanted = resized(picture, hole.painted.shape)
    for _ in range(3):
        render, _ = EditRenderer(known).pair(known)
        seen = denoised(render(spp, 1), removed.materials.albedo, removed.normal)
        factor = np.clip((wanted + 0.005) / (seen + 0.005), 0.1, 10)
        albedo = np.where(hole.painted[..., None], known.materials.albedo * factor, known.materials.albedo)
        albedo = np.clip(albedo, 0.005, 1).astype(np.float32)
        known = replace(known, materials=replace(known.materials, albedo=albedo))
    return replace(removed, materials=known.materials)
