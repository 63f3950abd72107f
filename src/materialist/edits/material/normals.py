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
    """How far normals are joined; by eye on five things in chrome and gold."""

    window: float = 0.05  # standard deviation, part of the root of an object's area
    contrast: float = 0.05  # sRGB-encoded: less in the photo is no sign of another normal


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
    """[H, W, 3] float32 unit: normals under a mask [H, W] bool, smooth where the photo is (He et al. 2013).

    In each window they are a linear function of the photo's grey: where that is even, their mean; where it shows a
    crease or a curl, they turn with it. normal: [H, W, 3] unit. photo: [H, W, 3] linear.
    """
    # Nothing is read outside of the mask's window: of many small things each takes little.
    box = window(mask)
    grey = np.clip(linear_to_srgb(photo[box]), 0, 1).mean(-1, dtype=np.float32)[..., None]
    inside = mask[box].astype(np.float32)[..., None]
    sigma = SETTINGS.window * float(np.sqrt(mask.sum()))
    norm = _blurred(inside, sigma) + 1e-6

    def mean(values: Array) -> Array:
        return _blurred(values * inside, sigma) / norm

    # --- n = slope * grey + offset, by least squares in each window ---
    mean_grey, mean_normal = mean(grey), mean(normal[box])
    variance = mean(grey * grey) - mean_grey**2
    covariance = mean(grey * normal[box]) - mean_grey * mean_normal
    slope = covariance / (variance + SETTINGS.contrast**2)
    offset = mean_normal - slope * mean_grey
    # --- All windows that hold a pixel, in the mean ---
    turned = unit(mean(slope) * grey + mean(offset))
    result = np.array(normal, np.float32)
    result[mask] = turned[mask[box]]
    return result


def _blurred(values: Array, sigma: float) -> Array:
    """A Gaussian mean of [H, W, C], 0 outside, C of 1 kept."""
    outside = cv2.BORDER_CONSTANT
    sigma = max(sigma, 0.5)
    blurred = cv2.GaussianBlur(values.astype(np.float32), (0, 0), sigma, borderType=outside)
    return np.asarray(blurred).reshape(values.shape)
