"""The rim that a network's outline leaves out: pixels beside a mask that have the colours of the object.

What an edit leaves of the old colour there is seen at once, as a red line round a jug that was made blue.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy import ndimage

from materialist.geometry.silhouette import disc, grown, window
from materialist.types import Array


@dataclass(frozen=True)
class MaskRimSettings:
    """What belongs to the object; tuned on 60 masks of half the photos of `bench select`; lengths in longer sides."""

    reach: float = 0.004  # from the mask; 0.006 to 0.012 takes more of what is not the object's
    window: float = 0.01  # standard deviation of the Gaussian that weighs colours near a pixel
    brightness: float = 0.35  # weight of brightness beside colour: rims are shaded
    grain: float = 0.03  # standard deviation of an even surface's colour, sRGB-encoded
    margin: float = (
        4.0  # squared standard deviations by which a pixel is nearer to the object's colours
    )
    most: float = 20.0  # of the same: more is as sure
    blur: float = 0.7  # standard deviation, pixels, of the Gaussian that takes single pixels out


SETTINGS = MaskRimSettings()


def with_rim(mask: Array, photo: Array) -> Array:
    """[H, W] bool: a mask and the rim beside it whose colours are the object's, and not those beyond.

    mask: [H, W] bool. photo: [H, W, 3] sRGB-encoded.
    """
    longer = max(mask.shape)
    reach = max(1, round(SETTINGS.reach * longer))
    sigma = SETTINGS.window * longer
    if not mask.any() or mask.all():
        return mask
    # --- Only the part of the picture around the mask ---
    box = window(mask, margin=int(np.ceil(3 * sigma)) + 2 * reach)
    inside = mask[box]
    near = grown(inside, reach)
    core = cv2.erode(inside.astype(np.uint8), disc(reach)) > 0
    # --- How far each pixel's colour is from those of the object, and of what is beyond the rim ---
    colour = _features(photo[box])
    to_object = _distance(colour, core, sigma)
    to_other = _distance(colour, ~near, sigma)
    nearer = np.clip(to_other - to_object, -SETTINGS.most, SETTINGS.most).astype(np.float32)
    alike = cv2.GaussianBlur(nearer, (0, 0), SETTINGS.blur) > SETTINGS.margin
    # --- What is joined to the mask ---
    result = mask.copy()
    result[box] = ndimage.binary_propagation(inside, mask=inside | (near & alike))
    return result


def _features(photo: Array) -> Array:
    """[H, W, 4] colour without brightness, and brightness by its weight."""
    brightness = photo.mean(-1, keepdims=True)
    parts = (photo - brightness, SETTINGS.brightness * brightness)
    return np.concatenate(parts, -1).astype(np.float32)


def _distance(colour: Array, members: Array, sigma: float) -> Array:
    """[H, W] squared standard deviations of each colour [H, W, C] from those of the members [H, W] bool near it.

    Where no member is near, it is the largest that counts.
    """
    weight = members.astype(np.float32)
    norm = cv2.GaussianBlur(weight, (0, 0), sigma)
    known = norm > 1e-3
    norm = np.maximum(norm, 1e-6)[..., None]
    mean = cv2.GaussianBlur(colour * weight[..., None], (0, 0), sigma) / norm
    square = cv2.GaussianBlur(colour**2 * weight[..., None], (0, 0), sigma) / norm
    variance = np.maximum(square - mean**2, 0) + SETTINGS.grain**2
    distance = ((colour - mean) ** 2 / variance).sum(-1)
    return np.where(known, distance, SETTINGS.most)
