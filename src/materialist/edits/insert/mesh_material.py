"""Materials of mesh files as surfaces: glTF's metallic-roughness, OBJ's .mtl, colours of vertices."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from materialist.color import srgb_to_linear
from materialist.edits.core.surfaces import triple, uniform_surface
from materialist.io.bitmap import MAX_PIXELS
from materialist.types import Array, Surface

GREY = 0.5
"""Albedo and roughness where a file says nothing."""
TRANSMISSION, TRANSFORM = "KHR_materials_transmission", "KHR_texture_transform"
SHOWN = {
    TRANSMISSION, "KHR_materials_ior", "KHR_materials_emissive_strength", "KHR_materials_pbrSpecularGlossiness",
    "EXT_texture_webp",
}  # fmt: skip
"""glTF extensions that are shown, by trimesh or by `gltf_surface`."""


class Textures:
    """Pictures of a file as arrays; `damaged` counts those that cannot be read."""

    def __init__(self, longest: int):
        self.longest = longest
        self.damaged = 0

    def pixels(self, image: Any) -> Array | None:
        """[h, w, 3] float32 in [0, 1] as stored, of a PIL picture without its alpha; None for none, or a damaged one.

        A picture whose longer side exceeds `longest` pixels is shrunk; one larger than any photo counts as damaged.
        """
        if image is None:
            return None
        try:
            if math.prod(image.size) > MAX_PIXELS:
                raise ValueError("too large")
            if image.mode.startswith(("I", "F")):  # greys of 16 bits or floats: "RGB" would clip them at 255
                from PIL import Image

                values = np.asarray(image, np.float32) / np.float32(1 if image.mode == "F" else 65535)
                grey = np.asarray(self._shrunk(Image.fromarray(values)), np.float32)
                return np.repeat(grey[..., None], 3, -1)
            return np.asarray(self._shrunk(image).convert("RGB"), np.float32) / 255
        except (OSError, ValueError, SyntaxError, MemoryError):
            self.damaged += 1
            return None

    def _shrunk(self, image: Any) -> Any:
        if max(image.size) > self.longest:
            image = image.copy()
            image.thumbnail((self.longest, self.longest))
        return image


def gltf_surface(material: Any, said: dict[str, Any], textures: Textures) -> tuple[Surface, list[str]]:
    """(surface of trimesh's PBRMaterial, parts that are not shown); `said` is the same material in the file.

    glTF 2.0, section 3.9: factors times textures; green is roughness, blue metallic; factors default to 1. Transmitted
    light is tinted by the base colour, and an emissive strength of 1 is the white of the photo.
    """
    pbr = said.get("pbrMetallicRoughness") or {}
    factor = np.asarray(pbr.get("baseColorFactor", _unit_range(material.baseColorFactor)), np.float32)[:3]
    colour = textures.pixels(material.baseColorTexture)
    albedo = factor.reshape(1, 1, 3) if colour is None else srgb_to_linear(colour) * factor
    rough, metal = (1.0 if v is None else float(v) for v in (material.roughnessFactor, material.metallicFactor))
    packed = textures.pixels(material.metallicRoughnessTexture)
    packed = np.ones((1, 1, 3), np.float32) if packed is None else packed
    surface = _clipped(albedo, packed[..., 1] * rough, packed[..., 2] * metal)
    emission = np.zeros(3) if material.emissiveFactor is None else np.asarray(material.emissiveFactor, np.float64)
    emission = emission * float(_extension(said, "KHR_materials_emissive_strength").get("emissiveStrength", 1))
    if emission.any() and material.emissiveTexture is None:
        surface = replace(surface, emission=triple(np.clip(emission, 0, 1e6)))
    entering = _extension(said, TRANSMISSION)
    share = float(np.clip(entering.get("transmissionFactor", 0.0), 0, 1))
    if share > 0 and "transmissionTexture" not in entering:
        ior = float(np.clip(_extension(said, "KHR_materials_ior").get("ior", 1.5), 1, 3))
        surface = replace(surface, transmission=share, ior=ior, tint=triple(surface.albedo.mean((0, 1))))
    return surface, _left_out(said)


def gltf_uv(said: dict[str, Any], uv: Array) -> Array:
    """uv [V, 2], v DOWN, under the transform of a glTF material's base colour, or else of its roughness."""
    pbr = said.get("pbrMetallicRoughness") or {}
    told = _extension(pbr.get("baseColorTexture") or pbr.get("metallicRoughnessTexture") or {}, TRANSFORM)
    cos, sin = np.cos(told.get("rotation", 0.0)), np.sin(told.get("rotation", 0.0))
    return uv * told.get("scale", 1.0) @ np.array([[cos, -sin], [sin, cos]]) + told.get("offset", 0.0)


def _left_out(said: dict[str, Any]) -> list[str]:
    """Parts of a glTF material that are not shown."""
    extensions = said.get("extensions") or {}
    return [
        *["its normal map"] * ("normalTexture" in said),
        *["its emissive texture"] * ("emissiveTexture" in said),
        *["its transparency (taken as opaque)"] * (said.get("alphaMode", "OPAQUE") != "OPAQUE"),
        *["its transmission texture"] * ("transmissionTexture" in _extension(said, TRANSMISSION)),
        *(name for name in extensions if name not in SHOWN),
    ]


def mtl_surface(material: Any, textures: Textures) -> tuple[Surface, list[str]]:
    """(surface of trimesh's SimpleMaterial, parts of the .mtl that are not shown).

    Kd (linear), or map_Kd; Pr and Pm; else the width of the highlight Ns: a Phong exponent n is about as wide as GGX
    with alpha^2 = 2 / (n + 2), and roughness = sqrt(alpha). Ke is emission; 1 is the photo's white.
    """
    said = {str(k).lower(): v for k, v in (getattr(material, "kwargs", None) or {}).items()}
    image = getattr(material, "image", None)
    # Only a picture of a file has a format; trimesh makes one up where a material has none.
    colour = textures.pixels(image if getattr(image, "format", None) else None)
    # Writers leave Kd black, or half, beside a texture: it counts where there is none.
    kd = _numbers(said.get("kd"), (GREY,) * 3).reshape(1, 1, 3)
    albedo = kd if colour is None else srgb_to_linear(colour)
    (exponent,) = _numbers(said.get("ns"), (0.0,))
    shiny = (2 / (max(exponent, 0.0) + 2)) ** 0.25 if exponent else GREY
    flat = lambda key, otherwise: _numbers(said.get(key), (otherwise,)).reshape(1, 1)  # noqa: E731
    surface = _clipped(albedo, flat("pr", shiny), flat("pm", 0.0))
    emission = np.clip(np.nan_to_num(_numbers(said.get("ke"), (0.0,) * 3), posinf=0), 0, 1e6)
    clear = _numbers(said.get("d"), (1.0,))[0] < 1 or _numbers(said.get("tr"), (0.0,))[0] > 0
    maps = [key for key in said if key.startswith(("map_", "bump", "norm", "disp")) and key != "map_kd"]
    left_out = [*["its transparency (taken as opaque)"] * bool(clear), *(f"its {key}" for key in maps)]
    return replace(surface, emission=triple(emission)), left_out


def coloured(colours: Array) -> tuple[Surface, Array]:
    """(matt surface with a texture of one texel a face, uv [F, 2] of each face's texel) of linear colours [F, 3]."""
    side = max(1, int(np.ceil(np.sqrt(len(colours)))))
    texture = np.zeros((side * side, 3), np.float32)
    texture[: len(colours)] = colours
    number = np.arange(len(colours))
    uv = (np.stack([number % side, number // side], -1) + 0.5) / side
    return replace(uniform_surface(GREY, GREY, 0.0), albedo=texture.reshape(side, side, 3)), uv.astype(np.float32)


def _extension(said: dict[str, Any], name: str) -> dict[str, Any]:
    found = (said.get("extensions") or {}).get(name)
    return found if isinstance(found, dict) else {}


def _clipped(albedo: Array, roughness: Array, metallic: Array) -> Surface:
    clip = lambda v: np.ascontiguousarray(np.clip(np.nan_to_num(v), 0, 1), np.float32)  # noqa: E731
    return Surface(clip(albedo), clip(roughness), clip(metallic))


def _unit_range(factor: Any) -> Array:
    """[3 or 4] factor in [0, 1] of trimesh's, which may be in bytes; ones for none."""
    if factor is None:
        return np.ones(3)
    factor = np.asarray(factor)
    return factor / 255 if factor.dtype == np.uint8 else factor


def _numbers(value: Any, otherwise: tuple[float, ...]) -> Array:
    """[n] float32 of an entry of an .mtl; `otherwise` where the entry is missing or is no list of n numbers."""
    try:
        found = np.asarray([] if value is None else value, np.float32).ravel()
    except (TypeError, ValueError):
        found = np.zeros(0, np.float32)
    return np.asarray(found if len(found) == len(otherwise) else otherwise, np.float32)
