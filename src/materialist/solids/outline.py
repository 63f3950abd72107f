"""What was turned on a lathe, known by its outline: predicted normals are rarely clean enough to meet one axis.

The outline of such a thing is its own image in the plane through the camera and the axis. What of the half plane beside
the axis stays inside the outline at every turn is the largest body with that outline (its visual hull), and for what
bulges and waves gently it is the thing itself, but for the two ends that the camera sees from above and below.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from materialist.camera import pixel_rays, project
from materialist.geometry.contour import silhouette_field
from materialist.solids.lathe import FEWEST, Lathed
from materialist.solids.profile import Profile, fitted
from materialist.solids.revolution import AIR, Meridian, along, ground_height, thickness_of
from materialist.solids.symmetry import surface_in
from materialist.solids.turning import Axis
from materialist.types import Array, Camera

ALIKE, COVERED = 0.964, 0.955
"""Shares of the mask that must lie in its image, and that the body must cover: boxes have edges where it is round."""
LEANING = 0.12
"""Least slope of how far the map's normals lean sideways over how far the body's do: a face seen straight on has 0, and
predicted normals of round things, however blurred, 0.2 and more."""
ABOVE = 0.3
"""Sine of the angle between the axis and the way to the object below which its outline, from above, says nothing."""
STEPPED, SIDE = 0.9, 0.5
"""Least `_stepped`, over what of the body looks up or down by less than this."""
TILTS = (0.05, 0.15, 0.28, 0.42)
"""Radians that the camera may look down, where no ground tells it, or the body does not fill the outline then."""
ELSEWHERE = 0.3
"""How far, relatively, the place on the ground may be from where the depth map has the object."""
TURNS = 40
"""Turns at which a place beside the axis must stay inside the outline."""
FINE = 120
"""Cells of the hull along the object."""
FLAT = 1.25
"""Slopes up to this multiple of that at which the camera looks down are of the end caps, of which the outline says no
more than how high they are."""


def outlined(
    depth: Array, normal: Array, mask: Array, camera: Camera, *, up: Array | None = None, behind: Array | None = None
) -> Lathed | None:
    """An object turned on a lathe by its outline, or None where that, or the normals, are of something else.

    Arguments and errors as of `lathe.lathed`; where nothing tells the upright direction, or it does not fit, the camera
    looks down as the body fills the outline best. An object that the frame cuts is none.
    """
    inside = surface_in(mask, depth, camera)
    if inside.sum() < FEWEST:
        return None
    edge = np.zeros_like(inside)
    edge[[0, -1]] = edge[:, [0, -1]] = True
    if (inside & edge).any():
        return None
    rays, depth, normal = pixel_rays(camera).astype(np.float64), np.asarray(depth, np.float64), np.asarray(normal)
    told = [] if up is None else [(np.asarray(up, np.float64), behind)]
    # A predicted ground may lean: then the outline says how far the camera looks down, and the ground says nothing.
    guessed = [(np.array([0, np.cos(tilt), np.sin(tilt)]), None) for tilt in TILTS]
    best: tuple[float, Standing | None] = (COVERED, None)
    for tries in (told, guessed):
        for upright, below in tries:
            found = _standing_along(upright, inside, depth, normal, rays, below, camera)
            best = max(best, found, key=lambda one: one[0])
        if best[1] is not None:
            break
    if best[1] is None or not best[1].profile.lines():
        return None
    alike, axis, profile = best[1]
    front, _ = seen_from(profile, axis, inside, rays)
    thick = thickness_of(profile, axis, np.where(front > 0, front, depth), inside, rays)
    return Lathed(thick, 1 - alike, axis, profile)


class Standing(NamedTuple):
    """A body that an outline may be of."""

    alike: float
    """Share of the mask that lies in its image."""
    axis: Axis
    profile: Profile


def _standing_along(
    up: Array, inside: Array, depth: Array, normal: Array, rays: Array, behind: Array | None, camera: Camera
) -> tuple[float, Standing | None]:
    """The body that stands along `up`, and the share of the mask that it covers; (0, None) if it does not fit."""
    middle = rays[inside].mean(0)
    if np.linalg.norm(np.cross(up, middle)) < ABOVE * np.linalg.norm(middle):
        return 0.0, None
    across, alike = _mirror(inside, rays, up, camera)
    if alike < ALIKE:
        return 0.0, None
    ahead = np.cross(across, up)
    ahead *= np.sign(ahead @ middle)
    body = _standing(silhouette_field(inside), inside, depth, rays, up, ahead, behind, camera)
    if body is None:
        return 0.0, None
    axis, profile = body
    found, leaning = seen_from(profile, axis, inside, rays)
    there = inside & (found > 0)
    own, other = ((values @ across)[there] for values in (leaning, normal))
    side = np.abs((leaning @ up)[there]) < SIDE
    if (own * other).sum() < LEANING * (own * own).sum() or _stepped(own[side], other[side]) < STEPPED:
        return 0.0, None
    return float(there.sum() / inside.sum()), Standing(alike, axis, profile)


def _stepped(own: Array, other: Array) -> float:
    """Squares left of `other` [N] by the best step of `own` [N], over those left by a straight line.

    Towards the sides the normals of a round thing turn evenly, those of a box by one step at its edge.
    """
    order = np.argsort(own)
    x, y = own[order], other[order] - other.mean()
    if len(x) < 8:
        return np.inf
    line = float((y**2).sum() - ((x - x.mean()) @ y) ** 2 / max(float(((x - x.mean()) ** 2).sum()), 1e-12))
    count, total = np.arange(1, len(y)), np.cumsum(y)[:-1]
    explained = total**2 / count + total**2 / (len(y) - count)  # y sums to 0
    return float((y**2).sum() - explained.max()) / max(line, 1e-9)


def _mirror(inside: Array, rays: Array, up: Array, camera: Camera) -> tuple[Array, float]:
    """[3] unit: across the upright plane through the camera in which the mask is its own image best, and how well."""
    from scipy.optimize import minimize_scalar

    own = rays[inside]
    middle = own.mean(0)
    first = np.cross(up, -middle)
    first /= np.linalg.norm(first)  # across the plane through the middle of the mask
    second = np.cross(up, first)

    def plane(angle: float) -> Array:
        return np.cos(angle) * first + np.sin(angle) * second

    def unlike(angle: float) -> float:
        normal = plane(angle)
        place, ahead = project(own - 2 * (own @ normal)[:, None] * normal, camera)
        x, y = np.floor(place).astype(int).T
        there = (ahead > 0) & (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
        return 1 - float((inside[np.where(there, y, 0), np.where(there, x, 0)] & there).mean())

    width = np.ptp(own @ first) / np.linalg.norm(middle)
    best = min(np.linspace(-0.2, 0.2, 21) * width, key=unlike)
    found = minimize_scalar(unlike, bounds=(best - 0.02 * width, best + 0.02 * width), method="bounded")
    angle = min((best, float(found.x)), key=unlike)
    return plane(angle), 1 - unlike(angle)


def _standing(
    field: Array, inside: Array, depth: Array, rays: Array, up: Array, ahead: Array, behind: Array | None,
    camera: Camera,
) -> tuple[Axis, Profile] | None:  # fmt: skip
    """The axis and profile: as far away as the ground that the object stands on, or as the depth map has its front."""
    first = Axis(up, ahead, True)  # at distance 1
    trial = _profile(field, first, camera, None)
    if trial is None:
        return None
    front, _ = seen_from(trial, first, inside, rays)
    both = inside & (front > 0)
    away = float(np.median(depth[both] / front[both])) if both.any() else 1.0
    ground = ground_height(Axis(up, np.zeros(3), True), behind, inside, rays)
    if np.isfinite(ground) and trial.floor < 0 and abs(ground / trial.floor / away - 1) < ELSEWHERE:
        away = ground / trial.floor
    axis = Axis(up, away * ahead, True)
    profile = _profile(field, axis, camera, ground if np.isfinite(ground) else None)
    return None if profile is None else (axis, profile)


def _profile(field: Array, axis: Axis, camera: Camera, ground: float | None) -> Profile | None:
    """The profile of the visual hull, its caps rounded; None where nothing stays inside the outline."""
    from skimage.measure import find_contours

    far = float(np.linalg.norm(axis.foot))
    pixel = far / camera.focal
    rows, columns = np.nonzero(field > 0)
    if not len(rows):  # thinner than a pixel
        return None
    extent = max(np.ptp(rows), np.ptp(columns)) * pixel * 1.3
    cell = extent / FINE
    place, _ = project(axis.foot[None], camera)
    middle = (camera.height / 2 - (rows.min() + rows.max()) / 2) * pixel / max(float(axis.up[1]), 0.3)
    base = middle - float((camera.height / 2 - place[0, 1]) * pixel) / max(float(axis.up[1]), 0.3)
    low = base - 0.7 * extent
    r = np.arange(int(0.6 * extent / cell)) * cell
    h = low + np.arange(int(1.4 * extent / cell)) * cell
    values = -_hull(field, axis, r, h, camera) * pixel / cell
    lines = find_contours(values, 0.0)
    if not lines or len(longest := max(lines, key=len)) < 12:
        return None
    line = longest[:, ::-1] * cell + [0, low]  # (distance, height)
    if line[0, 1] > line[-1, 1]:
        line = line[::-1]
    return _capped(line, far, cell, ground)


def _hull(field: Array, axis: Axis, r: Array, h: Array, camera: Camera) -> Array:
    """[len(h), len(r)] pixels by which places beside the axis are inside the outline at every turn.

    The mean of what the left and what the right half of the outline say: a mask is never quite its own image.
    """
    from scipy.ndimage import map_coordinates

    first = np.cross(axis.up, axis.foot)
    first /= np.linalg.norm(first)
    halves = []
    for half in (0.0, np.pi):
        least = np.full((len(h), len(r)), np.inf)
        for angle in half + np.linspace(-np.pi / 2, np.pi / 2, TURNS // 2):
            out = np.cos(angle) * first + np.sin(angle) * np.cross(axis.up, first)
            points = axis.foot + r[None, :, None] * out + h[:, None, None] * axis.up
            x, y = np.moveaxis(project(points, camera)[0], -1, 0)
            inner = map_coordinates(field, [y - 0.5, x - 0.5], order=1, mode="nearest")
            beyond = np.maximum(np.maximum(-x, x - camera.width), np.maximum(-y, y - camera.height))
            least = np.minimum(least, inner - np.maximum(beyond, 0))
        halves.append(least)
    return (halves[0] + halves[1]) / 2


def _capped(line: Array, far: float, cell: float, ground: float | None) -> Profile | None:
    """A profile through a line from the lower to the upper end, `far` from the camera, heights those above it."""
    from scipy.ndimage import gaussian_filter1d

    smooth = gaussian_filter1d(line, 3.0, axis=0, mode="nearest")
    step = np.gradient(smooth, axis=0)
    step /= np.maximum(np.linalg.norm(step, axis=1, keepdims=True), 1e-12)
    # The lower end is seen from above over its near rim, the upper one over its far rim.
    lower, upper = (np.abs(smooth[:, 1]) / np.maximum(far + side * smooth[:, 0], 0.1 * far) for side in (-1, 1))
    half = np.arange(len(line)) < np.argmax(smooth[:, 0])
    limit = FLAT * np.where(half, lower, upper)
    steep = np.abs(step[:, 1]) > limit * np.abs(step[:, 0])
    if steep.sum() < 4:
        return None
    slope = float(upper[np.flatnonzero(steep)[-1]])
    first, last = np.flatnonzero(steep)[[0, -1]]
    side, along = smooth[first : last + 1], step[first : last + 1]
    leaning = np.stack([along[:, 1], -along[:, 0]], -1)
    # A round end of the same slope where it begins, level at the axis.
    wide, top = side[-1]
    r = np.arange(0, wide, cell)[::-1]
    cap = np.stack([r, top + slope * (wide**2 - r**2) / (2 * max(wide, cell))], -1)
    lean = np.stack([slope * r / max(wide, cell), np.ones_like(r)], -1)
    lean /= np.linalg.norm(lean, axis=1, keepdims=True)
    seen, leaning = np.concatenate([side, cap]), np.concatenate([leaning, lean])
    high = float(np.ptp(seen[:, 1]))
    floor = float(side[0, 1])
    if ground is not None:
        floor = float(np.clip(ground + AIR * high, floor - 0.1 * high, floor + 0.1 * high))
    return fitted(seen, leaning, np.zeros((0, 2)), cell, floor)


def seen_from(profile: Profile, axis: Axis, inside: Array, rays: Array) -> tuple[Array, Array]:
    """[H, W] planar depth at which rays enter a body, 0 where they pass, and its unit normals [H, W, 3] there."""
    ray, plane = rays[inside], Meridian(axis)
    length = np.linalg.norm(ray, axis=-1)
    reach = 1.2 * float(np.hypot(profile.seen[:, 0].max(), np.ptp(profile.seen[:, 1]) / 2))
    middle = axis.foot + profile.seen[:, 1].mean() * axis.up
    first, steps = (ray @ middle) / length**2, np.arange(-reach, reach, 0.5 * profile.cell)
    hit, front = np.zeros(len(ray), bool), first.copy()
    for part, values in along(profile, axis, ray, first, steps):
        hit[part] = (values < 0).any(1)
        front[part] += steps[(values < 0).argmax(1)] / length[part]
    points = ray * front[:, None]
    depth, normal = np.zeros(inside.shape), np.zeros((*inside.shape, 3))
    depth[inside] = np.where(hit, front, 0)
    normal[inside] = plane.spread(points, profile.slope(plane.of(points)))
    return depth, normal
