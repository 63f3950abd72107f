"""The share that a light of the photo has in the pixels around it: glass and shade have edges, a glow has none."""

from dataclasses import dataclass

import cv2
import numpy as np
from skimage.graph import MCP_Geometric

from materialist.color import linear_to_srgb
from materialist.edits.composite.upsample import GuidedUpsample, strips
from materialist.geometry.silhouette import grown, window
from materialist.types import Array, Photo


@dataclass(frozen=True)
class GlowSettings:
    """How a light fades into what is around it; tuned by eye."""

    reach: float = 0.02  # where nothing stops it, share of the longer side
    edge: float = 0.12  # change of brightness, sRGB-encoded, that ends it


SETTINGS = GlowSettings()


def light_share(seen: Array, photo: Photo) -> Array:
    """[H0, W0] float32 in [0, 1]: how much of each pixel of the photo is a light, from where it is seen [H, W] bool.

    At edges of the photo the light ends. Where an overexposed wall or a halo goes on beyond it, it fades, so that a
    dimmed light has no outline that the photo does not have.
    """
    fading = glow(seen, photo.linear)
    share = np.zeros(photo.original.shape[:2], np.float32)
    if not seen.any():
        return share
    upsample = GuidedUpsample(fading[..., None], photo.linear, share.shape)
    box, columns = window(fading > 0, share.shape, 3)  # the reach of `GuidedUpsample`
    for rows in strips(box.stop, start=box.start):
        share[rows, columns] = upsample(rows, columns, photo.original[rows, columns])[..., 0]
    return share


def glow(seen: Array, photo: Array) -> Array:
    """[H, W] float32 in [0, 1]: 1 in a light [H, W] bool, less with the distance along smooth parts of the photo.

    photo: [H, W, 3] linear.
    """
    if seen.all() or not seen.any():
        return seen.astype(np.float32)
    # --- The price of a step: its length, and how much the brightness changes there ---
    reach = max(2.0, SETTINGS.reach * max(seen.shape))
    bright = linear_to_srgb(np.clip(photo, 0, 1)).mean(-1).astype(np.float32)
    across, up = (cv2.Sobel(bright, cv2.CV_32F, *order, scale=1 / 8) for order in ((1, 0), (0, 1)))
    price = 1 / reach + np.hypot(across, up) / SETTINGS.edge
    # --- The least sum of prices on a way from the light ---
    price[~grown(seen, int(np.ceil(reach)))] = -1  # no way leads through what is too far
    border = np.argwhere(seen & grown(~seen, 1))
    distance, _ = MCP_Geometric(price).find_costs(border)
    fading = 1 - np.clip(distance, 0, 1)
    smooth = fading * fading * (3 - 2 * fading)
    return np.where(seen, 1, smooth).astype(np.float32)
