"""A picture laid on the surface of a region."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from materialist.camera import unproject
from materialist.errors import InputError
from materialist.types import Array, Scene


def read_texture(path: str | Path) -> Array:
    """[h, w, 3] float32 linear picture in [0, 1]. Raises InputError."""
    from materialist.io.photo import decode_photo

    return np.clip(decode_photo(Path(path)).over(1.0), 0, 1)


def projected(scene: Scene, region: Array, picture: Array, scale: float = 1.0) -> Array:
    """[H, W, 3] albedo: `picture` [h, w, 3] projected on the region [H, W] bool along its mean normal.

    The picture lies in the plane of the region's mean normal, upright as the camera sees it, and covers the region's
    extent there (times `scale`; repeated beyond), so that flat surfaces carry it in right perspective.
    Raises InputError for a picture without three channels, or with values outside [0, 1].
    """
    picture = np.asarray(picture, np.float32)
    if picture.ndim != 3 or picture.shape[2] != 3 or min(picture.shape[:2]) < 1:
        raise InputError(f"The texture is {picture.shape}; it must be a picture [h, w, 3].")
    if not (np.isfinite(picture).all() and picture.min() >= 0 and picture.max() <= 1):
        raise InputError(f"The texture has values from {picture.min():g} to {picture.max():g}; they must be 0 to 1.")
    use = region & (scene.depth > 0)
    points = unproject(scene.depth, scene.camera)
    right, up = _tangents(scene.normal[use].mean(0))
    across, along = points @ right, points @ -up  # [H, W], scene units, along growing downwards as rows do
    u, v = _unit(across, use), _unit(along, use)
    h, w = picture.shape[:2]
    # The longer side of the region is covered once; the other keeps the picture's proportions.
    extent = max(np.ptp(across[use]) / w, np.ptp(along[use]) / h, 1e-9) * scale
    u, v = u * np.ptp(across[use]) / (extent * w), v * np.ptp(along[use]) / (extent * h)
    return _repeated(picture, u, v)


def _tangents(normal: Array) -> tuple[Array, Array]:
    """Unit vectors to the right and up in the plane of `normal` [3], as the camera sees them."""
    normal = normal / max(float(np.linalg.norm(normal)), 1e-9)
    # On a floor the way up leads into the depth, on a ceiling out of it.
    up = np.array([0.0, 1.0, 0.0]) if abs(normal[1]) < 0.9 else np.array([0.0, 0.0, -np.sign(normal[1])])
    right = np.cross(up, normal)
    right /= np.linalg.norm(right)
    return right, np.cross(normal, right)


def _unit(values: Array, use: Array) -> Array:
    """Values [H, W] moved and scaled so that the region runs from 0 to 1."""
    low, high = values[use].min(), values[use].max()
    return (values - low) / max(high - low, 1e-9)


def _repeated(picture: Array, u: Array, v: Array) -> Array:
    """[H, W, 3] bilinear lookup at (u, v) in pictures, repeated; a large picture is first shrunk to what is seen."""
    import cv2

    h, w = picture.shape[:2]
    x = (u - np.floor(u)) * w - 0.5
    y = (v - np.floor(v)) * h - 0.5
    # Texture pixels to a pixel of the photo, by the median step: above 1 the picture would alias.
    step = max(float(np.median(np.abs(np.diff(u, axis=1)))) * w, float(np.median(np.abs(np.diff(v, axis=0)))) * h)
    if step > 1.5:
        k = min(1 / step, 1.0)
        small = cv2.resize(picture, (max(1, round(w * k)), max(1, round(h * k))), interpolation=cv2.INTER_AREA)
        return _repeated(small, u, v) if small.shape != picture.shape else small
    padded = cv2.copyMakeBorder(picture, 1, 1, 1, 1, cv2.BORDER_WRAP)
    return cv2.remap(padded, x.astype(np.float32) + 1, y.astype(np.float32) + 1, cv2.INTER_LINEAR)
