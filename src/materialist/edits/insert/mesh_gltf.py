"""What trimesh leaves out of a glTF file: normalized integers, glass, glow, and what nobody reads here."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from materialist.edits.insert.mesh_folder import gltf_header
from materialist.errors import InputError
from materialist.types import Array, Surface

NORMALIZED = "MATERIALIST_normalized"
"""Name under which trimesh is told of integers that stand for [0, 1] or [-1, 1]."""
READ = ("KHR_materials_", "KHR_mesh_quantization", "EXT_texture_webp", "KHR_lights_punctual", "KHR_texture_transform")
"""Extensions that a file may require, by how their names begin; what of them is left out is told."""
GLOSSY = "KHR_materials_pbrSpecularGlossiness"
GLASS = "KHR_materials_transmission"
UNLIT = "KHR_materials_unlit"
LAYERS: dict[str, tuple[Any, ...]] = {
    "clearcoat": ("clearcoatFactor", 0), "sheen": ("sheenColorFactor", 0, 0, 0), "specular": ("specularFactor", 1),
    "diffuse_transmission": ("diffuseTransmissionFactor", 0), "anisotropy": ("anisotropyStrength", 0),
    "iridescence": ("iridescenceFactor", 0), "dispersion": ("dispersion", 0),
}  # fmt: skip
"""Extensions that are not shown: the value that says whether they do anything, and the one with which they do not."""
FAN = 6
"""The mode of triangle fans, which trimesh passes over."""
METAL = 0.2
"""Specular reflectance from which such a material is a metal."""
_MOST = {5120: 127, 5121: 255, 5122: 32767, 5123: 65535}


def prepared(path: Path, data: bytes) -> tuple[bytes, list[dict[str, Any]]]:
    """(bytes for trimesh, the file's materials) of a .gltf or .glb: materials are renamed to their number.

    Bytes that are no glTF come back as they are, for trimesh to refuse. Raises InputError for a file that requires an
    extension which is not read.
    """
    try:
        header = gltf_header(data)
        unread = [name for name in header.get("extensionsRequired", []) if not name.startswith(READ)]
        materials = list(header.get("materials", []))
        for number, material in enumerate(materials):
            materials[number] = _lit(_without_gloss(material))
            header["materials"][number] = {**materials[number], "name": str(number)}
        _announce(header)
        primitives = [p for mesh in header.get("meshes", []) for p in mesh["primitives"]]
        fans = any(p.get("mode") == FAN for p in primitives)
        out = _with_header(data, header)
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, struct.error):
        return data, []
    if unread:
        raise InputError(
            f"{path} needs the glTF extension {unread[0]}, which is not read; export it without (in Blender, without "
            "compression), or as OBJ or PLY."
        )
    return out, [*materials, {"fans": True}] if fans else materials


def _lit(material: dict[str, Any]) -> dict[str, Any]:
    """A material that is shown without light (photogrammetry) as a matt one of its colour; others as they are."""
    if UNLIT not in (material.get("extensions") or {}):
        return material
    pbr = {**(material.get("pbrMetallicRoughness") or {}), "metallicFactor": 0.0, "roughnessFactor": 1.0}
    return {**material, "pbrMetallicRoughness": pbr}


def _without_gloss(material: dict[str, Any]) -> dict[str, Any]:
    """The material with metallic and roughness in place of the older specular and glossiness."""
    said = dict(material.get("extensions") or {})
    old = said.pop(GLOSSY, None)
    if old is None:
        return material
    specular = np.asarray(old.get("specularFactor", [1, 1, 1]), np.float64)
    metal = "specularFactor" in old and specular.max() > METAL and "diffuseTexture" not in old
    diffuse = old.get("diffuseFactor", [1, 1, 1, 1])
    pbr: dict[str, Any] = {
        "baseColorFactor": [*specular.tolist(), 1.0] if metal else diffuse,
        "metallicFactor": float(metal), "roughnessFactor": 1 - _number(old.get("glossinessFactor"), 1.0),
    }  # fmt: skip
    if "diffuseTexture" in old:
        pbr["baseColorTexture"] = old["diffuseTexture"]
    return {**material, "pbrMetallicRoughness": pbr, "extensions": said}


def _announce(header: dict[str, Any]) -> None:
    """Name the normalized accessors of every primitive in an extension of it."""
    accessors = header.get("accessors", [])
    whole = {k: _MOST[a["componentType"]] for k, a in enumerate(accessors) if a.get("normalized")}
    for mesh in header.get("meshes", []):
        for primitive in mesh["primitives"]:
            own = {str(k): whole[k] for k in primitive["attributes"].values() if k in whole}
            if own:
                primitive.setdefault("extensions", {})[NORMALIZED] = own
    if whole:
        _register()


def _register() -> None:
    from trimesh.exchange.gltf.extensions import register_handler

    @register_handler(NORMALIZED, scope="primitive_preprocess")
    def _divided(context: Any) -> None:
        """glTF 2.0, section 3.11: f = max(c / most, -1)."""
        for key, most in context["data"].items():
            values = context["accessors"][int(key)]
            if values.dtype.kind in "iu":  # several primitives may share one
                context["accessors"][int(key)] = np.maximum(values.astype(np.float64) / most, -1)


def _with_header(data: bytes, header: dict[str, Any]) -> bytes:
    """The file with another JSON."""
    text = json.dumps(header, separators=(",", ":")).encode()
    if data[:4] != b"glTF":
        return text
    (length,) = struct.unpack_from("<I", data, 12)
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
    return head + text + rest


def extended(surface: Surface, material: dict[str, Any]) -> Surface:
    """The surface with the glass (KHR_materials_transmission, _ior) and the glow of a material of the file.

    What enters is tinted by the base colour and by the colour of its volume over its thickness (KHR_materials_volume),
    and an emissive strength of 1 is the white of the photo. Where a texture says what is glass, nothing is.
    """
    from dataclasses import replace

    entering = _extension(material, GLASS)
    share = _number(entering.get("transmissionFactor"), 0.0)
    if share > 0 and "transmissionTexture" not in entering:
        ior = float(np.clip(_number(_extension(material, "KHR_materials_ior").get("ior"), 1.5), 1, 3))
        tint = np.clip(surface.albedo.mean((0, 1)), 0, 1) * _attenuation(_extension(material, "KHR_materials_volume"))
        red, green, blue = (float(c) for c in tint)
        surface = replace(surface, transmission=min(share, 1.0), ior=ior, tint=(red, green, blue))
    glow = _glow(material)
    if glow.any() and "emissiveTexture" not in material:
        red, green, blue = (float(c) for c in glow)
        surface = replace(surface, emission=(red, green, blue))
    return surface


def tiled(uv: Array, material: dict[str, Any]) -> Array:
    """Texture coordinates [V, 2], v down, scaled and moved as KHR_texture_transform says of the base colour.

    Of roughness, where the base colour has no texture.
    """
    move = _moved(material.get("pbrMetallicRoughness") or {})
    if _number(move.get("rotation"), 0.0):
        return uv
    return uv * np.asarray(move.get("scale", [1, 1]), np.float64) + np.asarray(move.get("offset", [0, 0]), np.float64)


def left_out(materials: list[dict[str, Any]]) -> list[str]:
    """What of the file's materials is not shown, in words."""
    found: list[str] = []
    for material in materials:
        pbr = material.get("pbrMetallicRoughness") or {}
        maps = [m for m in (pbr.get("baseColorTexture"), pbr.get("metallicRoughnessTexture")) if m]
        found += ["its normal map"] * ("normalTexture" in material)
        found += ["its glowing texture"] * ("emissiveTexture" in material and bool(_glow(material).any()))
        found += ["its transparency (taken as opaque)"] * (material.get("alphaMode", "OPAQUE") != "OPAQUE")
        found += ["its second texture coordinates"] * any(m.get("texCoord", 0) for m in maps)
        moves = [_transform(m) for m in maps]
        odd = any(_number(m.get("rotation"), 0.0) or m != _moved(pbr) for m in moves)
        found += ["how its textures are turned (KHR_texture_transform)"] * odd
        found += ["what is glass in it (a texture)"] * ("transmissionTexture" in _extension(material, GLASS))
        found += ["that light does not change it (KHR_materials_unlit)"] * (UNLIT in (material.get("extensions") or {}))
        for what, (key, *usual) in LAYERS.items():
            value = _extension(material, f"KHR_materials_{what}").get(key, usual)
            found += [f"its {what} (KHR_materials_{what})"] * (not np.array_equal(np.ravel(value), np.ravel(usual)))
        found += ["its triangle fans"] * bool(material.get("fans"))
    return list(dict.fromkeys(found))


def _extension(material: dict[str, Any], name: str) -> dict[str, Any]:
    """What a material says in an extension, nothing where that is no object."""
    said = (material.get("extensions") or {}).get(name)
    return said if isinstance(said, dict) else {}


def _moved(pbr: dict[str, Any]) -> dict[str, Any]:
    """The transform of the texture coordinates: the base colour's, or roughness' where that has no texture."""
    return _transform(pbr.get("baseColorTexture") or pbr.get("metallicRoughnessTexture"))


def _attenuation(volume: dict[str, Any]) -> Array:
    """[3] what a volume leaves of white light over its thickness: colour ** (thickness / distance)."""
    colour = np.array([_number(c, 1.0) for c in np.ravel(volume.get("attenuationColor", [1, 1, 1]))])
    if len(colour) != 3:
        return np.ones(3)
    distance = _number(volume.get("attenuationDistance"), np.inf)
    thick = _number(volume.get("thicknessFactor"), 0.0) / distance if distance > 0 else 0.0
    return np.clip(colour, 0, 1) ** max(thick, 0.0)


def _glow(material: dict[str, Any]) -> Array:
    """[3] radiance, as a multiple of the photo's white."""
    factor = np.asarray(material.get("emissiveFactor") or [0, 0, 0], np.float64)
    strength = _extension(material, "KHR_materials_emissive_strength").get("emissiveStrength", 1)
    return np.clip(np.nan_to_num(factor * _number(strength, 1.0)), 0, 1e6)


def _transform(reference: dict[str, Any] | None) -> dict[str, Any]:
    return ((reference or {}).get("extensions") or {}).get("KHR_texture_transform") or {}


def _number(value: Any, otherwise: float) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return otherwise
