"""The base and the edited picture, rendered with the same random numbers, and what truly differs between them."""

from dataclasses import dataclass, replace
from itertools import count

import cv2
import numpy as np
from scipy.ndimage import rank_filter
from skimage.morphology import remove_small_objects

from materialist.color import linear_to_srgb, luminance
from materialist.edits.composite.native_layer import NativeLayer, native_layer
from materialist.edits.composite.rims import settled
from materialist.edits.core.region import body_coverage
from materialist.edits.core.renderer import (
    EditRenderer,
    Render,
    RenderOptions,
    denoised,
    is_relit,
    same_shapes,
)
from materialist.errors import InputError
from materialist.geometry.membrane import nearest
from materialist.geometry.silhouette import grown, window
from materialist.types import Array, Scene


@dataclass(frozen=True)
class LayerSettings:
    """What counts as a difference, and as a firefly; tuned by eye unless derived."""

    # Probing: few paths on a lattice of pixels find out where the edit reaches.
    probe_divisor: int = 16  # one in so many of all paths probes, in each half
    min_probe_paths: int = 8  # of each half, below 144 paths; at 16 paths all of them
    lattice: int = 256  # pixels along the longer side that probe

    # What counts as a difference.
    window: int = 9  # pixels across, over which it is measured; larger sees fainter light
    min_change: float = 1 / 255  # of an sRGB-encoded channel; derived: a level of 8 bits
    min_sigmas: float = 3.0  # standard errors that it must exceed; derived: 1 in 400 by chance
    min_gain: float = 0.25  # below it a difference is none
    denoiser_margin: int = 16  # pixels around it that the denoiser sees
    min_rays: int = 4  # of a probed pixel that pass the new bodies; with fewer its neighbour counts

    # Fireflies.
    min_firefly: float = 1.0  # radiance; below white a sparkle does no harm; derived
    firefly_ratio: float = 3.0  # to the second brightest of the eight neighbours


SETTINGS = LayerSettings()


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
    relit: bool = False
    """Whether the light is another one."""
    native: NativeLayer | None = None
    """New bodies at native size, which stand before all this; under them the maps above go on from what is beside."""
    diffuse: Array | None = None
    """[H, W] in [0, 1]: what new metal leaves of the diffuse light, in which the photo's own texture is; None: all."""
    albedos: tuple[Array, Array] | None = None
    """[H, W, 3] albedo (1 - metallic) of the fitted and the edited scene, to which diffuse light is proportional."""
    covered: Array | None = None
    """[H, W] bool: bodies that only one scene has and `native` has not: the rendering alone is seen; in `changed`."""


def render_layers(renderer: EditRenderer, edited: Scene, options: RenderOptions) -> Layers:
    """Render a fitted scene and an edit of it, and separate the edit from the noise.

    Both pictures come in two halves with different seeds: what the halves disagree on is
    noise. See `difference`.
    """
    # --- Both renderings, and the pixels whose surface the edit replaces ---
    scene = renderer.scene
    relit = is_relit(scene, edited)
    changed = changed_pixels(scene, edited)
    if not changed.any() and same_shapes(scene, edited):
        nothing = np.zeros_like(scene.photo.linear)
        return Layers(nothing, nothing, changed, changed)
    guides = [(shown.materials.albedo, shown.normal) for shown in (scene, edited)]

    # --- Bodies and lamps that only one scene has: at native size, with their own outline ---
    alone = None
    covered = None
    if (scene.bodies, scene.lamps) != (edited.bodies, edited.lamps) or (relit and edited.lamps):
        alone = native_layer(renderer, edited, options)
        anything = renderer.covered(edited)
        covered = anything if alone is None else anything & (alone.inside == 0)
        changed = changed | covered
        if options.denoise:
            guides[1] = renderer.guides(edited, covered)
        covered = covered & ~renderer.emitter_pixels(edited)  # `in_photo` lays them on the photo

    # --- Everything else, at working size: what new bodies leave of a pixel lies in their shadow ---
    base, other = renderer.pair(edited, alone.names if alone else ())
    layers = difference(
        base,
        other,
        changed,
        guides if options.denoise else None,
        options,
        hidden=alone.inside if alone else None,
    )
    if relit:
        rendered = settled([layers.base, layers.edited], scene.depth, scene.photo.linear)
        layers = replace(layers, base=rendered[0], edited=rendered[1])
    return replace(
        layers,
        relit=relit,
        native=alone,
        covered=covered,
        diffuse=diffuse_kept(scene, edited),
        albedos=diffuse_albedos(scene, edited),
    )


def diffuse_kept(scene: Scene, edited: Scene) -> Array:
    """[H, W] in [0, 1]: the share of the diffuse lobe that an edit keeps, (1 - M_new) / (1 - M_old), at most 1."""
    old = np.maximum(1 - scene.materials.metallic, 1e-3)
    new = np.maximum(1 - edited.materials.metallic, 1e-3)
    return np.minimum(new / old, 1)


def diffuse_albedos(scene: Scene, edited: Scene) -> tuple[Array, Array]:
    """[H, W, 3] each: `Layers.albedos` of an edit."""
    first, second = (
        shown.materials.albedo * (1 - shown.materials.metallic[..., None])
        for shown in (scene, edited)
    )
    return first, second


def changed_pixels(scene: Scene, edited: Scene) -> Array:
    """[H, W] bool: where the maps or the depth of the two scenes differ; everywhere under another light."""
    a = scene.materials
    b = edited.materials
    changed = (
        (a.albedo != b.albedo).any(-1) | (a.roughness != b.roughness) | (a.metallic != b.metallic)
    )
    changed = (changed & (scene.depth > 0)) | (scene.depth != edited.depth)
    if changed.any() and scene.bodies and scene.bodies == edited.bodies[: len(scene.bodies)]:
        changed &= body_coverage(scene) < 1  # a body hides the surface before and after
    return changed | is_relit(scene, edited)


def difference(
    base: Render,
    edited: Render,
    changed: Array,
    guides: list[tuple[Array, Array]] | None,
    options: RenderOptions,
    *,
    hidden: Array | None = None,
) -> Layers:
    """Layers of any two renderings of one view, 0 where they are not traced.

    Outside `changed` the edit arrives by way of a few paths only, and their noise would dust the whole photo. There
    the difference counts where its mean over a neighbourhood can be seen and stands out from what two half renderings
    disagree on (a shrinkage by the estimated noise, as of Wiener); elsewhere it is exactly zero. Few paths on a lattice
    of pixels find out where that is; the edit is traced there alone.

    Args:
        changed: [H, W] bool: pixels that the edit replaces.
        hidden: [H, W] share of each pixel that neither picture shows; one that is too small has the values of the
            pixel nearest to it.
        guides: albedo and normal [H, W, 3] of the base, and of the edited scene, with which both pictures are denoised
            before they are compared, where the denoiser is installed; None: as they are.
    """
    spp = options.spp
    if spp < 2:
        raise InputError(f"spp is {spp}; a composite needs at least 2 samples per pixel.")
    half = -(-spp // 2)
    probe_paths = min(half, max(SETTINGS.min_probe_paths, spp // SETTINGS.probe_divisor))
    seeds = (2 * options.seed, 2 * options.seed + 1)
    done = count()
    steps = 2 * (1 + (not changed.all()) + (half > probe_paths))
    shown_pixels = np.ones_like(changed)
    if hidden is not None:
        shown_pixels = hidden <= max(0.0, 1 - SETTINGS.min_rays / probe_paths)

    def traced(paths: int, seed: int, of_base: Array, of_edited: Array) -> tuple[Array, Array]:
        options.tick("render", next(done), steps)
        return base(paths, seed, of_base & shown_pixels), edited(
            paths, seed, of_edited & shown_pixels
        )

    # --- Probe: where does the edit reach beyond the pixels that it replaces? ---
    near = changed
    if not changed.all():
        step = max(1, round(max(changed.shape) / SETTINGS.lattice))
        lattice = np.zeros_like(changed)
        lattice[::step, ::step] = True
        few = [p[::step, ::step] for k in seeds for p in traced(probe_paths, k, lattice, lattice)]
        few = _filled(few, shown_pixels[::step, ::step])
        # Parts that chance makes are as large as a window or two.
        large = remove_small_objects(_gain(*few) > 0, max_size=2 * SETTINGS.window**2 // step**2)
        near = (
            changed
            | np.kron(large, np.ones((step, step), bool))[: len(changed), : changed.shape[1]]
        )
    if half > probe_paths:
        near = grown(near, SETTINGS.window)

    # --- Trace both pictures there, in two halves of different seeds ---
    shown = grown(near, SETTINGS.denoiser_margin)
    pairs = []
    for k in seeds:
        probed = traced(probe_paths, k, shown, near)
        pair = [np.where(shown[..., None], picture, 0) for picture in probed]
        if half > probe_paths:
            added = traced(half - probe_paths, k + 2, near, near)
            share = (half - probe_paths) / half * near[..., None]
            pair = [old + share * (new - old) for old, new in zip(pair, added, strict=True)]
        pairs.append([pair[0], np.where(near[..., None], pair[1], pair[0])])
    options.tick("render", steps, steps)

    # --- Hidden pixels have the values of what is shown beside them ---
    pairs = [_filled(pair, shown_pixels) for pair in pairs]

    # --- What the halves agree on is the edit, what they disagree on is noise ---
    (b0, e0), (b1, e1) = pairs
    differs = ((e0 != b0) | (e1 != b1)).any(-1)  # [H, W]
    b = (b0 + b1) / 2
    e = (e0 + e1) / 2
    if not differs.any():
        return Layers(b, b, differs, differs)
    measured = window(near, margin=SETTINGS.window)
    gain = changed.astype(np.float32)
    gain[measured] = np.maximum(
        gain[measured],
        near[measured] * _gain(*(p[measured] for p in (b0, e0, b1, e1))),
    )

    # --- Denoise both, and keep the difference by its gain ---
    if guides is not None:
        box = window(near, margin=SETTINGS.denoiser_margin)
        # Both alike: a sparkle taken from one picture alone would be a dot in their difference.
        for picture, (albedo, normal) in zip((b, e), guides, strict=True):
            noisy = without_fireflies(picture[box])
            picture[box] = denoised(noisy, albedo[box], normal[box])
    reached = differs & (gain > 0)
    e = np.where(reached[..., None], b + (e - b) * gain[..., None], b)
    return Layers(b, e, reached, changed & reached)


def _filled(pictures: list[Array], known: Array) -> list[Array]:
    """The pictures [H, W, 3] with the values of the nearest known [H, W] bool pixel elsewhere."""
    if known.all() or not known.any():
        return pictures
    source = nearest(known)
    return [picture[source] for picture in pictures]


def inner(hidden: Array) -> Array:
    """[H, W] bool: those of the hidden pixels on which nothing beside them depends, as `difference` averages."""
    return ~grown(~hidden, SETTINGS.window)


def _gain(b0: Array, e0: Array, b1: Array, e1: Array) -> Array:
    """[H, W] `significance` of the edit in two halves, 0 where its mean over the window is too small to be seen.

    Fireflies are brought down first, as in what is shown: a few would hide the shadow that they lie in.
    """
    b0, e0, b1, e1 = (without_fireflies(picture) for picture in (b0, e0, b1, e1))
    base = np.maximum(_mean(((b0 + b1) / 2).astype(np.float32)), 0)
    edited = np.maximum(_mean(((e0 + e1) / 2).astype(np.float32)), 0)
    # Above white both are scaled down together: a change there is seen by its share.
    white = np.maximum(np.maximum(base, edited), 1)
    change = np.abs(linear_to_srgb(edited / white) - linear_to_srgb(base / white)).max(-1)
    return np.where(change >= SETTINGS.min_change, significance(e0 - b0, e1 - b1), 0)


def significance(d0: Array, d1: Array) -> Array:
    """[H, W] in [0, 1]: how far the mean of a difference over a window stands out from its noise.

    d0, d1: [H, W, 3] the difference in two independent half renderings. With m the mean of (d0 + d1) / 2 over the
    window and s its standard error, from (d0 - d1) / 2, the gain is max(0, 1 - (min_sigmas s / m)^2), the positive part
    of a Wiener filter; a gain below 1/4 is 0, so that nothing is left of mere noise. It is the larger one of the sum of
    the channels, where a change is seen first, and of the three together, among which another hue cancels in the sum.
    """
    gain = np.zeros(d0.shape[:2])
    for first, second in ((d0, d1), (d0.sum(-1, keepdims=True), d1.sum(-1, keepdims=True))):
        m2 = np.zeros(gain.shape)
        variance = np.zeros(gain.shape)
        for k in range(first.shape[-1]):
            m2 += _mean((first[..., k] + second[..., k]) / 2) ** 2
            variance += _mean(((first[..., k] - second[..., k]) / 2) ** 2) / SETTINGS.window**2
        gain = np.maximum(gain, 1 - SETTINGS.min_sigmas**2 * variance / np.maximum(m2, 1e-30))
    return np.where(gain > SETTINGS.min_gain, np.clip(gain, 0, 1), 0).astype(np.float32)


def _mean(values: Array) -> Array:
    """Means over a window: Gaussian ones, as of a box of `window` pixels, which would show its corners in the gain."""
    return cv2.GaussianBlur(
        values, (0, 0), SETTINGS.window / np.sqrt(4 * np.pi), borderType=cv2.BORDER_REFLECT
    )


def without_fireflies(picture: Array) -> Array:
    """[H, W, 3] linear with lone bright pixels brought down, their colour kept; a highlight of two pixels stays.

    They come from single paths, as where glass focuses small lights.
    """
    light = luminance(picture)
    around = np.ones((3, 3), bool)
    around[1, 1] = False
    # The second brightest neighbour: a highlight of two pixels has one beside it.
    limit = np.maximum(
        SETTINGS.firefly_ratio * rank_filter(light, -2, footprint=around, mode="nearest"),
        SETTINGS.min_firefly,
    )
    fireflies = light > limit
    return (picture * np.where(fireflies, limit / np.maximum(light, 1e-9), 1)[..., None]).astype(
        np.float32
    )
