"""The edit brought back into the photograph: everything that it does not reach stays as it was taken.

`layers.render_layers` renders the scene with and without the edit. `into_photo` lays the change on the photo: under the
same light it adds their difference and dims what the fit missed (`_same_light`), under another light it multiplies by
their ratio.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import cv2
import numpy as np

from materialist import metrics
from materialist.edits.composite.base import base_scene, base_without_shadow
from materialist.edits.composite.into_photo import into_photo
from materialist.edits.composite.layers import render_layers
from materialist.edits.core.notes import PICTURED, is_pictured, warned
from materialist.edits.core.renderer import EditRenderer, RenderOptions, denoised, rendered
from materialist.edits.core.surfaces import dimmed_emitters
from materialist.errors import InputError
from materialist.io.out.colours import photo_colours
from materialist.io.out.depth import is_deep
from materialist.io.out.exif import copied_exif
from materialist.options import PATHS
from materialist.spelling import spelled
from materialist.types import Array, Scene

Upscale = Callable[[Array], Array]
"""upscale(picture [H, W, 3] linear) -> a larger one, linear."""
NARROWED = "The photo's file has another colour space than sRGB; the saved scene, and pictures made of it, have sRGB."
RERENDERED = 64
"""Paths a pixel of the re-rendering of an edited scene that is kept."""


@spelled
def composite(
    scene: Scene,
    edited: Scene,
    *,
    spp: int = PATHS,
    seed: int = 0,
    full_render: bool = False,
    denoise: bool = True,
    upscale: Upscale | None = None,
    device: str = "auto",
    progress=None,
) -> Array:
    """The photograph with the edit in it: [H0, W0, 3] float32 linear, at the photo's native size.

    Bit for bit the photo's own values where the edit does not reach, everywhere if it changes nothing; HDR stays HDR.

    Args:
        scene: the fitted scene; its photo is what stays. edited: the same scene after `edit`, `relight`, ...
        spp: paths per pixel, of each of the two renderings.
        full_render: the plain rendering of the edited scene [H, W, 3], as in the paper, and no photo.
        denoise: clean the renderings before they are compared (where the denoiser is installed).
        upscale: with `full_render`, a super-resolution of yours that enlarges the rendering, by as much as it does
            (paper, appendix Post-Processing with Super-Resolution). The composite has the photo's own detail instead.

    Raises InputError for `upscale` without `full_render`, or a result of it that is no larger picture; for
    `full_render` of glass of the two-interface model, which only the photo shows.
    """
    options = RenderOptions(spp, seed, denoise, device, progress)
    return _Compositor(scene, options, full_render, upscale).picture(edited, last=True)


def composite_in_place(
    scene: Scene,
    edited: Scene,
    options: RenderOptions,
    *,
    full_render: bool = False,
    upscale: Upscale | None = None,
) -> Array:
    """`composite`, which may write over the edited scene's own photo, to save memory."""
    compositor = _Compositor(scene, options, full_render, upscale)
    return compositor.picture(edited, last=True, spent=True)


def pictures(
    scene: Scene,
    edits: Iterable[Scene],
    *,
    spp: int = PATHS,
    seed: int = 0,
    full_render: bool = False,
    denoise: bool = True,
    upscale: Upscale | None = None,
    device: str = "auto",
    progress=None,
    count: int | None = None,
) -> Iterator[Array]:
    """[H0, W0, 3] each: composites of many edits of one scene, as `composite`; what they share is rendered once.

    An edit that is the same object as the one before it, as of a thing at rest, gives the same picture again.
    count: how many there are, for `progress`, where `edits` is no list. One is held at a time.
    """
    # One compositor for all: the base is rendered once.
    options = RenderOptions(spp, seed, denoise, device)
    compositor = _Compositor(scene, options, full_render, upscale)
    tick = progress or (lambda *_: None)
    total = len(edits) if isinstance(edits, Sequence) else count or 0
    before: Scene | None = None
    picture = scene.photo.original
    for k, edited in enumerate(edits):
        tick("frames", k, total)
        if edited is not before:
            picture = compositor.picture(edited)
        before = edited
        yield picture
    tick("frames", total, total)


class _Compositor:
    """Pictures of edits of one scene; what several edits are compared with is rendered once."""

    def __init__(
        self, scene: Scene, options: RenderOptions, full_render: bool, upscale: Upscale | None
    ):
        if upscale is not None and not full_render:
            raise InputError(
                "upscale goes with full_render=True; the composite has the photo's native size already."
            )
        self._scene = scene
        self._options = options
        self._full_render = full_render
        self._upscale = upscale
        self._last: Scene | None = None
        self._renderer: EditRenderer | None = None

    def picture(self, edited: Scene, *, last: bool = False, spent: bool = False) -> Array:
        """[H0, W0, 3] the edit in the photo; [H, W, 3] its plain rendering, or that enlarged.

        last: no other picture follows. spent: the edited scene's own photo is not needed any more.
        """
        options = self._options
        renderer = self._base(edited, spent)
        if self._full_render:
            return self._plain(renderer, edited)
        # The difference of two renderings, laid on the photo, with in-photo emitters that it dims.
        layers = render_layers(renderer, edited, options)
        dimmed = dimmed_emitters(self._scene, edited)
        lights = (renderer.emitter_pixels(edited), dimmed) if dimmed else None
        if last:
            from materialist.render.variant import give_back

            give_back()  # before what takes most memory
        photo = renderer.scene.photo
        once = last and photo is not self._scene.photo and photo is not edited.photo
        return into_photo(photo, layers, lights, options.progress, once=once)

    def _base(self, edited: Scene, spent: bool) -> EditRenderer:
        """The renderer of what the edit is compared with."""
        last = self._last
        self._last = edited
        if self._renderer is None or last is None or not _same_base(self._scene, last, edited):
            # As in the paper, a plain rendering needs no photo without the object's shadow.
            if self._full_render:
                base = base_scene(self._scene, edited)
            else:
                base = base_without_shadow(self._scene, edited, self._options, spent=spent)
            self._renderer = EditRenderer(base, device=self._options.device)
        return self._renderer

    def _plain(self, renderer: EditRenderer, edited: Scene) -> Array:
        """[H, W, 3] the plain rendering, as in the paper; larger with `upscale`."""
        options = self._options
        if is_pictured(edited):
            raise InputError(
                f"{PICTURED}a full rendering would not show it; take the closed model, or the composite."
            )
        picture = renderer.pair(edited)[1](options.spp, options.seed)
        if options.denoise:
            picture = denoised(picture, *renderer.guides(edited))
        return picture if self._upscale is None else _enlarged(picture, self._upscale)


def _same_base(scene: Scene, first: Scene, second: Scene) -> bool:
    """Whether two edits are compared with the same base, which then is rendered once."""
    if first.photo is not second.photo:
        return False
    if dimmed_emitters(scene, first) != dimmed_emitters(scene, second):
        return False
    # A photo of its own shows what a removal disoccludes: then maps and geometry count, too.
    return first.photo is scene.photo or (
        first.geometry is second.geometry and first.materials is second.materials
    )


def _enlarged(picture: Array, upscale: Upscale) -> Array:
    """The picture [H, W, 3] as a super-resolution makes it; values below 0 are 0. Raises InputError."""
    try:
        large = np.asarray(upscale(picture), np.float32)
    except Exception as error:  # whatever a user's function raises
        raise InputError(f"upscale failed: {type(error).__name__}: {error}.") from error
    larger = (
        large.ndim == 3
        and large.shape[2] == 3
        and min(np.subtract(large.shape, picture.shape)) >= 0
    )
    if not larger or not np.isfinite(large).all():
        raise InputError(
            f"upscale gave {large.shape} for {picture.shape}; return a larger picture, finite and linear."
        )
    return np.maximum(large, 0)


def developed(
    scene: Scene, edited: Scene, picture: Array, *, seed: int = 0, device: str = "auto"
) -> Scene:
    """The edited scene as a scene of its own: its photo is the composite [H0, W0, 3], its re-rendering one of itself.

    Edits of it start there.
    """
    # --- The composite as a photo of its own ---
    size = (scene.camera.width, scene.camera.height)
    same = picture.shape[:2] == size[::-1]
    linear = (
        picture if same else np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
    )
    photo = replace(
        scene.photo,
        linear=linear.astype(np.float32),
        original=picture,
        source=None,
        deep=is_deep(scene.photo),
        exif=copied_exif(scene.photo).tobytes(),
    )
    # --- Its re-rendering, and how well that agrees ---
    again = rendered(edited, spp=RERENDERED, seed=seed, device=device)
    figures = {"rerender_psnr_path": metrics.psnr(again, photo.linear)}
    figures["rerender_ssim_path"] = metrics.ssim(again, photo.linear)
    stage = {
        "name": "edit",
        "edits": edited.provenance.get("edits", []),
        "bodies": len(edited.bodies),
    }
    old = edited.report
    report = replace(old, stages=(*old.stages, stage), metrics={**old.metrics, **figures})
    saved = replace(edited, photo=photo, rerender=again, report=report)
    return saved if photo_colours(scene.photo).space is None else warned(saved, NARROWED)
