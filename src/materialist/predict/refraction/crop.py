"""What RefractionNet sees of an object: a square window around it, its maps made independent of place and scale."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from materialist.camera import turn_upright, unit
from materialist.color import linear_to_srgb
from materialist.geometry.silhouette import border_distance, object_size, spacing, window
from materialist.solids.symmetry import mirrored_thickness
from materialist.types import Array

SIDE = 64
"""Pixels on a side of what the network sees."""
MARGIN = 0.06
"""Room around the object, as a part of its longer side."""
CHANNELS = 11
"""photo 3, mask, normal 3, n.v, depth, mirrored thickness, distance to the silhouette."""


@dataclass(frozen=True)
class View:
    """An object in a square window of S x S pixels."""

    photo: Array
    """[S, S, 3] float32 linear."""
    inside: Array
    """[S, S] bool."""
    normal: Array
    """[S, S, 3] float32 unit, camera frame."""
    depth: Array
    """[S, S] float32 planar, scene units."""
    rays: Array
    """[S, S, 3] float32 camera rays at z = -1."""

    @property
    def size(self) -> float:
        """Size of the object, scene units: the unit of the network's thickness."""
        return object_size(self.inside, self.depth, self.rays)


@dataclass(frozen=True)
class Window:
    """A square of a picture, in pixels from its upper left corner; it may reach over the border."""

    left: float
    top: float
    side: float

    @classmethod
    def around(cls, inside: Array) -> Window:
        """The window around a mask [H, W] bool, which it frames to the fraction of a pixel as the training views do."""
        rows, columns = window(inside)
        height = rows.stop - rows.start
        width = columns.stop - columns.start
        side = max(height, width) * (1 + 2 * MARGIN)
        return cls(
            (columns.start + columns.stop - side) / 2, (rows.start + rows.stop - side) / 2, side
        )

    def moved(self, larger: float, right: float, down: float) -> Window:
        """The window `larger` times as large about its middle, and that many of its sides aside."""
        edge = (larger - 1) / 2
        return Window(
            self.left + (right - edge) * self.side,
            self.top + (down - edge) * self.side,
            larger * self.side,
        )

    def cut(self, photo: Array, inside: Array, normal: Array, depth: Array, rays: Array) -> View:
        """The window of maps [H, W, ...] at SIDE x SIDE pixels; means over the object alone."""
        weight = inside.astype(np.float32)
        share = self._cut(weight)

        # The background must not leak in: values are weighted by the mask before they are
        # averaged.
        def mean(x):
            return self._cut(x * _like(weight, x)) / _like(np.maximum(share, 1e-6), x)

        seen = share > 0.5
        if not seen.any():
            seen = share >= share.max()
        photo, normal, depth = (mean(x.astype(np.float32)) for x in (photo, normal, depth))
        return View(photo, seen, unit(normal), depth, self._rays(rays))

    def put_back(self, values: Array, seen: Array, inside: Array) -> Array:
        """[H, W] float32: values [S, S] known where `seen`, brought back to the mask `inside` [H, W], 0 outside."""
        known = self._spread(seen.astype(np.float32), inside.shape)
        spread = self._spread(
            np.where(seen, values, 0).astype(np.float32), inside.shape
        ) / np.maximum(known, 1e-6)
        # Pixels of the mask that no known value reaches take the median of the object.
        filled = np.where(known > 1e-3, spread, float(np.median(values[seen])))
        return np.where(inside, filled, 0).astype(np.float32)

    def _cut(self, values: Array) -> Array:
        """[SIDE, SIDE, ...] of values [H, W, ...], 0 beyond the border: means down, bilinear up."""
        # First at a whole multiple of SIDE, so that the area mean then has equal weights.
        fine = SIDE * max(1, int(np.ceil(self.side / SIDE)))
        flags = cv2.WARP_INVERSE_MAP | cv2.INTER_LINEAR
        large = cv2.warpAffine(
            np.ascontiguousarray(values, np.float32), self._map(fine), (fine, fine), flags=flags
        )
        return cv2.resize(large, (SIDE, SIDE), interpolation=cv2.INTER_AREA)

    def _spread(self, values: Array, shape: tuple[int, ...]) -> Array:
        """[H, W] of values [S, S]; 0 beyond the window."""
        return cv2.warpAffine(values, self._map(SIDE), (shape[1], shape[0]), flags=cv2.INTER_LINEAR)

    def _map(self, side: int) -> Array:
        """[2, 3] from pixels of the window at side x side to those of the picture, their centres being whole."""
        step = self.side / side
        return np.array(
            [[step, 0, self.left + step / 2 - 0.5], [0, step, self.top + step / 2 - 0.5]]
        )

    def _rays(self, rays: Array) -> Array:
        """[SIDE, SIDE, 3] rays of the window, which go on evenly beyond the border."""
        step = spacing(rays)
        across = (np.arange(SIDE) + 0.5) / SIDE * self.side - 0.5
        result = np.empty((SIDE, SIDE, 3), np.float32)
        result[..., 0] = rays[0, 0, 0] + step * (self.left + across)[None, :]
        result[..., 1] = rays[0, 0, 1] - step * (self.top + across)[:, None]
        result[..., 2] = -1
        return result


def refraction_features(view: View) -> Array:
    """[CHANNELS, S, S] float32, 0 outside the object: what the network is given of it.

    Lengths are in units of the object's size, directions in the frame of the ray through the window's centre, so that
    neither the place in the picture nor the scene's scale matters.
    """
    # --- Directions in the frame of the window's central ray ---
    length = np.linalg.norm(view.rays, axis=-1)
    normal = view.normal @ to_window(view.rays).T
    facing = -np.sum(view.normal * view.rays, -1) / length
    # --- Lengths in units of the object's size ---
    size = view.size
    distance = view.depth * length
    relief = (distance - np.median(distance[view.inside])) / size
    border = border_distance(view.inside) / np.sqrt(view.inside.sum())
    mirror = mirrored_thickness(view.depth, view.normal, view.inside, view.rays) / size
    flat = [view.inside.astype(np.float32), facing, np.clip(relief, -3, 3), mirror, border]
    stacked = np.concatenate([linear_to_srgb(view.photo) - 0.5, normal, np.stack(flat, -1)], -1)
    masked = np.where(view.inside[..., None], stacked, 0)  # [S, S, CHANNELS]
    return np.ascontiguousarray(np.moveaxis(masked, -1, 0), np.float32)


MIRROR = 9
"""The channel of `refraction_features` that holds the mirrored thickness."""
MASK = 6
"""The channel of `refraction_features` that holds the mask."""
NORMAL_X = 3
"""The channel of `refraction_features` that changes its sign in a mirror; the other two of the normal follow it."""
BACK_X = 2
"""The channel of the network's answer that does, with the other two of the back's normal after it."""
ANSWERS = 5
"""Channels of the answer: solid and hollow thickness, the back's normal."""


def to_window(rays: Array) -> Array:
    """[3, 3] rotation of camera directions into the network's frame: level, -Z along the middle of rays [S, S, 3]."""
    forward = rays[len(rays) // 2, rays.shape[1] // 2].astype(np.float64)
    return turn_upright(-forward / np.linalg.norm(forward)).T


def _like(weight: Array, values: Array) -> Array:
    """Weights [..] with a last axis where values have one."""
    return weight[..., None] if values.ndim > weight.ndim else weight
