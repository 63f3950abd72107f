"""A jug without its handle: the part of an object that may be a surface of revolution."""

from dataclasses import dataclass

import cv2
import numpy as np

from materialist.camera import pixel_rays
from materialist.geometry.silhouette import border_distance, grown
from materialist.solids.outline import has_mirror_image, mirror_plane
from materialist.types import Array, Camera


@dataclass(frozen=True)
class HandleSettings:
    """What counts as a handle or a spout; lengths are parts of the object's size, the root of its area."""

    min_height: float = 0.15  # upright extent of the body; a handle beside a spout has less
    rounding: float = 0.02  # by which corners of the body are given back
    min_width: float = 0.012  # of a handle: what is thinner belongs to the body's outline
    max_half_width: float = 0.085  # thicker is what another thing or no symmetry leaves; 38 handles
    min_body: float = 0.75  # share of the object that the body has


SETTINGS = HandleSettings()


def without_handles(inside: Array, up: Array, camera: Camera) -> Array | None:
    """[H, W] bool: what of an object mirrors itself at an upright plane, without what stands out at one side.

    inside: [H, W] bool, one object. up: [3] unit, the upright direction in the camera's frame.
    None where nothing stands out, where it is too thick for a handle, or the rest too small a part of the object.
    """
    size = float(np.sqrt(inside.sum()))
    rays = pixel_rays(camera).astype(np.float64)
    across, _ = mirror_plane(inside, rays, up, camera)
    mirrored = has_mirror_image(inside, rays, across, camera).astype(np.uint8)
    # --- What is mirrored and high: where a handle meets the image of a spout it is low ---
    column = np.ones((max(3, round(SETTINGS.min_height * size)), 1), np.uint8)
    _, number = cv2.connectedComponents(cv2.morphologyEx(mirrored, cv2.MORPH_OPEN, column))
    if not number.any():
        return None
    largest = number == np.argmax(np.bincount(number[number > 0]))
    body = grown(largest, max(1, round(SETTINGS.rounding * size))) & (mirrored > 0)
    # --- The body keeps its own outline, which is never quite its mirror image ---
    width = 2 * max(1, round(SETTINGS.min_width * size)) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width, width))
    aside = cv2.morphologyEx((inside & ~body).astype(np.uint8), cv2.MORPH_OPEN, disc) > 0
    body = inside & ~aside
    if not aside.any() or body.sum() < SETTINGS.min_body * inside.sum():
        return None
    if border_distance(aside).max() > SETTINGS.max_half_width * size:
        return None
    return body
