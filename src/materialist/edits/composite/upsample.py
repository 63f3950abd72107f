"""Layers of working size brought to the photo's native size along the photo's own edges."""

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np

from materialist.color import linear_to_srgb
from materialist.geometry.silhouette import window
from materialist.types import Array


@dataclass(frozen=True)
class MatteSettings:
    """Shares of a surface in the photo's pixels along its outline; tuned by eye unless derived."""

    tile: int = 32  # working pixels: side of the parts in which a matte is made; derived: memory
    # working pixels from the mask's border up to which a matte may reach; derived: `near`
    border: int = 4
    near: float = 2.5  # standard deviation of the windows of mean colours, working pixels; larger averages texture
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


@dataclass(frozen=True)
class UpsampleSettings:
    """Joint bilateral upsampling: standard deviations; tuned by eye."""

    colour: float = 0.06  # of the colour weight, sRGB-encoded: about a just visible step
    strip: int = 128  # native rows handled at a time; derived: memory
    radius: float = 0.8  # of the spatial weight, working pixels, over 4 x 4 of them


MATTE = MatteSettings()
UPSAMPLE = UpsampleSettings()


def strips(height: int, size: int = UPSAMPLE.strip, start: int = 0) -> Iterator[slice]:
    """Slices of at most `size` rows that cover `height` rows, from `start` on."""
    return (slice(top, min(top + size, height)) for top in range(start, height, size))


class GuidedUpsample:
    """Joint bilateral upsampling (Kopf et al. 2007), a strip of native rows at a time.

    Each native pixel takes the mean of the 4 x 4 working pixels around it, weighted by distance and by how alike the
    photo looks there at working size (`small` [H, W, 3] linear) and here at native size (`large` [H0, W0, 3]).
    """

    def __init__(self, small: Array, large: Array):
        self.guide = linear_to_srgb(small)
        self.large = large
        self.same = small.shape == large.shape

    def __call__(
        self, layer: Array, members: Array, rows: slice, columns: slice = slice(None)
    ) -> Array:
        """[h, w, C] float32: `layer` [H, W, C] in a native window, from the working pixels `members` [H, W] bool.

        0 where none of the 4 x 4 is a member. At equal sizes (`same`) the layer itself, whatever the members.
        """
        if self.same:
            return layer[rows, columns].astype(np.float32)
        here = linear_to_srgb(self.large[rows, columns])  # [h, w, 3]
        native = self.large.shape[:2]
        working = members.shape
        y0, ys = _taps(np.arange(rows.start, rows.stop), native[0], working[0], UPSAMPLE.radius)
        x0, xs = _taps(np.arange(native[1])[columns], native[1], working[1], UPSAMPLE.radius)
        total = np.zeros((*here.shape[:2], layer.shape[2]), np.float32)
        if not members[y0.min() : y0.max() + 1].any():
            return total
        norm = np.zeros(here.shape[:2], np.float32)
        for i in range(4):
            for row in np.unique(y0[i]):
                band = slice(
                    *np.searchsorted(y0[i], (row, row + 1))
                )  # the native rows that look up this working row
                for j in range(4):
                    away = here[band] - self.guide[row, x0[j]]
                    away = np.einsum("ijk,ijk->ij", away, away)
                    # The small constant keeps a mean of the neighbourhood where nothing there looks alike.
                    weight = np.exp(-0.5 / UPSAMPLE.colour**2 * away) + 1e-4
                    weight *= ys[i][band, None] * (xs[j] * members[row, x0[j]])
                    total[band] += weight[..., None] * layer[row, x0[j]]
                    norm[band] += weight
        total /= np.maximum(norm, 1e-20)[..., None]
        return total.astype(np.float32)


def matte(mask: Array, large: Array) -> Array:
    """[H0, W0] float32 share of the masked surface in each native pixel, from a mask [H, W] bool at working size.

    Within about two working pixels of the mask's border a native pixel lies somewhere between the mean colours well
    inside and well outside nearby; its place on the line between them is its share. Where both sides look alike, and
    where the pixel is no mixture of the two, the enlarged mask decides. Exactly 0 and 1 further away.
    """
    height, width = large.shape[:2]
    scale = max(height / mask.shape[0], width / mask.shape[1])
    soft = cv2.resize(mask.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)
    if mask.all() or not mask.any():
        return soft
    wide = np.ones((2 * MATTE.border + 1,) * 2, np.uint8)
    border = np.asarray(
        cv2.dilate(mask.astype(np.uint8), wide) != cv2.erode(mask.astype(np.uint8), wide)
    )
    alpha = (soft >= 0.5).astype(np.float32)
    margin = int(np.ceil((3 * MATTE.near + 4) * scale))
    for tile in strips(mask.shape[0], MATTE.tile):
        for part in strips(mask.shape[1], MATTE.tile):
            if not border[tile, part].any():
                continue
            own = np.zeros_like(border)
            own[tile, part] = True
            rows, columns = window(own, (height, width))
            around = tuple(
                slice(max(v.start - margin, 0), v.stop + margin) for v in (rows, columns)
            )
            found = _shares(soft[around], large[around], scale)
            top = rows.start - around[0].start
            left = columns.start - around[1].start
            alpha[rows, columns] = found[top:, left:][
                : rows.stop - rows.start, : columns.stop - columns.start
            ]
    return alpha


def _shares(soft: Array, large: Array, scale: float) -> Array:
    """[h, w] float32: `matte` of a window, of `scale` native pixels a working pixel; `soft` the enlarged mask."""
    reach = np.ceil(1.5 * scale)
    sure_in = _distance_to(soft < 0.999) > reach
    sure_out = _distance_to(soft > 0.001) > reach
    encoded = linear_to_srgb(large)

    # The place of each colour on the line between the mean colours of both sides: 0 is outside, 1 inside.
    front, front_variance, known_front = _mean_of(encoded, sure_in, MATTE.near * scale)
    back, back_variance, known_back = _mean_of(encoded, sure_out, MATTE.near * scale)
    line = front - back
    length = np.sqrt(np.maximum((line**2).sum(-1), 1e-6))
    place = ((encoded - back) * line).sum(-1) / length**2

    # How far the place is to be trusted: the sides differ, and the colour is a mixture of them.
    deviation = np.sqrt(np.maximum(front_variance, back_variance) + MATTE.grain**2)
    distinct = _ramp(length / deviation, *MATTE.apart)
    nearest = np.clip(place, -MATTE.beyond, 1 + MATTE.beyond)[..., None]
    away = np.sqrt(((encoded - back - nearest * line) ** 2).sum(-1))
    foreign = _ramp(np.maximum(away - 2 * MATTE.grain, 0) / length, *MATTE.beside)
    trust = distinct * (1 - foreign) * known_front * known_back

    alpha = soft + trust * (np.clip(place, 0, 1) - soft)
    alpha = np.where(sure_in | (alpha > 0.999), 1, np.where(sure_out | (alpha < 0.001), 0, alpha))
    return alpha.astype(np.float32)


def _distance_to(mask: Array) -> Array:
    """[H, W] pixels from each pixel to the nearest of the mask, infinite where there is none."""
    if not mask.any():
        return np.full(mask.shape, np.inf, np.float32)
    return cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)


def _ramp(values: Array, low: float, high: float) -> Array:
    """0 up to `low`, 1 from `high` on, linear between."""
    return np.clip((values - low) / (high - low), 0, 1)


def _mean_of(picture: Array, members: Array, sigma: float) -> tuple[Array, Array, Array]:
    """Colours of the members [H, W] bool near each pixel, weighted by a Gaussian of `sigma` pixels.

    Returns their mean [H, W, 3], its variance [H, W], channels added, and where there are any [H, W] bool.
    """
    # A wide Gaussian is as smooth on a coarser grid: its cost stays the same whatever the photo's size.
    factor = max(1, int(sigma / MATTE.coarse))
    height, width = members.shape
    coarse = (-(-width // factor), -(-height // factor))

    def blurred(values: Array) -> Array:
        small = cv2.resize(values, coarse, interpolation=cv2.INTER_AREA) if factor > 1 else values
        small = cv2.GaussianBlur(small, (0, 0), sigma / factor, borderType=cv2.BORDER_REFLECT)
        if factor == 1:
            return small
        return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)

    weight = members.astype(np.float32)
    norm = np.maximum(blurred(weight), 1e-12)
    mean = blurred(picture * weight[..., None]) / norm[..., None]
    square = blurred((picture**2).sum(-1) * weight) / norm
    return mean, np.maximum(square - (mean**2).sum(-1), 0), norm > 1e-5


def _taps(index: Array, native: int, working: int, radius: float) -> tuple[Array, Array]:
    """The four working positions [4, n] around native positions [n] of one axis, and their spatial weights [4, n]."""
    place = (index + 0.5) * working / native - 0.5
    base = np.floor(place).astype(np.int64)
    taps = base[None] + np.arange(-1, 3)[:, None]
    weights = np.exp(-0.5 * ((taps - place[None]) / radius) ** 2).astype(np.float32)
    return np.clip(taps, 0, working - 1), weights
