"""The difference of two renderings, laid on the photo at its native size (docs/editing.md has the formulas)."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from materialist.edits.composite.layers import Layers
from materialist.edits.composite.upsample import GuidedUpsample, matte, strips
from materialist.geometry.membrane import nearest
from materialist.geometry.silhouette import grown, window
from materialist.types import Array, Photo


@dataclass(frozen=True)
class CompositeSettings:
    """How the photo's residual over the fit follows an edit; tuned by eye unless derived."""

    floor: float = 0.02  # radiance added to both sides of edited / base; larger trusts ratios of dark pixels less
    # largest factor on the photo's detail beyond working size under another light
    most_detail: float = 2.0
    # working pixels to either side of a changed surface's border; derived: the matte's reach
    edge: int = 2
    rim: float = 4.0  # working pixels by which the change beside a body goes on under it; derived: upsampling's reach
    white: float = 0.995  # channel of a linear photo from which it is clipped; derived: 8 bits
    # least channel of a pixel of an emitter from which it is clipped; derived: 8 bits
    clipped: float = 0.97
    # least channel from which a pixel of an emitter may be brighter than it looks
    nearly: float = 0.9
    # strips of a large photo that are made at a time, about 0.2 GB each; derived: memory
    threads: int = 4


SETTINGS = CompositeSettings()


def into_photo(photo: Photo, layers: Layers, lights: tuple[Array, dict] | None = None) -> Array:
    """[H0, W0, 3] the photo with the difference of two renderings added.

    out = photo + change + (factor - 1) (photo - reference), of which `_same_light` and `_other_light` give the three.
    At the border of a replaced surface both sides are mixed by the share that each has in the photo's pixel.

    New bodies stand before it: they are the rendering alone, and hide the photo by their share. At the rim of bodies
    brighter than an ordinary photo's white, white is mixed in: a few hundredths of a lamp's radiance would fill a
    pixel, and its outline would be ragged.

    lights: of in-photo emitters that are dimmed: where they are seen, and what is known of them; see `in_photo`.
    """
    picture = _changed(photo, layers) if layers.reached.any() else photo.original.copy()
    if lights is not None:
        picture = in_photo(picture, photo, *lights)
    if layers.native is None:
        return picture
    share = layers.native.share[..., None]
    own = layers.native.picture
    own = own if photo.hdr else np.where(share < 1, np.minimum(own, 1), own)
    return np.where(share > 0, share * own + (1 - share) * picture, picture).astype(np.float32)


def _changed(photo: Photo, layers: Layers) -> Array:
    """[H0, W0, 3] the same without the new bodies."""
    out = photo.original.copy()
    stack = np.concatenate(_terms(photo, layers), -1)  # [H, W, 9]
    stack[~layers.reached, :6] = 0
    upsample = GuidedUpsample(photo.linear, photo.original)
    native = out.shape[:2]
    alpha = matte(layers.changed, photo.original)
    stack, clear = _under_bodies(stack, layers)
    changed = layers.changed
    reached = (stack[..., :3] != 0).any(-1)
    if not reached.any():
        return out
    box, columns = window(reached, native, 3)  # the reach of `GuidedUpsample`
    sides = [
        (stack[nearest(own)] if upsample.same and own.any() else stack * own.any(), own)
        for own in (changed & clear, ~changed & clear)
    ]

    def laid(rows: slice) -> None:
        here = out[rows, columns]
        share = alpha[rows, columns]
        large = np.zeros((*share.shape, stack.shape[-1]), np.float32)
        for part, side in zip((share, 1 - share), sides, strict=True):
            where = np.flatnonzero((part > 0).any(0))
            if where.size:
                own = slice(int(where[0]), int(where[-1]) + 1)
                there = slice(columns.start + own.start, columns.start + own.stop)
                large[:, own] += part[:, own, None] * upsample(*side, rows, there)
        change = large[..., :3]
        excess = large[..., 3:6]
        reference = large[..., 6:]
        held = here if photo.hdr or layers.relit else _unclipped(here, reference)
        moved = np.maximum(held + change + excess * (held - reference), 0)
        out[rows, columns] = np.where((change != 0).any(-1, keepdims=True), moved, here)

    with ThreadPoolExecutor(min(SETTINGS.threads, os.cpu_count() or 1)) as threads:
        list(threads.map(laid, strips(box.stop, start=box.start)))
    return out


def onto_working(photo: Photo, layers: Layers) -> Array:
    """[H, W, 3] the same at working size, where nothing is enlarged; borders as hard as the mask.

    A fraction of the time of `into_photo`: for pictures while a slider moves.
    """
    change, excess, reference = _terms(photo, layers)
    held = photo.linear if photo.hdr or layers.relit else _unclipped(photo.linear, reference)
    moved = np.maximum(held + change + excess * (held - reference), 0)
    return np.where(layers.reached[..., None], moved, photo.linear)


def _terms(photo: Photo, layers: Layers) -> tuple[Array, Array, Array]:
    """(change, factor - 1, reference), [H, W, 3] each."""
    change, excess, reference = (_other_light if layers.relit else _same_light)(photo, layers)
    if layers.covered is not None:
        # A body in place of the photo's surface: the rendering alone is seen, and no residual of the photo.
        own = layers.covered[..., None]
        change = np.where(own, layers.edited - reference, change)
        excess = np.where(own, -1, excess)
    if not (photo.hdr or layers.relit):
        # As with the rim of bodies: where a surface ends, white is mixed in, not what outshines it.
        edge = grown(layers.changed, SETTINGS.edge) & grown(~layers.changed, SETTINGS.edge)
        change = np.where(edge[..., None], np.minimum(change, np.maximum(1 - reference, 0)), change)
    return change.astype(np.float32), excess.astype(np.float32), reference


def _same_light(photo: Photo, layers: Layers) -> tuple[Array, Array, Array]:
    """out = edited + factor (photo - base).

    The residual of the photo over the fit is mostly texture that the albedo lacks: it dims as the surface does,
    factor = edited / base, and does not grow (a ratio above 1 is taken as 1). New metal hides it.
    """
    factor = np.minimum((layers.edited + SETTINGS.floor) / (layers.base + SETTINGS.floor), 1)
    if layers.diffuse is not None:
        factor = factor * layers.diffuse[..., None]
    return layers.edited - layers.base, factor - 1, layers.base


def _other_light(photo: Photo, layers: Layers) -> tuple[Array, Array, Array]:
    """out = photo factor, factor = edited / base, kept between `edited` and g photo, g the factor's median per channel.

    What the fit leaves unexplained is mostly texture, which goes with the light as the surface does. Highlights and
    shadows that the fit has elsewhere than the photo are not: without the bounds they would print their negative.
    """
    base = np.maximum(layers.base, 0)
    edited = np.maximum(layers.edited, 0)
    floor = SETTINGS.floor
    factor = (edited + floor) / (base + floor)
    overall = np.exp(np.median(np.log(factor).reshape(-1, 3), axis=0))
    held = photo.linear if photo.hdr else _unclipped(photo.linear, base)
    dimmed = overall * held
    moved = np.clip(
        (held + floor) * factor - floor, np.minimum(dimmed, edited), np.maximum(dimmed, edited)
    )
    return moved - photo.linear, np.minimum(factor, SETTINGS.most_detail) - 1, photo.linear


def _under_bodies(stack: Array, layers: Layers) -> tuple[Array, Array]:
    """(stack [H, W, 9], [H, W] bool where it is known), continued under the rim of bodies at native resolution.

    Pixels beside a body look up values under its rim when they are enlarged, where the layers show the body itself.
    """
    clear = np.ones_like(layers.changed) if layers.native is None else layers.native.inside == 0
    if clear.all() or not clear.any():
        return stack, clear
    away, (row, column) = ndimage.distance_transform_edt(~clear, return_indices=True)
    return stack[row, column], away <= SETTINGS.rim


def _unclipped(photo: Array, base: Array) -> Array:
    """A channel at the photo's white is a lower bound: where the fit says more, its value is taken."""
    return np.where(photo >= SETTINGS.white, np.maximum(photo, base), photo)


def in_photo(picture: Array, photo: Photo, seen: Array, found: dict) -> Array:
    """[H0, W0, 3] a composite in which emitters show the photo itself, dimmed: with the trees in the window.

    Clipped pixels have the estimated radiance of the emitters. seen: [H, W] bool: where lights are seen. found:
    `core.surfaces.KEY` of the provenance.
    """
    dim = float(found["dim"])
    if dim == 1 or not seen.any():
        return picture
    share = matte(seen, photo.original)
    picture = picture.copy()
    box = window(seen, picture.shape[:2], 4)
    share = share[box][..., None]
    seen_so = photo.original[box]
    here = picture[box]
    white = seen_so.min(-1, keepdims=True)
    own = dim * seen_so
    if not photo.hdr:
        whole = np.clip((white - SETTINGS.nearly) / (SETTINGS.clipped - SETTINGS.nearly), 0, 1)
        lifted = own * (1 + max(found["radiance"] - 1, 0) * whole)
        # What is not clipped is as bright as it is, and dimming brightens nothing.
        own = np.where((white < SETTINGS.clipped) & (dim < 1), np.minimum(lifted, seen_so), lifted)
    picture[box] = np.where(share > 0, share * own + (1 - share) * here, here)
    return picture
