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

    # part of the photo's surfaces beyond which nothing is left to tell what stood behind
    most: float = 0.9
    shadow: float = 0.15  # how far around the object the ground is filled by default, part of the root of its area
    # part of the object up to which what is surrounded by filled pixels is filled as well
    island: float = 0.01
    # part of the photo from which a filled hole is a guess; tuned by eye on 6 photos
    large: float = 0.15
    cut: float = 0.1  # part of its outline that the frame cuts from which it is one, too; tuned by eye on 6 photos


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
    own = checked_region(scene, mask) > 0.5
    if not own.any():
        raise InputError("The mask is nowhere above one half on a surface; mark the object itself.")
    gone = grown(own, round(grow * max(own.shape)))
    surface = scene.depth > 0
    plane = scene.geometry.plane_label
    ground = (plane >= 0) & (scene.normal[..., 1] > 0.5)
    share = SETTINGS.shadow if shadow is None else shadow
    painted = gone | (ground & grown(gone, round(share * float(np.sqrt(own.sum())))))
    if (painted & surface).sum() > SETTINGS.most * surface.sum() or (painted | ~surface).all():
        mask_share, whole = (
            (part & surface).sum() / max(surface.sum(), 1) for part in (own, painted)
        )
        raise InputError(
            f"The mask covers {mask_share:.0%} of the photo's surfaces (sky is none), {whole:.0%} with a shadow of "
            f"{share:g}, so that nothing tells what stands behind; mark one object only, or give a smaller shadow."
        )
    return Hole(
        own, gone, remove_small_holes(painted, max_size=int(SETTINGS.island * own.sum())) & ~bodies
    )


def evidence_notes(hole: Hole) -> list[str]:
    """What to say of a hole whose surroundings tell little of what was hidden."""
    here = hole.painted
    frame = np.pad(np.zeros(tuple(n - 2 for n in here.shape), bool), 1, constant_values=True)
    outline = here & ~binary_erosion(here)
    share = float(here.mean())
    cut = float((here & frame).sum() / max(int(outline.sum()), 1))
    why = [f"it takes {share:.0%} of the photo"] * (share > SETTINGS.large)
    why += [f"{cut:.0%} of its outline lies on the frame"] * (cut > SETTINGS.cut)
    if not why:
        return []
    return [
        f"The photo tells little of what the object hid: {' and '.join(why)}. What is there now is a guess from the "
        "rest of the photo; where you have the view without the object, give it as the background."
    ]
