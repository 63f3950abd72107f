"""Three directions at right angles, as rooms and streets have them, and normals that are drawn to them.

Straight edges of a building run along three directions. In the picture, those of one direction meet in a vanishing
point, which tells the direction to a degree or two; predicted normals of the same floors and walls are 5 to 30 degrees
off. An edge and the camera span a plane: its normal is at right angles to the direction of the edge.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import label

from materialist.camera import unit
from materialist.geometry.silhouette import disc
from materialist.types import Array


@dataclass(frozen=True)
class ManhattanSettings:
    """When a picture has such directions, and which normals they draw; by eye on 26 photos unless said otherwise."""

    # The frame of directions.
    min_edge: float = 0.03  # length of an edge, longer sides
    longest: float = 0.2  # from which on edges weigh alike, longer sides
    most_edges: int = 400  # the longest are used; derived: time
    tolerance: float = 2.0  # degrees between an edge and its direction
    min_apart: float = 0.05  # sine of the angle between two edges' planes that tell a direction
    most_normals: int = 300  # are looked at; derived: time
    normals_weight: float = 0.5  # of the normals beside the edges
    draws: int = 2000  # frames that are tried; derived: time
    rounds: int = 10  # of least squares, at most
    min_edges: int = 100  # with fewer a picture has no frame
    min_support: float = 0.42  # share of the edges' length that the frame explains; else it is none
    min_near: float = 0.4  # share of the normals that are near an axis; by chance 0.28

    # Normals near an axis.
    # degrees: on the axis up to the first, untouched from the second on
    ramp: tuple[float, float] = (25.0, 40.0)
    # standard deviation below which normals are relief and stay, longer sides
    detail: float = 0.006
    step: float = 0.04  # of log depth between neighbours, at which a surface ends
    min_area: float = 0.01  # share of the picture that a floor or wall has at least
    max_turn: float = 30.0  # degrees by which normals may turn across it: round things turn more
    max_off: float = 20.0  # degrees from that turn: what is farther off stands out
    lines: int = 2  # pixels: half the width of gaps that are closed


SETTINGS = ManhattanSettings()


def manhattan_frame(
    picture: Array, normal: Array, depth: Array, rays: Array, seed: int = 0
) -> Array | None:
    """[3, 3] three unit directions at right angles, as rows, along which most straight edges run; None without such.

    Of frames that explain the edges alike, the one that more normals are near. picture: [H, W, 3] sRGB-encoded.
    normal, depth: [H, W, 3] unit, [H, W] planar, 0 = none. rays: [H, W, 2 or more] x and y of the rays at z = -1.
    """
    planes, length = _edges(picture, rays)
    known = normal[depth > 0]
    if len(planes) < SETTINGS.min_edges or not len(known):
        return None
    weight = np.minimum(length, SETTINGS.longest)
    weight /= weight.sum()
    near = np.sin(np.radians(SETTINGS.tolerance))
    # --- Frames of three edges: two that share a direction, and one of another (RANSAC) ---
    drawn = np.random.default_rng(seed).choice(len(planes), (SETTINGS.draws, 3), p=weight)
    one, other, third = np.moveaxis(planes[drawn], 1, 0)
    first = np.cross(one, other)
    second = np.cross(unit(first), third)
    # Edges on one line leave their direction open, and so does a third edge of the same one.
    apart = np.minimum(np.linalg.norm(first, axis=-1), np.linalg.norm(second, axis=-1))
    first, second = unit(first), unit(second)
    frames = np.stack([first, second, np.cross(first, second)], 1)  # [D, 3, 3]
    away = np.abs(np.einsum("nc,dkc->dnk", planes, frames)).min(-1)  # sine of the angle, [D, N]
    score = np.clip(1 - (away / near) ** 2, 0, 1) @ weight
    some = known[:: max(1, len(known) // SETTINGS.most_normals)]
    shares = np.clip(1 - _angles(some, frames) / SETTINGS.ramp[1], 0, 1).mean(-1)
    score += SETTINGS.normals_weight * shares
    frame = frames[np.argmax(np.where(apart > SETTINGS.min_apart, score, -1))]
    # --- Each direction by least squares over its edges, then at right angles again ---
    for _ in range(SETTINGS.rounds):
        away = np.abs(planes @ frame.T)
        whose = np.where(away.min(1) < near, away.argmin(1), -1)
        moved = frame.copy()
        for k in range(3):
            own = whose == k
            if own.sum() > 1:
                direction = np.linalg.svd(planes[own] * weight[own, None])[2][-1]
                moved[k] = direction * np.sign(direction @ frame[k])
        left, _, right = np.linalg.svd(moved)
        frame = left @ right
    # --- Whether it explains edges and normals ---
    support = weight[np.abs(planes @ frame.T).min(1) < near].sum()
    close = (_angles(some, frame) < SETTINGS.ramp[0]).mean()
    return frame if support >= SETTINGS.min_support and close >= SETTINGS.min_near else None


def drawn_to_frame(normal: Array, depth: Array, frame: Array) -> Array:
    """[H, W, 3] unit normals: those of floors and walls near an axis of the frame [3, 3] are drawn to it.

    Relief stays on them, and so do round things. normal: [H, W, 3] unit. depth: [H, W] planar, 0 = no surface.
    """
    axes = np.concatenate([frame, -frame])
    smooth = unit(cv2.GaussianBlur(normal, (0, 0), SETTINGS.detail * max(depth.shape)))
    cosine = smooth @ axes.T
    nearest = cosine.argmax(-1)
    angle = np.degrees(np.arccos(np.clip(cosine.max(-1), -1, 1)))
    # --- Floors and walls: large pieces near one axis, whose normals hardly turn across them ---
    candidates = (angle < SETTINGS.ramp[1]) & _within(depth)
    flat = np.zeros(depth.shape, np.uint8)
    for k in range(len(axes)):
        pieces, count = label(candidates & (nearest == k))
        area = np.bincount(pieces.ravel(), minlength=count + 1)
        for piece in 1 + np.flatnonzero(area[1:] >= SETTINGS.min_area * depth.size):
            flat[_flat_part(smooth, pieces == piece)] = 1
    # Steps of depth inside of them leave lines.
    closed = cv2.morphologyEx(flat, cv2.MORPH_CLOSE, disc(SETTINGS.lines))
    # --- Drawn to the axis, with their relief ---
    low, high = SETTINGS.ramp
    share = (np.clip((high - angle) / (high - low), 0, 1) * closed)[..., None]
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
    found = cv2.createLineSegmentDetector().detect(grey)[0]
    ends = np.zeros((0, 2, 2)) if found is None else np.asarray(found, float).reshape(-1, 2, 2)
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
