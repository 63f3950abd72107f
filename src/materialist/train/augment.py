"""Samples cut, resampled and mirrored so that labels, rays and picture stay true to each other."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from materialist.camera import rays_at
from materialist.io.samples import Sample
from materialist.types import Array


def window(sample: Sample, top: int, left: int, height: int, width: int) -> Sample:
    """The given rectangle of the sample; each pixel keeps its ray."""
    rows, columns = slice(top, top + height), slice(left, left + width)
    return _each(sample, lambda array, _: np.ascontiguousarray(array[rows, columns]))


def resized(sample: Sample, height: int, width: int) -> Sample:
    """The sample at height x width pixels: colours are averaged, geometry is taken from the nearest pixel.

    Albedo, roughness and metallic are averaged over what has a surface: the sky has none to mix in.
    """
    if sample.depth.shape == (height, width):
        return sample
    smooth = cv2.INTER_AREA if height < sample.depth.shape[0] else cv2.INTER_LINEAR
    scaled = lambda array, method: np.asarray(cv2.resize(array, (width, height), interpolation=method))  # noqa: E731
    share = scaled(sample.mask, smooth)

    def work(array: Array, name: str) -> Array:
        if name == "rays":
            return rays_at(array, height, width)
        if name in ("normal", "depth", "mask"):
            return scaled(array, cv2.INTER_NEAREST_EXACT)
        if name in ("albedo", "roughness", "metallic"):
            deep = (..., None) if array.ndim == 3 else ...
            return scaled(array * sample.mask[deep], smooth) / np.maximum(share, 1e-6)[deep]
        return scaled(array, smooth)

    return _each(sample, work)


def flip(sample: Sample, axis: int = 1) -> Sample:
    """The mirror image along an axis: 1 reverses columns and negates x of normals and rays, 0 rows and y."""
    mirror = np.array([-1, 1, 1] if axis == 1 else [1, -1, 1], np.float32)
    mirrored = _each(sample, lambda array, _: np.ascontiguousarray(np.flip(array, axis)))
    return replace(mirrored, normal=mirrored.normal * mirror, rays=mirrored.rays * mirror[:2])


def _each(sample: Sample, work) -> Sample:
    """The sample with `work(array, name)` applied to every map it has, without its light."""
    arrays = {name: getattr(sample, name) for name in sample.__dataclass_fields__ if name != "light"}
    changed = {name: work(array, name) for name, array in arrays.items() if array is not None}
    return replace(sample, light=None, **changed)
