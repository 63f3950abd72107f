"""Regions of a picture that are likely to be of one material."""

from dataclasses import dataclass

import numpy as np
from skimage.segmentation import felzenszwalb

from materialist.color import linear_to_srgb
from materialist.types import Array, Camera


@dataclass(frozen=True)
class RegionSettings:
    """Felzenszwalb and Huttenlocher 2004; tuned by eye on four photos."""

    scale: float = 100.0  # larger: larger regions
    least_share: float = 0.001  # of the picture that a region has at least


SETTINGS = RegionSettings()


def albedo_regions(albedo: Array, pixels: Array, camera: Camera, settings: RegionSettings = SETTINGS) -> Array:
    """[P] int64 number, from 0 without gaps, of the region that each of the row-major `pixels` [P] lies in.

    A region is joined and of like albedo [P, 3] (linear). Pixels beside the surface are black.
    """
    picture = np.zeros((camera.height, camera.width, 3))
    picture.reshape(-1, 3)[pixels] = linear_to_srgb(albedo)
    least = max(20, round(settings.least_share * camera.width * camera.height))
    # Without a blur before it, whose edges would be regions of their own.
    labels = felzenszwalb(picture, scale=settings.scale, sigma=0, min_size=least)
    return np.unique(labels.reshape(-1)[pixels], return_inverse=True)[1].astype(np.int64)
