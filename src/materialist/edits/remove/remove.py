"""The scene without one of its objects (paper, Background Inpainting): what was behind it, in maps, depth and photo."""

from dataclasses import replace
from typing import Unpack

import cv2
import numpy as np

from materialist.edits.core.notes import noted, warned
from materialist.edits.core.region import body_coverage
from materialist.edits.core.renderer import denoised
from materialist.edits.remove.background import picture_behind
from materialist.edits.remove.behind import HiddenGeometry, behind
from materialist.edits.remove.hole import Hole, evidence_notes, make_hole
from materialist.edits.remove.options import Removal, RemovalKeywords
from materialist.geometry.build import rebuilt
from materialist.geometry.membrane import membrane
from materialist.geometry.silhouette import window
from materialist.option_kinds import documented
from materialist.predict import resample
from materialist.types import Array, Materials, Photo, Scene

FLOOR = 0.05
"""Radiance up to which an albedo or a re-rendering differs from the photo by a sum, beyond it by a factor (by eye)."""

MARGIN = 32
"""Pixels around a hole in which the re-rendering loses its noise: 64 and 96 fill the hole alike, to 0.03 %."""


@documented(Removal)
def remove(
    scene: Scene,
    mask: Array,
    options: Removal | None = None,
    *,
    fitted: Scene | None = None,
    **values: Unpack[RemovalKeywords],
) -> Scene:
    """The scene without the object under a mask: photo, surfaces and materials go on behind it.

    In the result `photo` and `rerender` are filled alike: their difference is what the fit misses of the
    surroundings. Outside the hole both are as before; `composite` takes the object's shadow and reflection away there.

    mask: [H, W] bool, or weights in [0, 1], at working size. options, values: `Removal`, or single fields of it.
    fitted: the scene before its edits: the photo does not show what they put there.
    Raises InputError for an option out of its range; a mask that is empty, of another size, all sky, or (nearly) all
    of the photo; a background of another aspect. SetupError, WeightsError: a library or model that is not there.
    """
    # --- The hole, the surfaces behind it, and a picture of them ---
    options = Removal.merged(options, **values)
    fitted = fitted or scene
    hole, hidden, (picture, method, warnings) = disocclusion(scene, mask, options, fitted)
    # --- The photo, maps and re-rendering are filled alike ---
    photo = with_hole(scene.photo, picture, hole.painted)
    old = scene.materials
    # What lies around the hole tells what it is filled with; the whole picture takes a second.
    around = window(hole.painted, margin=MARGIN)
    shown = scene.rerender.copy()
    shown[around] = denoised(scene.rerender[around], old.albedo[around], scene.normal[around])
    # Roughness and metallic have no picture: spanned over the hole from its border.
    roughness = membrane(np.clip(old.roughness, 0, 1), ~hole.painted)
    metallic = membrane(np.clip(old.metallic, 0, 1), ~hole.painted)
    removed = replace(
        scene,
        photo=photo,
        depth=hidden.depth,
        normal=hidden.normal,
        geometry=rebuilt(scene, hidden.depth, hidden.normal, scene.camera),
        materials=Materials(
            np.minimum(carried(old.albedo, photo.linear, hole.painted), 1), roughness, metallic
        ),
        rerender=np.where(
            hole.painted[..., None], carried(shown, photo.linear, hole.painted), scene.rerender
        ),
    )
    facts = {
        "filled_by": method,
        "pixels": int(hole.object.sum()),
        "grow": options.grow,
        "shadow": "auto" if options.shadow is None else options.shadow,
    }
    if method == "migan":
        warnings += evidence_notes(hole)
    return noted(warned(removed, *warnings), "remove", facts)


def disocclusion(
    scene: Scene, mask: Array, options: Removal, fitted: Scene
) -> tuple[Hole, HiddenGeometry, tuple[Array, str, list[str]]]:
    """The hole that a removal leaves, the surfaces behind it, and what `picture_behind` gives: most of its work."""
    photographed = replace(scene, bodies=fitted.bodies)
    bodies = (
        body_coverage(photographed) > 0
        if photographed.bodies
        else np.zeros(scene.depth.shape, bool)
    )
    # --- What is taken away, and what stands behind it ---
    hole = make_hole(scene, mask, grow=options.grow, shadow=options.shadow, bodies=bodies)
    front = np.where(hole.object, scene.depth, 0)
    hidden = behind(
        scene.depth, scene.normal, scene.geometry.plane_label, hole.gone, front, scene.camera
    )
    return hole, hidden, picture_behind(scene, options, hole.painted, ~bodies)


def carried(values: Array, photo: Array, hole: Array) -> Array:
    """[H, W, 3] float32 albedo or radiance with the hole [H, W] bool filled as a filled photo [H, W, 3] is.

    Their ratio around the hole is spanned over it: light is smooth, and the texture is the photo's.
    """
    ratio = membrane(np.log((values + FLOOR) / (photo + FLOOR)), ~hole)
    filled = np.maximum((photo + FLOOR) * np.exp(ratio) - FLOOR, 0)
    return np.where(hole[..., None], filled, values).astype(np.float32)


def with_hole(photo: Photo, picture: Array, hole: Array) -> Photo:
    """The photo with a picture [h, w, 3] linear of any size in the hole [H, W] bool; elsewhere bit for bit itself."""
    # --- At native size: a soft border, inwards only ---
    native = photo.original.shape[:2]
    box = window(hole, native)
    over = _outline(hole, native)[box][..., None].copy()
    large = resample.values(picture, native)[box].copy()
    original = photo.original.copy()  # last, for the memory
    original[box] = np.where(over > 0, over * large + (1 - over) * original[box], original[box])
    linear = np.where(hole[..., None], resample.values(picture, hole.shape), photo.linear).astype(
        np.float32
    )
    return replace(photo, linear=linear, original=original)


def _outline(mask: Array, native: tuple[int, ...]) -> Array:
    """[H0, W0] float32 share of a mask at native size: nothing outside, rising from its smoothed outline inwards."""
    hard = cv2.resize(mask.astype(np.uint8), native[::-1], interpolation=cv2.INTER_NEAREST)
    if native == mask.shape:
        return hard.astype(np.float32)
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.0)
    share: Array = np.asarray(cv2.resize(smooth, native[::-1], interpolation=cv2.INTER_CUBIC))
    # From 0 at one half of the smoothed mask to 1 at three quarters.
    share *= 4  # in place, for the memory
    share -= 2
    np.clip(share, 0, 1, out=share)
    share *= hard
    # A smoothed outline would lose lines one pixel wide: they stay hard.
    thin = mask & (
        cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) == 0
    )
    thin = cv2.resize(thin.astype(np.uint8), native[::-1], interpolation=cv2.INTER_NEAREST)
    share[thin > 0] = 1
    return share
