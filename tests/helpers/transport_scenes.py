"""A furnished room with known maps and light, and pixels far from its depth edges."""

import cv2
import numpy as np
from geometry_scenes import room, sphere_depth

from materialist.camera import unproject
from materialist.envmap import texel_directions
from materialist.geometry.build import build_geometry
from materialist.types import Camera, Geometry, Materials


def furnished_room(size: int, *, completion: str = "planes") -> tuple[Camera, Geometry, Materials]:
    """A floor, a wall, a box and a ball; albedo, roughness and metallic differ between and along them."""
    camera = Camera(size, size * 3 // 4, 45.0)
    depth, normal, label = room(camera)
    ball, ball_normal = sphere_depth(camera, (0.85, -0.5, -3.4), 0.5)
    closer = ball < depth
    depth = np.where(closer, ball, depth)
    label = np.where(closer, 3, label)
    normal = np.where(closer[..., None], ball_normal, normal).astype(np.float32)
    geometry = build_geometry(depth.astype(np.float32), normal, camera, completion=completion)
    return camera, geometry, _materials(unproject(depth.astype(np.float32), camera), label)


def _materials(points, label) -> Materials:
    """Maps by object (0 floor, 1 wall, 2 box, 3 ball) and position [H, W, 3]."""
    albedo = np.array([[0.55, 0.45, 0.35], [0.6, 0.6, 0.65], [0.25, 0.5, 0.3], [0.8, 0.55, 0.25]])[
        label
    ]
    roughness = np.array([0.35, 0.8, 0.5, 0.2])[label]
    metallic = np.array([0.0, 0.1, 0.4, 1.0])[label]
    wave = 0.5 + 0.5 * np.sin(3 * points[..., 0]) * np.cos(2 * points[..., 2] + points[..., 1])
    albedo = albedo * (0.7 + 0.3 * wave[..., None])
    return Materials(
        albedo.astype(np.float32),
        (roughness + 0.15 * wave).astype(np.float32),
        metallic.astype(np.float32),
    )


def windowed_sky(height: int = 32):
    """Envmap [h, 2h, 3] of moderate contrast: a gradient, a warm window to the left, a cool one behind the camera."""
    d = texel_directions(height, 2 * height)
    sky = 0.25 + 0.2 * np.stack([d[..., 1], d[..., 1], d[..., 1] + 0.2], -1)
    for centre, sharpness, colour in (
        ((-0.7, 0.5, -0.1), 12, (4.0, 3.2, 2.4)),
        ((0.5, 0.4, 0.75), 20, (1.6, 2.2, 3.0)),
    ):
        axis = np.array(centre) / np.linalg.norm(centre)
        sky = sky + np.exp(sharpness * (d @ axis - 1))[..., None] * colour
    return np.maximum(sky, 0.02).astype(np.float32)


def away_from_edges(depth, pixels: int = 3):
    """[H, W] bool: no surface of another depth, no end of the picture within so many pixels. depth: [H, W]."""
    inverse = np.where(depth > 0, 1 / np.maximum(depth, 1e-9), 0)
    padded = np.pad(inverse, 1, mode="edge")
    curvature = [
        np.abs(np.diff(padded, 2, axis=k))[s] for k, s in ((0, np.s_[:, 1:-1]), (1, np.s_[1:-1]))
    ]
    edge = np.maximum(*curvature) > 0.01 * np.maximum(inverse, 1e-9)
    kernel = np.ones((2 * pixels + 1, 2 * pixels + 1), np.uint8)
    return (cv2.dilate(edge.astype(np.uint8), kernel) == 0) & (depth > 0)
