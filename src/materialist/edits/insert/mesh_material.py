"""Materials of mesh files as surfaces: glTF's metallic-roughness, OBJ's .mtl, colours of vertices or faces."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from materialist.color import srgb_to_linear
from materialist.edits.core.surfaces import uniform_surface
from materialist.errors import InputError
from materialist.types import Array, Surface

GREY = 0.5
"""Albedo and roughness where a file says nothing."""
OPAQUE = "its transparency (taken as opaque)"
LEFT_OUT = {
    "its bump or normal map": ("bump", "map_bump", "norm", "map_norm", "disp", "map_disp"),
    "its glowing texture": ("map_ke",),
    OPAQUE: ("map_d",),
}
"""Entries of an .mtl that are not shown, in words."""
MAX_TEXTURE = 4096
"""Pixels along the longer side of a texture; larger ones are shrunk."""


def surface_of(material: Any, folder: Any, factor: Any = None) -> Surface:
    """The Surface of a trimesh material, None for none; further maps of an .mtl are read through `folder`.

    `factor` [3 or 4] is glTF's base colour as the file has it: trimesh keeps 8 bits of it.
    """
    if material is None:
        return uniform_surface(GREY, GREY, 0.0)
    if hasattr(material, "metallicFactor"):
        return _from_gltf(material, folder, factor)
    return _from_mtl(material, folder)


def texels(colours: Array) -> tuple[Array, Array]:
    """One texel a face: (linear texture [n, n, 3], uv [F, 2] of each one's centre), from linear colours [F, 3]."""
    side = max(1, int(np.ceil(np.sqrt(len(colours)))))
    texture = np.zeros((side * side, 3), np.float32)
    texture[: len(colours)] = colours
    number = np.arange(len(colours))
    uv = (np.stack([number % side, number // side], -1) + 0.5) / side
    return texture.reshape(side, side, 3), uv.astype(np.float32)


def _from_gltf(material: Any, folder: Any, factor: Any) -> Surface:
    """glTF 2.0, section 3.9: factors times textures; green is roughness, blue metallic; factors default to 1."""
    factor = _rgb(material.baseColorFactor if factor is None else np.asarray(factor, np.float32), 1.0)
    albedo = factor.reshape(1, 1, 3)
    colour = _pixels(material.baseColorTexture, folder)
    if colour is not None:
        albedo = srgb_to_linear(colour) * factor
    rough = 1.0 if material.roughnessFactor is None else float(material.roughnessFactor)
    metal = 1.0 if material.metallicFactor is None else float(material.metallicFactor)
    roughness, metallic = np.full((1, 1), rough, np.float32), np.full((1, 1), metal, np.float32)
    packed = _pixels(material.metallicRoughnessTexture, folder)
    if packed is not None:
        roughness, metallic = packed[..., 1] * np.float32(rough), packed[..., 2] * np.float32(metal)
    return _clipped(albedo, roughness, metallic)


def _from_mtl(material: Any, folder: Any) -> Surface:
    """Kd (linear) times map_Kd; Pr, Pm and their maps where the file has them, else the width of the highlight Ns.

    Ke is its glow; 1 is the photo's white. A Phong exponent n is about as wide as GGX with alpha^2 = 2 / (n + 2), and
    roughness = sqrt(alpha).
    """
    said = {str(k).lower(): v for k, v in (getattr(material, "kwargs", None) or {}).items()}
    image = getattr(material, "image", None)
    colour = _pixels(image if getattr(image, "format", None) else None, folder)  # trimesh makes one up where none is
    kd = said.get("kd")
    if colour is not None:
        albedo = srgb_to_linear(colour)  # writers leave Kd black, or half, beside a texture
    elif kd is not None:
        albedo = np.asarray(kd, np.float32).reshape(1, 1, -1)[..., :3]
    else:
        albedo = np.full((1, 1, 3), GREY, np.float32)
    exponent = _number(said.get("ns"), None)
    shiny = GREY if not exponent else (2 / (max(exponent, 0.0) + 2)) ** 0.25
    roughness = _map(said.get("map_pr"), folder, _number(said.get("pr"), shiny))
    metallic = _map(said.get("map_pm"), folder, _number(said.get("pm"), 0.0))
    for what, keys in LEFT_OUT.items():
        folder.left_out |= {what} if any(key in said for key in keys) else set()
    if _number(said.get("d"), 1.0) < 1 or _number(said.get("tr"), 0.0) > 0:
        folder.left_out.add(OPAQUE)
    surface = _clipped(albedo, roughness, metallic)
    glow = np.ravel(said.get("ke", []))
    if len(glow) < 3:
        return surface
    r, g, b = (float(np.clip(np.nan_to_num(_number([v], 0.0), posinf=0), 0, 1e6)) for v in glow[:3])
    return replace(surface, emission=(r, g, b))


def _map(reference: Any, folder: Any, otherwise: Any) -> Array:
    """[h, w] grey values of a texture that an .mtl names (the last word: options come before), or one value."""
    if reference:
        from PIL import Image

        try:
            with Image.open(_stream(folder.get(str(reference[-1])))) as image:
                pixels = _pixels(image, folder)
            if pixels is not None:
                return pixels[..., 0]
        except InputError:  # refused: `folder` has noted it
            pass
        except FileNotFoundError:  # noted as well
            pass
        except (OSError, Image.DecompressionBombError):  # no picture, or one too large
            folder.damaged += 1
    return np.full((1, 1), otherwise, np.float32)


def _stream(data: bytes):
    import io

    return io.BytesIO(data)


def _pixels(image: Any, folder: Any) -> Array | None:
    """[h, w, 3] float32 in [0, 1] as stored, of a PIL picture without its alpha; None for none, or a damaged one."""
    if image is None:
        return None
    try:
        if image.mode.startswith(("I", "F")):  # greys of 16 bits or floats, which "RGB" would clip at 255
            image = _shrunk(_grey(image))
            return np.repeat(np.asarray(image, np.float32)[..., None], 3, -1)
        return np.asarray(_shrunk(image).convert("RGB"), np.float32) / 255
    except (OSError, ValueError, SyntaxError, MemoryError):
        folder.damaged += 1
        return None


def _grey(image: Any) -> Any:
    """A PIL picture of 16-bit or float greys as floats in [0, 1]."""
    from PIL import Image

    values = np.asarray(image, np.float32)
    return Image.fromarray(values / np.float32(1 if image.mode == "F" else 65535))


def _shrunk(image: Any) -> Any:
    if max(image.size) > MAX_TEXTURE:
        image = image.copy()
        image.thumbnail((MAX_TEXTURE, MAX_TEXTURE))
    return image


def _clipped(albedo: Array, roughness: Array, metallic: Array) -> Surface:
    clip = lambda v: np.ascontiguousarray(np.clip(np.nan_to_num(v), 0, 1), np.float32)  # noqa: E731
    return Surface(clip(albedo), clip(roughness), clip(metallic))


def _rgb(value: Any, otherwise: float) -> Array:
    """[3] float32 from a factor in [0, 1], or in bytes."""
    if value is None:
        return np.full(3, otherwise, np.float32)
    array = np.asarray(value)
    return (array.astype(np.float32) / (255 if array.dtype == np.uint8 else 1))[:3]


def _number(value: Any, otherwise: Any) -> Any:
    """A float from 0.3, "0.3" or ["0.3"]."""
    try:
        return float(np.ravel(value)[0])
    except (TypeError, ValueError, IndexError):
        return otherwise
