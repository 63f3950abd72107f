"""Renderings beside occlusions, where depth and the photo disagree by a few pixels about which surface is seen."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt

from materialist.color import linear_to_srgb
from materialist.types import Array


@dataclass(frozen=True)
class RimSettings:
    """Where a rendering is not trusted, and what speaks for it there; lengths in longer sides; by eye on 2 photos."""

    step: float = 0.04  # difference of log depth between neighbours from which one hides the other
    unsure: float = 0.004  # from there up to which a rendering is not trusted at all
    sure: float = 0.012  # from where it is trusted
    reach: float = 0.024  # of the pixels that speak for it
    colour: float = 0.08  # standard deviation of alike colours, sRGB-encoded
    samples: int = 6  # pixels looked up along the reach
    floor: float = 1e-3  # radiance added before logarithms


SETTINGS = RimSettings()


def settled(pictures: list[Array], depth: Array, photo: Array) -> list[Array]:
    """The renderings [H, W, 3] with rims that look like the surface that the photo shows there.

    Beside an occlusion a pixel takes the mean of trusted pixels nearby that have its colour in the photo (joint
    bilateral; of logarithms, so that a ratio of two such pictures is a mean of ratios). Relit things otherwise have a
    bright or dark outline where their rim is rendered as what is behind them, or the other way round.

    depth: [H, W] planar, 0 for none. photo: [H, W, 3] linear.
    """
    # --- How far each pixel is from an occlusion, and so how far it is trusted ---
    side = max(depth.shape)
    beside = _occlusions(depth)
    if not beside.any():
        return pictures
    away = distance_transform_edt(~beside)
    ramp = (away - SETTINGS.unsure * side) / ((SETTINGS.sure - SETTINGS.unsure) * side)
    trust = np.clip(ramp, 0, 1).astype(np.float32)
    rows, columns = np.nonzero(trust < 1)
    if not trust.any():
        return pictures
    # --- Log radiance of all pictures side by side, and colours as the eye sees them ---
    logs = np.concatenate([np.log(np.maximum(p, 0) + SETTINGS.floor) for p in pictures], -1)
    logs = logs.astype(np.float32)
    seen = linear_to_srgb(np.clip(photo, 0, 1)).astype(np.float32)
    colours = seen[rows, columns]
    # --- The mean over a disc around each pixel ---
    total = np.zeros((len(rows), logs.shape[-1]), np.float32)
    norm = np.zeros(len(rows), np.float32)
    reach = SETTINGS.reach * side
    stride = max(1, round(reach / SETTINGS.samples))
    height, width = depth.shape
    for down in range(-int(reach), int(reach) + 1, stride):
        for right in range(-int(reach), int(reach) + 1, stride):
            square = (down**2 + right**2) / reach**2
            if square > 1:
                continue
            y = np.clip(rows + down, 0, height - 1)
            x = np.clip(columns + right, 0, width - 1)
            other = seen[y, x] - colours
            like = np.exp(-0.5 / SETTINGS.colour**2 * np.einsum("nc,nc->n", other, other))
            # Standard deviation of half the reach; the constant is for colours that nothing there has.
            weight = trust[y, x] * (like + 1e-4) * np.float32(np.exp(-2 * square))
            total += weight[:, None] * logs[y, x]
            norm += weight
    # --- Where nothing trusted is near, it stays ---
    known = norm > 1e-9
    rows = rows[known]
    columns = columns[known]
    share = trust[rows, columns, None]
    mean = total[known] / norm[known, None]
    logs[rows, columns] = share * logs[rows, columns] + (1 - share) * mean
    rims = np.exp(logs[rows, columns]) - SETTINGS.floor
    # --- Back to pictures: only rims are other than before ---
    results = []
    for k, picture in enumerate(pictures):
        result = picture.astype(np.float32)
        result[rows, columns] = np.maximum(rims[:, 3 * k : 3 * k + 3], 0)
        results.append(result)
    return results


def _occlusions(depth: Array) -> Array:
    """[H, W] bool: pixels of which a neighbour lies clearly nearer or farther; the sky is the farthest."""
    surface = depth > 0
    log = np.log(np.where(surface, depth, 1))
    beside = np.zeros(depth.shape, bool)
    for near, far in (np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:]):
        apart = (np.abs(log[near] - log[far]) > SETTINGS.step) & surface[near] & surface[far]
        apart |= surface[near] != surface[far]
        beside[near] |= apart
        beside[far] |= apart
    return beside
