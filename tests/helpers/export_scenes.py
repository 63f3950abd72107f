"""A small scene that no mirroring or transposing leaves alone: a room's corner with a box, each part in a colour."""

import json
import struct
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from edit_scenes import scene_of

from materialist.camera import pixel_rays
from materialist.edits.core.surfaces import uniform_surface
from materialist.exporters.glb import glb_bytes
from materialist.exporters.parts import body_parts, scene_parts
from materialist.exporters.run import export
from materialist.render.scene import RenderScene
from materialist.types import Body, Camera, FitReport, Lamp, Materials, Scene, Surface


@cache
def room(width: int = 64, height: int = 40, fov: float = 50.0, completion: str = "planes") -> Scene:
    """Floor, back wall, a box to the left, sky in the upper right corner; light from the right."""
    camera = Camera(width, height, fov)
    rays = pixel_rays(camera)
    x = rays[..., 0]
    y = rays[..., 1]
    floor = np.where(y < -0.02, 1.0 / np.maximum(-y, 1e-3), 1e6)  # [H, W] the plane y = -1
    depth = np.minimum(floor, 6.0).astype(np.float32)
    normal = np.where((floor < 6)[..., None], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]).astype(np.float32)
    label = np.where(floor < 6, 1, 0)
    box = (np.abs(x + 0.2) < 0.1) & (np.abs(y + 0.1) < 0.12)
    depth[box], normal[box], label[box] = 3.0, (0, 0, 1), 2
    depth[: height // 8, -width // 6 :] = 0
    albedo = np.array([(0.6, 0.5, 0.2), (0.2, 0.5, 0.7), (0.8, 0.1, 0.1)], np.float32)[label]
    checks = (np.indices((height, width)) // 4).sum(0) % 2
    albedo = (albedo * (0.7 + 0.3 * checks[..., None])).astype(np.float32)
    roughness = np.linspace(0.3, 0.9, width, dtype=np.float32)[None].repeat(height, 0)
    metallic = np.where(label == 2, 0.8, 0.1).astype(np.float32)
    scene = scene_of(
        camera, depth, normal, albedo, photo=albedo * 0.8, envmap=sky(), completion=completion
    )
    photo = replace(scene.photo, path='dir/<b>ro"om.png', fov_source="default")
    materials = Materials(albedo, roughness, metallic)
    report = FitReport(
        ({"name": "light", "steps": 3, "seconds": 0.5},),
        {"rerender_psnr_path": 31.25, "poor_fraction": float("nan")},
        ("too </script> dark",),
    )
    made = replace(
        scene, photo=photo, materials=materials, rerender=photo.linear * 0.9, report=report
    )
    return replace(made, provenance={"tau": 6.0, "seed": 0})


def sky(height: int = 16) -> np.ndarray:
    """[h, 2h, 3] light, bright and reddish to the right and above, bluish behind."""
    rows, columns = np.indices((height, 2 * height))
    up = np.cos(np.pi * (rows + 0.5) / height)
    around = np.pi * ((columns + 0.5) / height - 1)
    right = np.sin(around)
    ahead = np.cos(around)
    red = 0.6 + 1.5 * np.clip(right, 0, 1) * (1 + up)
    green = 0.5 + 0.5 * np.clip(up, 0, 1)
    blue = 0.7 + np.clip(-ahead, 0, 1)
    return np.stack([red, green, blue], -1).astype(np.float32)


def renderer(scene: Scene) -> RenderScene:
    """Our own, of the scene."""
    made = RenderScene(scene.geometry, scene.camera, bodies=scene.bodies)
    made.set_materials(scene.materials)
    made.set_envmap(scene.envmap)
    return made


def with_bodies(*surfaces: Surface) -> Scene:
    """The room with a square plate before the box for each surface, facing the camera."""
    made = []
    for k, surface in enumerate(surfaces):
        x = -0.9 + 0.9 * k
        corners = np.array(
            [[x, -0.4, -2], [x + 0.8, -0.4, -2], [x + 0.8, 0.4, -2], [x, 0.4, -2]], np.float32
        )
        uv = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)
        normals = np.tile(np.float32([0, 0, 1]), (4, 1))
        made.append(
            Body(
                corners,
                np.array([[0, 1, 2], [0, 2, 3]], np.int32),
                normals,
                uv,
                surface,
                f"plate{k}",
            )
        )
    return replace(room(), bodies=tuple(made))


CHECKS = Surface(
    np.array([[[1, 0, 0], [0, 1, 0]], [[0, 0, 1], [1, 1, 1]]], np.float32),
    np.full((1, 1), 0.4, np.float32),
    np.zeros((1, 1), np.float32),
)
GLASS = uniform_surface(1.0, 0.2, 0.0, transmission=1.0, ior=1.4, tint=(0.9, 0.5, 0.4))
GLOW = uniform_surface(0.1, 0.5, 0.0, emission=(3.0, 1.5, 0.75))
LAMP = Lamp((0.9, 0.3, -2.6), (6.0, 4.5, 3.0), 0.12)


def blender_facts(scene: Scene, folder: Path) -> dict:
    """What the folder for Blender says of a scene."""
    return json.loads((export(scene, folder, to="blend").path / "scene.json").read_text())


def document(scene: Scene) -> dict:
    """The JSON in a scene's GLB."""
    data = glb_bytes(scene, [*scene_parts(scene), *body_parts(scene)])
    (size,) = struct.unpack_from("<I", data, 12)
    return json.loads(data[20 : 20 + size])
