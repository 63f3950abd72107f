"""glTF 2.0 binary: mesh, PBR textures, camera. The light goes beside it as a Radiance .hdr.

glTF's frame, its camera (looking down -Z, +Y up), its texture coordinates (v down) and its material model (metallic
and perceptual roughness, alpha = r^2, F0 = 0.04) are ours; only the diffuse lobe is Lambert's instead of Disney's.
Light stays outside: the one extension for it, EXT_lights_image_based, wants prefiltered cube maps, and few read it.
"""

import json
import math
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np

from materialist import __version__
from materialist.camera import unit
from materialist.color import srgb_levels
from materialist.edits.core.surfaces import edge_faults
from materialist.exporters.parts import Part, farthest, one_roughness
from materialist.io.display import encoded, to_bytes
from materialist.types import Array, Camera, Lamp, Materials, Scene, Surface

_FLOAT, _UINT = 5126, 5125
_VERTICES, _INDICES = 34962, 34963
_NEAREST, _NEAREST_MIPMAP_LINEAR, _CLAMP = 9728, 9986, 33071
_LINEAR, _LINEAR_MIPMAP_LINEAR, _REPEAT = 9729, 9987, 10497


def glb_bytes(scene: Scene, parts: list[Part]) -> bytes:
    """One self-contained file: header, JSON chunk, binary chunk (glTF 2.0 specification, section 4)."""
    document = _Document(any(part.surface is not None for part in parts))
    meshes = [document.add_part(part) for part in parts]
    nodes: list[dict] = [{"name": part.name, "mesh": mesh} for part, mesh in zip(parts, meshes)]
    nodes.append({"name": "camera", "camera": 0})
    punctual = "KHR_lights_punctual"
    for k, lamp in enumerate(scene.lamps):
        place, which = [float(c) for c in lamp.position], {punctual: {"light": k}}
        nodes.append({"name": f"lamp{k}", "translation": place, "extensions": which})
    camera = scene.camera
    content = {
        "asset": {"version": "2.0", "generator": f"materialist {__version__}"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(nodes)))}],
        "nodes": nodes,
        "cameras": [_camera(camera, parts)],
        **document.content,
        "buffers": [{"byteLength": len(document.data)}],
        "extras": {"photo": {"width": camera.width, "height": camera.height, "horizontal_fov_degrees": camera.fov}},
    }
    if scene.lamps:
        content["extensions"] = {punctual: {"lights": [_light(lamp) for lamp in scene.lamps]}}
        document.extensions.add(punctual)
    if document.extensions:
        content["extensionsUsed"] = sorted(document.extensions)
    text = json.dumps(content, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(document.data), 0x004E4942) + bytes(document.data)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def write_hdr(path: Path, envmap: Array) -> None:
    """The light [h, 2h, 3] as a Radiance picture (8 bits of mantissa and a shared exponent), rows and columns as is."""
    import cv2

    path.write_bytes(cv2.imencode(".hdr", np.ascontiguousarray(envmap[..., ::-1], np.float32))[1].tobytes())


def _light(lamp: Lamp) -> dict:
    """A point of the lamp's intensity, power / (4 pi), in the radiance of the photo x scene units squared."""
    most = float(max(lamp.power))
    color = [float(c) / max(most, 1e-30) for c in lamp.power]
    return {"type": "point", "color": color, "intensity": most / (4 * math.pi)}


class _Document:
    """Meshes, materials, textures and the buffer behind them, as they are added."""

    def __init__(self, bodies: bool) -> None:
        self.data = bytearray()
        self.extensions: set[str] = set()
        self.content: dict[str, list] = {
            "meshes": [], "materials": [], "textures": [], "images": [], "accessors": [], "bufferViews": [],
            "samplers": [
                {"magFilter": _NEAREST, "minFilter": _NEAREST_MIPMAP_LINEAR, "wrapS": _CLAMP, "wrapT": _CLAMP},
                {"magFilter": _LINEAR, "minFilter": _LINEAR_MIPMAP_LINEAR, "wrapS": _REPEAT, "wrapT": _REPEAT},
            ][: 1 + bodies],
        }  # fmt: skip

    def add_part(self, part: Part) -> int:
        mesh = part.mesh
        attributes = {
            "POSITION": self._accessor(mesh.vertices.astype("<f4"), "VEC3", bounds=True),
            "NORMAL": self._accessor(unit(mesh.normals).astype("<f4"), "VEC3"),
            "TEXCOORD_0": self._accessor(mesh.uv.astype("<f4"), "VEC2"),
        }
        indices = self._accessor(mesh.faces.astype("<u4").ravel(), "SCALAR", indices=True)
        primitive = {"attributes": attributes, "indices": indices, "material": self._material(part)}
        return self._add("meshes", {"name": part.name, "primitives": [primitive]})

    def _material(self, part: Part) -> int:
        m, sampler = passing(part), 0 if part.surface is None else 1
        packed = to_bytes(np.stack([np.zeros_like(m.roughness), m.roughness, m.metallic], -1))
        pbr = {
            "baseColorTexture": {"index": self._texture("base_color", srgb_levels(m.albedo), sampler)},
            "metallicRoughnessTexture": {"index": self._texture("metallic_roughness", packed, sampler)},
        }
        material: dict = {"name": part.name, "doubleSided": True, "pbrMetallicRoughness": pbr}
        if part.surface is not None and max(part.surface.emission) > 0:
            strength = float(max(part.surface.emission))
            material["emissiveFactor"] = [float(c) / strength for c in part.surface.emission]
            material["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
            self.extensions.add("KHR_materials_emissive_strength")
        if part.surface is not None and part.surface.transmission > 0:
            thick = _mean_chord(part)
            material.setdefault("extensions", {}).update(self._glass(part.surface, thick))
            material["doubleSided"] = thick == 0
        return self._add("materials", material)

    def _glass(self, surface: Surface, thick: float) -> dict:
        """KHR_materials_transmission, _ior and _volume; the base colour tints what passes, see `passing`.

        Without a thickness glass is a thin wall by the specification, and bends nothing.
        """
        glass: dict[str, dict] = {
            "KHR_materials_transmission": {"transmissionFactor": float(surface.transmission)},
            "KHR_materials_ior": {"ior": float(surface.ior)},
        }
        if thick > 0:
            glass["KHR_materials_volume"] = {"thicknessFactor": thick}
        self.extensions |= set(glass)
        return glass

    def _texture(self, name: str, pixels: Array, sampler: int) -> int:
        view = self._view(encoded(pixels))
        image = self._add("images", {"name": name, "mimeType": "image/png", "bufferView": view})
        return self._add("textures", {"sampler": sampler, "source": image})

    def _accessor(self, values: Array, kind: str, *, bounds: bool = False, indices: bool = False) -> int:
        """Index of an accessor of values [N, components] or [N]."""
        view = self._view(values.tobytes(), _INDICES if indices else _VERTICES)
        accessor: dict = {
            "bufferView": view, "componentType": _UINT if indices else _FLOAT, "count": len(values), "type": kind
        }  # fmt: skip
        if bounds:
            accessor |= {"min": values.min(0).tolist(), "max": values.max(0).tolist()}
        return self._add("accessors", accessor)

    def _view(self, data: bytes, target: int | None = None) -> int:
        view = {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)}
        self.data += data + b"\0" * (-len(data) % 4)
        return self._add("bufferViews", view | ({"target": target} if target else {}))

    def _add(self, kind: str, item: dict) -> int:
        self.content[kind].append(item)
        return len(self.content[kind]) - 1


def _camera(camera: Camera, parts: list[Part]) -> dict:
    """The photo's pinhole; near and far well outside of the scene."""
    reach = farthest(parts)
    nearest = float(-parts[0].mesh.vertices[:, 2].max())  # the depth surface lies before the camera
    aspect = camera.width / camera.height
    vertical = 2 * math.atan(math.tan(math.radians(camera.fov) / 2) / aspect)
    near = max(nearest * 0.1, reach * 1e-5)
    perspective = {"yfov": vertical, "aspectRatio": aspect, "znear": near, "zfar": reach * 4}
    return {"name": "photo", "type": "perspective", "perspective": perspective}


def _mean_chord(part: Part) -> float:
    """Mean way through a closed part, scene units: 4 volume / area (Cauchy); 0 for an open one."""
    from trimesh import Trimesh

    open_edges, _ = edge_faults(part.mesh.vertices, part.mesh.faces)
    mesh = Trimesh(part.mesh.vertices, part.mesh.faces, process=False)
    return 0.0 if open_edges or mesh.area == 0 else float(4 * abs(mesh.volume) / mesh.area)


def passing(part: Part) -> Materials:
    """The maps of a part; one colour of glTF is for what glass reflects diffusely and what passes: their mean."""
    m, surface = one_roughness(part), part.surface
    if surface is None or surface.transmission == 0:
        return m
    share = np.float32(surface.transmission)
    return replace(m, albedo=((1 - share) * m.albedo + share * np.array(surface.tint, np.float32)).astype(np.float32))
