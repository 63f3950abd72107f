"""Depth of field, added to a sharp picture: layers of depth, each blurred by the lens, laid over each other."""

import cv2
import numpy as np

from materialist.types import Array, Camera

LAYERS = 10
"""Steps of blur between the nearest and the farthest surface."""
FAR = 1e3
"""Metres to where no surface is."""
LEAST = 0.7
"""Pixels of blur that are not worth a layer."""


def defocused(image: Array, depth: Array, camera: Camera, aperture: float, focus: float) -> Array:
    """[H, W, 3] float32: the radiance as a lens of that diameter shows it, focused at that distance, both metres.

    depth: [H, W] planar, metres, 0 where there is no surface.
    """
    distance = np.where(depth > 0, depth, FAR)
    # pixels across, signed: near negative
    blur = aperture * camera.focal * (1 / focus - 1 / distance)
    low = float(blur.min())
    high = float(blur.max())
    if max(-low, high) < LEAST:
        return image
    steps = np.linspace(high, low, LAYERS)
    spacing = max((high - low) / (LAYERS - 1), 1e-6)
    total = np.zeros_like(image, np.float32)
    cover = np.zeros((*depth.shape, 1), np.float32)
    for step in steps:  # far to near; each pixel belongs to the two nearest layers
        share = np.clip(1 - np.abs(blur - step) / spacing, 0, 1).astype(np.float32)[..., None]
        layer = _blurred(
            np.concatenate([image * share, share], -1).astype(np.float32), abs(float(step))
        )
        total = layer[..., :3] + total * (1 - layer[..., 3:])
        cover = layer[..., 3:] + cover * (1 - layer[..., 3:])
    return total / np.maximum(cover, 1e-4)


def _blurred(layer: Array, diameter: float) -> Array:
    """The layer [H, W, 4] under a disc of that diameter, pixels."""
    if diameter < LEAST:
        return layer
    radius = diameter / 2
    side = 2 * int(np.ceil(radius)) + 1
    place = np.arange(side) - side // 2
    away = np.hypot(place[:, None], place[None])
    disc = np.clip(radius + 0.5 - away, 0, 1).astype(np.float32)
    return cv2.filter2D(layer, -1, disc / disc.sum(), borderType=cv2.BORDER_REFLECT)
