"""Edits of albedo, roughness and metallic inside a region (paper, Opaque Material Editing)."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import cv2
import numpy as np

from materialist.camera import unit, unproject
from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.edits.core.notes import noted
from materialist.edits.core.region import checked_region, reshaped
from materialist.edits.material.detail import core_of, highlights, shaded, shading_detail
from materialist.edits.material.normals import is_metal, with_metal_normals
from materialist.edits.material.options import MaterialEdit, MaterialKeywords
from materialist.errors import InputError
from materialist.geometry.planes import axes
from materialist.io.photo import decode_photo
from materialist.option_kinds import documented
from materialist.types import Array, Materials, Prediction, Scene


@documented(MaterialEdit)
def edit(
    scene: Scene,
    mask: Array,
    options: MaterialEdit | None = None,
    **values: Unpack[MaterialKeywords],
) -> Scene:
    """The scene with other materials inside the mask; everything else, the photo included, is shared.

    The prior takes the new paint as well, for later edits.

    A new colour or texture keeps the photo's fine shading and gloss (`detail`, see `detail.shading_detail`).
    Saturation and value keep the order of a texture: nothing clips, and grey stays grey. A number for roughness or
    metallic sets it, a text with a sign ("+0.5", "-0.5") shifts it; +-0.5 are the paper's high and low. Hue,
    saturation and value act on a new albedo or texture, too.

    mask: [H, W] bool, or weights in [0, 1], at working size.
    options, values: see `options.MaterialEdit`; `values` are fields of it, as in `edit(scene, mask, hue=120)`.
    Raises InputError for a mask of another size or empty, or a value out of its range.
    """
    changes = MaterialEdit.merged(options, **values)
    weight = weight_of(scene, mask, changes)
    # --- The new albedo: hue, saturation and value act on it last, then the old shading ---
    materials = scene.materials
    colour, texture = base_colour(scene, weight, changes)
    if changes.hue or changes.saturation or changes.value:
        colour = shifted_hsv(colour, changes.hue, changes.saturation, changes.value)
    metallic = changed(materials.metallic, changes.metallic)
    prior = _predicted(scene, weight, colour, changes)
    if changes.albedo is not None or changes.texture is not None:
        region = core_of(weight)
        # Shades stay, and white gloss white; metal has reflections of its own.
        white = changes.detail * (1 - metallic) * highlights(scene, weight)
        factor = shading_detail(scene, region, changes.detail, metallic, white)
        colour = shaded(colour, factor, region)
        colour = colour + white[..., None] * (1 - colour)
    # Mixed by the weight, so that a feathered border fades.
    new = Materials(
        _mix(materials.albedo, colour, weight[..., None]),
        _mix(materials.roughness, changed(materials.roughness, changes.roughness), weight),
        _mix(materials.metallic, metallic, weight),
    )
    # --- Metal mirrors each bump of predicted normals: round bodies get smooth ones ---
    region = weight > 0.5
    edited = replace(scene, materials=new, prior=prior)
    if is_metal(metallic, region, changes):
        edited = with_metal_normals(edited, region)
    # --- What the provenance keeps: only what was asked for ---
    names = ("hue", "saturation", "value", "grow", "feather")
    facts: dict[str, Any] = {name: getattr(changes, name) or None for name in names}
    facts |= {
        "albedo": changes.albedo,
        "roughness": changes.roughness,
        "metallic": changes.metallic,
        "texture": texture,
        "detail": changes.detail if changes.detail != 1 else None,
        "normals": "metal" if edited.normal is not scene.normal else None,
    }
    return noted(edited, "material", {**facts, "pixels": int(region.sum())})


def shifted_hsv(albedo: Array, hue: float, saturation: float, value: float) -> Array:
    """[..., 3] linear albedo moved in the HSV of its sRGB encoding (the numbers colour pickers show); float32.

    Value and saturation move towards their ends instead of being added to, so that no texture is cut off: with v > 0
    V becomes V + v (1 - V), else V (1 + v); with s > 0 S becomes S (1 + s (1 - S)), else S (1 + s).
    """
    shape = albedo.shape
    encoded = linear_to_srgb(albedo).reshape(-1, 1, 3)
    # Of floats: H in [0, 360), S and V in [0, 1].
    hsv = cv2.cvtColor(np.ascontiguousarray(encoded), cv2.COLOR_RGB2HSV)
    h = hsv[..., 0]
    s = hsv[..., 1]
    v = hsv[..., 2]
    h = (h + hue) % 360
    s = s * (1 + saturation * (1 - s)) if saturation > 0 else s * (1 + saturation)
    v = v + value * (1 - v) if value > 0 else v * (1 + value)
    moved = cv2.cvtColor(np.stack([h, s, v], -1).astype(np.float32), cv2.COLOR_HSV2RGB)
    return srgb_to_linear(np.clip(moved, 0, 1)).reshape(shape)


def weight_of(scene: Scene, mask: Array, changes: MaterialEdit) -> Array:
    """[H, W] in [0, 1]: how much of the new material each pixel gets. Raises InputError as `edit` does."""
    region = reshaped(checked_region(scene, mask), changes.grow, changes.feather)
    return region * (scene.depth > 0)


def _predicted(scene: Scene, weight: Array, colour: Array, changes: MaterialEdit) -> Prediction:
    """The prior with the new paint, on which later edits find the fit's shading and gloss again.

    colour: [H, W, 3] the new albedo, without the photo's shading.
    """
    old = scene.prior.materials.albedo
    inside = weight > 0
    if changes.albedo is not None or changes.texture is not None:
        paint = colour
    elif changes.hue or changes.saturation or changes.value:
        paint = old.copy()
        paint[inside] = shifted_hsv(old[inside], changes.hue, changes.saturation, changes.value)
    else:
        return scene.prior
    albedo = _mix(old, paint, weight[..., None])
    return replace(scene.prior, materials=replace(scene.prior.materials, albedo=albedo))


def base_colour(
    scene: Scene, weight: Array, changes: MaterialEdit
) -> tuple[Array, list[int] | None]:
    """([H, W, 3] albedo before hue, saturation and value act, shape of the texture that it has)."""
    if changes.albedo is not None and changes.texture is not None:
        raise InputError(
            "Give an albedo or a texture, not both; hue, saturation and value can go with either."
        )
    if changes.texture is not None:
        picture = changes.texture
        if isinstance(picture, str | Path):
            picture = np.clip(decode_photo(Path(picture)).exposed(), 0, 1)
        region = core_of(weight)
        laid = projected(scene, region, picture, changes.texture_scale, turn=changes.texture_turn)
        return laid, list(np.shape(picture))
    if changes.albedo is not None:
        return np.broadcast_to(
            np.asarray(changes.albedo, np.float32), scene.materials.albedo.shape
        ), None
    return scene.materials.albedo, None


def changed(old: Array, value: float | str | None) -> Array:
    """[H, W] roughness or metallic set to a number, or shifted by a signed text, and kept in [0, 1]."""
    if value is None:
        return old
    return np.clip(old + float(value), 0, 1) if isinstance(value, str) else np.full_like(old, value)


def _mix(old: Array, new: Array, weight: Array) -> Array:
    """float32; old exactly where the weight is 0, new exactly where it is 1."""
    return np.where(weight >= 1, new, old + (new - old) * weight).astype(np.float32)


def projected(
    scene: Scene, region: Array, picture: Array, scale: float = 1.0, *, turn: float = 0.0
) -> Array:
    """[H, W, 3] albedo: `picture` [h, w, 3] projected on the region [H, W] bool along its mean normal.

    The picture lies in the plane of the region's mean normal, upright as the camera sees it, and covers the region's
    extent there (times `scale`; repeated beyond), so that flat surfaces carry it in right perspective. turn: degrees
    by which it is turned clockwise in that plane.
    Raises InputError for a picture without three channels, or with values outside [0, 1].
    """
    picture = np.asarray(picture, np.float32)
    if picture.ndim != 3 or picture.shape[2] != 3 or min(picture.shape[:2]) < 1:
        raise InputError(f"The texture is {picture.shape}; it must be a picture [h, w, 3].")
    if not (np.isfinite(picture).all() and picture.min() >= 0 and picture.max() <= 1):
        raise InputError(
            f"The texture has values from {picture.min():g} to {picture.max():g}; they must be 0 to 1."
        )
    use = region & (scene.depth > 0)
    points = unproject(scene.depth, scene.camera)
    normal = unit(scene.normal[use].mean(0))
    # On a floor the way up leads into the depth.
    right, up = axes(normal) * (-1 if normal[1] >= 0.9 else 1)
    # [H, W] scene units; `along` grows downwards as rows do.
    across = points @ right
    along = points @ -up
    if turn:
        cos, sin = np.cos(np.radians(turn)), np.sin(np.radians(turn))
        across, along = cos * across + sin * along, cos * along - sin * across
    height, width = picture.shape[:2]
    # The longer side of the region is covered once; the other keeps the picture's proportions.
    texel = max(np.ptp(across[use]) / width, np.ptp(along[use]) / height, 1e-9) * scale
    u = (across - across[use].min()) / (texel * width)
    v = (along - along[use].min()) / (texel * height)
    return _repeated(picture, u, v, use)


def _repeated(picture: Array, u: Array, v: Array, use: Array) -> Array:
    """[H, W, 3] bilinear lookup in a picture [h, w, 3] that repeats; one too fine for the photo is shrunk first.

    u, v: [H, W] texture coordinates, from 0 to 1 across and down one picture. use: [H, W] bool, the pixels that count.
    """
    height, width = picture.shape[:2]
    # Texels to a pixel of the photo, by the median step: above 1 the picture would alias.
    texels_per_pixel = max(_median_step(u.T, use.T) * width, _median_step(v, use) * height)
    if texels_per_pixel > 1.5:
        if (height, width) == (1, 1):
            return np.broadcast_to(picture, (*u.shape, 3))
        shrink = 1 / texels_per_pixel
        size = (max(1, round(width * shrink)), max(1, round(height * shrink)))
        return _repeated(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), u, v, use)
    # One pixel of the opposite side around it: the bilinear lookup then repeats without a seam.
    padded = cv2.copyMakeBorder(picture, 1, 1, 1, 1, cv2.BORDER_WRAP)
    columns = ((u - np.floor(u)) * width - 0.5).astype(np.float32) + 1
    rows = ((v - np.floor(v)) * height - 0.5).astype(np.float32) + 1
    return cv2.remap(padded, columns, rows, cv2.INTER_LINEAR)


def _median_step(values: Array, use: Array) -> float:
    """Median change of values [H, W] from row to row, where both are in use [H, W] bool; 0 where none are."""
    steps = np.abs(np.diff(values, axis=0))[use[1:] & use[:-1]]
    return float(np.median(steps)) if steps.size else 0.0
