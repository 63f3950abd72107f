"""Glass while a slider moves: what does not change is made once, and only the pixels of the object are traced."""

from dataclasses import replace
from typing import Any

from materialist.edits.composite.layers import without_fireflies
from materialist.edits.composite.native_layer import spread_known
from materialist.edits.core.renderer import EditRenderer, denoised, photo_sky
from materialist.edits.glass.glass import glass, glass_surface
from materialist.edits.glass.options import Glass
from materialist.errors import InputError
from materialist.geometry.silhouette import area, window
from materialist.types import Array, Scene, Surface

MAX_PATHS = 600_000
"""Paths of one picture, as far as MIN_PATHS a pixel allow."""
MIN_PATHS = 4
"""Paths a traced pixel."""
MARGIN = 2
"""Working pixels around the object that are traced as well."""


class GlassPreview:
    """An object of a fitted scene as glass, again and again with other glass.

    The background and the closed body are made when it is built (seconds); a picture then takes the paths inside the
    object's rectangle alone. Its shadow and caustics on the surroundings, which `composite` adds, are not shown:
    around the object stands the photo with the object gone.

    scene, mask, options, values: as for `glass.glass`. Raises InputError as that, and for a model that is not `closed`.
    """

    def __init__(self, scene: Scene, mask: Array, options: Glass | None = None, **values: Any):
        from materialist.render.pixels import first_hits
        from materialist.render.variant import setup

        self._options = options = Glass.merged(options, **values)
        if options.model != "closed":
            raise InputError(
                f"The preview traces the closed body; model is '{options.model}', leave it 'closed'."
            )
        setup(options.device)
        self.scene = scene
        # --- The scene with the body; its glass is exchanged for every picture ---
        edited = glass(scene, mask, options, ior=1.5, transmission=1.0)
        self._edited = replace(edited, envmap=photo_sky(edited))
        self._renderer = EditRenderer(self._edited, device=options.device)
        self._name = f"body{len(self._edited.bodies) - 1}"
        self._size = scene.depth.shape
        # --- Where it is seen, and the denoiser's guides: the same for every picture ---
        traced = self._target(self._edited.bodies[-1].surface).mi_scene
        body = {self._name: self._edited.bodies[-1]}
        sight = first_hits(traced, scene.camera, body, self._size)
        self.share = sight.share
        """[H, W] float32 in [0, 1]: share of each working pixel in which the glass is seen."""
        if not self.share.any():
            raise InputError("The camera sees nothing of the object; mark another one.")
        self._box = window(self.share > 0, margin=MARGIN)
        self._guides = sight.albedo[self._box], sight.normal[self._box]

    def picture(self, *, spp: int = 16, seed: int = 0, **values: Any) -> Array:
        """[H, W, 3] float32 linear at working size: the photo with the object as glass.

        `spp` paths a working pixel of the object, fewer for objects so large that these are more than MAX_PATHS;
        `values`: `ior`, `transmission`, `tint` and `roughness` of this glass.
        """
        from materialist.render.pixels import radiance
        from materialist.render.scene import GLASS_DEPTH

        # --- The pixels of the object alone, by few paths ---
        surface = glass_surface(self.scene, Glass.merged(self._options, **values))
        target = self._target(surface)
        box = self._box
        paths = max(MIN_PATHS, min(spp, MAX_PATHS // area(box)))
        seen = radiance(
            target, self._size, box, spp=paths, seed=seed, max_depth=GLASS_DEPTH, names=[self._name]
        )
        traced = denoised(without_fireflies(spread_known(seen)), *self._guides)
        # --- Laid on the photo by the share of each pixel ---
        out = self._edited.photo.linear.copy()
        share = self.share[box][..., None]
        out[box] = share * traced + (1 - share) * out[box]
        return out

    @property
    def filled(self) -> Array:
        """[H, W] bool: where a picture is not the photo, for the object stood there and the glass does not."""
        return (self._edited.photo.linear != self.scene.photo.linear).any(-1)

    def _target(self, surface: Surface):
        bodies = (*self._edited.bodies[:-1], replace(self._edited.bodies[-1], surface=surface))
        return self._renderer.render_scene(replace(self._edited, bodies=bodies))
