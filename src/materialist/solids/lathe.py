"""What was turned on a lathe: bottles, bulbs, vases, balls, rings, cups without their handles.

All its normals meet one axis, and say alone where that stands and how it leans. Around it every visible point tells a
place of one profile (`geometry.revolution`): no guess of the thickness is needed, and exact maps give it exactly.

Where most normals do so, and the others do not (the stalk of an apple, the plate of a door knob), the profile still
tells the back: not the whole body, but a smooth one, which glass needs more than one in the right place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.camera import pixel_rays
from materialist.solids.half_turn import LOOKING_DOWN, TILTS, Fit
from materialist.solids.profile import Profile
from materialist.solids.revolution import fits, profile_of, swept, thickness_of
from materialist.solids.shell import Shell
from materialist.solids.symmetry import surface_in
from materialist.solids.turning import Axis
from materialist.solids.vessel import vessel
from materialist.types import Array, Camera

FEWEST = 64
"""Pixels below which an object is too small to tell."""
ROUND = 0.035
"""Mean sine between normals and the planes through the axis up to which an object counts as turned on a lathe."""
MEETS, MOST, USUAL = 0.15, 0.75, 0.06
"""Sine at which a normal still meets the axis, and the least share that must, and their largest median sine, for an
object that is mostly of the lathe."""
ASTRAY = 0.03
"""What of its front may lie beside the mask or before the front after half a turn, as a part of its size."""
BEHIND = (0.1, 0.3, 0.5)
"""Where the axis is first looked for, behind the middle of the front, in units of the object's size."""
REACH = 1.5
"""Farthest place of the axis, in the same units: normals of one plane all meet at infinity."""
LEVEL = 0.02
"""What the square of a deviation from the usual tilt costs: for balls any tilt will do."""


@dataclass(frozen=True)
class Lathed:
    """An object turned on a lathe."""

    thickness: Array
    """[H, W] float32 along the camera ray, scene units, to where it leaves the object; 0 outside the mask."""
    misfit: float
    """Mean sine between visible normals and planes through the axis; of an outline, its part not in its image."""
    axis: Axis
    profile: Profile
    whole: bool = True
    """Whether the profile is the whole object; else it only tells how far back most of it reaches."""

    def body(self, camera: Camera, *, wall: float | None = None, open_top: bool = False) -> Shell:
        """The closed object; with `wall`, its thickness in scene units, a hollow one, without a lid if `open_top`."""
        return swept(self.profile, self.axis, camera, wall=wall, open_top=open_top)

    def opens(self, wall: float) -> bool:
        """Whether it can be a vessel that is open at the top."""
        return vessel(self.profile, wall) is not None


def lathed(
    depth: Array, normal: Array, mask: Array, camera: Camera, *, up: Array | None = None, behind: Array | None = None
) -> Lathed | None:
    """An object that was turned on a lathe, all or most of it, or None where normals do not meet one axis.

    Args:
        depth: [H, W] planar, scene units, 0 = none. normal: [H, W, 3] unit. mask: [H, W] bool or weights: one object.
        up: [3] unit, the axis' direction in the camera's frame, where a support tells it; else the camera is taken
            not to lean sideways, and the angle at which it looks down is found with the axis.
        behind: [H, W] planar depth of what stands behind the object, 0 = nothing: the object ends above it.

    Raises:
        InputError: maps of different sizes, or a mask without any surface.
    """
    inside = surface_in(mask, depth, camera)
    if inside.sum() < FEWEST:
        return None
    rays = pixel_rays(camera).astype(np.float64)
    fit = Fit(depth, normal, inside, depth, rays, None if up is None else np.asarray(up, np.float64))
    axis = _axis(fit)
    misfit = fit.unturned(axis)
    mostly = _mostly(fit, axis)
    if misfit > ROUND and not mostly:
        return None
    front = np.asarray(depth, np.float64)
    profile = profile_of(front, np.asarray(normal, np.float64), inside, rays, axis, behind)
    whole = misfit <= ROUND and fits(profile) and bool(profile.lines())
    if not (whole or mostly):
        return None
    return Lathed(thickness_of(profile, axis, front, inside, rays), misfit, axis, profile, whole)


def _mostly(fit: Fit, axis: Axis) -> bool:
    """Whether most normals meet the axis, and half a turn brings the front behind itself."""
    sines = fit.sines(axis)
    meets = (sines < MEETS).mean() > MOST and np.median(sines) < USUAL
    return bool(meets and fit.astray(axis) < ASTRAY)


def _axis(fit: Fit) -> Axis:
    """The axis that the normals meet best."""
    from scipy.optimize import minimize

    def cost(values: Array) -> float:
        far = np.maximum(np.abs(values[:2]) - REACH, 0).sum()
        lean = 0 if fit.up is not None else LEVEL * (values[2] - LOOKING_DOWN[0]) ** 2
        return fit.unturned(fit.axis(values)) + far + lean

    tilts = TILTS if fit.up is None else (0.0,)
    starts = [np.array([0.0, behind, tilt]) for behind in BEHIND for tilt in tilts]
    found = []
    for start in sorted(starts, key=cost)[:3]:
        first = np.stack([start, *(start + np.diag([0.08, 0.12, 0.12]))])
        options = {"maxfev": 200, "xatol": 1e-3, "fatol": 1e-6, "initial_simplex": first}
        found.append(minimize(cost, start, method="Nelder-Mead", options=options))
    return fit.axis(min(found, key=lambda one: one.fun).x)
