"""The object at a pixel: of all regions that grow from it, the one whose outline is the strongest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from materialist.types import Array, Scene

_COLOUR, _STEP, _CREASE = 12.0, 0.03, 0.35
"""A full edge: Lab distance between neighbours, share of a jump of depth beyond the slope, 1 - cos of a turn."""
_SHADED = 0.3
"""What a change of lightness still counts, squared, where a surface turns away from itself: most of it is shading."""
_MOST = 3.0
"""Strength at which an edge counts no more."""
_FLOOR = 0.01
"""Cost of a step where nothing changes: keeps the region near its seed."""
_APART = 20.0
"""Lab distance of the mean colours of two sides that are clearly different."""
_KINDS = ("plain", "coarse", "chroma")
_CANDIDATES = 48
_LIKELY = 0.8
"""Worth of a region that agrees with what is likely, beside that of its outline, where what is likely is sure."""
_DOUBT = (0.7, 0.9)
"""Certainty from which it counts at all, and in full: of a photo unlike its lessons a network says "perhaps" widely."""
_SHARES = (0.3, 0.5, 0.7)
"""Shares from which what is likely makes regions of its own."""


def object_around(features, seeds: Sequence[tuple[int, int]], likely: Array | None = None) -> Array:
    """[H, W] bool of the object under the seeds (column, row).

    `likely` [H, W] in [0, 1], if given, is how likely a pixel belongs to it (see `predict.clicks`).

    A region grows from the seeds over the least crossed edges (a geodesic distance, over an edge map of colour, depth
    and normals). Each distance gives one candidate; the outline's mean edge strength, how suddenly the growth stops
    there, and a mild liking for regions that stay off the frame, choose.
    """
    edges = edge_map(features)
    worth = 0.0 if likely is None else _LIKELY * float(np.clip((certainty(likely) - _DOUBT[0]) / np.ptp(_DOUBT), 0, 1))
    best, best_score = np.zeros(features.shape, bool), -np.inf
    for region in _regions(features, edges, seeds, likely):
        score = outline_score(region, edges, features.lab)
        if likely is not None:
            score += worth * float(np.minimum(region, likely).sum() / np.maximum(region, likely).sum())
        if score > best_score:
            best, best_score = region, score
    return best


def certainty(likely: Array) -> float:
    """In [0, 1]: how far a map [H, W] of likelihoods agrees with itself cut at a half; 1 for yes and no alone."""
    half = likely > 0.5
    return float(np.minimum(half, likely).sum() / max(float(np.maximum(half, likely).sum()), 1e-6))


def _regions(features, edges: Array, seeds: Sequence[tuple[int, int]], likely: Array | None) -> Iterator[Array]:
    """[H, W] bool: what may be the object."""
    from skimage.measure import label

    for kind in _KINDS:
        distance = geodesic(edges if kind == "plain" else edge_map(features, kind), seeds)
        for level in _levels(distance):
            yield _filled(distance <= level)
    for share in _SHARES if likely is not None else ():
        region = _filled(np.asarray(likely) > share)
        parts = label(region, connectivity=1)
        under = np.unique([parts[y, x] for x, y in seeds])
        if under.any():
            yield np.isin(parts, under[under > 0])


def edge_map(features, kind: str = "plain") -> Array:
    """[H, W] strength, 1 for a plain edge, of the border between surfaces that passes through each pixel.

    kind: `plain`; `coarse` does not see fine texture; `chroma` does not see shading and highlights.
    """
    import cv2

    lab: Array = np.ascontiguousarray(features.lab, np.float32)
    lab = np.asarray(cv2.GaussianBlur(lab, (0, 0), 2.5) * 2 if kind == "coarse" else cv2.bilateralFilter(lab, 5, 12, 2))
    if kind == "chroma":
        lab = lab * np.array([0.25, 1.5, 1.5], np.float32)
    crease = sum(_gradient(features.normal[..., c]) ** 2 for c in range(3)) / 2 / _CREASE
    convex = convexity(features.normal)
    shaded = cv2.dilate((convex * np.minimum(crease, 1)).astype(np.float32), np.ones((3, 3), np.uint8))
    light, chroma = _gradient(lab[..., 0]) ** 2, sum(_gradient(lab[..., c]) ** 2 for c in (1, 2))
    colour = np.sqrt(light * (1 - (1 - _SHADED) * shaded) + chroma) / _COLOUR
    safe = np.where(features.surface, features.depth, 1.3 * features.depth.max())
    inverse = 1 / np.maximum(safe, 1e-9)  # planar in the picture for a plane, so that its second difference is a step
    step = _second(inverse) / np.maximum(inverse, 1e-12) / _STEP
    shape = np.sqrt(np.minimum(step, _MOST) ** 2 + 0.5 * crease * (1 - convex))
    return (np.minimum(colour, _MOST) + borne_out(shape, colour) * shape).astype(np.float32)


def convexity(normal: Array) -> Array:
    """[H, W] in [0, 1]: what part of the turn of normals [H, W, 3] is away from each other, in the picture's plane.

    It is large at the edges of a box, 0 between a thing and what it stands on, and where nothing turns. Things
    end in concave creases and in steps of the depth; their convex edges are inside them.
    """
    import cv2

    change = lambda v, x, y: cv2.Sobel(np.ascontiguousarray(v, np.float32), cv2.CV_32F, x, y, ksize=3, scale=1 / 4)  # noqa: E731
    apart = change(normal[..., 0], 1, 0) - change(normal[..., 1], 0, 1)  # rows go down, Y goes up
    turn = np.sqrt(sum(_gradient(normal[..., c]) ** 2 for c in range(3)))
    return np.clip(apart / np.maximum(turn, 1e-6), 0, 1)


def borne_out(shape: Array, colour: Array) -> float:
    """In [0, 1]: how far the photo shows an edge where the shape has one; a guessed relief has edges of its own."""
    import cv2

    strong = shape > 0.5
    if strong.sum() < 20:
        return 1.0
    near = cv2.dilate(np.ascontiguousarray(colour, np.float32), np.ones((5, 5), np.uint8))
    # Chance alone puts half of the edges where the photo has more than its median.
    return float(np.clip(2 * (near[strong] > np.quantile(near, 0.6)).mean() - 1.0, 0, 1))


def geodesic(edges: Array, seeds: Sequence[tuple[int, int]]) -> Array:
    """[H, W] least sum of edge strength on a way from any seed (column, row)."""
    from skimage.graph import MCP_Geometric

    height, width = edges.shape
    # Two pixels around each seed: a click on a speck means what the speck lies on.
    disc = [(i, j) for i in range(-2, 3) for j in range(-2, 3) if i * i + j * j <= 4]
    starts = {(min(max(y + i, 0), height - 1), min(max(x + j, 0), width - 1)) for x, y in seeds for i, j in disc}
    return MCP_Geometric(edges.astype(np.float64) + _FLOOR).find_costs(sorted(starts))[0]


def outline_score(region: Array, edges: Array, lab: Array) -> float:
    """How much a region looks like an object: edges along its outline, other colours outside, little on the frame.

    Args:
        region: [H, W] bool. edges: [H, W] of `edge_map`. lab: [H, W, 3] with L in [0, 100].

    Returns:
        The larger the better; -inf for a region that is tiny or most of the picture.
    """
    import cv2

    area = region.mean()
    if not 2e-4 < area < 0.75:
        return -np.inf
    kernel = np.ones((3, 3), np.uint8)
    mask = region.astype(np.uint8)
    # The outline, one pixel to either side: edges are two pixels wide.
    outline = (cv2.dilate(mask, kernel) - cv2.erode(mask, kernel, borderValue=1)) > 0
    framed = np.zeros_like(region)
    framed[[0, -1]] = framed[:, [0, -1]] = True
    on_frame = float((region & framed).sum())
    length = float(outline.sum()) / 2
    if length == 0:
        return -np.inf
    strongest = cv2.dilate(edges, kernel)
    strength = float((1 - np.exp(-2 * strongest[outline])).mean()) + 0.3 * float(contrast(region, lab)[outline].mean())
    compact = 4 * np.pi * region.sum() / max((length + on_frame) ** 2, 1)
    frame = on_frame / (length + on_frame)
    return strength - 0.5 * frame + 0.15 * min(compact, 1.0) + 0.03 * float(np.log(area))


def contrast(region: Array, lab: Array, window: int = 11) -> Array:
    """[H, W] in [0, 1]: difference of the mean colours of both sides of the outline nearby: texture averages out."""
    import cv2

    inside = region.astype(np.float32)
    box = lambda v: cv2.blur(v, (window, window), borderType=cv2.BORDER_REFLECT)  # noqa: E731
    mean = lambda side: box(lab * side[..., None]) / np.maximum(box(side), 1e-6)[..., None]  # noqa: E731
    away = np.linalg.norm(mean(inside) - mean(1 - inside), axis=-1)
    return 1 - np.exp(-away / _APART)


def _levels(distance: Array) -> Array:
    """Candidate distances: even in the area that they enclose, on a log scale."""
    ordered = np.sort(distance[np.isfinite(distance)].ravel())
    ranks = np.unique(np.geomspace(max(4, 3e-4 * len(ordered)), 0.75 * len(ordered), _CANDIDATES).astype(int))
    return ordered[np.minimum(ranks, len(ordered) - 1)]


def _filled(region: Array) -> Array:
    """Without holes below a tenth of the region, and without hair."""
    import cv2
    from scipy import ndimage

    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    closed = cv2.morphologyEx(region.astype(np.uint8), cv2.MORPH_CLOSE, kernel) > 0
    holes, count = ndimage.label(~closed)
    if count:
        sizes = ndimage.sum_labels(np.ones_like(holes), holes, np.arange(1, count + 1))
        small = np.flatnonzero(sizes < 0.1 * closed.sum()) + 1
        touching = np.unique(np.concatenate([holes[0], holes[-1], holes[:, 0], holes[:, -1]]))
        closed = closed | np.isin(holes, np.setdiff1d(small, touching))
    return closed


def _gradient(values: Array) -> Array:
    """[H, W] length of the central difference, per pixel."""
    import cv2

    values = np.ascontiguousarray(values, np.float32)
    x = cv2.Sobel(values, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8)
    y = cv2.Sobel(values, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8)
    return np.hypot(x, y) * 2


def _second(values: Array) -> Array:
    """[H, W] length of the second differences: 0 on a slope."""
    padded = np.pad(values, 1, mode="reflect", reflect_type="odd")
    x = padded[1:-1, 2:] - 2 * values + padded[1:-1, :-2]
    y = padded[2:, 1:-1] - 2 * values + padded[:-2, 1:-1]
    return np.hypot(x, y)


def likely(scene: Scene, points: Sequence[tuple[int, int]]) -> Array:
    """[H, W] in [0, 1]: how likely each pixel is of the object that all (column, row) points lie on, says ClickNet."""
    from materialist.color import linear_to_srgb
    from materialist.predict.clicks.segment import Photo, object_at

    return object_at(Photo(linear_to_srgb(scene.photo.linear), scene.normal, scene.depth), points)
