"""How far RefractionNet and the symmetry prior are from true thickness and true backs."""

import numpy as np
import torch

from materialist.predict.refraction.crop import BACK_X, MASK, MIRROR, NORMAL_X
from materialist.types import Array

BATCH = 64
"""Views at a time."""


def relative_error(predicted: Array, truth: Array, inside: Array) -> Array:
    """[N] mean absolute error over mean true thickness, of maps [N, S, S] within inside [N, S, S]."""
    error = (np.abs(predicted - truth) * inside).sum((1, 2))
    return error / np.maximum((truth * inside).sum((1, 2)), 1e-6)


def degrees(predicted: Array, truth: Array, inside: Array) -> Array:
    """[N] mean angle in degrees between unit normals [N, 3, S, S] within inside [N, S, S]."""
    angle = np.degrees(np.arccos(np.clip((predicted * truth).sum(1), -1, 1)))
    return (angle * inside).sum((1, 2)) / np.maximum(inside.sum((1, 2)), 1)


def mean_errors(network, views: dict[str, Array]) -> dict[str, float]:
    return {name: float(np.nanmean(values)) for name, values in errors(network, views).items()}


def errors(network, views: dict[str, Array]) -> dict[str, Array]:
    """Figures [N] of every view (see `dataset.make_views`).

    `solid`, `hollow`: relative errors, the latter NaN for shapes that are not, and left out where none is; `symmetry`:
    of the mirrored thickness as the solid one; `back`, `back_symmetry`: degrees by which the back's normals are off,
    those predicted and those of the front mirrored.
    """
    maps = views["maps"].astype(np.float32)
    target = views["target"].astype(np.float32)
    with torch.inference_mode():
        parts = [
            network(torch.from_numpy(maps[k : k + BATCH])).numpy()
            for k in range(0, len(maps), BATCH)
        ]
    predicted = np.concatenate(parts)
    # Where the mask that the network got is wider than the object, there is nothing to compare with.
    inside = (maps[:, MASK] > 0.5) & (target[:, 0] > 0)
    front = maps[:, NORMAL_X : NORMAL_X + 3] * np.array([1, 1, -1], np.float32)[:, None, None]
    front /= np.maximum(np.linalg.norm(front, axis=1, keepdims=True), 1e-6)
    figures = {
        "solid": relative_error(predicted[:, 0], target[:, 0], inside),
        "symmetry": relative_error(maps[:, MIRROR], target[:, 0], inside),
        "back": degrees(predicted[:, BACK_X:], target[:, BACK_X:], inside),
        "back_symmetry": degrees(front, target[:, BACK_X:], inside),
    }
    hollow = views["hollow"].astype(bool)
    if hollow.any():
        figures["hollow"] = np.where(
            hollow, relative_error(predicted[:, 1], target[:, 1], inside), np.nan
        )
    return figures
