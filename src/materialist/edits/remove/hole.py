"""The pixels that taking an object away concerns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.color import linear_to_srgb
from materialist.edits.composite.upsample import nearest
from materialist.edits.core.region import checked_region
from materialist.edits.remove.contact_shadow import contact_shadow, morphed
from materialist.errors import InputError
from materialist.types import Array, Scene


@dataclass(frozen=True)
class HoleSettings:
    """How far a hole reaches beyond the object; defocus tuned by eye on 25 objects."""

    most: float = 0.9  # part of the photo's surfaces beyond which nothing is left to tell what stood behind
    before: float = 0.97  # part of the object's depth up to which a surface stands before it
    island: float = 0.01  # part of the object up to which what is surrounded by filled pixels is filled as well
    reach: float = 0.02  # largest defocus width, part of the picture's longer side
    inside: float = 0.006  # how deep inside an object its own colour is, as such a part
    contrast: float = 0.15  # least distance of object and surroundings, sRGB, whose mixture is told from either
    mixture: float = 0.04  # median share of the object's colour at which its defocus ends


@dataclass(frozen=True)
class Hole:
    """What is taken away, at working size."""

    object: Array
    """[H, W] bool: the object itself."""
    gone: Array
    """[H, W] bool: the object and a rim of mixed pixels, wide where it is out of focus; depth and normals end here."""
    painted: Array
    """[H, W] bool: where materials and photo are filled: `gone`, its shadow and reflection on the ground, no bodies."""


def make_hole(
    scene: Scene, mask: Array, *, grow: float, shadow: float | None, bodies: Array | None = None,
    settings: HoleSettings = HoleSettings(),
) -> Hole:  # fmt: skip
    """The pixels that a removal concerns; `grow` and `shadow` as of `materialist.Removal`.

    `bodies` [H, W] bool: where the photo shows bodies of earlier edits, which stay; None for nowhere.

    Raises:
        InputError: a mask that is empty, of another size, all sky, or (nearly) all of the photo.
    """
    import cv2
    from skimage.morphology import remove_small_holes

    own = checked_region(scene, mask) > 0.5
    if not own.any():
        raise InputError("The mask is nowhere above one half on a surface; mark the object itself.")
    bodies = np.zeros_like(own) if bodies is None else bodies
    gone = morphed(cv2.MORPH_DILATE, own, round(grow * max(own.shape))) | _defocused(scene, own, bodies, settings)
    surface = scene.depth > 0
    if (gone & surface).sum() > settings.most * surface.sum() or (gone | ~surface).all():
        if own.mean() < 0.5 and (~gone & ~surface).sum() > (~gone & surface).sum():
            raise InputError(
                "Nearly everything around the mask is sky, so that no scene would be left without it; mark a thing "
                "that stands on something."
            )
        raise InputError(
            f"The mask covers {own.sum() / max(surface.sum(), 1):.0%} of what the photo shows, so that nothing tells "
            "what stands behind; mark one object only."
        )
    plane = scene.geometry.plane_label
    ground = (plane >= 0) & (scene.normal[..., 1] > 0.5)
    if shadow is None:
        painted = gone | contact_shadow(scene.photo.linear, plane, ground, own, gone)
    else:
        painted = gone | (ground & morphed(cv2.MORPH_DILATE, gone, round(shadow * float(np.sqrt(own.sum())))))
    return Hole(own, gone, remove_small_holes(painted, max_size=int(settings.island * own.sum())) & ~bodies)


def _defocused(scene: Scene, own: Array, bodies: Array, settings: HoleSettings) -> Array:
    """[H, W] bool: the object as far as it colours its surroundings, but for what stands before it."""
    import cv2

    bare = own & ~bodies
    if not bare.any():
        return own
    rim = morphed(cv2.MORPH_DILATE, bare, defocus_width(scene.photo.linear, bare, ~bodies, settings)) & ~bodies
    depth = scene.depth[nearest(own)]
    return rim & ((scene.depth == 0) | (scene.depth > settings.before * depth) | own)


def defocus_width(linear: Array, own: Array, usable: Array, settings: HoleSettings = HoleSettings()) -> int:
    """Pixels outside of an object [H, W] bool that have some of its colour, in the photo [H, W, 3] linear.

    Each is compared with the nearest pixels well inside and well outside; the median at each distance does not see
    neighbours and shadows, which lie on one side. `usable` [H, W] bool: what is compared.
    """
    import cv2
    from scipy.ndimage import distance_transform_edt

    longest = max(own.shape)
    reach = max(2, round(settings.reach * longest))
    encoded = linear_to_srgb(linear)
    smooth = cv2.GaussianBlur(encoded, (0, 0), 1.0)
    away = distance_transform_edt(~own)
    sides = distance_transform_edt(own) > settings.inside * longest, away > reach + 2
    if not (sides[0].any() and sides[1].any()):
        return 0
    inner, outer = (smooth[nearest(side)] for side in sides)
    length = ((inner - outer) ** 2).sum(-1)
    share = ((encoded - outer) * (inner - outer)).sum(-1) / np.maximum(length, 1e-6)
    for pixels in range(1, reach + 1):
        ring = (np.abs(away - pixels) <= 0.5) & (length > settings.contrast**2) & usable
        if ring.sum() < 20 or np.median(share[ring]) <= settings.mixture:
            return pixels - 1
    return reach
