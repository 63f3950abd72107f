"""The pixels that taking an object away concerns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.edits.core.region import body_coverage, checked_region
from materialist.edits.remove.cast import cast
from materialist.edits.remove.halo import softness
from materialist.errors import InputError
from materialist.types import Array, Scene

GROW = 0.006
"""Part of the picture's longer side by which a hole is larger than the object: pixels at a silhouette show both."""
MOST = 0.9
"""Share of the picture's surfaces beyond which nothing is left to tell what stood behind."""
POCKET = 0.15
"""Part of the object's size up to which what lies on no plane at its foot is of the ground."""
BEFORE = 0.97
"""What is nearer than the object by this factor stands before it."""
ISLAND = 0.01
"""What is surrounded by pixels to fill, and smaller than this part of the object, is the rest of a shadow's edge."""
UPWARD = 0.5
"""Least Y of the normal of what a thing can stand on."""


@dataclass(frozen=True)
class Hole:
    """What is taken away, at working size."""

    object: Array
    """[H, W] bool: the object itself."""
    gone: Array
    """[H, W] bool: the object and a rim of mixed pixels, wide where it is out of focus; depth and normals end here."""
    painted: Array
    """[H, W] bool: where materials and photo are filled: `gone`, and what it casts on the ground."""


def make_hole(scene: Scene, mask: Array, *, grow: float = GROW, shadow: float | None = None) -> Hole:
    """The pixels that a removal concerns; arguments and errors as for `without`."""
    for name, value, most in (("rim", grow, 0.2), ("shadow", 0.0 if shadow is None else shadow, 2.0)):
        if not (np.isfinite(value) and 0 <= value <= most):
            raise InputError(f"The {name} is {value:g}; it must lie in [0, {most:g}].")
    own = checked_region(scene, mask) > 0.5
    if not own.any():
        raise InputError("The mask is nowhere above one half on a surface; mark the object itself.")
    height, width = own.shape
    gone = _grown(own, round(grow * max(height, width))) | _soft_rim(scene, own)
    surface = scene.depth > 0
    if (gone & surface).sum() > MOST * surface.sum() or (gone | ~surface).all():
        if own.mean() < 0.5 and (~gone & ~surface).sum() > (~gone & surface).sum():
            raise InputError(
                "Nearly everything around the mask is sky, so that no scene would be left without it; mark a thing "
                "that stands on something."
            )
        raise InputError(
            f"The mask covers {own.sum() / max(surface.sum(), 1):.0%} of what the photo shows, so that nothing tells "
            "what stands behind; mark one object only."
        )
    plane, upward = scene.geometry.plane_label, scene.normal[..., 1] > UPWARD
    if shadow is None:
        ground = pockets(plane, upward, gone, POCKET * own.sum())
        found = cast(scene.photo.linear, ground, upward | (ground != plane), own, gone)
        gone = gone | (found & (ground != plane))
        painted = gone | found
    else:
        painted = gone | ((plane >= 0) & upward & _grown(gone, round(shadow * float(np.sqrt(own.sum())))))
    return Hole(own, gone, painted | _islands(painted, ISLAND * own.sum()))


def pockets(plane: Array, upward: Array, gone: Array, most: float) -> Array:
    """`plane` [H, W] int where small parts of none (-1) beside what is `gone`, and else within one plane, are of it.

    A guessed depth is that of an object a little beyond its foot. `upward` [H, W] bool: what things stand on.
    """
    import cv2
    from scipy.ndimage import find_objects, label

    out = plane.copy()
    parts, count = label((plane < 0) & ~gone)
    area = np.bincount(parts.ravel(), minlength=count + 1)
    for number, box in enumerate(find_objects(parts), 1):
        box = tuple(slice(max(side.start - 1, 0), side.stop + 1) for side in box)
        part = parts[box] == number
        rim = cv2.dilate(part.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        beside = plane[box][rim & ~part & ~gone[box]]
        known = np.unique(beside[beside >= 0])
        within = area[number] <= most and (rim & gone[box]).any() and len(known) == 1 and (beside >= 0).all()
        if within and upward[plane == known[0]].mean() > 0.5:
            out[box][part] = known[0]
    return out


def _soft_rim(scene: Scene, own: Array) -> Array:
    """[H, W] bool: the object as far as it colours its surroundings, but for what stands before it."""
    from scipy.ndimage import distance_transform_edt

    body = body_coverage(scene) > 0 if scene.bodies else np.zeros_like(own)
    bare = own & ~body
    if not bare.any():
        return own
    rim = _grown(bare, softness(scene.photo.linear, bare, body)) & ~body
    row, column = distance_transform_edt(~own, return_distances=False, return_indices=True)
    depth = scene.depth[row, column]
    return rim & ((scene.depth == 0) | (scene.depth > BEFORE * depth) | own)


def _islands(painted: Array, most: float) -> Array:
    """[H, W] bool: parts of at most so many pixels that are surrounded by `painted` [H, W] bool."""
    from scipy.ndimage import label

    parts, _ = label(~painted)
    area = np.bincount(parts.ravel())
    area[0] = 0
    framed = np.unique(np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]]))
    area[framed] = 0
    return np.isin(parts, np.flatnonzero((area > 0) & (area <= most)))


def told_shadow(value: object) -> float | None:
    """The `shadow` of an option or a recipe: `auto`, or a number. Raises InputError for anything else."""
    if value == "auto":
        return None
    try:
        if not isinstance(value, bool):
            return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        pass
    raise InputError(f"The shadow is '{value}'; give auto, or a share of the object's size in [0, 2].")


def _grown(mask: Array, pixels: int) -> Array:
    import cv2

    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * max(pixels, 1) + 1,) * 2)
    return cv2.dilate(mask.astype(np.uint8), kernel) > 0 if pixels > 0 else mask
