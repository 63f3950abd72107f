"""Glass while a slider moves: what does not change is made once, and only the pixels of the object are traced."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from materialist.edits.composite.layers import without_fireflies
from materialist.edits.glass.glass import glass, glass_surface
from materialist.errors import InputError
from materialist.options import Glass
from materialist.types import Array, Scene, Surface

if TYPE_CHECKING:
    from materialist.render.scene import RenderScene

PATHS = 600_000
"""Paths of one picture, as far as FEWEST a pixel allow."""
FEWEST = 4
"""Paths a traced pixel."""
MARGIN = 2
"""Working pixels around the object that are traced as well."""


class GlassPreview:
    """An object of a fitted scene as glass, again and again with other glass.

    The background and the closed body are made when it is built (seconds); a picture then takes the paths inside the
    object's rectangle alone. Its shadow and caustics on the surroundings, which `composite` adds, are not shown: around
    the object stands the photo with the object gone.

    Args:
        scene, mask, options, values: as for `glass.glass`; `model` must be `closed`.

    Raises:
        InputError: as `glass.glass`, and for another model.
    """

    def __init__(self, scene: Scene, mask: Array, options: Glass | None = None, **values: Any):
        from materialist.edits.core.sky import photo_sky
        from materialist.render.variant import setup

        self._options = options = Glass.given(options, **values)
        if options.model != "closed":
            raise InputError(f"The preview traces the closed body; model is '{options.model}', leave it 'closed'.")
        setup(options.device)
        self.scene = scene
        # The glass itself is exchanged for every picture.
        self._edited = glass(scene, mask, options, ior=1.5, transmission=1.0)
        sky = photo_sky(self._edited)
        self._light = self._edited.envmap if sky is None else sky
        self._name = f"body{len(self._edited.bodies) - 1}"
        self._look()

    def picture(self, *, spp: int = 16, seed: int = 0, **values: Any) -> Array:
        """[H, W, 3] float32 linear at working size: the photo with the object as glass.

        `spp` paths a working pixel of the object, fewer for objects so large that these are more than PATHS;
        `values`: `ior`, `transmission`, `tint` and `roughness` of this glass.
        """
        from materialist.edits.composite.native_layer import spread
        from materialist.edits.core.renderer import denoised
        from materialist.render.native import radiance
        from materialist.render.scene import GLASS_DEPTH

        if spp < 1:
            raise InputError(f"spp is {spp}; give at least 1 path a pixel.")
        surface = glass_surface(self.scene, Glass.given(self._options, **values))
        target, box = self._target(surface), self._box
        paths = max(FEWEST, min(spp, PATHS // ((box[1] - box[0]) * (box[3] - box[2]))))
        seen = radiance(target, self._size, box, spp=paths, seed=seed, max_depth=GLASS_DEPTH, names=[self._name])
        calm = without_fireflies(spread(seen))
        guide = self._guide
        return self._in_photo(denoised(calm, guide.albedo, guide.normal))

    @property
    def share(self) -> Array:
        """[H, W] float32 in [0, 1]: share of each working pixel in which the glass is seen."""
        return self._share

    @property
    def filled(self) -> Array:
        """[H, W] bool: where a picture is not the photo, for the object stood there and the glass does not."""
        return (self._edited.photo.linear != self.scene.photo.linear).any(-1)

    def _look(self) -> None:
        """What of the body is seen where."""
        camera = self.scene.camera
        self._size = working = (camera.height, camera.width)
        share = self._sight((0, working[0], 0, working[1])).share
        rows, columns = np.flatnonzero(share.any(1)), np.flatnonzero(share.any(0))
        if not len(rows):
            raise InputError("The camera sees nothing of the object; mark another one.")
        self._share = share
        self._box = (
            max(0, int(rows[0]) - MARGIN), min(working[0], int(rows[-1]) + 1 + MARGIN),
            max(0, int(columns[0]) - MARGIN), min(working[1], int(columns[-1]) + 1 + MARGIN),
        )  # fmt: skip
        self._guide = self._sight(self._box)

    def _sight(self, box: tuple[int, int, int, int]) -> Any:
        from materialist.render.coverage import first_hits

        target = self._target(self._edited.bodies[-1].surface)
        return first_hits(target.mi_scene, self.scene.camera, {self._name: self._edited.bodies[-1]}, self._size, box)

    def _target(self, surface: Surface) -> RenderScene:
        """The ray tracer's scene with the body of that glass."""
        from materialist.render.scene import RenderScene

        edited = self._edited
        bodies = (*edited.bodies[:-1], replace(edited.bodies[-1], surface=surface))
        target = RenderScene(
            edited.geometry, edited.camera, bodies=bodies, lamps=edited.lamps, device=self._options.device
        )  # fmt: skip
        target.set_materials(edited.materials)
        target.set_envmap(self._light)
        return target

    def _in_photo(self, traced: Array) -> Array:
        """[H, W, 3] the traced rectangle in the photo without the object."""
        top, bottom, left, right = self._box
        out = self._edited.photo.linear.copy()
        share = self._share[top:bottom, left:right, None]
        out[top:bottom, left:right] = share * traced + (1 - share) * out[top:bottom, left:right]
        return out
