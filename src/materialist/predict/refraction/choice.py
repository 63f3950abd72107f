"""The thickness of an object: of a surface of revolution by itself, of anything else as RefractionNet predicts it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from materialist.camera import pixel_rays
from materialist.errors import WeightsError
from materialist.geometry.silhouette import surface_in
from materialist.predict.refraction.thickness import Thickness, thickness
from materialist.solids.finder import surface_of_revolution
from materialist.solids.front import smooth_front
from materialist.solids.symmetry import symmetric_thickness
from materialist.types import Array, Camera


@dataclass(frozen=True)
class Choice:
    """The thickness of an object and where it comes from."""

    thickness: Thickness
    method: str
    """`revolution`, `network` or `symmetry`."""


def best_thickness(
    photo_linear: Array, mask: Array, normal: Array, depth: Array, camera: Camera, *, up: Array | None = None,
    behind: Array | None = None,
) -> Choice:  # fmt: skip
    """The thickness of the object under a mask; without weights, what is no surface of revolution is mirrored.

    Args:
        photo_linear, mask, normal, depth, camera: as for `thickness`.
        up: [3] unit, the upright direction in the camera's frame, where a support tells it.
        behind: [H, W] planar depth of what stands behind the object, 0 = nothing.

    Returns:
        Thickness as of `thickness`; `hollow` is 0 where there are no weights. `back` is None for surfaces of
        revolution and mirrored objects: the depth of their back says more than the network.

    Raises:
        InputError: maps of different sizes, or a mask without any surface.
    """
    inside = surface_in(mask, depth, camera)
    try:
        guess, method = thickness(photo_linear, mask, normal, depth, camera), "network"
    except WeightsError:
        front = smooth_front(depth, normal, inside, pixel_rays(camera))
        mirrored = symmetric_thickness(front, normal, inside, camera)
        guess, method = Thickness(mirrored, np.zeros_like(mirrored)), "symmetry"
    found = surface_of_revolution(depth, normal, inside, camera, up=up, behind=behind)
    if found is None:
        return Choice(guess, method)
    body, solid = found
    whole = replace(guess, solid=solid, hollow=np.minimum(guess.hollow, solid), back=None, revolution=body)
    return Choice(whole, "revolution")
