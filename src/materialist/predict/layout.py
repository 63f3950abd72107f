"""Depth from a prior: a ground plane, a back wall or sky, and segments that stand upright on the ground."""

from __future__ import annotations

import cv2
import numpy as np

from materialist.color import linear_to_srgb
from materialist.types import Array, Camera

SEGMENT_SIZE = 320
"""Longer side at which the picture is segmented."""
WALL_ROWS = (0.35, 0.72)
"""Where ground and wall may meet, as a fraction of the height."""
HORIZON_ABOVE = 0.22
"""How far above that line the horizon is, as a fraction of the height."""
BULGE = 0.7
"""How far objects come forward: 1 makes a disc a half sphere."""


def guess_depth(linear: Array, camera: Camera) -> Array:
    """Planar depth [H, W] float32 of a linear picture [H, W, 3]; the bottom row is at 1 scene unit; 0 is sky."""
    height, width = linear.shape[:2]
    scale = min(1.0, SEGMENT_SIZE / max(height, width))
    small = (max(1, round(height * scale)), max(1, round(width * scale)))
    picture = linear_to_srgb(cv2.resize(linear, small[::-1], interpolation=cv2.INTER_AREA))
    labels = _segments(picture)
    sky = find_sky(picture)
    ground = _ground(labels, sky)
    contact = _wall_row(ground)
    objects = _objects(labels, ground, sky, contact)
    things = [(_enlarged(mask, (height, width)), _foot(mask) / scale) for mask in objects]
    swell = cv2.resize(_inflated(objects, small), (width, height), interpolation=cv2.INTER_LINEAR) / scale
    depth = 1 / _assemble((height, width), things, contact / scale, BULGE * swell / camera.focal)
    return np.where(_enlarged(sky, (height, width)), 0, depth).astype(np.float32)


def _enlarged(mask: Array, size: tuple[int, int]) -> Array:
    """[H, W] bool: a mask at another size, with a smooth outline."""
    soft = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.5)
    return cv2.resize(soft, size[::-1], interpolation=cv2.INTER_LINEAR) > 0.5


def find_sky(srgb: Array) -> Array:
    """[H, W] bool: smooth, bright and blue down from the top border; empty where that is not confident."""
    blurred = cv2.GaussianBlur(srgb, (0, 0), 2)
    red, _, blue = np.moveaxis(blurred, -1, 0)
    detail = cv2.GaussianBlur(np.abs(cv2.Laplacian(srgb.mean(-1), cv2.CV_32F)), (0, 0), 2)
    candidate = ((blurred.mean(-1) > 0.4) & (blue > red + 0.01) & (detail < 0.06)) | (blurred.min(-1) > 0.93)
    _, parts = cv2.connectedComponents(candidate.astype(np.uint8), connectivity=4)
    sky = np.zeros(srgb.shape[:2], bool)
    for k in np.unique(parts[0][candidate[0]]):
        part = parts == k
        evidence = (blue - red)[part].mean() > 0.06
        wide = part[0].mean() > 0.3 and part.mean() > 0.03 and part[-1].mean() < 0.05
        if evidence and wide:
            sky |= part
    return sky


def _segments(srgb: Array) -> Array:
    """[H, W] int labels of regions of one colour (Felzenszwalb and Huttenlocher 2004)."""
    from skimage.color import rgb2lab
    from skimage.segmentation import felzenszwalb

    if min(srgb.shape[:2]) < 8:
        return np.zeros(srgb.shape[:2], int)
    # Brightness counts half: shading and soft shadows must not cut a surface in two.
    lab = rgb2lab(srgb) / 100 * [0.5, 1, 1]
    area = srgb.shape[0] * srgb.shape[1]
    labels = felzenszwalb(lab, scale=120, sigma=0.8, min_size=max(20, area // 250), channel_axis=-1)
    return _without_rims(labels)


def _without_rims(labels: Array) -> Array:
    """The labels [H, W] with regions thinner than 5 pixels (blurred outlines) given to their nearest neighbours."""
    from scipy.ndimage import distance_transform_edt

    values, kernel = labels.astype(np.float32), np.ones((5, 5), np.uint8)
    core = cv2.dilate(values, kernel) == cv2.erode(values, kernel)
    thick = np.isin(labels, np.unique(labels[core]))
    if not thick.any():
        return labels
    nearest = distance_transform_edt(~thick, return_distances=False, return_indices=True)
    return labels[tuple(nearest)]


def _ground(labels: Array, sky: Array) -> Array:
    """[H, W] bool: the segments that take up most of the bottom of the picture."""
    height = labels.shape[0]
    strip = labels[-max(1, height // 20) :]
    found, counts = np.unique(strip, return_counts=True)
    ground = np.zeros(labels.shape, bool)
    for k, share in zip(found, counts / strip.size):
        part = labels == k
        # A thing that only touches the bottom is narrow there, or narrower there than higher up.
        columns = part.any(0).mean()
        if share > 0.12 and columns > 0.25:
            ground |= part
    return ground & ~sky & (np.arange(height)[:, None] > 0.3 * height)


def _wall_row(ground: Array) -> float:
    """The row where ground and wall meet."""
    height = ground.shape[0]
    low, high = (x * height for x in WALL_ROWS)
    columns = ground.any(0)
    if columns.mean() < 0.3:
        return float((low + high) / 2)
    tops = ground.argmax(0)[columns]
    return float(np.clip(np.percentile(tops, 15), low, high))


def _objects(labels: Array, ground: Array, sky: Array, contact: float) -> list[Array]:
    """Masks [H, W] of things that stand on the ground, the farthest first.

    A segment whose foot is in front of the wall is a thing; one that rests on a thing belongs to it.
    """
    height = labels.shape[0]
    things: dict[int, Array] = {}
    owner = np.full(labels.shape, -1)
    order = sorted(np.unique(labels), key=lambda k: -np.nonzero(labels == k)[0].max())
    for k in order:
        part = (labels == k) & ~sky & ~ground
        if not part.any():
            continue
        rows = np.nonzero(part.any(1))[0]
        beneath = np.roll(part, 2, axis=0) & ~part
        beneath[:2] = False
        under = owner[beneath]
        rests_on = int(np.bincount(under[under >= 0]).argmax()) if (under >= 0).any() else -1
        if rests_on >= 0 and (under == rests_on).mean() > 0.6 and part.mean() < 0.15:
            things[rests_on] |= part
            owner[part] = rests_on
        elif rows[-1] > contact + 0.04 * height and np.ptp(rows) > 0.1 * height and part.mean() < 0.4:
            things[k] = part
            owner[part] = k
    kept = [mask for mask in things.values() if _stands(mask, contact)]
    return sorted(kept, key=_foot)


def _stands(mask: Array, contact: float) -> bool:
    """Whether a mask is more likely a standing thing than a mark on the ground."""
    rows, columns = np.nonzero(mask.any(1))[0], np.nonzero(mask.any(0))[0]
    tall = np.ptp(rows) > 0.6 * np.ptp(columns) or rows[0] < contact - 0.05 * mask.shape[0]
    # What is cut by the upper corners and large is more likely a wall.
    wall = mask[0].mean() > 0.15 or (mask[:, [0, -1]].any() and mask.mean() > 0.12)
    return bool(tall and not wall and mask.sum() > 0.4 * np.ptp(rows) * np.ptp(columns))


def _foot(mask: Array) -> float:
    """The row on which a mask stands."""
    return float(np.percentile(np.nonzero(mask)[0], 97))


def _inflated(masks: list[Array], shape: tuple[int, int]) -> Array:
    """[H, W] float32 height in pixels of masks blown up like balloons: sqrt(4 u) with laplacian(u) = -1 inside.

    A disc becomes a half sphere. The border of the picture is free: what it cuts goes on behind it.
    """
    from scipy.sparse import coo_matrix, diags
    from scipy.sparse.linalg import spsolve

    owner = np.full(shape, -1)
    for k, mask in enumerate(masks):
        owner[mask] = k
    inside = owner >= 0
    count = int(inside.sum())
    height = np.zeros(shape, np.float32)
    if count == 0:
        return height
    number = np.full(shape, -1)
    number[inside] = np.arange(count)
    pairs, degree = [], np.zeros(shape)
    for axis in (0, 1):
        first, second = (np.take(np.arange(inside.size).reshape(shape), np.arange(shape[axis])[s], axis).ravel()
                         for s in (slice(None, -1), slice(1, None)))  # fmt: skip
        np.add.at(degree.reshape(-1), np.concatenate([first, second]), 1)
        joined = inside.flat[first] & (owner.flat[first] == owner.flat[second])
        pairs.append(np.stack([number.flat[first[joined]], number.flat[second[joined]]]))
    i, j = np.concatenate(pairs, axis=1)
    links = coo_matrix((np.ones(2 * len(i)), (np.concatenate([i, j]), np.concatenate([j, i]))), (count, count))
    # A whole picture of one thing would have no border: the small term keeps it solvable.
    u = spsolve((diags(degree[inside] + 1e-6) - links).tocsc(), np.ones(count))
    height[inside] = np.sqrt(4 * np.maximum(u, 0))
    return np.minimum(height, 0.5 * max(shape))


def _assemble(shape: tuple[int, int], things: list[tuple[Array, float]], contact: float, swell: Array) -> Array:
    """[H, W] inverse depth: ground plane, wall above row `contact`, and upright things in front of them.

    `things` are masks [H, W] with the row of their foot; `swell` [H, W] is how far they come forward, relative to
    their depth.
    """
    height, width = shape
    horizon = contact - HORIZON_ABOVE * height
    # Inverse depth of a plane is linear on the screen; the bottom row is at depth 1.
    ground = lambda row: (np.maximum(row, contact) + 0.5 - horizon) / (height - 0.5 - horizon)  # noqa: E731
    inverse = np.repeat(ground(np.arange(height))[:, None], width, axis=1)
    for mask, foot in things:
        upright = ground(foot) / (1 - np.minimum(swell, 0.3))
        # Never behind the ground that it stands on.
        inverse = np.where(mask, np.maximum(upright, inverse), inverse)
    return inverse
