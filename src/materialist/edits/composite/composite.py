"""The edit brought back into the photograph: everything it does not reach stays as it was taken."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from materialist.edits.composite.emitters import in_photo
from materialist.edits.composite.layers import Layers, render_layers
from materialist.edits.composite.native_layer import NativeLayer
from materialist.edits.composite.revealed import revealed
from materialist.edits.composite.upsample import GuidedUpsample, matte, strips, window
from materialist.edits.core.emitters import base_of, dimmed_emitters
from materialist.edits.core.notes import PICTURED, is_pictured
from materialist.edits.core.renderer import EditRenderer, denoised, rendered
from materialist.errors import InputError
from materialist.types import Array, Photo, Scene

Upscale = Callable[[Array, tuple[int, int]], Array]
"""upscale(picture [H, W, 3] linear, (H0, W0)) -> [H0, W0, 3] linear."""
FLOOR = 0.02
"""Radiance added to both sides of edited / base: below it a ratio says nothing."""
RIM = 4.0
"""Working pixels under the outline of a new body to which the change beside it goes on: what enlarging looks up."""
MOST = 1.0
"""Largest factor on what the photo has and the fit has not, under the same light."""
THREADS = 4
"""Strips of a large photo that are made at a time, of about 0.2 GB each."""
RERENDERED = 36
"""Camera rays a pixel of the re-rendering of an edited scene that is kept."""
MOST_DETAIL = 2.0
"""Largest factor on the photo's detail beyond working size, under another light."""
BELIEVED, SHADE_FADE = 2.0, 2.0
"""Photo over fit from which added light is not believed, and by which power of what is beyond it fades."""
WILD, EVEN, NEARBY = (2.0, 4.0), 0.02, 9
"""Roughness of the fit over that of the photo, at least EVEN (logarithms per pixel, over NEARBY of them), at which it
begins to be not believed under another light, and is not at all."""
LIGHT_FADE = 12.0
"""How fast the fit's error goes when the light changes."""


def composite(
    scene: Scene,
    edited: Scene,
    *,
    spp: int = 256,
    seed: int = 0,
    full_render: bool = False,
    denoise: bool = True,
    upscale: Upscale | None = None,
    device: str = "auto",
    progress=None,
) -> Array:
    """The photograph with the edit in it.

    Args:
        scene: the fitted scene; its photo is what stays.
        edited: the same scene after `edit`, `relight`, ...
        spp: paths per pixel, of each of the two renderings.
        full_render: the plain rendering of the edited scene at working size, as in the paper, and no photo.
        denoise: clean the renderings before they are compared (where the denoiser is installed).
        upscale: with `full_render`, a super-resolution of yours that brings the rendering to the photo's native size
            (paper, appendix Post-Processing with Super-Resolution). The composite has the photo's own detail instead.

    Returns:
        [H0, W0, 3] float32 linear, at the photo's native size; bit for bit the photo's own values where the edit does
        not reach, everywhere if it changes nothing. HDR photos stay HDR. With `full_render` [H, W, 3], or [H0, W0, 3]
        with `upscale` as well.

    Raises:
        InputError: `upscale` without `full_render`, or a result of it that is not a picture of native size;
            `full_render` of glass of the two-interface model, which only the photo shows.
    """
    if upscale is not None and not full_render:
        raise InputError("upscale goes with full_render=True; the composite has the photo's native size already.")
    _check_rendered(edited, full_render)
    lights = dimmed_emitters(scene, edited)
    scene = base_of(scene, edited)
    renderer = EditRenderer(scene, device=device)
    if full_render:
        picture = plain(renderer, edited, spp=spp, seed=seed, denoise=denoise)
        return picture if upscale is None else _upscaled(picture, scene.photo.original.shape, upscale)
    layers = render_layers(renderer, edited, spp=spp, seed=seed, clean=denoise, progress=progress)
    return _finished(renderer, edited, layers, lights, spp=spp, seed=seed, clean=denoise)


def pictures(
    scene: Scene, edits: Iterable[Scene], *, spp: int = 64, seed: int = 0, full_render: bool = False,
    denoise: bool = True, device: str = "auto", progress=None, count: int | None = None,
) -> Iterator[Array]:  # fmt: skip
    """[H0, W0, 3] each: composites of many edits of one scene, as `composite`; what they share is rendered once.

    An edit that is the same object as the one before it, as of a thing at rest, gives the same picture again.
    count: how many there are, for `progress`, where `edits` is no list. One is held at a time.
    """
    tick = progress or (lambda *_: None)
    total = len(edits) if isinstance(edits, Sequence) else count or 0
    renderer, lights = EditRenderer(scene, device=device), None
    before: Scene | None = None
    picture = scene.photo.original
    for k, edited in enumerate(edits):
        tick("frames", k, total)
        if edited is before:
            yield picture
            continue
        before = edited
        _check_rendered(edited, full_render)
        found = dimmed_emitters(scene, edited)
        if found != lights:  # frames of one film share their lights, and so their base picture
            renderer, lights = EditRenderer(base_of(scene, edited), device=device), found
        if full_render:
            picture = plain(renderer, edited, spp=spp, seed=seed, denoise=denoise)
        else:
            layers = render_layers(renderer, edited, spp=spp, seed=seed, clean=denoise)
            picture = _finished(renderer, edited, layers, lights, spp=spp, seed=seed, clean=denoise)
        yield picture
    tick("frames", total, total)


def _finished(renderer: EditRenderer, edited: Scene, layers: Layers, lights: dict | None, **options) -> Array:
    """[H0, W0, 3] the composite of layers; `lights`: what was found of the photo's lights where these were dimmed."""
    photo, layers = revealed(renderer, edited, layers, **options)
    picture = into_photo(photo, layers)
    if not lights:
        return picture
    before = None if layers.native is None else layers.native.share
    return in_photo(picture, photo, renderer.emitter_pixels(edited), lights, before)


def _check_rendered(edited: Scene, full_render: bool) -> None:
    if full_render and is_pictured(edited):
        raise InputError(f"{PICTURED}a full rendering would not show it; take the closed model, or the composite.")


def plain(renderer: EditRenderer, edited: Scene, *, spp: int, seed: int = 0, denoise: bool = True) -> Array:
    """[H, W, 3] the path-traced picture of the edited scene, as in the paper, and nothing of the photo."""
    picture = renderer.pair(edited)[1](spp, seed)
    if not denoise:
        return picture
    albedo, normal = renderer.guides(edited)
    return denoised(picture, albedo, normal)


def _upscaled(picture: Array, shape: tuple[int, ...], upscale: Upscale) -> Array:
    """[H0, W0, 3] what the caller's function makes of a picture."""
    large = np.asarray(upscale(picture, (shape[0], shape[1])), np.float32)
    if large.shape != shape or not np.isfinite(large).all():
        raise InputError(f"upscale gave {large.shape}, not {shape} (finite, linear); resize what it returns.")
    return np.maximum(large, 0)


def into_photo(photo: Photo, layers: Layers) -> Array:
    """[H0, W0, 3] the photo with the difference of two renderings added (see docs/editing.md for the formulas).

    out = photo + change + (factor - 1) (photo - reference), of which `_same_light` and `_other_light` give the three.
    At the border of a replaced surface both sides are mixed by the share that each has in the photo's pixel.
    """
    from scipy import ndimage

    out = photo.original.copy()
    if not layers.reached.any():
        return _in_front(out, layers.native, photo.hdr)
    stack = np.concatenate((_other_light if layers.relit else _same_light)(photo, layers), -1)  # [H, W, 9]
    stack[~layers.reached, :6] = 0
    upsample, native = GuidedUpsample(photo.linear, photo.original), out.shape[:2]
    alpha = matte(layers.changed, photo.original)
    changed, clear = layers.changed, np.ones_like(layers.changed)
    if layers.native is not None:
        clear = layers.native.inside == 0
    if clear.any() and not clear.all():
        # The rim of a body: what light changes beside it goes on under it, where there is nothing to look up.
        away, (row, column) = ndimage.distance_transform_edt(~clear, return_indices=True)
        if layers.relit:
            stack, changed, clear = stack[row, column], changed[row, column], away <= RIM
        else:
            lost = ~clear & (away <= RIM) & ~_looked_up(changed, clear)
            stack = np.where(lost[..., None], stack[row, column], stack)
            clear = clear | lost
    reached = (stack[..., :3] != 0).any(-1)
    if not reached.any():
        return _in_front(out, layers.native, photo.hdr)
    box, columns = window(reached, native, 3)  # nothing of it is seen further away: see `GuidedUpsample`

    def laid(rows: slice) -> None:
        here, share = out[rows, columns], alpha[rows, columns]
        large = np.zeros((*share.shape, stack.shape[-1]), np.float32)
        above = np.zeros_like(here)
        for part, members in ((share, changed & clear), (1 - share, ~changed & clear)):
            where = np.flatnonzero((part > 0).any(0))
            if where.size:
                own = slice(int(where[0]), int(where[-1]) + 1)
                there = slice(columns.start + own.start, columns.start + own.stop)
                side = upsample(stack, members, rows, there)
                large[:, own] += part[:, own, None] * side
                if part is share and not photo.hdr:
                    above[:, own] = _above_white(here[:, own], side, share[:, own, None])
        change, excess, reference = large[..., :3], large[..., 3:6], large[..., 6:]
        held = here if photo.hdr or layers.relit else _unclipped(here, reference)
        moved = np.maximum(held + change + excess * (held - reference) - above, 0)
        out[rows, columns] = np.where((change != 0).any(-1, keepdims=True), moved, here)

    with ThreadPoolExecutor(min(THREADS, os.cpu_count() or 1)) as threads:
        list(threads.map(laid, strips(box.stop, start=box.start)))
    return _in_front(out, layers.native, photo.hdr)


def _above_white(photo: Array, side: Array, share: Array) -> Array:
    """[h, w, 3] what a mixed pixel would have too much of a surface brighter than white: white is what is mixed in, as
    a photo's pixels would be enlarged, lest a few hundredths of a highlight fill it."""
    change, excess, reference = side[..., :3], side[..., 3:6], side[..., 6:]
    own = photo + change + excess * (photo - reference)
    return np.where((share > 0) & (share < 1), share * np.maximum(own - np.maximum(photo, 1), 0), 0)


def _looked_up(changed: Array, clear: Array) -> Array:
    """[H, W] bool: where a `clear` pixel on the same side of `changed` [H, W] bool is near enough to be enlarged."""
    import cv2

    kernel = np.ones((3, 3), np.uint8)
    near = [cv2.dilate((clear & side).astype(np.uint8), kernel) > 0 for side in (changed, ~changed)]
    return np.where(changed, *near)


def _in_front(picture: Array, native: NativeLayer | None, hdr: bool) -> Array:
    """[H0, W0, 3] with new bodies before it: they are the rendering alone, and hide the photo by their share.

    At the rim of what is brighter than an ordinary photo's white, white is mixed in, as a photo's pixels would be
    enlarged: a few hundredths of a lamp's radiance would fill a pixel, and its outline would be ragged.
    """
    if native is None:
        return picture
    share = native.share[..., None]
    own = native.picture if hdr else np.where(share < 1, np.minimum(native.picture, 1), native.picture)
    return np.where(share > 0, share * own + (1 - share) * picture, picture).astype(np.float32)


def onto_working(photo: Photo, layers: Layers) -> Array:
    """[H, W, 3] the same at working size, where there is nothing to enlarge; borders as hard as the mask.

    A fraction of the time of `into_photo`: for pictures while a slider moves.
    """
    change, excess, reference = (_other_light if layers.relit else _same_light)(photo, layers)
    held = photo.linear if photo.hdr or layers.relit else _unclipped(photo.linear, reference)
    moved = np.maximum(held + change + excess * (held - reference), 0)
    return np.where(layers.reached[..., None], moved, photo.linear)


def _same_light(photo: Photo, layers: Layers) -> tuple[Array, Array, Array]:
    """(change, factor - 1, reference), [H, W, 3] each: out = edited + factor (photo - base).

    What the photo has and the fit has not is mostly texture that the albedo lacks: it dims as the surface does,
    factor = edited / base, and does not grow (a ratio above 1 is taken as 1). Where an edit takes a pattern away
    (`layers.held`), what the photo has at its rim goes, too.

    Beside what was edited, light that is added to what the fit has far too dark is not believed: there the fit has
    shade that the photo has not, and takes it away from a material that made up for it.
    """
    factor = np.minimum((layers.edited + FLOOR) / (layers.base + FLOOR), MOST)
    if layers.held is not None:
        factor = factor * layers.held[..., None]
    change = layers.edited - layers.base
    dark = np.log((photo.linear.mean(-1) + FLOOR) / (layers.base.mean(-1) + FLOOR)) - np.log(BELIEVED)
    faded = np.where(layers.changed, 1, np.exp(-SHADE_FADE * np.maximum(dark, 0)))[..., None]
    return np.where(change > 0, faded * change, change).astype(np.float32), factor - 1, layers.base


def _other_light(photo: Photo, layers: Layers) -> tuple[Array, Array, Array]:
    """The same for another light: out = edited + factor (photo - small) + kept (small - base), small the photo at
    working size.

    Beyond working size the photo has texture, which goes with the light: factor = edited / base. At working size the
    fit's error is mostly shading, which belongs to the old light: it is kept as far as the new light is the old one
    but for a constant g per channel, kept = g exp(-LIGHT_FADE |ln(edited / base) - ln g|), averaged nearby.
    """
    import cv2

    base, edited = _calmed(photo, layers)
    ratio = np.log((edited + FLOOR) / (base + FLOOR))
    overall = np.median(ratio.reshape(-1, 3), axis=0)
    window = max(3, max(ratio.shape[:2]) // 8)
    away = cv2.blur(np.abs(ratio - overall), (window, window), borderType=cv2.BORDER_REFLECT)
    kept = np.exp(overall - LIGHT_FADE * away)
    held = photo.linear if photo.hdr else _unclipped(photo.linear, base)
    change = edited + kept * (held - base) - photo.linear
    return change, np.minimum(np.exp(ratio), MOST_DETAIL) - 1, photo.linear


def _calmed(photo: Photo, layers: Layers) -> tuple[Array, Array]:
    """[H, W, 3] twice: both renderings where the fit is no rougher than the photo. Where it is, normals and shine are
    wrong, and another light makes it worse: there the photo stands for the fit, changed as its surroundings are.

    What is beyond the photo's white is as flat in both.
    """
    from materialist.geometry.membrane import membrane

    as_seen = layers.base if photo.hdr else np.minimum(layers.base, 1)
    seen, fit = (_roughness(np.log(np.maximum(v, 0) + FLOOR).mean(-1)) for v in (photo.linear, as_seen))
    wild = np.clip((fit - WILD[0] * np.maximum(seen, EVEN)) / ((WILD[1] - WILD[0]) * np.maximum(seen, EVEN)), 0, 1)
    if layers.replaced is not None:
        wild = np.where(layers.replaced, 0, wild)  # what is another surface now looks as it is rendered
    if not (wild > 0).any() or (wild > 0.5).all():
        return layers.base, layers.edited
    ratio = np.log((np.maximum(layers.edited, 0) + FLOOR) / (np.maximum(layers.base, 0) + FLOOR))
    ratio = membrane(ratio, wild < 0.5)
    wild = wild[..., None].astype(np.float32)
    changed = np.maximum((photo.linear + FLOOR) * np.exp(ratio) - FLOOR, 0)
    return wild * photo.linear + (1 - wild) * layers.base, wild * changed + (1 - wild) * layers.edited


def _roughness(values: Array) -> Array:
    """[H, W] mean difference of neighbours nearby."""
    import cv2

    steps = sum(np.abs(np.diff(values, axis=k, append=np.take(values, [-1], k))) for k in (0, 1))
    return np.asarray(cv2.blur(np.ascontiguousarray(steps, np.float32), (NEARBY, NEARBY)))


def developed(scene: Scene, edited: Scene, picture: Array, *, seed: int = 0, device: str = "auto") -> Scene:
    """The edited scene as a scene of its own: its photo is the composite [H0, W0, 3], its re-rendering one of itself.

    Edits of it start there.
    """
    from dataclasses import replace

    import cv2

    from materialist import metrics
    from materialist.edits.composite.output import is_deep

    camera = scene.camera
    size = (camera.width, camera.height)
    same = picture.shape[:2] == size[::-1]
    linear = picture if same else np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
    photo = replace(
        scene.photo, linear=linear.astype(np.float32), original=picture, source=None, deep=is_deep(scene.photo)
    )
    again = rendered(edited, spp=RERENDERED, seed=seed, device=device)
    figures = {"rerender_psnr_path": metrics.psnr(again, photo.linear)}
    figures["rerender_ssim_path"] = metrics.ssim(again, photo.linear)
    stage = {"name": "edit", "edits": edited.provenance.get("edits", []), "bodies": len(edited.bodies)}
    old = edited.report
    report = replace(old, stages=(*old.stages, stage), metrics={**old.metrics, **figures})
    return replace(edited, photo=photo, rerender=again, report=report)


def _unclipped(photo: Array, base: Array) -> Array:
    """A channel at the photo's white is a lower bound: where the fit says more, its value is taken."""
    return np.where(photo >= 0.995, np.maximum(photo, base), photo)
