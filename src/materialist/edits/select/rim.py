"""The rim that a network's outline leaves out: pixels beside a mask that have the colours of the object.

What an edit leaves of the old colour there is seen at once, as a red line round a jug that was made blue.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy import ndimage

from materialist.geometry.silhouette import window
from materialist.types import Array


@dataclass(frozen=True)
class MaskRimSettings:
    """What belongs to the object; tuned on 60 masks of half the photos of `bench select`; lengths in longer sides."""

    reach: float = 0.004  # from the mask; 0.006 to 0.012 takes more of what is not the object's
    window: float = 0.01  # standard deviation of the Gaussian that weighs colours near a pixel
    brightness: float = 0.35  # weight of brightness beside colour: rims are shaded
    grain: float = 0.03  # standard deviation of an even surface's colour, sRGB-encoded
    # squared standard deviations by which a pixel is nearer to the object's colours
    margin: float = 4.0
    most: float = 20.0  # of the same: more is as sure
    # least standard deviation, pixels, where colours are weighed; derived: time
    coarse: float = 5.0
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
    near = inside | (_away(~inside) <= reach)
    core = _away(inside) > reach
    # --- How far each pixel's colour is from those of the object, and of what is beyond the rim ---
    colour = _features(photo[box])
    to_object, known = _distance(colour, core, sigma)
    to_other, known_other = _distance(colour, ~near, sigma)
    nearer = np.clip(to_other - to_object, -SETTINGS.most, SETTINGS.most)
    # Where one side is not near, as in a gap that a thin thing fills, nothing is taken.
    nearer = np.where(known & known_other, nearer, 0).astype(np.float32)
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


def _away(mask: Array) -> Array:
    """[H, W] pixels from those of a mask [H, W] bool to the nearest outside of it; 0 there."""
    return np.asarray(
        cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    )


def _distance(colour: Array, members: Array, sigma: float) -> tuple[Array, Array]:
    """[H, W] squared standard deviations of each colour [H, W, C] from those of the members [H, W] bool near it.

    And where there are any [H, W] bool.
    """
    height, width = members.shape
    # A wide Gaussian is as smooth on a coarser grid: its cost stays that of a small picture.
    factor = max(1, int(sigma / SETTINGS.coarse))
    coarse = (-(-width // factor), -(-height // factor))

    def blurred(values: Array) -> Array:
        small = cv2.resize(values, coarse, interpolation=cv2.INTER_AREA) if factor > 1 else values
        small = cv2.GaussianBlur(small, (0, 0), sigma / factor)
        if factor == 1:
            return small
        return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)

    weight = members.astype(np.float32)
    norm = blurred(weight)
    known = norm > 1e-3
    norm = np.maximum(norm, 1e-6)[..., None]
    mean = blurred(colour * weight[..., None]) / norm
    square = blurred(colour**2 * weight[..., None]) / norm
    variance = np.maximum(square - mean**2, 0) + SETTINGS.grain**2
    return ((colour - mean) ** 2 / variance).sum(-1), known
