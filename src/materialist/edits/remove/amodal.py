"""Things that an object hid in part go on behind it: their outlines are carried on (good continuation)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from materialist.types import Array

Select = Callable[[tuple[int, int]], Array]
"""select((x, y)) -> [H, W] bool: the thing at a pixel."""
SAME = 0.4
"""Overlap (intersection over union) of a part of the depth and what is selected there, above which they are one."""
JUMP = 0.06
"""Step of inverse depth, as a part of it, at which one thing ends and another begins."""
TOUCHES = 2.5
"""Pixels from the hole up to which an outline lies on its rim."""
LOOKED_AT = 0.2
"""Length of outline that tells where it goes, as a part of the hole's size, and its limits in pixels."""
SHORTEST, LONGEST = 6, 30
MOST_THINGS = 3
"""So many things go on, those that share most of the rim: each is looked for anew."""
AROUND = 8
"""Pixels around the rim in which depths are compared: nearer to it they are mixed."""
LEAST_CONTACT, LEAST_AREA = 5, 40
"""Pixels of outline on the rim, and pixels of a thing, below which nothing is told."""
MOST_CONTACT = 0.5
"""A thing that holds more of the rim than this part is the background."""
MOST_TURN = 4.2
"""Radians by which a continuation turns at most: two thirds of a circle."""
MOST_ADDED = 1.0
"""What is hidden of a thing is at most so many times what is seen of it."""
HIDES = 1.01
"""A thing goes on only if what hid it is nearer by this factor."""


def going_on(
    loose: Array, hole: Array, inverse: Array, front: Array, select: Select | None = None
) -> list[tuple[Array, Array]]:
    """The things beside a hole that go on into it, nearest first.

    Args:
        loose: [H, W] bool: surfaces of things; not read in the hole.
        hole: [H, W] bool.
        inverse: [H, W] inverse depth; not read in the hole.
        front: [H, W] inverse depth of what was taken away, 0 where it was not.
        select: finds the thing at a pixel, sharper than depth does; None takes the outlines of depth.

    Returns:
        What is seen of each thing, [H, W] bool, and what goes on in the hole, [H, W] bool.
    """
    found: list[tuple[float, Array, Array]] = []
    seen = np.zeros_like(hole)
    ring = _grown(hole, 3) & ~hole
    touching = lambda part: int((ring & part).sum())  # noqa: E731
    parts = [
        part
        for part in _things(loose & ~hole, inverse)
        if part.sum() >= LEAST_AREA
        and touching(part) >= LEAST_CONTACT
        and _is_behind(ring & part, part, hole, inverse, front)
    ]
    for part in sorted(parts, key=touching, reverse=True)[:MOST_THINGS]:
        if (seen & part).sum() > SAME * part.sum():
            continue
        own = part if select is None else _sharpened(part, hole, select)
        seen |= own
        hidden = _hidden(own, hole)
        if hidden.any() and hidden.sum() <= MOST_ADDED * own.sum():
            found.append((float(np.median(inverse[own])), own, hidden))
    return [(own, hidden) for _, own, hidden in sorted(found, key=lambda item: -item[0])]


def _sharpened(own: Array, hole: Array, select: Select) -> Array:
    """[H, W] bool: the thing that is selected in the middle of a part; nothing where that is another one."""
    from scipy.ndimage import distance_transform_edt

    deep = distance_transform_edt(np.pad(own, 1))[1:-1, 1:-1]
    y, x = np.unravel_index(int(deep.argmax()), deep.shape)
    found = select((int(x), int(y))) & ~hole
    alike = (found & own).sum() > SAME * (found | own).sum()
    return found if alike else np.zeros_like(own)


def _grown(mask: Array, pixels: int) -> Array:
    import cv2

    return cv2.dilate(mask.astype(np.uint8), np.ones((2 * pixels + 1,) * 2, np.uint8)) > 0


def _things(loose: Array, inverse: Array) -> list[Array]:
    """[H, W] bool each: connected parts of `loose` between steps of depth, without their thin tips."""
    import cv2
    from skimage.measure import label
    from skimage.segmentation import expand_labels

    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    seen = np.where(loose, inverse, 0).astype(np.float32)
    high = cv2.dilate(seen, kernel)
    low = cv2.erode(np.where(loose, inverse, np.inf).astype(np.float32), kernel)
    even = loose & (high - low <= JUMP * np.maximum(high, 1e-12))
    parts = label(cv2.morphologyEx(even.astype(np.uint8), cv2.MORPH_OPEN, kernel) > 0, connectivity=1)
    parts = np.where(loose, expand_labels(parts, 3), 0)
    return [parts == k for k in range(1, parts.max() + 1)]


def _hidden(own: Array, hole: Array) -> Array:
    """[H, W] bool: the part of a hole that a thing's outline encloses when it is carried on."""
    import cv2
    from scipy.ndimage import distance_transform_edt

    out = np.zeros(hole.shape, np.uint8)
    outlines, _ = cv2.findContours(own.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not outlines:
        return out > 0
    line = max(outlines, key=len)[:, 0].astype(float)  # [N, 2] x, y in order
    away = distance_transform_edt(~hole)
    near = away[line[:, 1].astype(int), line[:, 0].astype(int)] <= TOUCHES
    length = int(np.clip(LOOKED_AT * np.sqrt(hole.sum()), SHORTEST, LONGEST))
    rim = int(((away > 0) & (away <= 1)).sum())
    for first, count in _runs(near):
        if count < LEAST_CONTACT or count > MOST_CONTACT * rim or count + 2 * SHORTEST > len(line):
            continue
        run = line[(first + np.arange(count)) % len(line)]
        back = line[(first - 1 - np.arange(length)) % len(line)]
        ahead = line[(first + count + np.arange(length)) % len(line)]
        curve = _joined(run[0], _end(back), run[-1], _end(ahead))
        polygon = np.concatenate([run, curve[::-1]])
        cv2.fillPoly(out, [np.round(polygon).astype(np.int32)], 1)
    return (out > 0) & hole


def _runs(near: Array) -> list[tuple[int, int]]:
    """(first, count) of each run of True in a closed line [N] bool."""
    if near.all() or not near.any():
        return []
    start = int(np.flatnonzero(~near)[0])
    turned = np.roll(near, -start).astype(np.int8)
    step = np.diff(np.concatenate([turned, [0]]))
    firsts, lasts = np.flatnonzero(step == 1) + 1, np.flatnonzero(step == -1)
    return [((start + int(a)) % len(near), int(b - a + 1)) for a, b in zip(firsts, lasts)]


def _is_behind(rim: Array, own: Array, hole: Array, inverse: Array, front: Array) -> bool:
    """Whether what was taken away stood before a thing near the pixels `rim` [H, W] bool, where the two meet."""
    around = _grown(rim, AROUND)
    thing, before = own & around, hole & around & (front > 0)
    return bool(before.any() and np.median(front[before]) > HIDES * np.median(inverse[thing]))


def _end(line: Array) -> Array:
    """[2] unit: where an outline [N, 2] goes on beyond its first point.

    A parabola through the points; the later ones matter less.
    """
    s = np.arange(len(line)) / len(line)
    basis = np.stack([np.ones_like(s), s, s**2], -1)
    weight = np.linspace(1, 0.3, len(line))[:, None]
    _, slope, _ = np.linalg.lstsq(basis * weight, line * weight, rcond=None)[0]
    return -slope / max(float(np.linalg.norm(slope)), 1e-9)


def _angle(a: Array, b: Array) -> float:
    """Between two vectors, in [0, pi]."""
    return float(np.abs(np.arctan2(a[0] * b[1] - a[1] * b[0], a @ b)))


def _joined(a: Array, along_a: Array, b: Array, along_b: Array) -> Array:
    """[K, 2] from a to b: a cubic curve that leaves both as their outlines go on, by circles in the circle's shape.

    An arc that turns by t between the ends of a chord has handles of 1 / (3 cos(t / 4)^2) of the chord; none goes
    beyond the point in which straight continuations meet. Corners are rounded: less is added than might be.
    """
    apart = float(np.linalg.norm(b - a))
    total = min(_angle(b - a, along_a) + _angle(a - b, along_b), MOST_TURN)
    reach = np.full(2, apart / (3 * np.cos(total / 4) ** 2))
    matrix = np.stack([along_a, -along_b], -1)
    if abs(np.linalg.det(matrix)) > 0.1:
        meet = np.linalg.solve(matrix, b - a)
        if (meet > 0).all() and (meet < 2 * apart).all():
            reach = np.minimum(reach, meet)
    t = np.linspace(0, 1, 64)[:, None]
    p, q = a + reach[0] * along_a, b + reach[1] * along_b
    return (1 - t) ** 3 * a + 3 * (1 - t) ** 2 * t * p + 3 * (1 - t) * t**2 * q + t**3 * b
