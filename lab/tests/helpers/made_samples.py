"""Tiny labelled pictures with closed forms: a tilted plane with two paints under a gradient of light, and sky above."""

import json
from pathlib import Path

import numpy as np

from materialist.camera import pixel_rays
from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.types import Camera

NORMAL = np.array([0.0, 0.8, 0.6], np.float32)


def arrays(height: int = 48, width: int = 64, fov: float = 50.0, seed: int = 0) -> dict:
    """The arrays of one .npz: the plane normal . p = -1.2, sky where its depth would be above 2.5."""
    rng = np.random.default_rng(seed)
    rays = pixel_rays(Camera(width, height, fov))
    facing = -(rays @ NORMAL)
    depth = np.where(facing > 1.2 / 2.5, 1.2 / np.maximum(facing, 1e-3), 0)
    surface = depth > 0
    paints = rng.uniform(0.1, 0.8, (2, 3))
    stripes = (np.arange(width) // 8 % 2)[None].repeat(height, 0)
    albedo = (linear_to_srgb(paints[stripes]) * 255 + 0.5).astype(np.uint8)
    albedo[~surface] = 0
    linear = srgb_to_linear(albedo)
    shading = (
        np.linspace(0.4, 1.1, width)[None, :, None]
        * np.array([1.0, 0.9, 0.8])
        * np.ones((height, 1, 1))
    )
    metallic = np.where(np.arange(width) > 3 * width // 4, 255, 0)[None].repeat(height, 0)
    rest = 0.05 + 0.3 * (metallic[..., None] > 0) * linear
    image = np.where(
        surface[..., None], linear * (1 - metallic[..., None] / 255) * shading + rest, 0.9
    )
    return {
        "image": image.astype(np.float16),
        "shading": shading.astype(np.float16),
        "albedo": albedo,
        "roughness": np.full((height, width), 102, np.uint8),
        "metallic": (metallic * surface).astype(np.uint8),
        "normal": np.where(surface[..., None], np.round(NORMAL * 127), 0).astype(np.int8),
        "depth": depth.astype(np.float16),
        "mask": surface.astype(np.uint8),
        "fov": np.float32(fov),
    }


def write_set(folder: Path, count: int = 4, **options) -> Path:
    """A data set of `count` such samples."""
    (folder / "samples").mkdir(parents=True, exist_ok=True)
    (folder / "dataset.json").write_text(json.dumps({"seed": 5}))
    for k in range(count):
        np.savez_compressed(folder / "samples" / f"{k:07d}.npz", **arrays(seed=k, **options))
    return folder
