"""The border of a marked surface at the photo's native size: where it runs, and what share and colour each side has."""

from dataclasses import dataclass

import cv2
import numpy as np

from materialist.color import linear_to_srgb
from materialist.edits.composite.border import SETTINGS as BORDER
from materialist.edits.composite.border import on_edges
from materialist.edits.composite.upsample import strips
from materialist.geometry.silhouette import Box, area, common, window, within
from materialist.types import Array


@dataclass(frozen=True)
class MatteSettings:
    """Lengths in working pixels unless said otherwise; tuned by eye and on composites: three, ten for soft borders."""

    tile: int = 48  # side of the parts in which a matte is made; derived: memory

    # Shares of mixed pixels, by their place between the mean colours of both sides.
    width: float = 1.5  # from a sharp border up to which pixels may be mixed
    widest: float = 5.0  # the same of a soft one
    # standard deviations of the two Gaussians that say how soft the photo's edge is
    narrow: float = 0.35
    wide: float = 1.0
    blur_grid: float = 2.0  # grid points a working pixel for that, at most; derived: time
    shift: float = 0.6  # by which a pixel's colour may move the border
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

    # Colours of both sides of a mixed pixel: standard deviation of the Gaussian over which they are averaged.
    unmix: float = 1.5


SETTINGS = MatteSettings()
RIM = 9
"""Pixels by which a mask is continued beyond the picture; derived: more than the distances that count."""
STAIRS = 0.5
"""Standard deviation, pixels, of the Gaussian that takes steps out of a border that is enlarged; by eye."""


def matte(mask: Array, large: Array, box: Box | None = None) -> Array:
    """[H0, W0] float32 share of the masked surface in each native pixel, from a mask [H, W] bool at working size.

    large: [H0, W0, 3] linear, the photo. The border moves to the photo's edges (`border.on_edges`), and is as soft as
    they are. Beside it a pixel's place on the line between the mean colours of both sides is its share; where both look
    alike, or the pixel is no mixture of them, the border decides. Exactly 0 and 1 further away. box: the native rows
    and columns to make, None for all.
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
    reach = BORDER.reach + SETTINGS.widest + 1
    distance = on_edges(distance, large, reach)
    # --- Tile by tile along the border, each with what its pixels look up around it ---
    border = np.abs(distance) <= SETTINGS.widest + 1
    margin = int(np.ceil(3 * SETTINGS.near + SETTINGS.widest))
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


def unmixed(share: Array, picture: Array, scale: float) -> tuple[Array, Array]:
    """Colours [h, w, 3] of the masked surface and of what is beside it, in a picture [h, w, 3] linear that mixes both.

    share: [h, w] of the surface. scale: native pixels a working pixel. Each side's colours are averaged nearby; a
    pixel's deviation from the mixture of both means is shared out, so that share * front + (1 - share) * back is the
    picture (Forte 2021, "Approximate Fast Foreground Colour Estimation", with all of the residual).
    """
    part = share[..., None]
    sigma = SETTINGS.unmix * max(1.0, scale)
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
    size = large.shape[1::-1]
    away = np.asarray(cv2.resize(distance, size, interpolation=cv2.INTER_CUBIC))
    blur = _edge_blur(encoded, away, scale)
    # A blurred step has 95 % of its rise within two standard deviations of its middle.
    width = np.clip(2 * blur, SETTINGS.width, SETTINGS.widest)
    sure_in = away > width
    sure_out = away < -width
    # A border as soft as the photo's edge, at least a pixel; the colours decide where they can, not far from it.
    rise = np.maximum(2.5 * blur, 1)
    soft = np.clip(0.5 + away / rise, 0, 1)
    least = np.clip(0.5 + (away - SETTINGS.shift) / rise, 0, 1)
    most = np.clip(0.5 + (away + SETTINGS.shift) / rise, 0, 1)
    place, trust = _place(encoded, sure_in, sure_out, SETTINGS.near * scale)
    alpha = soft + trust * (np.clip(place, least, most) - soft)
    return np.where(sure_in, 1, np.where(sure_out, 0, alpha)).astype(np.float32)


def _edge_blur(encoded: Array, away: Array, scale: float) -> Array:
    """[h0, w0] standard deviation, working pixels, of the photo's blur across the border: of its lens, or out of focus.

    A Gaussian of s makes of a step of blur b one of sqrt(b^2 + s^2); the energy of its gradient falls by the same
    factor, which gives b from two Gaussians (after Zhuo and Sim 2011, "Defocus Map Estimation from a Single Image").
    """
    size = encoded.shape[1::-1]
    fine = min(scale, SETTINGS.blur_grid)
    grid = (max(2, round(size[0] * fine / scale)), max(2, round(size[1] * fine / scale)))
    seen = cv2.resize(encoded, grid, interpolation=cv2.INTER_AREA)
    distance = cv2.resize(away, grid, interpolation=cv2.INTER_AREA)
    # --- The step: from the mean colour of one side to that of the other; texture counts little ---
    most = SETTINGS.widest
    near = SETTINGS.near * fine
    place, trust = _place(seen, distance > most, distance < -most, near)
    step = np.clip(place, -0.25, 1.25).astype(np.float32)
    weight = trust * (np.abs(distance) < most)
    # --- How much of the energy of its gradient each Gaussian leaves ---
    energies = []
    for sigma in (SETTINGS.narrow, SETTINGS.wide):
        down, right = np.gradient(cv2.GaussianBlur(step, (0, 0), sigma * fine))
        energy = ((down**2 + right**2) * weight).astype(np.float32)
        energies.append(cv2.GaussianBlur(energy, (0, 0), near))
    more, less = energies
    # Energies are inverse to the widths: square = (b^2 + wide^2) / (b^2 + narrow^2).
    square = (np.maximum(more, 1e-9) / np.maximum(less, 1e-9)) ** 2
    variance = (SETTINGS.wide**2 - square * SETTINGS.narrow**2) / np.maximum(square - 1, 1e-4)
    blur = np.sqrt(np.clip(variance, 0, (most / 2) ** 2))
    # Without a step to measure, the border is sharp.
    blur = np.where(less > 1e-6, blur, 0).astype(np.float32)
    return np.asarray(cv2.resize(blur, size, interpolation=cv2.INTER_LINEAR))


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
