"""Depth and normals of what an object hides: planes go on, everything else is spanned from its surroundings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from materialist.camera import pixel_rays
from materialist.geometry.membrane import membrane
from materialist.types import Array, Camera

THING, SKY, LOOSE = -3, -2, -1
"""Labels of a thing that goes on (the next ones are -4, -5, ...), of what has no surface, and of other surfaces that
lie on no plane; planes are 0, 1, ..."""
LEAST = 0.01
"""A surface hides behind the object only if it has this share of the pixels around it."""
FIRM = 0.1
"""If planes hold this share of the pixels around, no hidden pixel belongs to what is none: things end, planes go on."""
BEYOND = 0.5
"""Unless this share of what lies on no plane, around, stands where no plane goes on: that is the background."""
FARTHEST, NEARER = 1.1, 0.9
"""A plane ends by this multiple of the depth up to which it is seen anywhere, and is not where it would come before
this part of the depth that is seen."""
AROUND = 0.15
"""Surroundings that are looked at, as a part of the hole's extent."""
SMALL, BESIDE = 2.0, 0.45
"""A plane of less than so many holes that does not reach the frame is a face of a thing, which is no background unless
it is seen around this part of the hole."""
STRAIGHT = 0.9
"""Planes part along straight lines if such lines sort this share of the pixels around rightly."""
RINGS = (0.1, 0.2, 0.4, 0.8)
"""Widths of the ring around the hole, in its size, in which surfaces that part are looked at: the first in which they
come near each other along half of its size, the widest if that is nowhere so."""
MEET, ALONG, LEAST_ALONG = 4, 0.5, 0.05
"""Pixels up to which that is near, that part, and the part below which they are not seen to meet at all: then what is
nearest counts."""
FADES = 0.2
"""Distance from the hole, in its size, at which a pixel counts by 1 / e of one at its rim."""
SLACK = 1e-7
"""Penalty on the weights of those lines."""
CLEAR = 1e-3
"""What was hidden lies at least this part of the depth behind what hid it."""


Things = Sequence[tuple[Array, Array]]
"""What is seen of a thing and what of it is hidden, [H, W] bool each, nearest thing first."""


@dataclass(frozen=True)
class Behind:
    """What stands behind an object, at working size; outside the hole it is the scene's own."""

    depth: Array
    """[H, W] float32 planar, scene units; 0 for sky."""
    normal: Array
    """[H, W, 3] float32 unit."""
    label: Array
    """[H, W] int: SKY, LOOSE, the plane, or a thing."""


def behind(
    depth: Array, normal: Array, plane: Array, hole: Array, front: Array, camera: Camera, things: Things = ()
) -> Behind:
    """Continue the surfaces around a hole into it.

    Args:
        depth: [H, W] planar, scene units, 0 = sky. normal: [H, W, 3] unit. plane: [H, W] int: plane of a pixel, -1 for
            none; none of the three is read in the hole.
        hole: [H, W] bool. There must be something around it.
        front: [H, W] depth of what is taken away, 0 where nothing is: the result never comes before it.
        things: what was hidden in part (see `amodal.going_on`); it stands before everything else. Where what lies on no
            plane is the background, there are none.

    Planes part along straight lines where such lines sort the pixels around; else each hidden pixel belongs to the
    surface whose share, spanned over the hole as a membrane, is largest. On a plane inverse depth goes on linearly,
    corrected by a membrane to meet the depth around.
    """
    rays = pixel_rays(camera).astype(np.float64)
    box = _surroundings(hole)
    seen = np.where(hole | (depth <= 0), LOOSE, plane)
    ends = {int(k): FARTHEST * float(np.percentile(depth[seen == k], 99)) for k in np.unique(seen[seen >= 0])}
    ends = {k: end for k, end in ends.items() if not is_thing(seen == k, hole)}
    known = np.where(depth > 0, plane, SKY).astype(np.int64)
    hidden = [(own[box], gone[box]) for own, gone in things]

    def parted(kinds: Array) -> Array | None:
        found = _straight(known, hole, _where_they_meet(known, hole, kinds), kinds)
        return None if found is None else found[box]

    part = _behind(depth[box], normal[box], known[box], hole[box], front[box], rays[box], ends, hidden, parted)
    for number, (own, _) in reversed(list(enumerate(things))):
        known[own] = THING - number if (part.label == THING - number).any() else known[own]
    out = Behind(depth.astype(np.float32), normal.astype(np.float32), known)
    for whole, piece in ((out.depth, part.depth), (out.normal, part.normal), (out.label, part.label)):
        whole[box] = piece
    return out


def is_thing(own: Array, hole: Array) -> bool:
    """Whether the plane of the pixels `own` [H, W] bool is of something beside a hole, and not its background."""
    if own[[0, -1]].any() or own[:, [0, -1]].any() or own.sum() >= SMALL * hole.sum():
        return False
    rows, columns = np.nonzero(own & _ring(hole))
    if not len(rows):
        return False
    y, x = (v.mean() for v in np.nonzero(hole))
    seen = np.histogram(np.arctan2(rows - y, columns - x), 36, (-np.pi, np.pi))[0] > 0
    return bool(seen.mean() < BESIDE)


def _surroundings(hole: Array) -> tuple[slice, slice]:
    """The window around a hole that tells what is in it."""
    rows, columns = np.flatnonzero(hole.any(1)), np.flatnonzero(hole.any(0))
    margin = max(8, round(AROUND * max(np.ptp(rows), np.ptp(columns))))
    top, left = max(rows[0] - margin, 0), max(columns[0] - margin, 0)
    return np.s_[top : rows[-1] + margin + 1, left : columns[-1] + margin + 1]


def _behind(
    depth: Array, normal: Array, known: Array, hole: Array, front: Array, rays: Array, ends: dict[int, float],
    things: Things, parted: Callable[[Array], Array | None],
) -> Behind:  # fmt: skip
    """`behind` of a window; `ends`: the depth at which each plane ends; planes that it lacks do not go on."""
    inverse = np.where(depth > 0, 1 / np.where(depth > 0, depth, 1), 0).astype(np.float64)
    label = _labels(known, hole, inverse, rays, ends, parted)
    if not (label[hole] == LOOSE).any():
        for number, (own, hidden) in reversed(list(enumerate(things))):
            label[own | (hidden & hole)] = THING - number
        known = np.where(hole, known, label)
    new_depth, new_normal = depth.astype(np.float32).copy(), normal.astype(np.float32).copy()
    surface = ~hole & (depth > 0)
    general = membrane(inverse, surface) if surface.any() else inverse
    for k in np.unique(label[hole]):
        here = hole & (label == k)
        if k == SKY:
            new_depth[here] = 0
            continue
        own = ~hole & (known == k) & (inverse > 0)
        spanned = _on_plane(inverse, own, rays) if k >= 0 else membrane(inverse, own)
        spanned = np.where(spanned > 0, spanned, general)[here]
        limit = np.where(front[here] > 0, (1 - CLEAR) / np.maximum(front[here], 1e-12), np.inf)
        new_depth[here] = 1 / np.clip(np.minimum(spanned, limit), 1e-9, None)
        turned = membrane(normal, own)[here]
        new_normal[here] = turned / np.maximum(np.linalg.norm(turned, axis=-1, keepdims=True), 1e-6)
    return Behind(new_depth, new_normal, label)


def _labels(
    known: Array, hole: Array, inverse: Array, rays: Array, ends: dict[int, float],
    parted: Callable[[Array], Array | None],
) -> Array:  # fmt: skip
    """[H, W] int: the labels of the pixels around, carried into the hole."""
    kinds, count = np.unique(known[~hole], return_counts=True)
    ring = _ring(hole)
    shares = np.array([np.mean(known[ring] == k) if ring.any() else 0.0 for k in kinds])
    goes_on = (shares >= LEAST) & ((kinds < 0) | np.isin(kinds, list(ends)))
    goes_on = goes_on if goes_on.any() else shares >= LEAST
    kept = kinds[goes_on] if goes_on.any() else kinds[count.argmax()][None]
    loose = ring & (known == LOOSE)
    near = {int(k): ends[int(k)] for k in kept if int(k) in ends}
    firm = kept if _is_background(np.where(hole, SKY, known), loose, inverse, rays, near) else kept[kept != LOOSE]
    if shares[np.isin(kinds, kept) & (kinds >= 0)].sum() >= FIRM:
        kept = firm
    indicator = np.stack([known == k for k in kept], -1).astype(np.float32)
    spanned = membrane(indicator, ~hole & np.isin(known, kept))
    chosen = kept[spanned.argmax(-1)]
    if len(firm) > 1:
        straight = parted(firm)
        chosen = chosen if straight is None or (LOOSE in kept and LOOSE not in firm) else straight
    return np.where(hole, chosen, known)


def _is_background(known: Array, loose: Array, inverse: Array, rays: Array, ends: dict[int, float]) -> bool:
    """Whether what is `loose` [H, W] bool around a hole stands where planes have ended, and not on them."""
    if not loose.any():
        return False
    beyond = np.ones(loose.sum(), bool)
    for k, end in ends.items():
        going_on = rays[loose] @ _flat(inverse, known == k, rays)  # inverse depth; above the horizon not positive
        beyond &= (going_on < 1 / end) | (going_on > inverse[loose] / NEARER)
    return bool(beyond.mean() > BEYOND)


def _where_they_meet(known: Array, hole: Array, kinds: Array) -> Array:
    """[H, W] bool: pixels of some surfaces around a hole, from as far away as two of them are seen to meet."""
    import cv2

    size, own = np.sqrt(hole.sum()), np.isin(known, kinds) & ~hole
    near = np.ones((2 * MEET + 1,) * 2, np.uint8)
    spread = [cv2.dilate(((known == k) & ~hole).astype(np.uint8), near) for k in kinds]
    meeting = (np.sum(spread, axis=0) > 1) & ~hole
    along = 0.0
    for part in RINGS:
        ring = _ring(hole, part * size)
        along = (meeting & ring).sum() / (2 * MEET * size)
        if along >= ALONG:
            break
    return own & (ring if along >= LEAST_ALONG else _ring(hole))


def _straight(known: Array, hole: Array, ring: Array, kinds: Array) -> Array | None:
    """[H, W] labels parted by straight lines: a linear classifier (softmax) of the places of the pixels around,
    which count less the farther from the hole they are.

    None where lines do not sort them well.
    """
    from scipy.ndimage import distance_transform_edt

    rows, columns = np.nonzero(ring)
    stride = max(1, len(rows) // 4000)
    rows, columns = rows[::stride], columns[::stride]
    middle, scale = np.array([rows.mean(), columns.mean()]), max(rows.std() + columns.std(), 1.0)
    at = lambda y, x: np.stack([np.ones_like(y, float), (y - middle[0]) / scale, (x - middle[1]) / scale], -1)  # noqa: E731
    basis = at(rows.astype(float), columns.astype(float))
    wanted = known[rows, columns][:, None] == kinds  # [N, K]
    away = distance_transform_edt(~hole)[rows, columns] / np.sqrt(hole.sum())
    near = np.exp(-away / FADES)
    balance = near / np.maximum(near @ wanted, 1e-12)[wanted.argmax(1)]
    weights = _softmax(basis, wanted, balance / balance.sum())
    right = (basis @ weights).argmax(-1) == wanted.argmax(-1)
    if (right * near).sum() < STRAIGHT * near.sum():
        return None
    y, x = np.mgrid[: known.shape[0], : known.shape[1]].astype(float)
    return kinds[(at(y, x) @ weights).argmax(-1)]


def _softmax(basis: Array, wanted: Array, weight: Array) -> Array:
    """[F, K] weights of the softmax classifier of features [N, F] into wanted [N, K] bool, samples weighted [N].

    Nearly without a penalty, and converged: where lines part the samples, they run in the middle of the gap.
    """
    from scipy.optimize import minimize
    from scipy.special import log_softmax

    shape = basis.shape[1], wanted.shape[1]

    def loss(flat: Array) -> tuple[float, Array]:
        at = flat.reshape(shape)
        logs = log_softmax(basis @ at, axis=-1)
        slope = basis.T @ ((np.exp(logs) - wanted) * weight[:, None]) + SLACK * at
        return float(-(logs[wanted] * weight).sum() + SLACK / 2 * (at**2).sum()), slope.ravel()

    found = minimize(loss, np.zeros(shape).ravel(), jac=True, method="L-BFGS-B", options={"maxiter": 500})
    return found.x.reshape(shape)


def _ring(hole: Array, reach: float | None = None) -> Array:
    """[H, W] bool: known pixels near the hole, within a tenth of its size, or other pixels."""
    import cv2

    reach = max(2, round(0.1 * np.sqrt(hole.sum()) if reach is None else reach))
    return (cv2.dilate(hole.astype(np.uint8), np.ones((2 * reach + 1,) * 2, np.uint8)) > 0) & ~hole


def _on_plane(inverse: Array, own: Array, rays: Array) -> Array:
    """[H, W] inverse depth of the plane through the pixels `own` [H, W] bool, bent to meet them at the hole."""
    flat = rays @ _flat(inverse, own, rays)
    sound = flat > 0.2 * np.median(inverse[own])
    bend = membrane(np.where(sound, inverse / np.where(sound, flat, 1), 1), own & sound)
    return np.where(sound, flat * bend, 0)


def _flat(inverse: Array, own: Array, rays: Array) -> Array:
    """[3] whose product with a ray is the inverse depth of the plane through the pixels `own` [H, W] bool."""
    scaled = rays[own] / np.maximum(inverse[own], 1e-12)[:, None]  # weighted by depth: the relative error counts
    return np.linalg.lstsq(scaled, np.ones(len(scaled)), rcond=None)[0]
