"""Small meshes as files, of every format."""

import json
from pathlib import Path

import numpy as np
import trimesh
from edit_scenes import scene_of
from PIL import Image

from materialist.camera import pixel_rays
from materialist.types import Camera, Scene


def box_file(path: Path, extents=(1.0, 2.0, 0.5)) -> Path:
    """A box standing on y = 0, in the format of the suffix."""
    box = trimesh.creation.box(extents)
    box.apply_translation([0, extents[1] / 2, 0])
    box.export(path)
    return path


def extent(bodies) -> float:
    """Longest side of the box around bodies, camera frame, scene units."""
    return float(np.ptp(np.concatenate([body.vertices for body in bodies]), axis=0).max())


def textured_obj(folder: Path, *, mtl: str = "quad.mtl", texture: str = "quad.png") -> Path:
    """A quad in x and y with a texture: red top left, green top right, blue bottom left, white bottom right."""
    pixels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    Image.fromarray(pixels).save(folder / "quad.png")
    (folder / "quad.mtl").write_text(f"newmtl paint\nKd 0.5 0.5 0.5\nNs 6\nPm 0.25\nmap_Kd {texture}\n")
    lines = [f"mtllib {mtl}", "v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "vt 0 0", "vt 1 0", "vt 1 1", "vt 0 1"]
    (folder / "quad.obj").write_text("\n".join([*lines, "usemtl paint", "f 1/1 2/2 3/3 4/4", ""]))
    return folder / "quad.obj"


def gltf_file(folder: Path, uri: str, image: str | None = None) -> Path:
    """A .gltf triangle whose buffer (and picture) have these addresses; `tri.bin` lies beside it."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4")
    uv = np.array([[0, 0], [1, 0], [0, 1]], "<f4")
    (folder / "tri.bin").write_bytes(points.tobytes() + uv.tobytes())
    material = {"pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 1], "roughnessFactor": 0.3}}
    content = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
        "materials": [material],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 24}],
        "buffers": [{"byteLength": 60, "uri": uri}],
    }  # fmt: skip
    if image is not None:
        material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
        content |= {"images": [{"uri": image}], "textures": [{"source": 0}]}
    (folder / "tri.gltf").write_text(json.dumps(content))
    return folder / "tri.gltf"


def floor_scene(width: int = 48, height: int = 36, *, tilt: float = 30.0, native: int = 1, noise: float = 0.0) -> Scene:
    """A grey floor 2 below the camera, which looks down on it by `tilt` degrees; sky where it does not reach.

    `noise` is the relative error of the depth, as a network makes it.
    """
    camera = Camera(width, height, 50.0)
    normal = np.array([0, np.cos(np.radians(tilt)), np.sin(np.radians(tilt))])
    along = -(pixel_rays(camera) @ normal)
    depth = np.where(along > 0.05, 2 / np.maximum(along, 0.05), 0).astype(np.float32)
    depth *= (1 + noise * np.random.default_rng(1).normal(0, 1, depth.shape)).astype(np.float32)
    normals, albedo = np.tile(normal, (height, width, 1)), np.full((height, width, 3), 0.5)
    original = np.full((height * native, width * native, 3), 0.5, np.float32)
    return scene_of(camera, depth, normals, albedo, roughness=0.9, original=original)


TETRAHEDRON = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4")


def tetrahedron_glb(path: Path, material: dict | None = None, required: tuple[str, ...] = (), **attributes) -> Path:
    """A .glb of a tetrahedron; `attributes` are further ones, name -> (array [4, n], componentType, normalized)."""
    import struct

    faces = np.array([0, 2, 1, 0, 1, 3, 1, 2, 3, 0, 3, 2], "<u2")
    attributes = {"POSITION": (TETRAHEDRON, 5126, False), **attributes}
    arrays = [*attributes.values(), (faces[:, None], 5123, False)]
    data, views, accessors = b"", [], []
    for array, kind, whole in arrays:
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        data += array.tobytes() + b"\0" * (-array.nbytes % 4)
        what = {"bufferView": len(views) - 1, "componentType": kind, "count": len(array), "normalized": whole}
        accessors.append({**what, "type": {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[array.shape[1]]})
    accessors[0] |= {"min": [0, 0, 0], "max": [1, 1, 1]}
    primitive = {"attributes": {n: k for k, n in enumerate(attributes)}, "indices": len(attributes)}
    content = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}], "accessors": accessors, "bufferViews": views,
        "buffers": [{"byteLength": len(data)}], "extensionsRequired": list(required),
    }  # fmt: skip
    if material is not None:
        content["materials"], primitive["material"] = [material], 0
    text = json.dumps(content).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(data), 0x004E4942) + data
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    return path
