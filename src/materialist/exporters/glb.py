"""glTF 2.0 binary, as trimesh writes it: mesh, PBR textures, camera. The light goes beside it as a Radiance .hdr.

glTF's frame, its camera (looking down -Z, +Y up), its texture coordinates (v down) and its material model (metallic
and perceptual roughness, alpha = r^2, F0 = 0.04) are ours; only the diffuse lobe is Lambert's instead of Disney's.
Light stays outside: the one extension for it, EXT_lights_image_based, wants prefiltered cube maps, and few read it.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import trimesh
from PIL import Image
from trimesh import Trimesh
from trimesh.exchange.gltf import export_glb
from trimesh.visual.material import PBRMaterial

from materialist import __version__
from materialist.color import srgb_levels
from materialist.edits.core.surfaces import edge_faults
from materialist.exporters.advice import advice
from materialist.exporters.parts import Part, farthest, one_roughness
from materialist.io.display import to_bytes
from materialist.types import Array, Camera, Lamp, Materials, Scene

_NEAREST = 9728
_NEAREST_MIPMAP_LINEAR = 9986
_CLAMP = 33071
_LINEAR = 9729
_LINEAR_MIPMAP_LINEAR = 9987
_REPEAT = 10497
_SAMPLERS = (
    {"magFilter": _NEAREST, "minFilter": _NEAREST_MIPMAP_LINEAR, "wrapS": _CLAMP, "wrapT": _CLAMP},
    {"magFilter": _LINEAR, "minFilter": _LINEAR_MIPMAP_LINEAR, "wrapS": _REPEAT, "wrapT": _REPEAT},
)
"""Of the photo's maps, and of those of bodies."""
_LAMPS = "KHR_lights_punctual"


def glb_bytes(scene: Scene, parts: list[Part]) -> bytes:
    """One self-contained file."""
    scene_graph = trimesh.Scene()
    for part in parts:
        mesh = part.mesh
        visual = trimesh.visual.TextureVisuals(
            mesh.uv * [1, -1] + [0, 1], material=_material(part)
        )  # its v runs up
        body = trimesh.Trimesh(
            mesh.vertices, mesh.faces, vertex_normals=mesh.normals, visual=visual, process=False
        )
        scene_graph.add_geometry(body, part.name, part.name)
    return export_glb(
        scene_graph,
        include_normals=True,
        tree_postprocessor=lambda tree: _complete(tree, scene, parts),
    )


def write_hdr(path: Path, envmap: Array) -> None:
    """The light [h, 2h, 3] as a Radiance picture (8 bits of mantissa and a shared exponent), rows and columns as is."""
    path.write_bytes(
        cv2.imencode(".hdr", np.ascontiguousarray(envmap[..., ::-1], np.float32))[1].tobytes()
    )


def _material(part: Part) -> Any:
    """trimesh's material of a part, but for its `_extensions`."""
    m = passing(part)
    packed = to_bytes(np.stack([np.zeros_like(m.roughness), m.roughness, m.metallic], -1))
    textures = {"baseColorTexture": srgb_levels(m.albedo), "metallicRoughnessTexture": packed}
    pictures = {name: Image.fromarray(pixels) for name, pixels in textures.items()}
    glow = (
        None
        if part.surface is None
        else np.array(part.surface.emission) / max(*part.surface.emission, 1e-30)
    )
    return PBRMaterial(part.name, glow, doubleSided=_thickness(part) == 0, **pictures)


def _complete(tree: dict[str, Any], scene: Scene, parts: list[Part]) -> None:
    """Add to the document what trimesh does not write: samplers, extensions, lamps, the photo's camera."""
    # --- Samplers: 0 for the photo's surfaces, 1 for bodies, whose textures repeat ---
    tree["asset"]["generator"] = f"materialist {__version__}"
    tree["samplers"] = list(_SAMPLERS[: 1 + any(part.surface is not None for part in parts)])
    for part, material in zip(parts, tree["materials"], strict=True):
        for texture in material["pbrMetallicRoughness"].values():
            tree["textures"][texture["index"]]["sampler"] = int(part.surface is not None)
        if extensions := _extensions(part):
            material["extensions"] = extensions
    used = {name for material in tree["materials"] for name in material.get("extensions", ())}
    # --- The camera and lamps as nodes of their own ---
    tree["cameras"], nodes = [_camera(scene.camera, parts)], [{"name": "camera", "camera": 0}]
    for k, lamp in enumerate(scene.lamps):
        place = [float(c) for c in lamp.position]
        which = {_LAMPS: {"light": k}}
        nodes.append({"name": f"lamp{k}", "translation": place, "extensions": which})
    tree["scenes"][0]["nodes"] += range(len(tree["nodes"]), len(tree["nodes"]) + len(nodes))
    tree["nodes"] += nodes
    # --- Names of all extensions, and what no field of glTF holds ---
    if scene.lamps:
        tree["extensions"] = {_LAMPS: {"lights": [_light(lamp) for lamp in scene.lamps]}}
        used.add(_LAMPS)
    if used:
        tree["extensionsUsed"] = sorted(used)
    size = {"width": scene.camera.width, "height": scene.camera.height}
    photo = {**size, "horizontal_fov_degrees": scene.camera.fov}
    tree["extras"] = {"photo": photo, **advice(scene)}


def _light(lamp: Lamp) -> dict:
    """A point of the lamp's intensity, power / (4 pi), in the radiance of the photo x scene units squared."""
    most = float(max(lamp.power))
    color = [float(c) / max(most, 1e-30) for c in lamp.power]
    return {"type": "point", "color": color, "intensity": most / (4 * math.pi)}


def _extensions(part: Part) -> dict[str, dict]:
    """Of the material of a body: glow and glass, whose base colour tints what passes, see `passing`."""
    surface = part.surface
    extensions = {}
    if surface is not None and max(surface.emission) > 0:
        extensions["KHR_materials_emissive_strength"] = {
            "emissiveStrength": float(max(surface.emission))
        }
    if surface is not None and surface.transmission > 0:
        extensions["KHR_materials_transmission"] = {
            "transmissionFactor": float(surface.transmission)
        }
        extensions["KHR_materials_ior"] = {"ior": float(surface.ior)}
        if (thick := _thickness(part)) > 0:
            extensions["KHR_materials_volume"] = {"thicknessFactor": thick}
    return extensions


def _camera(camera: Camera, parts: list[Part]) -> dict:
    """The photo's pinhole; near and far well outside of the scene."""
    reach = farthest(parts)
    nearest = float(-parts[0].mesh.vertices[:, 2].max())  # the depth surface lies before the camera
    aspect = camera.width / camera.height
    vertical = 2 * math.atan(math.tan(math.radians(camera.fov) / 2) / aspect)
    near = max(nearest * 0.1, reach * 1e-5)
    perspective = {"yfov": vertical, "aspectRatio": aspect, "znear": near, "zfar": reach * 4}
    return {"name": "photo", "type": "perspective", "perspective": perspective}


def _thickness(part: Part) -> float:
    """Mean way through glass, scene units: 4 volume / area (Cauchy). 0 for an open mesh and what is opaque.

    Without a thickness glass is a thin wall by the specification, and bends nothing.
    """
    if part.surface is None or part.surface.transmission == 0:
        return 0.0
    open_edges, _ = edge_faults(part.mesh.vertices, part.mesh.faces)
    mesh = Trimesh(part.mesh.vertices, part.mesh.faces, process=False)
    return 0.0 if open_edges or mesh.area == 0 else float(4 * abs(mesh.volume) / mesh.area)


def passing(part: Part) -> Materials:
    """The maps of a part; one colour of glTF is for what glass reflects diffusely and what passes: their mean."""
    m = one_roughness(part)
    surface = part.surface
    if surface is None or surface.transmission == 0:
        return m
    share = np.float32(surface.transmission)
    return replace(
        m,
        albedo=((1 - share) * m.albedo + share * np.array(surface.tint, np.float32)).astype(
            np.float32
        ),
    )
