"""A small scene whose photo is its own path-traced picture: a block before a wall, on the camera's axis."""

from functools import lru_cache

import numpy as np

from materialist.geometry.build import build_geometry
from materialist.types import Body, Camera, Materials, Photo, Prediction, Scene, Surface


def block_mask(height: int, width: int) -> np.ndarray:
    """[H, W] bool of the block: the middle third of the rows, left of the centre."""
    mask = np.zeros((height, width), bool)
    mask[height // 3 : 2 * height // 3, width // 4 : width // 2] = True
    return mask


def flat_scene(height: int = 36, width: int = 48, *, native: int = 1, sky: int = 0, block: float = 2.0) -> Scene:
    """The scene with a made-up photo; `native` times as large an original; `sky` rows without a surface.

    The wall is 3 away and the block `block`.
    """
    rng = np.random.default_rng(5)
    camera = Camera(width, height, 40.0)
    mask = block_mask(height, width)
    depth = np.where(mask, block, 3.0).astype(np.float32)
    depth[:sky] = 0
    normal = np.zeros((height, width, 3), np.float32)
    normal[..., 2] = 1
    albedo = np.where(mask[..., None], [0.6, 0.25, 0.1], [0.5, 0.5, 0.45]).astype(np.float32)
    albedo *= rng.uniform(0.9, 1.1, (height, width, 1)).astype(np.float32)
    materials = Materials(albedo, np.full((height, width), 0.5, np.float32), np.zeros((height, width), np.float32))
    prior = Prediction(materials, normal, depth, "made")
    original = np.kron(albedo, np.ones((native, native, 1), np.float32))
    original *= rng.uniform(0.97, 1.03, original.shape).astype(np.float32)
    photo = Photo(_shrunk(original, native), camera, original, fov_source="option")
    geometry = build_geometry(depth, normal, camera, completion="none")
    envmap = np.ones((8, 16, 3), np.float32)
    envmap[:4] *= 1.5
    return Scene(camera, photo, prior, materials, normal, depth, geometry, envmap, photo.linear)


@lru_cache(maxsize=4)
def rendered_scene(native: int = 1, block: float = 2.0) -> Scene:
    """The flat scene with its own rendering as photo (and as re-rendering)."""
    from dataclasses import replace

    from materialist.render.scene import RenderScene

    scene = flat_scene(native=native, block=block)
    target = RenderScene(scene.geometry, scene.camera)
    target.set_materials(scene.materials)
    target.set_envmap(scene.envmap)
    picture = np.clip(target.render(spp=64, seed=11), 0, 1)
    original = np.kron(picture, np.ones((native, native, 1), np.float32))
    return replace(scene, photo=replace(scene.photo, linear=picture, original=original), rerender=picture)


def _shrunk(original: np.ndarray, native: int) -> np.ndarray:
    h, w = original.shape[0] // native, original.shape[1] // native
    return original.reshape(h, native, w, native, 3).mean((1, 3)).astype(np.float32)


def tetrahedron() -> Body:
    """A red one, right of the block, half a unit before the wall."""
    corners = np.float32([[0.2, -0.3, -2.4], [0.7, -0.3, -2.4], [0.45, -0.3, -2.0], [0.45, 0.3, -2.3]])
    faces = np.int32([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    middle = corners.mean(0)
    normals = (corners - middle) / np.linalg.norm(corners - middle, axis=-1, keepdims=True)
    grey = np.full((1, 1), 0.5, np.float32)
    red = np.float32([[[0.7, 0.05, 0.05]]])
    return Body(corners, faces, normals, np.zeros((4, 2), np.float32), Surface(red, grey, 0 * grey))
