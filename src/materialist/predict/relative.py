"""Depths without scale and shift made into planar depth (docs/predictors.md, "Relative depth")."""

from __future__ import annotations

import cv2
import numpy as np

from materialist.predict.normals import normals_from_depth
from materialist.types import Array, Camera

DEFAULT_RATIO = 4.0
"""Far over near where no normal map says more: a room seen from inside it."""
RATIOS = np.geomspace(1.1, 60, 44)
"""Far over near that are tried against a normal map."""
ENDS = (0.5, 99.5)
"""Percentiles that count as the nearest and the farthest surface; beyond them lie outliers."""
TRIAL_SIZE = 96
"""Longer side, pixels, at which ratios are tried."""


def from_inverse(inverse: Array, camera: Camera, normal: Array | None = None) -> tuple[Array, float]:
    """Planar depth of an affine-invariant inverse depth: 1 / depth = s * inverse + t with s > 0 and t unknown.

    Scale is a convention (the nearest surface is at 1); the shift is the ratio of the farthest surface to the nearest.
    It is the one whose surface has the normals that are given, else `DEFAULT_RATIO`.

    Args:
        inverse: [H, W] float32, any unit, larger is nearer.
        normal: [H, W, 3] unit normals from elsewhere; zero where unknown.

    Returns:
        depth [H, W] float32 > 0, and the ratio.
    """
    nearness = _unit(inverse)

    def depth(ratio: float, t: Array) -> Array:
        # The guard keeps outliers behind the farthest surface at a finite distance.
        return 1 / np.maximum(t * (1 - 1 / ratio) + 1 / ratio, 0.5 / ratio)

    return _scaled(nearness, depth, camera, normal)


def from_affine(relative: Array, camera: Camera, normal: Array | None = None) -> tuple[Array, float]:
    """As `from_inverse`, of an affine-invariant depth: depth = s * relative + t, larger is farther."""
    farness = 1 - _unit(-relative)

    def depth(ratio: float, t: Array) -> Array:
        return np.maximum(1 + t * (ratio - 1), 0.5)

    return _scaled(farness, depth, camera, normal)


def _unit(values: Array) -> Array:
    """[H, W] with the percentiles `ENDS` at 0 and 1; a constant map becomes 1."""
    low, high = np.percentile(values, ENDS)
    if high - low <= 1e-6 * max(abs(low), abs(high), 1e-6):
        return np.ones(values.shape, np.float32)
    return ((values - low) / (high - low)).astype(np.float32)


def _scaled(t: Array, depth, camera: Camera, normal: Array | None) -> tuple[Array, float]:
    """The depth of the best ratio."""
    ratio = DEFAULT_RATIO if normal is None else _best_ratio(t, depth, camera, normal)
    return depth(ratio, t).astype(np.float32), ratio


def _best_ratio(t: Array, depth, camera: Camera, normal: Array) -> float:
    """The ratio whose surface agrees best with the normals: least mean angle, on a small copy.

    Not the median: a wall that faces the camera has its normals at every ratio, and may be most of the picture.
    """
    scale = min(1.0, TRIAL_SIZE / max(t.shape))
    size = (max(2, round(t.shape[1] * scale)), max(2, round(t.shape[0] * scale)))
    small_t = cv2.resize(t, size, interpolation=cv2.INTER_AREA)
    small_n = cv2.resize(np.ascontiguousarray(normal, np.float32), size, interpolation=cv2.INTER_AREA)
    length = np.linalg.norm(small_n, axis=-1)
    known = length > 0.9  # shorter: unknown, or an edge between two surfaces
    if known.sum() < 16:
        return DEFAULT_RATIO
    target = small_n[known] / length[known, None]
    view = Camera(*size, camera.fov)

    def error(ratio: float) -> float:
        found = normals_from_depth(depth(ratio, small_t), view, radius=1)[known]
        return float(np.arccos(np.clip((found * target).sum(-1), -1, 1)).mean())

    return float(min(RATIOS, key=error))
