"""The difference of two renderings, laid on the photo at its native size (docs/editing.md has the formulas)."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import cv2
import numpy as np

from materialist.edits.composite.border import SETTINGS as BORDER
from materialist.edits.composite.glare import add_glare
from materialist.edits.composite.glow import light_share
from materialist.edits.composite.layers import Layers
from materialist.edits.composite.matte import SETTINGS as MATTE
from materialist.edits.composite.matte import matte, unmixed
from materialist.edits.composite.upsample import GuidedUpsample, strips
from materialist.geometry.membrane import nearest
from materialist.geometry.silhouette import Box, disc, grown, window, within
from materialist.types import Array, Photo, Progress


@dataclass(frozen=True)
class CompositeSettings:
    """How the photo's residual over the fit follows an edit; tuned by eye unless derived."""

    floor: float = 0.02  # radiance added to edited and base: ratios of dark pixels count less
    black: float = 0.005  # radiance added to photo and diffuse light: ratios of black are noise
    max_detail_factor: float = 2.0  # on the photo's finest detail, under another light
    mixed_pixels: int = 1  # working pixels inside of a border whose maps may mix both sides
    clipped_photo: float = 0.995  # channel of a linear photo that is clipped; derived: 8 bits
    clipped_emitter: float = 0.97  # least channel of an emitter's clipped pixel; derived: 8 bits
    bright_emitter: float = 0.9  # least channel from which it may be brighter than it looks
    block: int = 1024  # native columns of a strip handled at a time; derived: memory and time
    max_threads: int = 4  # blocks of a large photo made together, 0.05 GB each; derived: memory


SETTINGS = CompositeSettings()


def into_photo(
    photo: Photo,
    layers: Layers,
    lights: tuple[Array, dict] | None = None,
    progress: Progress | None = None,
    *,
    once: bool = False,
) -> Array:
    """[H0, W0, 3] the photo with the difference of two renderings added.

    out = photo + change + (factor - 1) (photo - reference), of which `_same_light` and `_other_light` give the three.
    At the border of a replaced surface each side moves in its own colour, by the share that it has in the pixel.

    New bodies stand before it: they are the rendering alone, and hide the photo by their share. At the rim of bodies
    brighter than an ordinary photo's white, white is mixed in: a few hundredths of a lamp's radiance would fill a
    pixel, and its outline would be ragged.

    lights: of in-photo emitters that are dimmed: where they are seen, and what is known of them; see `in_photo`.
    once: nobody needs the photo's native pixels any more: without `lights` the result takes their place.
    """
    # --- The photo with the difference, and with the dimmed lights that it shows ---
    tick = progress or (lambda *_: None)
    picture = photo.original if once and lights is None else photo.original.copy()
    if layers.reached.any():
        _change(picture, photo, layers, tick)
    if lights is not None:
        picture = in_photo(picture, photo, *lights)
    if layers.native is None:
        return picture
    # --- New bodies, where they are seen ---
    box = layers.native.box
    share = layers.native.share[..., None]
    bodies = layers.native.picture
    bodies = bodies if photo.hdr else np.where(share < 1, np.minimum(bodies, 1), bodies)
    here = picture[box]
    mixed = np.maximum(share * bodies + (1 - share) * here, 0)
    picture[box] = np.where(share > 0, mixed, here)
    # --- Lamps glare: only under another light, which changes the whole photo anyhow ---
    if layers.relit:
        light = np.maximum(share * layers.native.picture - 1, 0)
        if light.any():
            add_glare(picture, light, box)
    return picture


def _change(out: Array, photo: Photo, layers: Layers, tick: Progress) -> None:
    """Add the change without the new bodies to `out` [H0, W0, 3] in place, which holds the photo's own pixels."""
    # --- All terms at working size; each side of the border of a replaced surface is a picture of its own ---
    stack = np.concatenate(_terms(photo, layers), -1)  # [H, W, 9]
    stack[~layers.reached, :6] = 0
    native = photo.original.shape[:2]
    clear = np.ones_like(layers.changed) if layers.native is None else layers.native.inside < 1
    sides = [
        _alone(stack, photo.linear, side, clear, native)
        for side in (layers.changed, ~layers.changed)
    ]
    # Beyond its own pixels a change goes as far as the border may move.
    reached = grown((stack[..., :3] != 0).any(-1), int(np.ceil(BORDER.reach + MATTE.widest)))
    if not reached.any():
        return
    box, columns = window(reached, native, 3)  # the reach of `GuidedUpsample`
    # --- Share and colours of the photo, with what the means of mixed pixels look up around them ---
    scale = max(1.0, native[1] / photo.linear.shape[1])
    margin = int(np.ceil(3 * MATTE.unmix * scale))
    held = (_wider(box, margin, native[0]), _wider(columns, margin, native[1]))
    alpha = matte(layers.changed, photo.original, held)
    original = photo.original[held]
    original = original.copy() if out is photo.original else original

    def laid(block: Box) -> None:
        rows, columns = block
        inner = within(block, held)
        # Its share of the first side, and the colours of both, as the photo has them.
        share = alpha[inner]
        colours = _side_colours(alpha, original, inner, scale)
        moved = original[inner].copy()
        for part, colour, side in zip((share, 1 - share), colours, sides, strict=True):
            # Only the columns that this side has a share in.
            used = np.flatnonzero((part > 0).any(0))
            if not used.size:
                continue
            local = slice(int(used[0]), int(used[-1]) + 1)
            there = slice(columns.start + local.start, columns.start + local.stop)
            large = side(rows, there, colour[:, local])
            free = photo.hdr or layers.relit
            moved[:, local] += part[:, local, None] * _difference(
                colour[:, local], large, part[:, local, None], free
            )
        out[rows, columns] = np.maximum(moved, 0)

    # --- Block by block, which bounds the memory ---
    across = list(strips(columns.stop, SETTINGS.block, columns.start))
    parts = [(rows, part) for rows in strips(box.stop, start=box.start) for part in across]
    with ThreadPoolExecutor(min(SETTINGS.max_threads, os.cpu_count() or 1)) as threads:
        for done, _ in enumerate(threads.map(laid, parts)):
            tick("photo", done, len(parts))
    tick("photo", len(parts), len(parts))


def _wider(side: slice, margin: int, size: int) -> slice:
    """Rows or columns with `margin` more at both ends, of `size`."""
    return slice(max(side.start - margin, 0), min(side.stop + margin, size))


def _alone(
    stack: Array, guide: Array, side: Array, clear: Array, native: tuple[int, ...]
) -> GuidedUpsample:
    """The terms [H, W, 9] of one side [H, W] bool of a border, carried on over the other; 0 where it has no pixel.

    Maps of pixels at the border mix both sides: those inside of them speak for them. clear: [H, W] bool: pixels whose
    terms are known.
    """
    size = SETTINGS.mixed_pixels
    pure = cv2.erode(side.astype(np.uint8), disc(size), borderValue=1) * clear.astype(np.uint8)
    # What is too thin to have an inside speaks for itself.
    thin = side & clear & (cv2.dilate(pure, disc(2 * size)) == 0)
    known = (pure > 0) | thin
    if not known.any():
        return GuidedUpsample(np.zeros_like(stack), guide, native)
    source = nearest(known)
    return GuidedUpsample(stack[source], guide[source], native)


def _side_colours(alpha: Array, photo: Array, box: Box, scale: float) -> tuple[Array, Array]:
    """Colours [h, w, 3] of both sides of the border in a window: the photo's, unmixed where both share it.

    photo: [H0, W0, 3] linear. alpha: [H0, W0] share of the first side. scale: native pixels a working pixel.
    """
    rows, columns = box
    here = photo[box]
    mixed = np.flatnonzero(((alpha[box] > 0) & (alpha[box] < 1)).any(0))
    if not mixed.size:
        return here, here
    # --- Only the columns with mixed pixels, and what their means look up ---
    margin = int(np.ceil(3 * MATTE.unmix * scale))
    part = (rows, slice(columns.start + int(mixed[0]), columns.start + int(mixed[-1]) + 1))
    around = (_wider(rows, margin, len(photo)), _wider(part[1], margin, photo.shape[1]))
    # --- Both sides unmixed there; the photo itself elsewhere ---
    pictures = unmixed(alpha[around], photo[around], scale)
    sides = []
    for picture in pictures:
        side = here.copy()
        side[within(part, box)] = picture[within(part, around)]
        sides.append(side)
    return sides[0], sides[1]


def _difference(colour: Array, large: Array, share: Array, free: bool) -> Array:
    """[h, w, 3] by which one side's colour moves: change + (factor - 1) (colour - reference), see `into_photo`.

    large: [h, w, 9] the three terms. share: [h, w, 1] of the side; where it is a part of a pixel, no more than white is
    mixed in, unless the picture is `free` of that bound.
    """
    change = large[..., :3]
    excess = large[..., 3:6]
    reference = large[..., 6:]
    # Where a channel is clipped, the rendering may say how bright it really is.
    held = colour if free else _unclipped(colour, reference)
    moved = np.maximum(held + change + excess * (held - reference), 0)
    if not free:
        # A mixed pixel is not made brighter than white, lest the outline be ragged.
        moved = np.where(share < 1, np.minimum(moved, np.maximum(held, 1)), moved)
    return np.where((change != 0).any(-1, keepdims=True), moved - colour, 0)


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
        covered = layers.covered[..., None]
        change = np.where(covered, layers.edited - reference, change)
        excess = np.where(covered, -1, excess)
    return change.astype(np.float32), excess.astype(np.float32), reference


def _same_light(photo: Photo, layers: Layers) -> tuple[Array, Array, Array]:
    """out = q edited + factor (photo - q base).

    Shadows and gaps that the fit lacks darken both renderings, by q of `missing_shade`, where the edit replaces the
    surface. The rest of the photo's residual is mostly texture and gloss that the albedo lacks: it dims as the surface
    does, factor = edited / base, and does not grow (a ratio above 1 is taken as 1). New metal hides both.
    """
    left = 1.0 if layers.diffuse is None else layers.diffuse[..., None]
    # A brighter surface does not amplify what the fit misses of the photo.
    factor = left * np.minimum((layers.edited + SETTINGS.floor) / (layers.base + SETTINGS.floor), 1)
    if layers.albedos is None:
        return layers.edited - layers.base, factor - 1, layers.base
    held = photo.linear if photo.hdr else _unclipped(photo.linear, layers.base)
    shade = missing_shade(held, layers.base, layers.edited, *layers.albedos)
    shade = np.where(layers.changed, shade, 1)[..., None]
    shade = 1 + left * (shade - 1)
    return shade * (layers.edited - layers.base), factor - 1, shade * layers.base


def missing_shade(photo: Array, base: Array, edited: Array, old: Array, new: Array) -> Array:
    """[...] q in [0, 1]: the photo's light over the diffuse light of the fit's rendering, where it has less.

    The edit tells the diffuse light: it changes in proportion to the albedo, so that old |edited - base| / |new - old|
    of the base is diffuse. Channels count by how much the edit changes them. All of the photo's light counts: the lack
    of a highlight that the fit has, or one that it lacks, is no shade.

    photo, base, edited: [..., 3] linear. old, new: [..., 3] albedo (1 - metallic) of the fitted and the edited scene.
    """
    weight = np.abs(new - old)
    diffuse = np.minimum(old * np.abs(edited - base), weight * np.maximum(base, 0))
    black = SETTINGS.black * weight.sum(-1) + 1e-9
    seen = (weight * np.maximum(photo, 0)).sum(-1)
    return np.minimum((seen + black) / (diffuse.sum(-1) + black), 1)


def _other_light(photo: Photo, layers: Layers) -> tuple[Array, Array, Array]:
    """out = photo factor, factor = edited / base, kept between `edited` and g photo, g the factor's median per channel.

    What the fit leaves unexplained is mostly texture, which goes with the light as the surface does. Highlights and
    shadows that the fit has elsewhere than the photo are not: without the bounds they would print their negative.
    """
    base = np.maximum(layers.base, 0)
    edited = np.maximum(layers.edited, 0)
    floor = SETTINGS.floor
    # The change of the light, pixel by pixel and as a whole.
    factor = (edited + floor) / (base + floor)
    overall = overall_factor(base, edited)
    held = photo.linear if photo.hdr else _unclipped(photo.linear, base)
    dimmed = overall * held
    moved = np.clip(
        (held + floor) * factor - floor, np.minimum(dimmed, edited), np.maximum(dimmed, edited)
    )
    return moved - photo.linear, np.minimum(factor, SETTINGS.max_detail_factor) - 1, photo.linear


def overall_factor(base: Array, edited: Array) -> Array:
    """[3]: g of `_other_light`, the change of the light as a whole, of two renderings [H, W, 3]."""
    floor = SETTINGS.floor
    factor = (np.maximum(edited, 0) + floor) / (np.maximum(base, 0) + floor)
    return np.exp(np.median(np.log(factor).reshape(-1, 3), axis=0))


def _unclipped(photo: Array, base: Array) -> Array:
    """A channel at the photo's white is a lower bound: where the fit says more, its value is taken."""
    return np.where(photo >= SETTINGS.clipped_photo, np.maximum(photo, base), photo)


def in_photo(picture: Array, photo: Photo, seen: Array, emitters: dict) -> Array:
    """[H0, W0, 3] a composite in which emitters show the photo itself, dimmed: with the trees in the window.

    The composite `picture` is changed in place.
    Clipped pixels have the estimated radiance of the emitters. seen: [H, W] bool: where lights are seen. emitters:
    `core.surfaces.KEY` of the provenance.
    """
    dim = float(emitters["dim"])
    if dim == 1 or not seen.any():
        return picture
    # --- Only the part of the photo where lights are seen ---
    share = light_share(seen, photo)
    box = window(share > 0)
    share = share[box][..., None]
    original = photo.original[box]
    here = picture[box]
    white = original.min(-1, keepdims=True)
    light = dim * original
    if not photo.hdr:
        # From bright to clipped, pixels rise from the photo's radiance to the estimated one.
        span = SETTINGS.clipped_emitter - SETTINGS.bright_emitter
        clipped = np.clip((white - SETTINGS.bright_emitter) / span, 0, 1)
        lifted = light * (1 + max(emitters["radiance"] - 1, 0) * clipped)
        # What is not clipped is as bright as it is, and dimming brightens nothing.
        unclipped = (white < SETTINGS.clipped_emitter) & (dim < 1)
        light = np.where(unclipped, np.minimum(lifted, original), lifted)
    picture[box] = np.where(share > 0, share * light + (1 - share) * here, here)
    return picture
