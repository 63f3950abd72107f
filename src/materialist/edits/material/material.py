"""Edits of albedo, roughness and metallic inside a region (paper, Opaque Material Editing)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.edits.core.notes import noted
from materialist.edits.core.region import checked_region
from materialist.edits.core.surfaces import parse_colour
from materialist.errors import InputError
from materialist.types import Array, Materials, Scene


def edit(
    scene: Scene,
    mask: Array,
    *,
    hue: float = 0.0,
    saturation: float = 0.0,
    value: float = 0.0,
    albedo: tuple[float, float, float] | str | None = None,
    texture: Array | None = None,
    texture_scale: float = 1.0,
    roughness: float | str | None = None,
    metallic: float | str | None = None,
) -> Scene:
    """The scene with other materials inside the mask; everything else, the photo included, is shared.

    Args:
        mask: [H, W] bool, or weights in [0, 1], at working size.
        hue: turn of the albedo's hue, degrees; +120 makes red green.
        saturation: in [-1, 1]; -1 is grey, 0 as it is, +1 more colourful; grey stays grey.
        value: in [-1, 1]; -1 is black, 0 as it is, +1 white. The texture keeps its order: nothing clips.
        albedo: (R, G, B) linear in [0, 1], or "#rrggbb" as sRGB: one colour in place of the texture.
        texture: [h, w, 3] linear picture, laid on the surface (see `texture.projected`). Hue, saturation and value
            act on a new albedo or texture, too.
        texture_scale: size of the picture; 1 covers the region once, 0.5 repeats it twice in each direction.
        roughness, metallic: a number in [0, 1] sets it, a string with a sign ("+0.5", "-0.5") shifts it; +-0.5 are
            the paper's high and low.

    Raises:
        InputError: a mask of another size or empty, or a value out of its range.
    """
    weight = checked_region(scene, mask)
    for name, amount in (("saturation", saturation), ("value", value)):
        _in_range(name, amount, -1, 1)
    _in_range("hue", hue, -3600, 3600)
    materials = scene.materials
    colour = _base_colour(scene, weight, albedo, texture, texture_scale)
    if hue or saturation or value:
        colour = shifted_hsv(colour, hue, saturation, value)
    new = Materials(
        _mix(materials.albedo, colour, weight[..., None]),
        _mix(materials.roughness, _changed("roughness", materials.roughness, roughness), weight),
        _mix(materials.metallic, _changed("metallic", materials.metallic, metallic), weight),
    )
    if albedo is not None and not isinstance(albedo, str):
        red, green, blue = (float(c) for c in albedo)
        albedo = (red, green, blue)
    entry = {
        "hue": hue, "saturation": saturation, "value": value, "albedo": albedo, "roughness": roughness,
        "metallic": metallic, "texture": None if texture is None else list(np.shape(texture)),
    }  # fmt: skip
    entry = {name: amount for name, amount in entry.items() if amount not in (None, 0.0) or name in SETTABLE}
    entry = {name: amount for name, amount in entry.items() if amount is not None}
    return noted(replace(scene, materials=new), "material", {**entry, "pixels": int((weight > 0.5).sum())})


SETTABLE = ("albedo", "roughness", "metallic")
"""Properties of which 0 is a value of its own and not 'as it is'."""


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


def _base_colour(scene: Scene, weight: Array, albedo, texture: Array | None, scale: float) -> Array:
    """[H, W, 3] albedo before hue, saturation and value act."""
    if albedo is not None and texture is not None:
        raise InputError("Give an albedo or a texture, not both; hue, saturation and value can go with either.")
    if texture is not None:
        from materialist.edits.material.texture import projected

        return projected(scene, weight > 0.5 if (weight > 0.5).any() else weight > 0, texture, scale)
    if albedo is not None:
        return np.broadcast_to(parse_colour(albedo), scene.materials.albedo.shape)
    return scene.materials.albedo


def _changed(name: str, old: Array, wanted: float | str | None) -> Array:
    """[H, W] property set to a number, or shifted by a signed string, and kept in [0, 1]."""
    if wanted is None:
        return old
    shift = isinstance(wanted, str) and wanted.strip()[:1] in ("+", "-")
    try:
        amount = float(wanted)
    except (TypeError, ValueError) as error:
        raise InputError(f"The {name} must be a number in [0, 1], or a shift such as +0.5, not {wanted!r}.") from error
    _in_range(f"{name} shift" if shift else name, amount, -1 if shift else 0, 1)
    return np.clip(old + amount, 0, 1) if shift else np.full_like(old, amount)


def _mix(old: Array, new: Array, weight: Array) -> Array:
    """float32; old exactly where the weight is 0, new exactly where it is 1."""
    return np.where(weight >= 1, new, old + (new - old) * weight).astype(np.float32)


def _in_range(name: str, amount: float, low: float, high: float) -> None:
    if isinstance(amount, bool) or not isinstance(amount, int | float | np.number) or not math.isfinite(amount):
        raise InputError(f"The {name} must be a number in [{low:g}, {high:g}], not {amount!r}.")
    if not low <= amount <= high:
        raise InputError(f"The {name} is {amount:g}; it must lie in [{low:g}, {high:g}].")
