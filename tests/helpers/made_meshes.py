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
    (folder / "quad.mtl").write_text(
        f"newmtl paint\nKd 0.5 0.5 0.5\nNs 6\nPm 0.25\nmap_Kd {texture}\n"
    )
    lines = [
        f"mtllib {mtl}",
        "v 0 0 0",
        "v 1 0 0",
        "v 1 1 0",
        "v 0 1 0",
        "vt 0 0",
        "vt 1 0",
        "vt 1 1",
        "vt 0 1",
    ]
    (folder / "quad.obj").write_text("\n".join([*lines, "usemtl paint", "f 1/1 2/2 3/3 4/4", ""]))
    return folder / "quad.obj"


def gltf_file(folder: Path, uri: str, image: str | None = None) -> Path:
    """A .gltf triangle whose buffer (and picture) have these addresses; `tri.bin` lies beside it."""
    uv = trimesh.visual.TextureVisuals(
        uv=[[0, 1], [1, 1], [0, 0]], material=trimesh.visual.material.PBRMaterial()
    )
    triangle = trimesh.Trimesh(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], visual=uv, process=False
    )
    made = trimesh.exchange.gltf.export_gltf(triangle.scene(), merge_buffers=True)
    content = json.loads(made.pop("model.gltf"))
    content["buffers"][0]["uri"] = uri
    material = {
        "pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 1], "roughnessFactor": 0.3}
    }
    content["materials"] = [material]
    if image is not None:
        material["pbrMetallicRoughness"]["baseColorTexture"] = {"index": 0}
        content |= {"images": [{"uri": image}], "textures": [{"source": 0}]}
    (folder / "tri.bin").write_bytes(*made.values())
    (folder / "tri.gltf").write_text(json.dumps(content))
    return folder / "tri.gltf"


def floor_scene(
    width: int = 48, height: int = 36, *, tilt: float = 30.0, native: int = 1, noise: float = 0.0
) -> Scene:
    """A grey floor 2 below the camera, which looks down on it by `tilt` degrees; sky where it does not reach.

    `noise` is the relative error of the depth, as a network makes it.
    """
    camera = Camera(width, height, 50.0)
    normal = np.array([0, np.cos(np.radians(tilt)), np.sin(np.radians(tilt))])
    along = -(pixel_rays(camera) @ normal)
    depth = np.where(along > 0.05, 2 / np.maximum(along, 0.05), 0).astype(np.float32)
    depth *= (1 + noise * np.random.default_rng(1).normal(0, 1, depth.shape)).astype(np.float32)
    normals = np.tile(normal, (height, width, 1))
    albedo = np.full((height, width, 3), 0.5)
    original = np.full((height * native, width * native, 3), 0.5, np.float32)
    return scene_of(camera, depth, normals, albedo, roughness=0.9, original=original)


def triangles_glb(path: Path, materials: list[dict], **extensions: dict) -> Path:
    """A .glb of a triangle for each material; its uv, v down, are (0, 0), (1, 0) and (0, 1)."""
    meshes = []
    for k in range(len(materials)):
        uv = trimesh.visual.TextureVisuals(
            [[0, 1], [1, 1], [0, 0]], trimesh.visual.material.PBRMaterial()
        )
        meshes.append(
            trimesh.Trimesh(
                [[k, 0, 0], [k + 1, 0, 0], [k, 1, 0]], [[0, 1, 2]], visual=uv, process=False
            )
        )

    def told(tree: dict) -> None:
        tree["materials"], tree["extensions"] = materials, extensions
        for k, mesh in enumerate(tree["meshes"]):
            mesh["primitives"][0]["material"] = k

    path.write_bytes(
        trimesh.exchange.gltf.export_glb(trimesh.Scene(meshes), tree_postprocessor=told)
    )
    return path


def tetrahedron_glb(
    path: Path, material: dict | None = None, required: tuple[str, ...] = ()
) -> Path:
    """A .glb of a tetrahedron with a material that requires these extensions."""

    def told(tree: dict) -> None:
        tree["extensionsRequired"] = list(required)
        if material is not None:
            tree["materials"], tree["meshes"][0]["primitives"][0]["material"] = [material], 0

    corners = np.eye(4, 3, -1)
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    solid = trimesh.Trimesh(corners, faces, process=False)
    path.write_bytes(trimesh.exchange.gltf.export_glb(solid.scene(), tree_postprocessor=told))
    return path
