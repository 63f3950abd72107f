"""The base and the edited picture, rendered with the same random numbers, and what truly differs between them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from materialist.edits.composite.fireflies import without_fireflies
from materialist.edits.composite.native_layer import NativeLayer, native_layer
from materialist.edits.core.region import body_coverage
from materialist.edits.core.renderer import EditRenderer, Render, denoised, is_relit
from materialist.errors import InputError
from materialist.types import Array, Scene

FAR = 1e3
"""Beyond any logarithm: pixels that are not asked."""
DARKEST = 0.02
"""Added to albedo before its logarithm is taken."""
PATTERNED, AT_RIM = (0.3, 0.8), 2
"""Contrast of albedo (logarithms) within so many pixels: none of a pattern, and certainly of one."""


@dataclass(frozen=True)
class Layers:
    """Two renderings at working size and their cleaned difference."""

    base: Array
    """[H, W, 3] float32 linear: the fitted scene."""
    edited: Array
    """[H, W, 3] float32 linear: the edited scene; exactly `base` where the edit does not reach."""
    reached: Array
    """[H, W] bool: pixels that the edit changes by more than the noise."""
    changed: Array
    """[H, W] bool: pixels whose own surface, or what stands there, the edit replaced; part of `reached`."""
    raw: Array
    """[H, W, 3] float32 linear: the edited scene as rendered, noise and all (the paper's plain output)."""
    relit: bool = False
    """Whether the light is another one."""
    native: NativeLayer | None = None
    """New bodies at native size, which stand before all this; the maps above are unfit for use under them."""
    covered: Array | None = None
    """[H, W] bool: glass in place of a surface of the photo: the rendering alone is seen; part of `changed`."""
    held: Array | None = None
    """[H, W] in [0, 1]: how much of what the photo has beyond the fit stays; None for all of it."""


def render_layers(
    renderer: EditRenderer, edited: Scene, *, spp: int = 256, seed: int = 0, clean: bool = True, progress=None
) -> Layers:
    """Render a fitted scene and an edit of it, and separate the edit from the noise.

    `spp` counts paths a pixel. Both pictures come in two halves with different seeds: what the halves disagree on is
    noise. See `difference`.
    """
    scene = renderer.scene
    base, other = renderer.pair(edited)
    relit = is_relit(scene, edited)
    changed = changed_pixels(scene, edited)
    guides = (scene.materials.albedo, edited.materials.albedo, scene.normal, edited.normal)
    alone, covered = None, None
    if (scene.bodies, scene.lamps) != (edited.bodies, edited.lamps) or (relit and edited.lamps):
        alone = native_layer(renderer, edited, spp=spp, seed=seed, clean=clean)
        anything = renderer.covered(edited)
        covered = anything if alone is None else anything & (alone.inside == 0)
        changed = changed | covered
        covered = covered & ~renderer.emitter_pixels(edited)  # `emitters.in_photo` lays them on the photo
        if clean:
            albedo, normal = renderer.body_guides(edited, anything)
            guides = (guides[0], albedo, guides[2], normal)
    layers = difference(
        base, other, changed, guides, spp=spp, seed=seed, clean=clean, progress=progress, focused=focused(edited),
    )  # fmt: skip
    held = texture_held(scene.materials.albedo, edited.materials.albedo)
    return replace(layers, relit=relit, native=alone, covered=covered, held=held)


def texture_held(albedo: Array, edited: Array) -> Array:
    """[H, W] float32 in [0, 1]: the part of the contrast of an albedo [H, W, 3] that is left where an edit changes it.

    What the photo has there beyond the fit is the rim of a pattern, which goes with it. 1 where there was none.
    """
    own = (albedo != edited).any(-1)
    held = np.ones(own.shape, np.float32)
    if not own.any():
        return held
    box = tuple(slice(v.min(), v.max() + 1) for v in (np.flatnonzero(own.any(1)), np.flatnonzero(own.any(0))))
    albedo, edited, own = albedo[box], edited[box], own[box]
    level = albedo[own].mean() / max(float(edited[own].mean()), 1e-3)  # a darker pattern is one all the same
    before, after = (_contrast(np.log(v + DARKEST).mean(-1), own) for v in (albedo, level * edited))
    patterned = np.clip((before - PATTERNED[0]) / (PATTERNED[1] - PATTERNED[0]), 0, 1)
    left = np.clip(after / np.maximum(before, 1e-6), 0, 1)
    held[box] = np.where(own, 1 - patterned * (1 - left), 1)
    return held


def _contrast(values: Array, own: Array) -> Array:
    """[H, W] largest difference of values [H, W] nearby, among the pixels `own` [H, W] bool."""
    import cv2

    window = np.ones((2 * AT_RIM + 1,) * 2, np.uint8)
    high, low = (np.where(own, values, far).astype(np.float32) for far in (-FAR, FAR))
    return np.maximum(np.asarray(cv2.dilate(high, window)) - np.asarray(cv2.erode(low, window)), 0)


def focused(scene: Scene) -> bool:
    """Whether small lights of the scene's own stand beside glass, through which no path can aim at them."""
    from materialist.render.bodies import is_glowing, is_transparent

    lit = bool(scene.lamps) or any(is_glowing(body.surface) for body in scene.bodies)
    return lit and any(is_transparent(body.surface) for body in scene.bodies)


def changed_pixels(scene: Scene, edited: Scene) -> Array:
    """[H, W] bool: where the maps or the depth of the two scenes differ; everywhere under another light."""
    a, b = scene.materials, edited.materials
    changed = (a.albedo != b.albedo).any(-1) | (a.roughness != b.roughness) | (a.metallic != b.metallic)
    changed = (changed & (scene.depth > 0)) | (scene.depth != edited.depth)
    if changed.any() and scene.bodies and scene.bodies == edited.bodies[: len(scene.bodies)]:
        changed &= body_coverage(scene) < 1  # a body hides the surface before and after
    return changed | is_relit(scene, edited)


def difference(
    base: Render, edited: Render, changed: Array, guides: tuple[Array, ...], *, spp: int, seed: int,
    clean: bool = True, progress=None, focused: bool = False,
) -> Layers:  # fmt: skip
    """Layers of any two renderings of one view.

    Outside `changed` the edit arrives by way of a few paths only, and their noise would dust the whole photo. There
    the difference counts where its mean over a neighbourhood stands out from what two half renderings disagree on
    (a shrinkage by the estimated noise, as of Wiener), and is exactly zero where no path differs.

    Args:
        changed: [H, W] bool: pixels that the edit replaces.
        guides: albedo [H, W, 3] of the base and of the edited scene, normal [H, W, 3] of the base and, if it is
            another one, of the edited scene.
        clean: denoise both pictures before they are compared, where the denoiser is installed.
        focused: whether small lights stand beside glass, so that lone bright pixels are what lights the rest.
    """
    if spp < 2:
        raise InputError(f"spp is {spp}; a composite needs at least 2 samples per pixel.")
    tick = progress or (lambda *_: None)
    halves = []
    for k in range(2):
        pair = []
        for j, render in enumerate((base, edited)):
            tick("render", 2 * k + j, 4)
            pair.append(render(-(-spp // 2), 2 * seed + k))
        halves.append(pair)
    tick("render", 4, 4)
    (b0, e0), (b1, e1) = halves
    b, e = (b0 + b1) / 2, (e0 + e1) / 2
    differs = ((e0 != b0) | (e1 != b1)).any(-1)  # [H, W]
    raw = e
    if not differs.any():
        return Layers(b, b, differs, changed & differs, raw)
    gain = np.where(changed, 1, significance(e0 - b0, e1 - b1)).astype(np.float32)
    if clean:
        b = denoised(b, guides[0], guides[2])
        e = denoised(without_fireflies(e, changed, spread=focused), guides[1], guides[-1])
    reached = differs & (gain > 0)
    e = np.where(reached[..., None], b + (e - b) * gain[..., None], b)
    return Layers(b, e, reached, changed & reached, raw)


def significance(d0: Array, d1: Array, *, window: int = 9, sigmas: float = 3.0) -> Array:
    """[H, W] in [0, 1]: how far the mean of a difference over a window stands out from its noise.

    d0, d1: [H, W, 3] the difference in two independent half renderings. With m the mean of (d0 + d1) / 2 over the
    window and s its standard error, from (d0 - d1) / 2, the gain is max(0, 1 - (sigmas s / m)^2), the positive part
    of a Wiener filter; a gain below 1/4 is 0, so that nothing is left of mere noise. It is the larger one of the sum of
    the channels, where a change is seen first, and of the three together, among which another hue cancels in the sum.
    """
    import cv2

    box = lambda v: cv2.blur(np.ascontiguousarray(v, np.float64), (window, window), borderType=cv2.BORDER_REFLECT)  # noqa: E731
    gain = np.zeros(d0.shape[:2])
    for first, second in ((d0, d1), (d0.sum(-1, keepdims=True), d1.sum(-1, keepdims=True))):
        m2, variance = np.zeros(gain.shape), np.zeros(gain.shape)
        for k in range(first.shape[-1]):
            m2 += box((first[..., k] + second[..., k]) / 2) ** 2
            variance += box(((first[..., k] - second[..., k]) / 2) ** 2) / window**2
        gain = np.maximum(gain, 1 - sigmas**2 * variance / np.maximum(m2, 1e-30))
    return np.where(gain > 0.25, np.clip(gain, 0, 1), 0).astype(np.float32)
