"""Which estimate of an object's thickness to believe: its front swept or turned around, RefractionNet's, the mirror's.

What was turned on a lathe is known by its normals, or by its outline, and its back with it. The outline knows nothing
of dents, and is asked where the maps are not exact enough to show them.

The turned front has the object's own edges, and is taken where it fits the front and the mask very well (boxes,
pyramids, bottles), or where the network says the same. Elsewhere RefractionNet's backs lean less wrongly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from materialist.camera import pixel_rays
from materialist.errors import WeightsError
from materialist.predict.refraction.thickness import Thickness, thickness
from materialist.solids.front import of_one_surface, smooth_front
from materialist.solids.half_turn import half_turn
from materialist.solids.lathe import lathed
from materialist.solids.outline import outlined
from materialist.solids.symmetry import surface_in, symmetric_thickness
from materialist.types import Array, Camera

CERTAIN = 0.02
"""Misfit up to which the turn is believed."""
FAR = 0.75
"""Mean difference of the turn from the guess, relative to the guess, beyond which it is never believed."""
AGREE = {"network": 0.1, "symmetry": 0.35}
"""The same up to which it is believed in any case, by what the guess comes from."""


@dataclass(frozen=True)
class Choice:
    """The thickness of an object and where it comes from."""

    thickness: Thickness
    method: str
    """`lathe`, `lathe, in part`, `outline`, `half-turn`, `network` or `symmetry`."""


def best_thickness(
    photo_linear: Array, mask: Array, normal: Array, depth: Array, camera: Camera, *, up: Array | None = None,
    behind: Array | None = None, prefer: str = "auto",
) -> Choice:  # fmt: skip
    """The thickness of the object under a mask.

    Args:
        photo_linear, mask, normal, depth, camera: as for `thickness`.
        up: [3] unit, the upright direction in the camera's frame, where a support tells it.
        behind: [H, W] planar depth of what stands behind the object, 0 = nothing.
        prefer: `auto`, or `half-turn`: the turn in any case.

    Returns:
        Thickness as of `thickness`; `hollow` is 0 where there are no weights, `back` None where the depth of the back
        says more about it than the network.

    Raises:
        InputError: maps of different sizes, or a mask without any surface.
    """
    inside = surface_in(mask, depth, camera)
    front = smooth_front(depth, normal, inside, pixel_rays(camera)).astype(np.float32)
    try:
        guess, method = thickness(photo_linear, mask, normal, depth, camera), "network"
    except WeightsError:
        mirrored = symmetric_thickness(front, normal, inside, camera)
        guess, method = Thickness(mirrored, np.zeros_like(mirrored)), "symmetry"
    ways = {"lathe": lathed, "outline": outlined}
    if of_one_surface(depth, normal, inside, pixel_rays(camera)):
        del ways["outline"]
    part = None
    for name, known in ways.items() if prefer == "auto" else ():
        if (found := known(front, normal, inside, camera, up=up, behind=behind)) is None:
            continue
        thick = _as_thick(guess, found.thickness)
        if found.whole:
            return Choice(replace(thick, lathe=found), name)
        part = Choice(thick, f"{name}, in part")
    if part is not None:
        return part
    turn = half_turn(front, normal, inside, guess.solid, camera, up=up)
    away = float(np.abs(turn.thickness - guess.solid)[inside].sum() / max(float(guess.solid[inside].sum()), 1e-9))
    believed = (turn.misfit < CERTAIN and away < FAR) or away < AGREE[method]
    if not (believed or prefer == "half-turn"):
        return Choice(guess, method)
    return Choice(_as_thick(guess, turn.thickness), "half-turn")


def _as_thick(guess: Thickness, solid: Array) -> Thickness:
    """The guess with another solid thickness [H, W], whose own slopes are those of the back."""
    return replace(guess, solid=solid, hollow=np.minimum(guess.hollow, solid), back=None)
