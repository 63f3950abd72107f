"""The border of a marked surface at the photo's native size: where it runs, and what share and colour each side has."""

import warnings
from dataclasses import dataclass

import cv2
import numpy as np
from skimage.segmentation import random_walker

from materialist.color import linear_to_srgb
from materialist.edits.composite.upsample import strips
from materialist.geometry.silhouette import Box, area, common, disc, window, within
from materialist.types import Array


@dataclass(frozen=True)
class MatteSettings:
    """Lengths in working pixels unless said otherwise; tuned by eye and on three composites."""

    tile: int = 48  # side of the parts in which a matte is made; derived: memory

    # Where the border runs: a random walk shares out the pixels beside the mask's own border.
    reach: float = 3.0  # by which the border may move
    finest: float = 4.0  # grid points a working pixel, at most; derived: time
    edge_weight: float = 5000.0  # of the photo's edges; larger keeps to them more

    # Shares of mixed pixels, by their place between the mean colours of both sides.
    width: float = 1.5  # from the border up to which pixels may be mixed
    near: float = 2.5  # standard deviation of the windows of mean colours; larger averages texture
    # least standard deviation, pixels, of those windows on the grid where they are computed; derived: time
    coarse: float = 6.0
    # standard deviation of an even surface's colour, sRGB-encoded, channels added
    grain: float = 0.03
    # mean colours' distance, standard deviations: not told apart, and clearly
    apart: tuple[float, float] = (2.0, 5.0)
    # a colour's distance from the line between both: a mixture, and none
    beside: tuple[float, float] = (0.3, 0.6)
    # continuation of that line beyond its ends, as the halos of sharpened edges need
    beyond: float = 0.75


SETTINGS = MatteSettings()
RIM = 8
"""Pixels by which a mask is continued beyond the picture; derived: more than the distances that count."""
STAIRS = 0.5
"""Standard deviation, pixels, of the Gaussian that takes steps out of a border that is enlarged; by eye."""


def matte(mask: Array, large: Array, box: Box | None = None) -> Array:
    """[H0, W0] float32 share of the masked surface in each native pixel, from a mask [H, W] bool at working size.

    large: [H0, W0, 3] linear, the photo. The border moves to the photo's edges within `reach` of the mask's own, and
    runs along that one where the photo has none. Beside it a pixel's place on the line between the mean colours of both
    sides is its share; where both look alike, or the pixel is no mixture of them, the border decides. Exactly 0 and 1
    further away. box: the native rows and columns to make, None for all.
    """
    # --- Away from the border: the mask itself, enlarged ---
    height, width = large.shape[:2]
    region = box or (slice(0, height), slice(0, width))
    scale = max(height / mask.shape[0], width / mask.shape[1])
    distance = _signed_distance(mask, STAIRS * (scale > 1))
    hard = cv2.resize(mask.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST)
    alpha: Array = np.asarray(hard[region]).astype(np.float32)
    if mask.all() or not mask.any():
        return alpha
    # --- Tile by tile along the border, each with what its pixels look up around it ---
    border = np.abs(distance) <= SETTINGS.reach + SETTINGS.width + 1
    margin = int(np.ceil(3 * SETTINGS.near + SETTINGS.reach + SETTINGS.width))
    for tile in strips(mask.shape[0], SETTINGS.tile):
        for part in strips(mask.shape[1], SETTINGS.tile):
            if not border[tile, part].any():
                continue
            tile_mask = np.zeros_like(border)
            tile_mask[tile, part] = True
            native = window(tile_mask, (height, width))
            here = common(native, region)
            if area(here) == 0:
                continue
            small = window(tile_mask, margin=margin)
            around = window(tile_mask, (height, width), margin)
            shares = _shares(distance[small], large[around], scale)
            alpha[within(here, region)] = shares[within(here, around)]
    return alpha


def unmixed(share: Array, picture: Array, sigma: float) -> tuple[Array, Array]:
    """Colours [h, w, 3] of the masked surface and of what is beside it, in a picture [h, w, 3] linear that mixes both.

    share: [h, w] of the surface. sigma: pixels, of the Gaussian over which each side's colours are averaged. A pixel's
    deviation from the mixture of both means is shared out, so that share * front + (1 - share) * back is the picture
    (Forte 2021, "Approximate Fast Foreground Colour Estimation", with all of the residual).
    """
    part = share[..., None]
    means = []
    for weight in (part, 1 - part):
        norm = _blurred(weight, sigma)
        mean = _blurred(picture * weight, sigma) / np.maximum(norm, 1e-6)
        means.append(np.where(norm > 1e-6, mean, picture))
    front, back = means
    rest = (picture - part * front - (1 - part) * back) / (part**2 + (1 - part) ** 2)
    return np.maximum(front + part * rest, 0), np.maximum(back + (1 - part) * rest, 0)


def _blurred(values: Array, sigma: float) -> Array:
    """A Gaussian mean of [h, w, C], C of 1 kept."""
    blurred = cv2.GaussianBlur(values, (0, 0), sigma, borderType=cv2.BORDER_REFLECT)
    return np.asarray(blurred).reshape(values.shape)


def _shares(distance: Array, large: Array, scale: float) -> Array:
    """[h0, w0] float32: `matte` of a window; `distance` [h, w] to the border, `scale` native pixels a working pixel."""
    encoded = linear_to_srgb(large)
    away = _moved(distance, encoded, scale)  # working pixels, at native size
    soft = np.clip(away + 0.5, 0, 1)
    sure_in = away > SETTINGS.width
    sure_out = away < -SETTINGS.width
    # A hard border, softened by a pixel; the colours decide where they can.
    place, trust = _place(encoded, sure_in, sure_out, SETTINGS.near * scale)
    alpha = soft + trust * (np.clip(place, 0, 1) - soft)
    return np.where(sure_in, 1, np.where(sure_out, 0, alpha)).astype(np.float32)


def _place(encoded: Array, sure_in: Array, sure_out: Array, sigma: float) -> tuple[Array, Array]:
    """Places [h, w] of colours on the line between the means of both sides nearby: 0 is outside, 1 inside.

    And how far each is to be trusted, [h, w] in [0, 1]: the sides differ, and the colour is a mixture of them.
    """
    # --- The line between the mean colours of what is surely of either side ---
    front, front_variance, known_front = _mean_of(encoded, sure_in, sigma)
    back, back_variance, known_back = _mean_of(encoded, sure_out, sigma)
    line = front - back
    length = np.sqrt(np.maximum((line**2).sum(-1), 1e-6))
    place = ((encoded - back) * line).sum(-1) / length**2
    # --- The sides differ, and the colour is a mixture of them ---
    deviation = np.sqrt(np.maximum(front_variance, back_variance) + SETTINGS.grain**2)
    distinct = _ramp(length / deviation, *SETTINGS.apart)
    nearest = np.clip(place, -SETTINGS.beyond, 1 + SETTINGS.beyond)[..., None]
    aside = np.sqrt(((encoded - back - nearest * line) ** 2).sum(-1))
    foreign = _ramp(np.maximum(aside - 2 * SETTINGS.grain, 0) / length, *SETTINGS.beside)
    return place, distinct * (1 - foreign) * known_front * known_back


def _moved(distance: Array, encoded: Array, scale: float) -> Array:
    """[h0, w0] signed distance to the border, working pixels, once it has moved to the photo's edges."""
    size = encoded.shape[1::-1]
    fine = min(scale, SETTINGS.finest)
    grid = (max(2, round(size[0] * fine / scale)), max(2, round(size[1] * fine / scale)))
    field = cv2.resize(distance.astype(np.float32), grid, interpolation=cv2.INTER_CUBIC)
    seen = cv2.resize(encoded, grid, interpolation=cv2.INTER_AREA)
    # --- Seeds: what is deep on either side; in a thin part its middle ---
    box = disc(round(SETTINGS.reach * fine))
    inside = field > 0.5 * cv2.dilate(field, box)
    outside = -field > 0.5 * cv2.dilate(-field, box)
    inside &= field > 0
    outside &= field < 0
    unsure = ~inside & ~outside
    if not unsure.any() or not inside.any() or not outside.any():
        return cv2.resize(field, size, interpolation=cv2.INTER_LINEAR)
    labels = np.where(inside, 1, np.where(outside, 2, 0))
    # Pixels that no unsure one touches are left out of the walk.
    touched = cv2.dilate(unsure.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    with warnings.catch_warnings(action="ignore"):  # that other solvers are faster
        likely = random_walker(
            seen,
            np.where(touched, labels, -1),
            beta=SETTINGS.edge_weight,
            mode="cg_j",
            channel_axis=-1,
            return_full_prob=True,
        )[0]
    members = np.where(touched, likely, inside) > 0.5
    # --- Texture and rims have edges, too: the border moves where it parts two colours ---
    _, trust = _place(seen, inside, outside, SETTINGS.near * fine)
    trust = cv2.GaussianBlur(trust.astype(np.float32), (0, 0), max(fine / 4, 0.5))
    moved = (
        _signed_distance(members, STAIRS * (fine > 1)) / fine
        if members.any() and not members.all()
        else field
    )
    away = np.where(touched, field + trust * (moved - field), field)
    return np.asarray(cv2.resize(away, size, interpolation=cv2.INTER_LINEAR))


def _signed_distance(mask: Array, stairs: float) -> Array:
    """[H, W] float32 pixels to the border of a mask, > 0 inside; a Gaussian of `stairs` pixels takes its steps away."""
    # What the picture's rim cuts goes on beyond it.
    framed = np.pad(mask.astype(np.uint8), RIM, mode="edge")
    inside, outside = (
        cv2.distanceTransform(side, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        for side in (framed, 1 - framed)
    )
    # Pixel centres lie half a pixel from the border between pixels.
    signed: Array = np.where(framed > 0, inside - 0.5, 0.5 - outside).astype(np.float32)
    if stairs > 0:
        signed = cv2.GaussianBlur(signed, (0, 0), stairs, borderType=cv2.BORDER_REFLECT)
    return signed[RIM:-RIM, RIM:-RIM]


def _ramp(values: Array, low: float, high: float) -> Array:
    """0 up to `low`, 1 from `high` on, linear between."""
    return np.clip((values - low) / (high - low), 0, 1)


def _mean_of(picture: Array, members: Array, sigma: float) -> tuple[Array, Array, Array]:
    """Colours of the members [H, W] bool near each pixel, weighted by a Gaussian of `sigma` pixels.

    Returns their mean [H, W, 3], its variance [H, W], channels added, and where there are any [H, W] bool.
    """
    # A wide Gaussian is as smooth on a coarser grid: its cost stays the same whatever the photo's size.
    factor = max(1, int(sigma / SETTINGS.coarse))
    height, width = members.shape
    coarse = (-(-width // factor), -(-height // factor))

    def blurred(values: Array) -> Array:
        small = cv2.resize(values, coarse, interpolation=cv2.INTER_AREA) if factor > 1 else values
        small = cv2.GaussianBlur(small, (0, 0), sigma / factor, borderType=cv2.BORDER_REFLECT)
        if factor == 1:
            return small
        return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)

    # Sums over the members, divided by how many there are.
    weight = members.astype(np.float32)
    norm = np.maximum(blurred(weight), 1e-12)
    mean = blurred(picture * weight[..., None]) / norm[..., None]
    square = blurred((picture**2).sum(-1) * weight) / norm
    return mean, np.maximum(square - (mean**2).sum(-1), 0), norm > 1e-5
