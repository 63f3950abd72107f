"""What tests measure of mesh models."""

import numpy as np

from materialist.edits.insert.meshes import MeshModel


def size(model: MeshModel) -> list[float]:
    """Width, height and depth."""
    return np.ptp(model.vertices, axis=0).round(4).tolist()


def area(model: MeshModel) -> float:
    """Area of all triangles."""
    total = 0.0
    for part in model.parts:
        a, b, c = np.moveaxis(part.vertices[part.faces].astype(np.float64), 1, 0)
        total += float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2
    return total


def colours(model: MeshModel) -> list[list[float]]:
    """The different albedos at the middles of the triangles, as a renderer that repeats textures sees them."""
    seen = []
    for part in model.parts:
        h, w = part.surface.albedo.shape[:2]
        u, v = part.uv[part.faces].mean(1).T
        column = np.floor(u * w).astype(int) % w
        row = np.floor(v * h).astype(int) % h
        seen.append(part.surface.albedo[row, column])
    return np.unique(np.concatenate(seen).round(3), axis=0).tolist()
