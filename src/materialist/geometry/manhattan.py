"""Three directions at right angles, as rooms and streets have them, and normals that are drawn to them.

Straight edges of a building run along three directions. In the picture, those of one direction meet in a vanishing
point, which tells the direction; predicted normals of the same floors and walls are 5 to 30 degrees off. An edge and
the camera span a plane: its normal is at right angles to the direction of the edge.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import label
from skimage.morphology import remove_small_holes, remove_small_objects

from materialist.camera import unit
from materialist.types import Array


@dataclass(frozen=True)
class ManhattanSettings:
    """When a picture has such directions, and which normals they draw; by eye on 26 photos unless said otherwise."""

    # The frame of directions.
    min_edge: float = 0.03  # length of an edge, longer sides
    longest: float = 0.2  # from which on edges weigh alike, longer sides
    most_edges: int = 400  # the longest are used; derived: time
    tolerance: float = 2.0  # degrees between an edge and its direction
    min_sine: float = 0.05  # sine of the angle between two edges' planes that tell a direction
    most_normals: int = 300  # are looked at; derived: time
    normals_weight: float = 0.5  # of the normals beside the edges
    draws: int = 2000  # frames that are tried; derived: time
    rounds: int = 10  # of least squares, at most
    refined: int = 20  # of the best drawn frames; derived: time
    min_edges: int = 100  # with fewer a picture has no frame
    # shares of the edges' length that a frame explains: in all, along its second and along its third direction
    min_support: tuple[float, float, float] = (0.42, 0.1, 0.02)
    near: float = 25.0  # degrees from an axis up to which a normal is near it
    min_near: float = 0.4  # share of the normals that are
    max_apart: float = 3.0  # degrees between directions of the picture and of its mirror image

    # Normals near an axis.
    # degrees: on the axis up to the first, untouched from the second on
    ramp: tuple[float, float] = (15.0, 30.0)
    # standard deviation below which normals are relief and stay, longer sides
    detail: float = 0.006
    step: float = 0.04  # of log depth between neighbours, at which a surface ends
    min_area: float = 0.01  # share of the picture that a floor or wall has at least
    max_turn: float = 30.0  # degrees by which normals may turn across it: round things turn more
    max_off: float = 20.0  # degrees from that turn: what is farther off stands out
    min_piece: float = 0.001  # share of the picture below which holes and islands are filled
    # standard deviation, pixels, of the border between what is drawn and what is not
    blur: float = 2.0
    # share of the picture that axes may turn away from the camera; else they are wrong
    max_away: float = 0.005


SETTINGS = ManhattanSettings()


def manhattan_axes(picture: Array, normal: Array, depth: Array, rays: Array) -> Array:
    """[K, 3] unit directions at right angles, at most three, along which most straight edges run; none without such.

    Of frames that explain the edges alike, the one that more normals are near. picture: [H, W, 3] sRGB-encoded.
    normal, depth: [H, W, 3] unit, [H, W] planar, 0 = none. rays: [H, W, 2 or more] x and y of the rays at z = -1.
    """
    known = normal[depth > 0]
    none = np.zeros((0, 3))
    if not len(known):
        return none
    some = known[:: max(1, len(known) // SETTINGS.most_normals)]
    # --- A frame of the edges of the picture, and one of those of its mirror image: other edges are found there ---
    frames = []
    mirrored = np.ascontiguousarray(picture[:, ::-1])
    for seen, seen_rays in ((picture, rays), (mirrored, rays[:, ::-1])):
        edges = _edges(seen, seen_rays)
        frame = _frame_of(*edges, some) if len(edges[0]) >= SETTINGS.min_edges else None
        if frame is None:
            return none
        frames.append(frame)
    # --- Only directions that both have ---
    cosine = frames[0] @ frames[1].T
    partner = np.abs(cosine).argmax(1)
    sign = np.sign(cosine[np.arange(3), partner])[:, None]
    mean = unit(frames[0] + sign * frames[1][partner])
    return mean[np.abs(cosine).max(1) >= np.cos(np.radians(SETTINGS.max_apart))]


def _frame_of(planes: Array, length: Array, normals: Array) -> Array | None:
    """The frame [3, 3] of edges (`_edges`) and some normals [N, 3]; None where it does not explain both."""
    weight = np.minimum(length, SETTINGS.longest)
    weight /= weight.sum()
    near = np.sin(np.radians(SETTINGS.tolerance))
    # --- Frames of three edges: two that share a direction, and one of another (RANSAC) ---
    drawn = np.random.default_rng(0).choice(len(planes), (SETTINGS.draws, 3), p=weight)
    one, other, third = np.moveaxis(planes[drawn], 1, 0)
    first = np.cross(one, other)
    second = np.cross(unit(first), third)
    # Edges on one line leave their direction open, and so does a third edge of the same one.
    sine = np.minimum(np.linalg.norm(first, axis=-1), np.linalg.norm(second, axis=-1))
    first, second = unit(first), unit(second)
    frames = np.stack([first, second, np.cross(first, second)], 1)[sine > SETTINGS.min_sine]

    def score(frames: Array) -> Array:
        """[D] by edges and normals, of frames [D, 3, 3]."""
        away = np.abs(np.einsum("nc,dkc->dnk", planes, frames)).min(-1)  # sine of the angle
        close = np.clip(1 - _angles(normals, frames) / SETTINGS.ramp[1], 0, 1).mean(-1)
        return np.clip(1 - (away / near) ** 2, 0, 1) @ weight + SETTINGS.normals_weight * close

    # --- The best of them, each direction by least squares over its edges, then at right angles again ---
    best = frames[np.argsort(-score(frames))[: SETTINGS.refined]]
    if not len(best):
        return None
    refined = np.stack([_refined(frame, planes, weight) for frame in best])
    frame = refined[np.argmax(score(refined))]
    # --- Whether it explains edges and normals ---
    away = np.abs(planes @ frame.T)
    whose = np.where(away.min(1) < near, away.argmin(1), 3)
    support = np.sort(np.bincount(whose, weight, 4)[:3])[::-1]
    explained = np.array([support.sum(), *support[1:]]) >= SETTINGS.min_support
    close = (_angles(normals, frame) < SETTINGS.near).mean() >= SETTINGS.min_near
    return frame if explained.all() and close else None


def _refined(frame: Array, planes: Array, weight: Array) -> Array:
    """[3, 3] the frame by least squares over the edges along it."""
    near = np.sin(np.radians(SETTINGS.tolerance))
    for _ in range(SETTINGS.rounds):
        away = np.abs(planes @ frame.T)
        whose = np.where(away.min(1) < near, away.argmin(1), -1)
        moved = frame.copy()
        for k in range(3):
            along = planes[whose == k] * weight[whose == k, None]
            if len(along) > 1:
                direction = np.linalg.eigh(along.T @ along)[1][:, 0]
                moved[k] = direction * np.sign(direction @ frame[k])
        left, _, right = np.linalg.svd(moved)
        if np.abs(left @ right - frame).max() < 1e-4:
            break
        frame = left @ right
    return frame


def drawn_to_axes(normal: Array, depth: Array, rays: Array, axes: Array) -> Array:
    """[H, W, 3] unit normals: those of floors and walls near one of the axes [K, 3] are drawn to it.

    Fine relief stays on them, and so do most round things; slopes up to 15 degrees are lost. Axes that would turn
    more than a few of them away from the camera are wrong, and nothing is drawn. normal: [H, W, 3] unit.
    depth: [H, W] planar, 0 = no surface. rays: [H, W, 2 or more] x and y of the rays at z = -1.
    """
    if not len(axes):
        return normal
    axes = np.concatenate([axes, -axes])
    smooth = unit(cv2.GaussianBlur(normal, (0, 0), SETTINGS.detail * max(depth.shape)))
    cosine = smooth @ axes.T
    nearest = cosine.argmax(-1)
    angle = np.degrees(np.arccos(np.clip(cosine.max(-1), -1, 1)))
    # --- Floors and walls: large pieces near one axis, whose normals hardly turn across them ---
    candidates = (angle < SETTINGS.ramp[1]) & _within(depth)
    flat = np.zeros(depth.shape, bool)
    for k in range(len(axes)):
        pieces, count = label(candidates & (nearest == k))
        area = np.bincount(pieces.ravel(), minlength=count + 1)
        for piece in 1 + np.flatnonzero(area[1:] >= SETTINGS.min_area * depth.size):
            flat |= _flat_part(smooth, pieces == piece)
    # Steps of depth inside of them leave lines, and what stands out leaves specks.
    small = int(SETTINGS.min_piece * depth.size)
    flat = remove_small_objects(remove_small_holes(flat, max_size=small), max_size=small)
    # --- How far each is drawn; none away from the camera ---
    low, high = SETTINGS.ramp
    share = np.clip((high - angle) / (high - low), 0, 1) * flat
    away = (axes[nearest][..., :2] * rays[..., :2]).sum(-1) - axes[nearest][..., 2] > 0
    if (away & (share > 0)).mean() > SETTINGS.max_away:
        return normal
    share = cv2.GaussianBlur(share * ~away, (0, 0), SETTINGS.blur)[..., None]
    # --- Drawn to the axis, with their relief ---
    drawn = unit(smooth + share * (axes[nearest] - smooth))
    return unit(drawn + normal - smooth).astype(np.float32)


def _angles(normals: Array, frames: Array) -> Array:
    """[..., N] degrees between normals [N, 3] and the nearest axes of frames [..., 3, 3]."""
    cosine = np.abs(normals @ np.swapaxes(frames, -1, -2)).max(-1)
    return np.degrees(np.arccos(np.clip(cosine, 0, 1)))


def _edges(picture: Array, rays: Array) -> tuple[Array, Array]:
    """Normals [N, 3] of the planes through the camera and straight edges, and the edges' lengths [N], longer sides."""
    height, width = picture.shape[:2]
    grey = cv2.cvtColor(np.round(255 * picture).astype(np.uint8), cv2.COLOR_RGB2GRAY)
    segments = cv2.createLineSegmentDetector().detect(grey)[0]
    ends = np.zeros((0, 2, 2))
    if segments is not None:
        ends = np.asarray(segments, float).reshape(-1, 2, 2)
    length = np.linalg.norm(ends[:, 0] - ends[:, 1], axis=-1) / max(height, width)
    longest = np.argsort(-length)[: SETTINGS.most_edges]
    longest = longest[length[longest] > SETTINGS.min_edge]
    # Rays are linear in the pixel.
    first = rays[0, 0, :2].astype(float)
    step = (rays[-1, -1, :2].astype(float) - first) / np.maximum([width - 1, height - 1], 1)
    place = first + ends[longest] * step
    ray = np.concatenate([place, -np.ones((*place.shape[:2], 1))], -1)
    return unit(np.cross(ray[:, 0], ray[:, 1])), length[longest]


def _within(depth: Array) -> Array:
    """[H, W] bool: pixels of a surface that does not end beside them."""
    log_depth = np.log(np.where(depth > 0, depth, 1)).astype(np.float32)
    square = np.ones((3, 3), np.uint8)
    change = cv2.dilate(log_depth, square) - cv2.erode(log_depth, square)
    return (depth > 0) & (change < SETTINGS.step)


def _flat_part(normal: Array, inside: Array) -> Array:
    """[H, W] bool: the piece [H, W] bool without what stands out from it; nothing where it is not flat.

    Its normals [H, W, 3] are compared with their best linear function of the place.
    """
    place = np.argwhere(inside).astype(float)
    place -= place.mean(0)
    mean = normal[inside].mean(0)
    slope, *_ = np.linalg.lstsq(place, normal[inside] - mean, rcond=None)
    # How far they turn: an even piece of that variance is sqrt(12) standard deviations wide.
    spread, axes = np.linalg.eigh(place.T @ place / len(place))
    turns = np.linalg.norm(axes.T @ slope, axis=-1) * np.sqrt(12 * np.maximum(spread, 0))
    result = np.zeros_like(inside)
    if np.degrees(turns.max()) <= SETTINGS.max_turn:
        fitted = unit(mean + place @ slope)
        cosine = (fitted * normal[inside]).sum(-1)
        result[inside] = cosine > np.cos(np.radians(SETTINGS.max_off))
    return result
