"""The pixels that taking an object away concerns."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_erosion
from skimage.morphology import remove_small_holes

from materialist.edits.core.region import checked_region
from materialist.errors import InputError
from materialist.geometry.silhouette import grown
from materialist.types import Array, Scene


@dataclass(frozen=True)
class HoleSettings:
    """When there is no hole, and what else is filled."""

    max_share: float = 0.9  # of the photo's surfaces; more leaves nothing to tell what stood behind
    shadow: float = 0.15  # ground filled around the object, part of the root of its area
    max_island: float = 0.01  # part of the object: what filled pixels surround is filled, too

    # When the filling is a guess; tuned by eye on 6 photos.
    large_share: float = 0.15  # of the photo
    cut_share: float = 0.1  # of its outline that the frame cuts


SETTINGS = HoleSettings()


@dataclass(frozen=True)
class Hole:
    """What is taken away, at working size."""

    object: Array
    """[H, W] bool: the object itself."""
    gone: Array
    """[H, W] bool: the object and a rim of mixed pixels; depth and normals end here."""
    painted: Array
    """[H, W] bool: where materials and photo are filled: `gone`, its shadow and reflection on the ground, no bodies."""


def make_hole(
    scene: Scene, mask: Array, *, grow: float, shadow: float | None, bodies: Array
) -> Hole:
    """The pixels that a removal concerns; `grow` and `shadow` as of `materialist.Removal`.

    `bodies` [H, W] bool: where the photo shows bodies of earlier edits, which stay.
    Raises InputError for a mask that is empty, of another size, all sky, or (nearly) all of the photo.
    """
    # --- The object, and a rim of pixels that mix it with what is behind ---
    region = checked_region(scene, mask) > 0.5
    if not region.any():
        raise InputError("The mask is nowhere above one half on a surface; mark the object itself.")
    gone = grown(region, round(grow * max(region.shape)))
    surface = scene.depth > 0
    plane = scene.geometry.plane_label
    # --- Its shadow and reflection lie on the ground: planes that face up ---
    ground = (plane >= 0) & (scene.normal[..., 1] > 0.5)
    share = SETTINGS.shadow if shadow is None else shadow
    painted = gone | (ground & grown(gone, round(share * float(np.sqrt(region.sum())))))
    if (painted & surface).sum() > SETTINGS.max_share * surface.sum() or (painted | ~surface).all():
        mask_share = (region & surface).sum() / max(surface.sum(), 1)
        whole = (painted & surface).sum() / max(surface.sum(), 1)
        raise InputError(
            f"The mask covers {mask_share:.0%} of the photo's surfaces (sky is none), {whole:.0%} with a shadow of "
            f"{share:g}, so that nothing tells what stands behind; mark one object only, or give a smaller shadow."
        )
    return Hole(
        region,
        gone,
        remove_small_holes(painted, max_size=int(SETTINGS.max_island * region.sum())) & ~bodies,
    )


def evidence_notes(hole: Hole) -> list[str]:
    """What to say of a hole whose surroundings tell little of what was hidden."""
    painted = hole.painted
    frame = np.pad(np.zeros(tuple(n - 2 for n in painted.shape), bool), 1, constant_values=True)
    # Both as shares: of the photo, and of the hole's outline.
    outline = painted & ~binary_erosion(painted)
    share = float(painted.mean())
    cut = float((painted & frame).sum() / max(int(outline.sum()), 1))
    reasons = []
    if share > SETTINGS.large_share:
        reasons.append(f"it takes {share:.0%} of the photo")
    if cut > SETTINGS.cut_share:
        reasons.append(f"{cut:.0%} of its outline lies on the frame")
    if not reasons:
        return []
    return [
        f"The photo tells little of what the object hid: {' and '.join(reasons)}. What is there now is a guess from "
        "the rest of the photo; where you have the view without the object, give it as the background."
    ]
