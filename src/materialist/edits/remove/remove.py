"""The scene without one of its objects (paper, Background Inpainting): what was behind it, in maps, depth and photo."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from materialist.edits.core.notes import noted, warned
from materialist.edits.core.region import body_coverage
from materialist.edits.core.renderer import denoised
from materialist.edits.remove.background import given_picture, matched, with_picture
from materialist.edits.remove.behind import behind
from materialist.edits.remove.filling import find_filling
from materialist.edits.remove.hole import make_hole
from materialist.edits.remove.native import with_hole
from materialist.options import Removal
from materialist.types import Array, Scene


def remove(
    scene: Scene, mask: Array, options: Removal | None = None, *, fitted: Scene | None = None, **values: Any
) -> Scene:
    """The scene without the object under a mask: surfaces go on behind it, and so do materials and the photo.

    In the result `photo` and `rerender` are filled alike, from the same places: their difference is what the fit
    misses of the surroundings. `composite` takes both as they are.

    mask: [H, W] bool, or weights in [0, 1], at working size. options, values: `Removal`, or single fields of it.
    fitted: the scene before its edits: a given background is the photo's, in the light of the photo.
    Raises InputError for an option out of its range; a mask that is empty, of another size, all sky, or (nearly) all
    of the photo; a background of another aspect. SetupError, WeightsError: a diffusion model that is not there.
    """
    from materialist.geometry.build import rebuilt

    options, fitted = Removal.given(options, **values), fitted or scene
    photographed = replace(scene, bodies=fitted.bodies)  # the photo does not show what edits since then put there
    bodies = body_coverage(photographed) > 0 if photographed.bodies else np.zeros(scene.depth.shape, bool)
    hole = make_hole(scene, mask, grow=options.grow, shadow=options.shadow, bodies=bodies)
    front = np.where(hole.object, scene.depth, 0)
    found = behind(scene.depth, scene.normal, scene.geometry.plane_label, hole.gone, front, scene.camera)
    filling = find_filling(
        scene.materials.albedo, scene.photo.linear, hole.painted, found.label, found.depth, scene.camera,
        seed=options.seed, usable=~bodies,
    )  # fmt: skip
    picture, warnings = given_picture(scene, options, hole.painted)
    if picture is not None:
        materials, photo, rerender = with_picture(scene, filling, picture)
    else:
        shown = denoised(scene.rerender, scene.materials.albedo, scene.normal)
        materials = filling.materials(scene.materials)
        photo = with_hole(scene.photo, filling.radiance(scene.photo.linear), hole.painted, filling.source)
        rerender = filling.radiance(shown)
    geometry = rebuilt(scene, found.depth, found.normal, scene.camera)
    removed = replace(
        scene, materials=materials, depth=found.depth, normal=found.normal, geometry=geometry, photo=photo,
        rerender=rerender,
    )  # fmt: skip
    if picture is not None:
        removed = matched(removed, hole.painted, picture, fitted)
    how = "background" if options.background is not None else ("inpainter" if options.inpaint else "patches")
    what = {
        "filled_by": how, "pixels": int(hole.object.sum()), "grow": options.grow,
        "shadow": "auto" if options.shadow is None else options.shadow,
    }  # fmt: skip
    return noted(warned(removed, *warnings), "remove", what)
