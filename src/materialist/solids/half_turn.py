"""Thickness of what stands upright and looks alike from behind: the visible front, turned half around an upright axis.

Cylinders, vases, bottles, boxes, pyramids and cushions are their own image after half a turn about an upright axis
(C2). Seen from above, the plane through their silhouette is not where front and back meet, so that the mirror of
`symmetry` is wrong for them; the turn is not. The axis is where the turned front fits: inside the mask, behind the
front, met by it at the left and right silhouette, and about as thick as a guess says.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from materialist.camera import pixel_rays
from materialist.geometry.contour import silhouette_field
from materialist.solids.symmetry import border_distance, object_size, spacing, surface_in
from materialist.solids.turning import Axis, turned_thickness
from materialist.types import Array, Camera

COARSE = 40
"""Pixels along the object while the axis is looked for."""
TILTS = (0.05, 0.25, 0.45)
"""Radians that the camera may look down, to start from, where nothing tells the upright direction."""
LOOKING_DOWN = (0.28, 2.0)
"""Angle, radians, at which things that stand somewhere are usually seen, and what the square of a deviation costs."""
LATHED = 0.3
"""Largest misfit of normals to a lathed body that is told from larger ones: others are not lathed at all."""
EDGED = 0.35
"""n.v at the object's lower end above which it ends in an edge, at a flat base; below, the surface turns away."""
SIDEWAYS = 0.85
"""Least share of the horizontal in the direction across a silhouette that counts as left or right."""
ANGULAR = 0.15
"""Largest change of n.v over the last pixels before the left and right silhouette at which the object ends there in an
edge, that the turn must bring to the edge on the other side; what is round turns away faster."""
INWARD = 2.0
"""Those last pixels."""
ASIDE = 0.12
"""Largest distance between such an edge and the silhouette that is told from larger ones, as a part of the object's
size: seen face on, the edges of a box are not each other's image."""
EDGES = 8.0
"""Weight of that distance against the relative difference from the guess."""
PAD = 8
"""Pixels around the object in which that distance is known."""
GAP = 0.4
"""Largest error that is told from larger ones, as a part of the object's size."""
FITS, FAILS = 0.06, 0.14
"""Misfit up to which an object is taken to be its own image, and from which it is not."""


@dataclass(frozen=True)
class HalfTurn:
    """The back of an object by a half turn."""

    thickness: Array
    """[H, W] float32 along the camera ray, scene units; 0 outside the mask."""
    misfit: float
    """How badly the best turned front fits the visible one and the mask, as a part of the object's size."""
    up: Array
    """[3] unit: the axis' direction, camera frame."""
    foot: Array
    """[3] a point of the axis, at the lowest visible height, scene units."""

    @property
    def trust(self) -> float:
        """In [0, 1]: 1 where the object is its own image as far as can be seen."""
        return float(np.clip((FAILS - self.misfit) / (FAILS - FITS), 0, 1))


def half_turn(
    depth: Array, normal: Array, mask: Array, guess: Array, camera: Camera, *, up: Array | None = None
) -> HalfTurn:
    """The thickness of an object, were it its own image after half a turn about an upright axis.

    Args:
        depth: [H, W] planar, scene units, 0 = none. normal: [H, W, 3] unit. mask: [H, W] bool or weights: one object.
        guess: [H, W] another estimate of the thickness, scene units: which axis, of those that fit, is left to it.
        up: [3] unit, the upright direction in the camera's frame, where a support tells it; else the camera is taken
            not to lean sideways, and the angle at which it looks down is found with the axis.

    Raises:
        InputError: maps of different sizes, or a mask without any surface.
    """
    inside = surface_in(mask, depth, camera)
    rays = pixel_rays(camera).astype(np.float64)
    fit = Fit(depth, normal, inside, guess, rays, None if up is None else np.asarray(up, np.float64))
    misfit, _ = fit.search(fit.strangeness)
    _, axis = fit.search(fit.difference)
    solid = turned_thickness(np.asarray(depth, np.float64), normal, inside, rays, axis)
    return HalfTurn(solid, misfit, axis.up, axis.foot)


def upright(depth: Array, normal: Array, plane: Array, camera: Camera) -> Array | None:
    """[3] unit, camera frame: across the largest plane that faces upwards, or None.

    depth [H, W] planar, normal [H, W, 3] unit, plane [H, W] int: the plane of a pixel, -1 for none.
    """
    points = pixel_rays(camera).astype(np.float64) * np.asarray(depth, np.float64)[..., None]
    best, most = None, 12
    for k in np.unique(plane[plane >= 0]):
        own = (plane == k) & (depth > 0)
        mean = normal[own].mean(0) if own.any() else np.zeros(3)
        if own.sum() > most and mean[1] > 0.6 * max(float(np.linalg.norm(mean)), 1e-9):
            offset = points[own][:: max(1, int(own.sum()) // 4000)]
            across = np.linalg.svd(offset - offset.mean(0), full_matrices=False)[2][-1]
            across = across * np.sign(across @ mean or 1.0)
            if across[1] > 0.6:
                best, most = across, int(own.sum())
    return best


class Fit:
    """The object at few pixels, and how well an axis fits it; parameters as of `half_turn`."""

    def __init__(self, depth: Array, normal: Array, inside: Array, guess: Array, rays: Array, up: Array | None):
        rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
        step = max(1, round(max(np.ptp(rows), np.ptp(columns)) / COARSE))
        part = np.s_[rows[0] : rows[-1] + 1 : step, columns[0] : columns[-1] + 1 : step]
        self.up, self.size = up, object_size(inside, depth, rays)
        self.inside, self.rays = inside[part], rays[part]
        self.depth, self.guess = (np.asarray(v, np.float64)[part] for v in (depth, guess))
        self.step = spacing(self.rays)
        self.length = np.linalg.norm(self.rays, axis=-1)
        self.points = (self.rays * self.depth[..., None])[self.inside]  # [N, 3]
        self.normals = np.asarray(normal, np.float64)[part][self.inside]  # [N, 3]
        self.facing = np.clip(-(np.asarray(normal)[part] * self.rays).sum(-1) / self.length, 0.06, 1)
        self.pixel = self.step * float(np.median(-self.points[:, 2])) / self.size
        self._borders()

    def _borders(self) -> None:
        from scipy.ndimage import distance_transform_edt, gaussian_filter

        self.away = distance_transform_edt(~np.pad(self.inside, 1))[1:-1, 1:-1]
        border = border_distance(self.inside)
        # Left and right only: above and below, what is seen turned is not what the rays leave by.
        field = gaussian_filter(np.pad(self.inside.astype(float), 3), 1.5)
        down, right = (g[3:-3, 3:-3] for g in np.gradient(field))
        self.rim = self.inside & (border < 1.7) & (np.abs(right) > SIDEWAYS * np.hypot(right, down))
        self.edges = self._edges(border, right, down)
        self.border = silhouette_field(np.pad(self.inside, PAD))  # pixels, > 0 inside
        # At distance e from a silhouette with a round section the front lies e cos / (1 - sin) before it.
        before = border * self.depth * self.step * self.facing / (1 - np.sqrt(1 - self.facing**2) + 1e-6)
        self.widest = np.minimum(2 * before, GAP * self.size)  # [h, w] gap next to the silhouette, at most

    def _edges(self, border: Array, right: Array, down: Array) -> tuple[Array, Array] | None:
        """[N, 3] points of the left and of the right edge in which the object ends, or None where it is round."""
        rim = self.rim & (border < 1.1)
        slope = np.maximum(np.hypot(right, down), 1e-9)
        rows, columns = np.indices(rim.shape)
        inner = (
            np.round(rows + INWARD * down / slope).astype(int),
            np.round(columns + INWARD * right / slope).astype(int),
        )
        i, j = (np.clip(k, 0, n - 1) for k, n in zip(inner, rim.shape, strict=True))
        sharp = rim & self.inside[i, j] & (np.abs(self.facing[i, j] - self.facing) < ANGULAR)
        if sharp.sum() < 0.5 * rim.sum() or min((sharp & (right > 0)).sum(), (sharp & (right < 0)).sum()) < 4:
            return None
        normal = np.zeros(self.rays.shape)
        normal[self.inside] = self.normals
        normal = normal[i, j]
        # From the centres of the last pixels to the silhouette, on the plane of what is just inside.
        away = np.stack([-right, down, np.zeros_like(right)], -1) / slope[..., None]
        ray = self.rays + away * (self.step * border)[..., None]
        facing = (normal * ray).sum(-1)
        depth = self.depth * (normal * self.rays).sum(-1) / np.where(np.abs(facing) < 1e-6, 1, facing)
        points = ray * depth[..., None]
        return points[sharp & (right > 0)], points[sharp & (right < 0)]

    def aside(self, axis: Axis) -> float:
        """How far beside the silhouette the turn brings the edges in which it ends, as a part of the object's size."""
        if self.edges is None:
            return 0.0
        from scipy.ndimage import map_coordinates

        x, y = self._seen(axis.turned(np.concatenate(self.edges)))
        off = np.abs(map_coordinates(self.border, [y + PAD, x + PAD], order=1, mode="nearest")) * self.pixel
        return float(np.minimum(off, ASIDE).mean())

    def _seen(self, points: Array) -> tuple[Array, Array]:
        """Column and row [N], fractions of pixels of the window, of points [N, 3]."""
        z = np.maximum(-points[:, 2], 1e-9)
        return (points[:, 0] / z - self.rays[0, 0, 0]) / self.step, (self.rays[0, 0, 1] - points[:, 1] / z) / self.step

    def axis(self, values: Array) -> Axis:
        """The axis of parameters (right, behind) in units of the object's size, and the tilt in radians."""
        up = np.array([0, np.cos(values[2]), np.sin(values[2])]) if self.up is None else self.up
        centre = np.array([*self.points[:, :2].mean(0), np.median(self.points[:, 2])])
        foot = centre + self.size * np.array([values[0], 0, -values[1]])
        height = self.points @ up
        low = float(np.percentile(height, 1))
        bottom = height <= low + 0.06 * np.ptp(height)
        base = bool(np.median(self.facing[self.inside][bottom]) > EDGED)
        return Axis(up, foot + (low - foot @ up) * up, base)

    def strangeness(self, axis: Axis) -> float:
        """How little the turned front goes with the mask and the front, as a part of the object's size."""
        wrong, gap = self._against(axis)
        more = np.clip((gap - self.widest) / self.size, 0, GAP)[self.rim]
        return 2 * wrong + (float(np.where(np.isfinite(more), more, GAP).mean()) if len(more) else 0.0)

    def astray(self, axis: Axis) -> float:
        """What of the turned front lies outside the mask or before the front, as a part of the object's size."""
        return self._against(axis)[0]

    def difference(self, axis: Axis) -> float:
        """The same, but for the guess in place of the silhouette: relative to the guessed thickness."""
        wrong, gap = self._against(axis)
        told = self.inside & np.isfinite(gap)
        off = np.abs(np.maximum(gap, 0) - self.guess)[told].sum() / max(float(self.guess[told].sum()), 1e-9)
        return (
            2 * wrong
            + EDGES * self.aside(axis)
            + min(off, 3.0)
            + 0.3 * float((self.inside & ~told).sum() / self.inside.sum())
        )

    def _against(self, axis: Axis) -> tuple[float, Array]:
        """What of the turned front lies outside the mask or before the front, and [h, w] the gap between the two."""
        back = axis.turned(self.points)
        z = np.maximum(-back[:, 2], 1e-9)
        x, y = self._seen(back)
        height, width = self.inside.shape
        i, j = np.clip(np.round(y).astype(int), 0, height - 1), np.clip(np.round(x).astype(int), 0, width - 1)
        beyond = np.maximum(np.abs(y - i), np.abs(x - j)) - 0.5
        outside = np.minimum((np.maximum(beyond, 0) + self.away[i, j]) * self.pixel, GAP)
        before = np.clip((self.depth[i, j] - z) / self.size, 0, GAP) * self.inside[i, j]
        exits = np.full(self.inside.shape, -np.inf)
        np.maximum.at(exits, (i, j), z)
        exits = np.minimum(_spread(exits), axis.base_depth(self.rays))
        return float(outside.mean() + 2 * before.mean()), (exits - self.depth) * self.length

    def unturned(self, axis: Axis) -> float:
        """How far normals are from meeting the axis, as those of a lathed body do; it tells the tilt of such a one."""
        return float(self.sines(axis).mean())

    def sines(self, axis: Axis) -> Array:
        """[N] sines between normals and the planes through the axis."""
        across = np.cross(axis.up, self.points - axis.foot)
        across /= np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-9)
        return np.abs((self.normals * across).sum(-1))

    def search(self, measure: Callable[[Axis], float]) -> tuple[float, Axis]:
        """The axis at which a measure is least, and its value there, by simplex searches from a few places."""
        from scipy.optimize import minimize

        def cost(values: Array) -> float:
            axis = self.axis(values)
            if self.up is not None:
                return measure(axis)
            usual, price = LOOKING_DOWN
            return measure(axis) + price * (values[2] - usual) ** 2 + min(self.unturned(axis), LATHED)

        starts = [np.array([0.0, b, t]) for b in (0.1, 0.3, 0.5) for t in (TILTS if self.up is None else (0.0,))]
        steps = np.diag([0.08, 0.12, 0.12])
        best: tuple[float, Array] = (np.inf, starts[0])
        for start in sorted(starts, key=cost)[:3]:
            options = {
                "maxfev": 120,
                "xatol": 2e-3,
                "fatol": 1e-4,
                "initial_simplex": np.stack([start, *(start + steps)]),
            }
            found = minimize(cost, start, method="Nelder-Mead", options=options)
            best = min(best, (float(found.fun), found.x), key=lambda pair: pair[0])
        axis = self.axis(best[1])
        return measure(axis), axis


def _spread(exits: Array) -> Array:
    """[h, w] with empty pixels (-inf) taking the largest of their neighbours."""
    from scipy.ndimage import maximum_filter

    return np.where(np.isfinite(exits), exits, maximum_filter(exits, 3))
