"""Planar depth from depths without scale and shift (docs/predictors.md, "Relative depth")."""

from dataclasses import dataclass

import cv2
import numpy as np

from materialist.predict.normals import normals_from_depth
from materialist.types import Array, Camera


@dataclass(frozen=True)
class RelativeSettings:
    """Search for the ratio of the farthest surface to the nearest. Tuned by eye."""

    ratio: float = 4.0  # without a normal map: a room seen from inside it
    range: tuple[float, float] = (1.1, 60.0)  # ratios tried against a normal map
    trials: int = 44  # ratios tried, evenly spaced in their logarithm
    percentiles: tuple[float, float] = (0.5, 99.5)  # nearest and farthest surface, less outliers
    side: int = 96  # longer side of the copy on which ratios are tried, pixels


SETTINGS = RelativeSettings()


def planar(
    values: Array, camera: Camera, normal: Array | None, *, inverse: bool, name: str
) -> tuple[Array, str, tuple[str, ...]]:
    """Planar depth of a relative one, the note for its source, and the warning that the report gives."""
    depth, ratio, fitted = from_relative(values, camera, normal, inverse=inverse)
    origin = "fitted to the normals" if fitted else "assumed"
    warning = f"Depth from {name} is relative: far / near = {ratio:.1f} was {origin}."
    return depth, f", far / near {ratio:.1f} {origin}", (warning,)


def from_relative(
    values: Array, camera: Camera, normal: Array | None = None, *, inverse: bool
) -> tuple[Array, float, bool]:
    """Planar depth of an affine-invariant depth d = s values + t, or inverse depth 1 / d, with s > 0 and t unknown.

    The nearest surface is put at 1. The shift follows from the ratio of the farthest surface to the nearest: the one
    with the least mean angle to the given normals. (Not median: a wall that faces the camera fits every ratio.)

    Returns depth [H, W] float32 > 0 of values [H, W], the ratio, and whether it was fitted to the normals [H, W, 3]
    (unit; zero where unknown).
    """
    # --- The values as t in about [0, 1] ---
    low, high = np.percentile(values, SETTINGS.percentiles)
    t = ((values - low) / max(high - low, 1e-6 * max(abs(low), abs(high), 1e-6))).astype(np.float32)

    def depth(ratio: float, t: Array) -> Array:
        if inverse:  # the guards keep outliers at a finite distance, and before the camera
            return (1 / np.maximum(t * (1 - 1 / ratio) + 1 / ratio, 0.5 / ratio)).astype(np.float32)
        return np.maximum(1 + t * (ratio - 1), 0.5).astype(np.float32)

    # --- The ratio whose normals agree best with the map, on a small copy ---
    if normal is not None:
        scale = min(1.0, SETTINGS.side / max(t.shape))
        size = (max(2, round(t.shape[1] * scale)), max(2, round(t.shape[0] * scale)))
        small_t = cv2.resize(t, size, interpolation=cv2.INTER_AREA)
        small_normal = cv2.resize(
            np.ascontiguousarray(normal, np.float32), size, interpolation=cv2.INTER_AREA
        )
        length = np.linalg.norm(small_normal, axis=-1)
        known = length > 0.9  # shorter: unknown, or an edge between two surfaces
        target = small_normal[known] / length[known, None]
        view = Camera(*size, camera.fov)

        def error(ratio: float) -> float:
            normals = normals_from_depth(depth(ratio, small_t), view, radius=1)[known]
            return float(np.arccos(np.clip((normals * target).sum(-1), -1, 1)).mean())

        if known.sum() >= 16:
            ratio = float(min(np.geomspace(*SETTINGS.range, SETTINGS.trials), key=error))
            return depth(ratio, t), ratio, True
    return depth(SETTINGS.ratio, t), SETTINGS.ratio, False
