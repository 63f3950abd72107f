"""What trimesh leaves out of a glTF file: normalized integers, glass, glow, and what nobody reads here."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from materialist.edit.mesh_folder import gltf_header
from materialist.errors import InputError
from materialist.types import Array, Surface

NORMALIZED = "MATERIALIST_normalized"
"""Name under which trimesh is told of integers that stand for [0, 1] or [-1, 1]."""
READ = ("KHR_materials_", "KHR_mesh_quantization", "EXT_texture_webp", "KHR_lights_punctual", "KHR_texture_transform")
"""Extensions that a file may require, by how their names begin; what of them is left out is told."""
GLOSSY = "KHR_materials_pbrSpecularGlossiness"
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
            materials[number] = _without_gloss(material)
            header["materials"][number] = {**materials[number], "name": str(number)}
        _announce(header)
        out = _with_header(data, header)
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, struct.error):
        return data, []
    if unread:
        raise InputError(
            f"{path} needs the glTF extension {unread[0]}, which is not read; export it without (in Blender, without "
            "compression), or as OBJ or PLY."
        )
    return out, materials


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

    What enters is tinted by the base colour, and an emissive strength of 1 is the white of the photo.
    """
    from dataclasses import replace

    said = material.get("extensions") or {}
    share = _number(said.get("KHR_materials_transmission", {}).get("transmissionFactor"), 0.0)
    if share > 0:
        ior = float(np.clip(_number(said.get("KHR_materials_ior", {}).get("ior"), 1.5), 1, 3))
        red, green, blue = (float(c) for c in np.clip(surface.albedo.mean((0, 1)), 0, 1))
        surface = replace(surface, transmission=min(share, 1.0), ior=ior, tint=(red, green, blue))
    glow = _glow(material)
    if glow.any() and "emissiveTexture" not in material:
        red, green, blue = (float(c) for c in glow)
        surface = replace(surface, emission=(red, green, blue))
    return surface


def tiled(uv: Array, material: dict[str, Any]) -> Array:
    """Texture coordinates [V, 2], v down, scaled and moved as KHR_texture_transform says of the base colour."""
    move = _transform((material.get("pbrMetallicRoughness") or {}).get("baseColorTexture"))
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
        odd = any(_number(m.get("rotation"), 0.0) or m != moves[0] for m in moves)
        found += ["how its textures are turned (KHR_texture_transform)"] * odd
    return list(dict.fromkeys(found))


def _glow(material: dict[str, Any]) -> Array:
    """[3] radiance, as a multiple of the photo's white."""
    factor = np.asarray(material.get("emissiveFactor") or [0, 0, 0], np.float64)
    strength = (material.get("extensions") or {}).get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1)
    return np.clip(np.nan_to_num(factor * _number(strength, 1.0)), 0, 1e6)


def _transform(reference: dict[str, Any] | None) -> dict[str, Any]:
    return ((reference or {}).get("extensions") or {}).get("KHR_texture_transform") or {}


def _number(value: Any, otherwise: float) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return otherwise
