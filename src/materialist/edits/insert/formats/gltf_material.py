"""Materials of glTF: metallic-roughness, and some extensions."""

from dataclasses import replace
from typing import Any

import numpy as np

from materialist.color import srgb_to_linear
from materialist.edits.core.surfaces import triple
from materialist.edits.insert.formats.content import Paint, TextureLayout
from materialist.edits.insert.formats.gltf_file import GltfFile, extension
from materialist.edits.insert.formats.textures import Textures, clipped_surface, unit_range
from materialist.types import Array, Surface

TRANSMISSION = "KHR_materials_transmission"
TRANSFORM = "KHR_texture_transform"
GLOSS = "KHR_materials_pbrSpecularGlossiness"
SHOWN = {TRANSMISSION, GLOSS, "KHR_materials_ior", "KHR_materials_emissive_strength"}
"""Extensions of materials that are shown."""
PICTURES = ("EXT_texture_webp", "EXT_texture_avif")
"""Extensions of textures that name another picture, which is preferred."""
ROWS = 256
"""Rows of a texture that are converted in one go: bounds the memory."""
DIELECTRIC = 0.04
"""Reflectance of the dielectrics of metallic-roughness, straight on."""
WRAP = {33071: "clamp", 33648: "mirror", 10497: "repeat"}


class GltfMaterials:
    """The materials that the shown meshes have: first all their pictures are looked at, then each is made."""

    def __init__(self, file: GltfFile, numbers: list[int]):
        self.file = file
        self.pictures = Textures(file.source)
        self.left_out: list[str] = []
        for number in numbers:
            entry = file.entry("materials", number)
            for info in _infos(entry):
                self._open(info)
        self.paints = {number: self._paint(file.entry("materials", number)) for number in numbers}

    def _open(self, info: Any) -> None:
        """Look at the header of a texture's picture."""
        image = self._image(info)
        data = None if image is None else self.file.picture(image)
        if data is not None:
            self.pictures.add(image, data)

    def _image(self, info: Any) -> Any:
        """Number of the picture of a textureInfo; None for none."""
        if not isinstance(info, dict):
            return None
        texture = self._texture(info)
        others = [extension(texture, name).get("source") for name in PICTURES]
        chosen = next((source for source in others if source is not None), texture.get("source"))
        if chosen is None:
            self.left_out.append("a texture that is not there, or in a format that is not read")
        return chosen

    def _texture(self, info: dict[str, Any]) -> dict[str, Any]:
        """The texture of a textureInfo; empty for one that the file does not have."""
        number = int(info.get("index", 0))
        return (
            self.file.entry("textures", number) if number < len(self.file.tree["textures"]) else {}
        )

    def _pixels(self, info: Any) -> Array | None:
        image = self._image(info)
        return None if image is None else self.pictures.pixels(image)

    def _layout(self, info: Any) -> TextureLayout:
        if not isinstance(info, dict):
            return TextureLayout()
        texture = self._texture(info)
        sampler = self.file.entry("samplers", texture["sampler"]) if "sampler" in texture else {}
        moved = extension(info, TRANSFORM)
        return TextureLayout(
            int(moved["texCoord"] if "texCoord" in moved else info.get("texCoord", 0)),
            _pair(moved.get("offset", (0, 0))),
            float(moved.get("rotation", 0.0)),
            _pair(moved.get("scale", (1, 1))),
            (WRAP[sampler.get("wrapS", 10497)], WRAP[sampler.get("wrapT", 10497)]),
        )

    def _paint(self, entry: dict[str, Any]) -> Paint:
        """A material as a surface.

        glTF 2.0, section 3.9: factors times textures; green is roughness, blue metallic; factors default to 1.
        Transmitted light is tinted by the base colour, and an emissive strength of 1 is the white of the photo.
        """
        colour_info, packed_info = _infos(entry)
        colour = self._pixels(colour_info)
        packed = self._pixels(packed_info)
        # One layout serves both textures: that of the colour, where it has one.
        leads = packed_info if colour is None and packed is not None else colour_info
        layout = self._layout(leads)
        if colour is not None and packed is not None and self._layout(packed_info) != layout:
            self.left_out.append("its roughness texture, which lies otherwise than its colour")
            packed = None
        if GLOSS in (entry.get("extensions") or {}):
            surface = self._glossy(entry, colour)
        else:
            surface = _metallic(entry, colour, packed)
        self.left_out += _left_out(entry)
        return Paint(_shining(entry, surface), layout)

    def _glossy(self, entry: dict[str, Any], colour: Array | None) -> Surface:
        """KHR_materials_pbrSpecularGlossiness as metallic-roughness."""
        gloss = extension(entry, GLOSS)
        diffuse = _tinted(colour, gloss.get("diffuseFactor"))
        specular = np.asarray(gloss.get("specularFactor", (1, 1, 1)), np.float32).reshape(1, 1, 3)
        factor = float(gloss.get("glossinessFactor", 1))
        glossiness = np.full((1, 1), factor, np.float32)
        info = gloss.get("specularGlossinessTexture")
        pixels = None if info is None else self.pictures.pixels(self._image(info), "RGBA")
        if pixels is not None:
            specular = srgb_to_linear(pixels[..., :3]) * specular
            glossiness = unit_range(pixels[..., 3], factor)
        albedo, metallic = _metals(diffuse, specular)
        return clipped_surface(albedo, 1 - glossiness, metallic)


def _infos(entry: dict[str, Any]) -> tuple[Any, Any]:
    """The textureInfos of a material's base colour, and of its roughness or gloss; None for none."""
    gloss = extension(entry, GLOSS)
    if gloss:
        return gloss.get("diffuseTexture"), gloss.get("specularGlossinessTexture")
    pbr = entry.get("pbrMetallicRoughness") or {}
    return pbr.get("baseColorTexture"), pbr.get("metallicRoughnessTexture")


def base_factor(entry: dict[str, Any]) -> Array:
    """[3] float32 that a material's base colours are multiplied by."""
    gloss = extension(entry, GLOSS)
    pbr = entry.get("pbrMetallicRoughness") or {}
    factor = gloss.get("diffuseFactor") if gloss else pbr.get("baseColorFactor")
    return np.asarray((1, 1, 1) if factor is None else factor, np.float32)[:3]


def _tinted(colour: Array | None, factor: Any) -> Array:
    """[h, w, 3] linear."""
    tint = np.asarray((1, 1, 1) if factor is None else factor, np.float32)[:3].reshape(1, 1, 3)
    if colour is None:
        return np.array(tint)
    linear = srgb_to_linear(colour)
    linear *= tint
    return linear


def _metallic(entry: dict[str, Any], colour: Array | None, packed: Array | None) -> Surface:
    pbr = entry.get("pbrMetallicRoughness") or {}
    albedo = _tinted(colour, pbr.get("baseColorFactor"))
    rough = float(pbr.get("roughnessFactor", 1))
    metal = float(pbr.get("metallicFactor", 1))
    if packed is None:
        return clipped_surface(albedo, np.full((1, 1), rough), np.full((1, 1), metal))
    roughness = unit_range(packed[..., 1], rough)
    metallic = unit_range(packed[..., 2], metal)
    return clipped_surface(albedo, roughness, metallic)


def _shining(entry: dict[str, Any], surface: Surface) -> Surface:
    """The surface with the light that a material gives off or lets in."""
    strength = float(extension(entry, "KHR_materials_emissive_strength").get("emissiveStrength", 1))
    emission = np.asarray(entry.get("emissiveFactor", (0, 0, 0)), np.float64) * strength
    if emission.any() and "emissiveTexture" not in entry:
        surface = replace(surface, emission=triple(np.clip(np.nan_to_num(emission), 0, 1e6)))
    entering = extension(entry, TRANSMISSION)
    share = float(np.clip(entering.get("transmissionFactor", 0.0), 0, 1))
    if share > 0 and "transmissionTexture" not in entering:
        ior = float(np.clip(extension(entry, "KHR_materials_ior").get("ior", 1.5), 1, 3))
        surface = replace(
            surface, transmission=share, ior=ior, tint=triple(surface.albedo.mean((0, 1)))
        )
    return surface


def _left_out(entry: dict[str, Any]) -> list[str]:
    """Parts of a material that are not shown."""
    left_out = []
    if "normalTexture" in entry:
        left_out.append("its normal map")
    if "emissiveTexture" in entry:
        left_out.append("its emissive texture")
    if entry.get("alphaMode", "OPAQUE") != "OPAQUE":
        left_out.append("its transparency (taken as opaque)")
    if "transmissionTexture" in extension(entry, TRANSMISSION):
        left_out.append("its transmission texture")
    extensions = entry.get("extensions") or {}
    left_out += [str(name)[:80] for name in extensions if name not in SHOWN]
    return left_out


def _metals(diffuse: Array, specular: Array) -> tuple[Array, Array]:
    """(base colour [h, w, 3], metallic [h, w]) of diffuse and specular colours [h, w, 3], as Khronos converts them.

    See the extension's `convert-between-workflows`.
    """
    height, width = np.maximum(diffuse.shape[:2], specular.shape[:2])
    base = np.empty((height, width, 3), np.float32)
    metallic = np.empty((height, width), np.float32)
    for start in range(0, height, ROWS):
        rows = np.arange(start, min(start + ROWS, height))
        d, s = (_scaled(picture, rows, height, width) for picture in (diffuse, specular))
        light = 1 - s.max(-1)
        m = _solved_metallic(_brightness(d), _brightness(s), light)[..., None]
        of_diffuse = d * light[..., None] / (1 - DIELECTRIC) / np.maximum(1 - m, 1e-6)
        of_specular = (s - DIELECTRIC * (1 - m)) / np.maximum(m, 1e-6)
        base[rows] = of_diffuse + m**2 * (of_specular - of_diffuse)
        metallic[rows] = m[..., 0]
    return base, metallic


def _scaled(picture: Array, rows: Array, height: int, width: int) -> Array:
    """[len(rows), width, 3] of a picture stretched to a height and width."""
    h, w = picture.shape[:2]
    return picture[(rows * h // height)[:, None], np.arange(width) * w // width]


def _brightness(colour: Array) -> Array:
    return np.sqrt(colour**2 @ np.array([0.299, 0.587, 0.114], np.float32))


def _solved_metallic(diffuse: Array, specular: Array, light: Array) -> Array:
    """Metallic at which a base colour gives both brightnesses; `light` is what the specular one leaves."""
    b = diffuse * light / (1 - DIELECTRIC) + specular - 2 * DIELECTRIC
    c = DIELECTRIC - specular
    root = np.sqrt(np.maximum(b**2 - 4 * DIELECTRIC * c, 0))
    metallic = np.clip((root - b) / (2 * DIELECTRIC), 0, 1)
    return np.where(specular < DIELECTRIC, 0, metallic)


def _pair(values: Any) -> tuple[float, float]:
    x, y = (float(value) for value in values)
    return x, y
