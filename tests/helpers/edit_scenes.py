"""A small scene whose photo is its own path-traced picture: a block before a wall, on the camera's axis."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from geometry_scenes import plane_depth, sphere_depth

from materialist.geometry.build import build_geometry
from materialist.pipeline import render_scene
from materialist.types import Body, Camera, Materials, Photo, Prediction, Scene, Surface


def block_mask(height: int, width: int) -> np.ndarray:
    """[H, W] bool of the block: the middle third of the rows, left of the centre."""
    mask = np.zeros((height, width), bool)
    mask[height // 3 : 2 * height // 3, width // 4 : width // 2] = True
    return mask


MASK = block_mask(36, 48)
"""Of the block of `flat_scene` and `rendered_scene`."""
INNER = np.pad(np.ones((6, 6), bool), ((15, 15), (15, 27)))
"""The middle of the block."""


def scene_of(
    camera: Camera,
    depth,
    normal,
    albedo,
    *,
    roughness=0.5,
    photo=None,
    original=None,
    envmap=None,
    completion="planes",
) -> Scene:
    """A scene of maps [H, W(, 3)]; the photo is the albedo and the light is even, unless they are given."""
    depth, normal, albedo = (np.asarray(a, np.float32) for a in (depth, normal, albedo))
    linear = albedo if photo is None else photo
    materials = Materials(
        albedo, np.full(depth.shape, roughness, np.float32), np.zeros(depth.shape, np.float32)
    )
    seen = Photo(linear, camera, linear if original is None else original, fov_source="option")
    geometry = build_geometry(depth, normal, camera, completion=completion)
    light = np.ones((8, 16, 3), np.float32) if envmap is None else envmap
    prior = Prediction(materials, normal, depth, "made")
    return Scene(camera, seen, prior, materials, normal, depth, geometry, light, linear)


def flat_scene(
    height: int = 36, width: int = 48, *, native: int = 1, sky: int = 0, block: float = 2.0
) -> Scene:
    """The scene with a made-up photo; `native` times as large an original; `sky` rows without a surface.

    The wall is 3 away and the block `block`.
    """
    rng = np.random.default_rng(5)
    mask = block_mask(height, width)
    depth = np.where(mask, block, 3.0)
    depth[:sky] = 0
    normal = np.broadcast_to([0, 0, 1], (height, width, 3))
    albedo = np.where(mask[..., None], [0.6, 0.25, 0.1], [0.5, 0.5, 0.45]).astype(np.float32)
    albedo *= rng.uniform(0.9, 1.1, (height, width, 1)).astype(np.float32)
    original = np.kron(albedo, np.ones((native, native, 1), np.float32))
    original *= rng.uniform(0.97, 1.03, original.shape).astype(np.float32)
    photo = original.reshape(height, native, width, native, 3).mean((1, 3)).astype(np.float32)
    envmap = np.ones((8, 16, 3), np.float32)
    envmap[:4] *= 1.5
    camera = Camera(width, height, 40.0)
    return scene_of(
        camera,
        depth,
        normal,
        albedo,
        photo=photo,
        original=original,
        envmap=envmap,
        completion="none",
    )


@lru_cache(maxsize=4)
def rendered_scene(native: int = 1, block: float = 2.0) -> Scene:
    """The flat scene with its own rendering as photo (and as re-rendering)."""
    scene = flat_scene(native=native, block=block)
    picture = np.clip(render_scene(scene, spp=64, seed=11), 0, 1)
    original = np.kron(picture, np.ones((native, native, 1), np.float32))
    return replace(
        scene, photo=replace(scene.photo, linear=picture, original=original), rerender=picture
    )


def tetrahedron() -> Body:
    """A red one, right of the block, half a unit before the wall."""
    corners = np.float32(
        [[0.2, -0.3, -2.4], [0.7, -0.3, -2.4], [0.45, -0.3, -2.0], [0.45, 0.3, -2.3]]
    )
    faces = np.int32([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    middle = corners.mean(0)
    normals = (corners - middle) / np.linalg.norm(corners - middle, axis=-1, keepdims=True)
    grey = np.full((1, 1), 0.5, np.float32)
    red = np.float32([[[0.7, 0.05, 0.05]]])
    return Body(corners, faces, normals, np.zeros((4, 2), np.float32), Surface(red, grey, 0 * grey))


def balls(*spheres):
    """(scene, number of the ball [H, W]): balls on a floor before a wall."""
    camera = Camera(96, 72, 45.0)
    floor = plane_depth(camera, (0, 1, 0), -0.6)
    depth = np.minimum(floor, 5.0)
    normal = np.where((floor < 5)[..., None], [0.0, 1, 0], [0.0, 0, 1])
    number = np.full(depth.shape, -1)
    for k, sphere in enumerate(spheres):
        front, outward = sphere_depth(camera, *sphere)
        here = front < depth
        depth[here], normal[here], number[here] = front[here], outward[here], k
    light = (0.4 * np.clip(normal @ [0.3, 0.7, 0.6], 0.1, 1)[..., None] * np.ones(3)).astype(
        np.float32
    )
    return scene_of(camera, depth, normal, np.full((*depth.shape, 3), 0.4), photo=light), number
