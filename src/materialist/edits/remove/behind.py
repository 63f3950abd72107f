"""Depth and normals of what an object hides: planes go on, everything else is spanned from its surroundings."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from scipy.optimize import minimize
from scipy.special import log_softmax

from materialist.camera import pixel_rays, unit
from materialist.geometry.membrane import membrane
from materialist.geometry.planes import through
from materialist.geometry.silhouette import grown, window
from materialist.types import Array, Camera

SKY = -2
LOOSE = -1
"""Labels of what has no surface, and of surfaces that lie on no plane; planes are 0, 1, ..."""


@dataclass(frozen=True)
class ContinuationSettings:
    """Which surfaces go on behind an object, and where they end; sizes are roots of the hole's area.

    Tuned by eye on 14 photos and 19 rooms of `bench glass`.
    """

    # Which surfaces go on.
    ring_width: float = 0.1  # of the ring around the hole whose surfaces may go on
    min_ring_share: float = 0.01  # of that ring, for a surface that goes on
    min_plane_share: float = 0.5  # of the ring: then only planes go on; from 22 pasted objects

    # Where they part.
    window: float = 0.4  # width of the surroundings that are looked at
    fading: float = 0.2  # distance from the hole at which a pixel counts 1 / e for lines
    min_sorted: float = 0.9  # part of the surroundings that lines must sort rightly
    min_gap: float = 1e-3  # part of the depth between what was hidden and what hid it


SETTINGS = ContinuationSettings()


@dataclass(frozen=True)
class HiddenGeometry:
    """What stands behind an object, at working size; outside the hole it is the scene's own."""

    depth: Array
    """[H, W] float32 planar, scene units; 0 for sky."""
    normal: Array
    """[H, W, 3] float32 unit."""
    label: Array
    """[H, W] int: SKY, LOOSE, or the plane."""


def behind(
    depth: Array, normal: Array, plane: Array, hole: Array, front: Array, camera: Camera
) -> HiddenGeometry:
    """Continue the surfaces around a hole into it.

    Surfaces part along straight lines where such lines sort the pixels around; else each hidden pixel belongs to the
    surface whose share, spanned over the hole as a membrane, is largest. On a plane inverse depth goes on linearly,
    corrected by a membrane to meet the depth around.

    Args:
        depth: [H, W] planar, scene units, 0 = sky. normal: [H, W, 3] unit. plane: [H, W] int: plane of a pixel, -1 for
            none; none of the three is read in the hole.
        hole: [H, W] bool. There must be something around it.
        front: [H, W] depth of what is taken away, 0 where nothing is: the result never comes before it.
    """
    known = np.where(depth > 0, plane, SKY).astype(np.int64)
    out = HiddenGeometry(depth.astype(np.float32), normal.astype(np.float32), known)
    box = window(hole, margin=max(8, round(SETTINGS.window * float(np.sqrt(hole.sum()))) + 1))
    around = _Surroundings(
        depth[box], normal[box], known[box], hole[box], pixel_rays(camera)[box].astype(float)
    )
    # --- Each hidden pixel gets the label of a surface around, then its depth and normal ---
    label = around.labels()
    for k in np.unique(label[around.hole]):
        here = around.hole & (label == k)
        new_depth, new_normal = around.surface(int(k), here, front[box])
        out.depth[box][here] = new_depth
        out.normal[box][here] = new_normal
    out.label[box] = label
    return out


class _Surroundings:
    """The hole and the surroundings that tell what is in it."""

    def __init__(self, depth: Array, normal: Array, known: Array, hole: Array, rays: Array):
        self.normal = normal
        self.known = known
        self.hole = hole
        self.rays = rays
        surface = depth > 0
        self.inverse = np.where(surface, 1 / np.where(surface, depth, 1), 0).astype(np.float64)
        self.spanned = membrane(self.inverse, ~hole & surface)
        self.ring = _ring(hole, SETTINGS.ring_width)

    def labels(self) -> Array:
        """[h, w] int: the labels around, carried into the hole."""
        # --- Which surfaces have enough of the ring to go on ---
        kinds, count = np.unique(self.known[~self.hole], return_counts=True)
        shares = np.array([(self.ring & (self.known == k)).sum() for k in kinds]) / max(
            self.ring.sum(), 1
        )
        kept = (
            kinds[shares >= SETTINGS.min_ring_share]
            if self.ring.any()
            else kinds[count.argmax()][None]
        )
        if shares[np.isin(kinds, kept) & (kinds >= 0)].sum() >= SETTINGS.min_plane_share:
            kept = kept[kept != LOOSE]
        # --- Straight lines part planes; what is no plane has no straight borders ---
        chosen = None if LOOSE in kept else self._parted(kept)
        if chosen is None:
            indicator = np.stack([self.known == k for k in kept], -1).astype(np.float32)
            chosen = kept[membrane(indicator, ~self.hole & np.isin(self.known, kept)).argmax(-1)]
        return np.where(self.hole, chosen, self.known)

    def _parted(self, kinds: Array) -> Array | None:
        """[h, w] labels parted by straight lines: a linear classifier (softmax) of the places of the pixels around.

        Pixels count less the farther from the hole they are. None where lines do not sort them well.
        """
        size = float(np.sqrt(self.hole.sum()))
        rows, columns = np.nonzero(np.isin(self.known, kinds) & _ring(self.hole, SETTINGS.window))
        if not len(rows):
            return None
        target = self.known[rows, columns][:, None] == kinds  # [N, K]
        y, x = (v / size for v in np.indices(self.hole.shape, float))
        # --- A linear classifier of places; each surface counts alike, near pixels more ---
        basis = np.stack([np.ones_like(y), y - y[rows, 0].mean(), x - x[0, columns].mean()], -1)
        near = np.exp(-distance_transform_edt(~self.hole)[rows, columns] / size / SETTINGS.fading)
        balance = near / np.maximum(near @ target, 1e-12)[target.argmax(1)]
        scores = basis @ _softmax(basis[rows, columns], target, balance / balance.sum())
        # --- Trusted where it sorts the pixels around rightly ---
        right = scores[rows, columns].argmax(-1) == target.argmax(-1)
        return (
            kinds[scores.argmax(-1)] if right @ near >= SETTINGS.min_sorted * near.sum() else None
        )

    def surface(self, label: int, pixels: Array, front: Array) -> tuple[Array, Array]:
        """Depth [P] and normals [P, 3] of one surface at `pixels` [h, w] bool of the hole."""
        if label == SKY:
            return np.zeros(pixels.sum()), self.normal[pixels]
        # Inverse depth: linear on a plane, spanned by a membrane elsewhere.
        members = ~self.hole & (self.known == label) & (self.inverse > 0)
        spanned = self._on_plane(members) if label >= 0 else membrane(self.inverse, members)
        spanned = np.where(spanned > 0, spanned, self.spanned)[pixels]
        # Never before what was taken away.
        limit = np.where(
            front[pixels] > 0, (1 - SETTINGS.min_gap) / np.maximum(front[pixels], 1e-12), np.inf
        )
        return 1 / np.clip(np.minimum(spanned, limit), 1e-9, None), unit(
            membrane(self.normal, members)[pixels]
        )

    def _on_plane(self, members: Array) -> Array:
        """[h, w] inverse depth of the plane through the pixels `members` [h, w] bool, bent to meet them at the hole."""
        flat = self.rays @ through(self.rays[members], 1 / np.maximum(self.inverse[members], 1e-12))
        # Where the plane runs to infinity it says nothing.
        sound = flat > 0.2 * np.median(self.inverse[members])
        bend = membrane(
            np.where(sound, self.inverse / np.where(sound, flat, 1), 1), members & sound
        )
        return np.where(sound, flat * bend, 0)


def _ring(hole: Array, width: float) -> Array:
    """[H, W] bool: pixels beside the hole, within `width` of its size."""
    return grown(hole, max(2, round(width * float(np.sqrt(hole.sum()))))) & ~hole


def _softmax(basis: Array, target: Array, weight: Array) -> Array:
    """[F, K] weights of the softmax classifier of features [N, F] into target [N, K] bool, samples weighted [N].

    Nearly without a penalty, and converged: where lines part the samples, they run in the middle of the gap.
    """
    shape = (basis.shape[1], target.shape[1])
    penalty = 1e-7

    def loss(flat: Array) -> tuple[float, Array]:
        weights = flat.reshape(shape)
        logs = log_softmax(basis @ weights, axis=-1)
        slope = basis.T @ ((np.exp(logs) - target) * weight[:, None]) + penalty * weights
        return float(
            -(logs[target] * weight).sum() + penalty / 2 * (weights**2).sum()
        ), slope.ravel()

    fit = minimize(
        loss, np.zeros(shape).ravel(), jac=True, method="L-BFGS-B", options={"maxiter": 500}
    )
    return fit.x.reshape(shape)
