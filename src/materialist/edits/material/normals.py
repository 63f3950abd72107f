"""Normals of polished things: of a body where it is round, else the map's, which follow the photo's own shapes."""

import hashlib
from dataclasses import dataclass, replace

import cv2
import numpy as np

from materialist.camera import unit
from materialist.color import linear_to_srgb
from materialist.edits.material.options import MaterialEdit
from materialist.geometry.build import with_normals
from materialist.geometry.planes import upright
from materialist.geometry.silhouette import window
from materialist.solids.parts import objects_in, outline_normals
from materialist.types import Array, Scene


@dataclass(frozen=True)
class PolishedSettings:
    """How far normals are joined; by eye on five things in chrome and gold, and on copper of three synthetic photos."""

    window: float = 0.05  # standard deviation, part of the root of an object's area
    contrast: float = 0.05  # sRGB-encoded: less in the photo is no sign of another normal
    bend: float = 0.2  # of normals in a window: less is an unevenness, more a crease
    coarse: float = 4.0  # least standard deviation, pixels, on the grid of windows; derived: time


SETTINGS = PolishedSettings()
MAX_KEPT = 4
"""Normal maps that are kept."""
_KEPT: dict[str, Array] = {}


def is_metal(metallic: Array, region: Array, changes: MaterialEdit) -> bool:
    """Whether an edit to a new metallic [H, W] takes other normals inside a region [H, W] bool."""
    if changes.metallic is None or changes.normals != "auto" or not region.any():
        return False
    return bool(metallic[region].mean() > 0.5)


def with_metal_normals(scene: Scene, region: Array) -> Scene:
    """The scene with `metal_normals` inside a region [H, W] bool."""
    normal = metal_normals(scene, region)
    turned = (normal != scene.normal).any(-1)
    if not turned.any():
        return scene
    return replace(scene, normal=normal, geometry=with_normals(scene.geometry, normal, turned))


def metal_normals(scene: Scene, region: Array) -> Array:
    """[H, W, 3] float32 unit: the normal map, with other normals inside a region [H, W] bool.

    A mirror shows every unevenness of predicted normals. A surface of revolution has those of its body
    (`outline_normals`), anything else those of `guided_normals`. Kept for the next value of a slider, since it takes a
    second.
    """
    # --- Kept under what it depends on ---
    digest = hashlib.sha256(repr(scene.camera).encode())
    arrays = (scene.depth, scene.normal, scene.photo.linear, scene.geometry.plane_label, region)
    for array in arrays:
        digest.update(np.ascontiguousarray(array).tobytes())
    key = digest.hexdigest()
    normal = _KEPT.get(key)
    if normal is None:
        # --- Round things by their outlines, the others by the photo ---
        up = upright(scene.normal, np.where(region, -1, scene.geometry.plane_label))
        normal = outline_normals(scene.depth, scene.normal, region, scene.camera, up)
        rest = region & (scene.depth > 0) & (normal == scene.normal).all(-1)
        for mask in objects_in(rest) if rest.any() else ():
            normal[mask] = guided_normals(scene.normal, scene.photo.linear, mask)[mask]
        # Other threads may do the same: what one of them took out is no error.
        for old in list(_KEPT)[: 1 - MAX_KEPT]:
            _KEPT.pop(old, None)
        _KEPT[key] = normal
    return normal.copy()


def guided_normals(normal: Array, photo: Array, mask: Array) -> Array:
    """[H, W, 3] float32 unit: normals under a mask [H, W] bool, even where they and the photo say so.

    A guided filter (He et al. 2013; on a coarser grid: He and Sun 2015): in each window the result is a linear
    function of the photo's grey and of the normals themselves, with a penalty on both slopes. Where grey is even and
    normals hardly bend it is their mean; creases stay, and curls that the photo shows come back.

    normal: [H, W, 3] unit. photo: [H, W, 3] linear.
    """
    box = window(mask)
    inside = mask[box][..., None].astype(np.float32)
    near = normal[box].astype(np.float32)
    sigma = SETTINGS.window * float(np.sqrt(mask.sum()))
    factor = max(1, int(sigma / SETTINGS.coarse))
    height, width = inside.shape[:2]
    grid = (-(-height // factor), -(-width // factor))

    def mean(values: Array) -> Array:
        return _blurred(_resized(values * inside, grid), sigma / factor) / norm

    norm = np.float32(1e-6) + _blurred(_resized(inside, grid), sigma / factor)
    # --- Features: grey and normals, in units of what is thought even ---
    grey = np.clip(linear_to_srgb(photo[box]), 0, 1).mean(-1, dtype=np.float32)[..., None]
    features = np.concatenate([grey / SETTINGS.contrast, near / SETTINGS.bend], -1)  # [h, w, K]
    count = features.shape[-1]
    # --- slope = (cov(features) + I)^-1 cov(features, normal), in each window ---
    mean_features = mean(features)
    mean_normal = mean(near)
    squares = mean(np.concatenate([features * features[..., [k]] for k in range(count)], -1))
    products = mean(np.concatenate([near * features[..., [k]] for k in range(count)], -1))
    squares = squares.reshape(*squares.shape[:2], count, count)
    products = products.reshape(*products.shape[:2], count, 3)
    covariance = squares - mean_features[..., :, None] * mean_features[..., None, :]
    cross = products - mean_features[..., :, None] * mean_normal[..., None, :]
    slope = np.linalg.solve(covariance + np.eye(count, dtype=np.float32), cross)
    offset = mean_normal - np.einsum("hwk,hwkc->hwc", mean_features, slope)
    # --- All windows that hold a pixel, in the mean ---
    shares = _resized(inside, grid)
    line = np.concatenate([slope.reshape(*slope.shape[:2], -1), offset], -1)
    line = _resized(_blurred(line * shares, sigma / factor) / norm, (height, width))
    slope = line[..., :-3].reshape(height, width, count, 3)
    turned = unit(np.einsum("hwk,hwkc->hwc", features, slope) + line[..., -3:])
    result = np.array(normal, np.float32)
    result[mask] = turned[mask[box]]
    return result


def _resized(values: Array, size: tuple[int, int]) -> Array:
    """[h, w, C] at another size (rows, columns): means over areas, or between pixels."""
    method = cv2.INTER_AREA if size[0] < len(values) else cv2.INTER_LINEAR
    # OpenCV resizes four channels at most.
    quads = np.split(values.astype(np.float32), range(4, values.shape[-1], 4), axis=-1)
    resized = [cv2.resize(quad, size[::-1], interpolation=method) for quad in quads]
    return np.concatenate([quad.reshape(*size, -1) for quad in resized], -1)


def _blurred(values: Array, sigma: float) -> Array:
    """A Gaussian mean of [H, W, C], 0 outside, C of 1 kept."""
    outside = cv2.BORDER_CONSTANT
    sigma = max(sigma, 0.5)
    blurred = cv2.GaussianBlur(values.astype(np.float32), (0, 0), sigma, borderType=outside)
    return np.asarray(blurred).reshape(values.shape)
