"""A small made-up scene: every field filled with values that no rounding leaves alone."""

import io
from dataclasses import replace

import numpy as np
from PIL import Image

from materialist.camera import unproject
from materialist.color import srgb_to_linear
from materialist.types import (
    Body,
    Camera,
    FitReport,
    Geometry,
    Materials,
    Mesh,
    Photo,
    Prediction,
    Scene,
    Surface,
)


def make_scene(height: int = 24, width: int = 33) -> Scene:
    """A scene with a grid mesh, two planes, a report and a PNG source."""
    rng = np.random.default_rng(height * 1000 + width)

    def random(*shape: int) -> np.ndarray:
        return rng.random(shape, np.float32)

    camera = Camera(width, height, 41.5)
    pixels = rng.integers(0, 256, (height, width, 3)).astype(np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    original = srgb_to_linear(pixels)
    photo = Photo(
        original,
        camera,
        original,
        False,
        "exif",
        "folder/kitchen.PNG",
        buffer.getvalue(),
        ("odd colours",),
    )
    depth = 2 + random(height, width)
    depth[:3] = 0
    normal = np.stack([random(height, width), random(height, width), 1 + random(height, width)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    materials = Materials(random(height, width, 3), random(height, width), random(height, width))
    prior = Prediction(
        replace(materials, roughness=random(height, width)), normal, depth, "maps", ("no normals",)
    )
    report = FitReport(
        ({"name": "light", "steps": 3, "seconds": 0.5, "losses": [1.0, 0.5]},),
        {"rerender_psnr_path": 31.25},
        ("dim",),
    )
    label = rng.integers(-1, 3, (height, width)).astype(np.int8)
    return Scene(
        camera,
        photo,
        prior,
        materials,
        normal,
        depth,
        Geometry(make_mesh(depth, normal, camera), label),
        random(8, 16, 3) * 1e4,
        random(height, width, 3) * 2,
        report,
        {"tool": "test", "seed": 3, "options": {"engine": "transport", "tau": 6.0, "mask": None}},
    )


def make_mesh(depth: np.ndarray, normal: np.ndarray, camera: Camera) -> Mesh:
    """Two triangles between neighbouring pixels; the last few called a continuation."""
    height, width = depth.shape
    index = np.arange(height * width, dtype=np.int32).reshape(height, width)
    a = index[:-1, :-1]
    b = index[1:, :-1]
    c = index[1:, 1:]
    d = index[:-1, 1:]
    faces = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 2).reshape(-1, 3)
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    uv = (
        np.stack([(column + 0.5) / width, (row + 0.5) / height], -1)
        .reshape(-1, 2)
        .astype(np.float32)
    )
    plane = np.full(len(faces), -1, np.int16)
    plane[-5:] = [0, 1, 2, 300, 0]
    points = unproject(depth, camera).reshape(-1, 3)
    return Mesh(points, faces, normal.reshape(-1, 3), uv, faces[:, 0].copy(), plane)


def make_body() -> Body:
    """A square of two triangles, of glass in part."""
    rng = np.random.default_rng(3)

    def numbers(*shape):
        return rng.random(shape, np.float32)

    surface = Surface(numbers(2, 3, 3), numbers(2, 3), numbers(1, 1), 0.9, 1.5, (0.5, 0.6, 1.0))
    return Body(
        numbers(4, 3),
        np.int32([[0, 1, 2], [0, 2, 3]]),
        numbers(4, 3),
        numbers(4, 2),
        surface,
        "a jug",
    )
