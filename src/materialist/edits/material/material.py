"""Edits of albedo, roughness and metallic inside a region (paper, Opaque Material Editing)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.edits.core.notes import noted
from materialist.edits.core.region import checked_region
from materialist.errors import InputError
from materialist.options import MaterialEdit
from materialist.types import Array, Materials, Scene


def edit(scene: Scene, mask: Array, options: MaterialEdit | None = None, **values: Any) -> Scene:
    """The scene with other materials inside the mask; everything else, the photo included, is shared.

    Saturation and value keep the order of a texture: nothing clips, and grey stays grey. A number for roughness or
    metallic sets it, a text with a sign ("+0.5", "-0.5") shifts it; +-0.5 are the paper's high and low. Hue, saturation
    and value act on a new albedo or texture, too.

    Args:
        mask: [H, W] bool, or weights in [0, 1], at working size.
        options, values: see `options.MaterialEdit`; `values` are fields of it, as in `edit(scene, mask, hue=120)`.

    Raises:
        InputError: a mask of another size or empty, or a value out of its range.
    """
    wanted = MaterialEdit.given(options, **values)
    weight = checked_region(scene, mask)
    materials = scene.materials
    colour, texture = _base_colour(scene, weight, wanted)
    if wanted.hue or wanted.saturation or wanted.value:
        colour = shifted_hsv(colour, wanted.hue, wanted.saturation, wanted.value)
    new = Materials(
        _mix(materials.albedo, colour, weight[..., None]),
        _mix(materials.roughness, _changed(materials.roughness, wanted.roughness), weight),
        _mix(materials.metallic, _changed(materials.metallic, wanted.metallic), weight),
    )
    shifts = {name: getattr(wanted, name) for name in ("hue", "saturation", "value") if getattr(wanted, name)}
    levels = {"albedo": wanted.albedo, "roughness": wanted.roughness, "metallic": wanted.metallic, "texture": texture}
    entry = {**shifts, **{name: level for name, level in levels.items() if level is not None}}
    return noted(replace(scene, materials=new), "material", {**entry, "pixels": int((weight > 0.5).sum())})


def shifted_hsv(albedo: Array, hue: float, saturation: float, value: float) -> Array:
    """[..., 3] linear albedo moved in the HSV of its sRGB encoding (the numbers colour pickers show); float32.

    Value and saturation move towards their ends instead of being added to, so that no texture is cut off: with v > 0
    V becomes V + v (1 - V), else V (1 + v); with s > 0 S becomes S (1 + s (1 - S)), else S (1 + s).
    """
    import cv2

    shape = albedo.shape
    encoded = linear_to_srgb(albedo).reshape(-1, 1, 3)
    hsv = cv2.cvtColor(np.ascontiguousarray(encoded), cv2.COLOR_RGB2HSV)  # float: H in [0, 360), S and V in [0, 1]
    h, s, v = hsv[..., 0], hsv[..., 1], hsv[..., 2]
    h = (h + hue) % 360
    s = s * (1 + saturation * (1 - s)) if saturation > 0 else s * (1 + saturation)
    v = v + value * (1 - v) if value > 0 else v * (1 + value)
    moved = cv2.cvtColor(np.stack([h, s, v], -1).astype(np.float32), cv2.COLOR_HSV2RGB)
    return srgb_to_linear(np.clip(moved, 0, 1)).reshape(shape)


def _base_colour(scene: Scene, weight: Array, wanted: MaterialEdit) -> tuple[Array, list[int] | None]:
    """([H, W, 3] albedo before hue, saturation and value act, shape of the texture that it has)."""
    if wanted.albedo is not None and wanted.texture is not None:
        raise InputError("Give an albedo or a texture, not both; hue, saturation and value can go with either.")
    if wanted.texture is not None:
        from materialist.edits.material.texture import projected, read_texture

        picture = read_texture(wanted.texture) if isinstance(wanted.texture, str | Path) else wanted.texture
        region = weight > 0.5 if (weight > 0.5).any() else weight > 0
        return projected(scene, region, picture, wanted.texture_scale), list(np.shape(picture))
    if wanted.albedo is not None:
        return np.broadcast_to(np.asarray(wanted.albedo, np.float32), scene.materials.albedo.shape), None
    return scene.materials.albedo, None


def _changed(old: Array, wanted: float | str | None) -> Array:
    """[H, W] property set to a number, or shifted by a signed text, and kept in [0, 1]."""
    if wanted is None:
        return old
    return np.clip(old + float(wanted), 0, 1) if isinstance(wanted, str) else np.full_like(old, wanted)


def _mix(old: Array, new: Array, weight: Array) -> Array:
    """float32; old exactly where the weight is 0, new exactly where it is 1."""
    return np.where(weight >= 1, new, old + (new - old) * weight).astype(np.float32)
