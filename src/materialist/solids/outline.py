"""A surface of revolution by its outline.

The outline of a surface of revolution is its own image in the plane through the camera and the axis. The part of the
half plane beside the axis that stays inside the outline at every turn is the largest body with that outline (its visual
hull). For bodies that bulge and wave gently the hull is the body itself, but for the two ends that the camera sees from
above and below. Predicted normals are rarely clean enough to tell an axis or a profile; an outline is.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import splev, splprep
from scipy.ndimage import binary_fill_holes, map_coordinates
from scipy.optimize import minimize_scalar
from skimage.measure import find_contours

from materialist.camera import pixel_rays, project, unit
from materialist.geometry.silhouette import silhouette_field, surface_in
from materialist.solids.profile import Profile
from materialist.solids.revolution import Axis, Revolution, ground_height
from materialist.types import Array, Camera


@dataclass(frozen=True)
class OutlineSettings:
    """When an outline is taken for that of a surface of revolution, and how its hull is made."""

    fewest: int = 64  # pixels below which an object is too small to tell
    # most of its filled outline, in its area: rings and handles have holes; tuned by eye
    pierced: float = 1.02
    # least share of the mask that lies in its image: boxes have edges where it is round
    alike: float = 0.964
    covered: float = 0.955  # least share of the mask that the body covers
    leaning: float = 0.12  # least slope of the map's sideways normals over the body's: a face seen straight on has 0
    stepped: float = 0.9  # least `_stepped`, over normals that look up or down by less than `side`
    side: float = 0.5  # see `stepped`
    above: float = 0.3  # sine of the angle between axis and view below which an outline from above says nothing
    standing: float = 0.15  # distance from the ground, in its heights, up to which it is made to reach it where it is
    # relative distance from the depth map's place up to which the ground is believed
    elsewhere: float = 0.3
    stairs: float = 0.1  # root mean square by which pixels move an outline, pixels: it is smoothed by so much; 4 meshes
    turns: int = 40  # turns at which a place beside the axis must stay inside the outline
    fine: int = 120  # cells of the hull along the object
    air: float = 0.004  # part of its height that an object stays above the ground
    flat: float = 1.25  # slopes up to this multiple of the camera's are of the end caps, which the outline hides


SETTINGS = OutlineSettings()


def surface_of_revolution(
    depth: Array,
    normal: Array,
    mask: Array,
    camera: Camera,
    *,
    up: Array | None = None,
    behind: Array | None = None,
) -> tuple[Revolution, Array] | None:
    """An object that is a surface of revolution and its thickness [H, W] float32 along the rays, scene units; or None.

    depth: [H, W] planar, scene units, 0 = none. normal: [H, W, 3] unit. mask: [H, W] bool or weights: one object; one
        that the frame cuts, or that has a hole, is none.
    up: [3] unit, the axis' direction in the camera's frame, as a support tells it; None: there is no such object.
    behind: [H, W] planar depth of what stands behind the object, 0 = nothing: the object ends above it.
    Raises InputError for maps of different sizes, or a mask without any surface.
    """
    inside = surface_in(mask, depth, camera)
    cut = inside[[0, -1]].any() or inside[:, [0, -1]].any()
    pierced = binary_fill_holes(inside).sum() > SETTINGS.pierced * inside.sum()
    if up is None or cut or inside.sum() < SETTINGS.fewest or pierced:
        return None
    rays = pixel_rays(camera).astype(np.float64)
    depth = np.asarray(depth, np.float64)
    normal = np.asarray(normal, np.float64)
    found = _along(up, _Seen(inside, depth, normal, rays, behind, camera))
    if found is None:
        return None
    body, front = found
    return body, body.thickness(np.where(front > 0, front, depth), inside, rays)


class _Seen(NamedTuple):
    """The maps of the object."""

    inside: Array
    depth: Array
    normal: Array
    rays: Array
    behind: Array | None
    camera: Camera


def _along(up: Array, seen: _Seen) -> tuple[Revolution, Array] | None:
    """The body whose axis points along `up` and the depth [H, W] of its front, 0 beside it; None if it does not fit."""
    middle = seen.rays[seen.inside].mean(0)
    if np.linalg.norm(np.cross(up, middle)) < SETTINGS.above * np.linalg.norm(middle):
        return None
    across, alike = _mirror(seen.inside, seen.rays, up, seen.camera)
    if alike < SETTINGS.alike:
        return None
    ahead = np.cross(across, up)
    first = Axis(up, ahead * np.sign(ahead @ middle))  # at distance 1
    border = _border(silhouette_field(seen.inside), first, seen.camera)
    if border is None:
        return None
    found = [_placed(first, border, seen, round_top) for round_top in (True, False)]
    seen_so = [(body, *body.front(seen.inside, seen.rays)) for body in found if body is not None]
    if not seen_so:
        return None
    body, front, leaning = max(seen_so, key=lambda one: float((one[2] * seen.normal).sum()))
    there = seen.inside & (front > 0)
    own, other = ((values @ across)[there] for values in (leaning, seen.normal))
    side = np.abs((leaning @ up)[there]) < SETTINGS.side
    leans = (own * other).sum() >= SETTINGS.leaning * (own * own).sum()
    if not leans or _stepped(own[side], other[side]) < SETTINGS.stepped:
        return None
    fits = there.sum() > SETTINGS.covered * seen.inside.sum() and body.profile.lines()
    return (body, front) if fits else None


def _stepped(own: Array, other: Array) -> float:
    """Squares left of `other` [N] by the best step of `own` [N], over those left by a straight line.

    Towards the sides the normals of a round thing turn evenly, those of a box by one step at its edge.
    """
    order = np.argsort(own)
    x = own[order]
    y = other[order] - other.mean()
    if len(x) < 8:
        return np.inf
    line = float(
        (y**2).sum() - ((x - x.mean()) @ y) ** 2 / max(float(((x - x.mean()) ** 2).sum()), 1e-12)
    )
    count = np.arange(1, len(y))
    total = np.cumsum(y)[:-1]
    explained = total**2 / count + total**2 / (len(y) - count)  # y sums to 0
    return float((y**2).sum() - explained.max()) / max(line, 1e-9)


def _mirror(inside: Array, rays: Array, up: Array, camera: Camera) -> tuple[Array, float]:
    """[3] unit: across the upright plane through the camera in which the mask is its own image best, and how well."""
    own = rays[inside]
    middle = own.mean(0)
    first = unit(np.cross(up, -middle))  # across the plane through the middle of the mask
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
    found = minimize_scalar(
        unlike, bounds=(best - 0.02 * width, best + 0.02 * width), method="bounded"
    )
    angle = min((best, float(found.x)), key=unlike)
    return plane(angle), 1 - unlike(angle)


def _placed(
    first: Axis, border: tuple[Array, float], seen: _Seen, round_top: bool
) -> Revolution | None:
    """The body where the depth map has its front, or as far away as the ground that it stands on.

    first: its axis at distance 1. border: as of `_border`. Its upper end is round, or flat.
    """
    whole, cell = border
    line = _capped(whole, float(np.linalg.norm(first.foot)), seen.camera, cell, round_top)
    if line is None:
        return None
    base = float(line[0, 1])
    high = float(np.ptp(line[:, 1]))
    front, _ = Revolution(first, Profile.of(line, cell, base)).front(seen.inside, seen.rays)
    both = seen.inside & (front > 0)
    away = float(np.median(seen.depth[both] / front[both])) if both.any() else 1.0
    ground = ground_height(Axis(first.up, np.zeros(3)), seen.behind, seen.inside, seen.rays)
    floor = base * away
    if np.isfinite(ground):
        near = abs(ground - floor) < SETTINGS.standing * high * away
        if not near and base < 0 and abs(ground / base / away - 1) < SETTINGS.elsewhere:
            away = ground / base
        lowest, highest = ((base + side * SETTINGS.standing * high) * away for side in (-1, 1))
        floor = float(np.clip(ground + SETTINGS.air * high * away, lowest, highest))
    line = line * away
    # Down to the base it goes on straight.
    down = unit(line[0] - line[3])
    foot = line[0] + down * (max(line[0, 1] - floor, 0) + cell * away) / max(float(-down[1]), 1e-3)
    line = np.concatenate([[np.maximum(foot, [0, -np.inf])], line])
    return Revolution(Axis(first.up, away * first.foot), Profile.of(line, cell * away, floor))


def _border(field: Array, axis: Axis, camera: Camera) -> tuple[Array, float] | None:
    """The border [K, 2] of the visual hull from its lower to its upper end, and the size of a cell.

    None where nothing stays inside the outline.
    """
    far = float(np.linalg.norm(axis.foot))
    pixel = far / camera.focal
    rows, columns = np.nonzero(field > 0)
    if not len(rows):  # thinner than a pixel
        return None
    extent = max(np.ptp(rows), np.ptp(columns)) * pixel * 1.3
    cell = extent / SETTINGS.fine
    place, _ = project(axis.foot[None], camera)
    middle = (
        (camera.height / 2 - (rows.min() + rows.max()) / 2) * pixel / max(float(axis.up[1]), 0.3)
    )
    base = middle - float((camera.height / 2 - place[0, 1]) * pixel) / max(float(axis.up[1]), 0.3)
    low = base - 0.7 * extent
    r = np.arange(int(0.6 * extent / cell)) * cell
    h = low + np.arange(int(1.4 * extent / cell)) * cell
    values = -_hull(field, axis, r, h, camera) * pixel / cell
    lines = find_contours(values, 0.0)
    if not lines or len(longest := max(lines, key=len)) < 12:
        return None
    line = longest[:, ::-1] * cell + [0, low]  # (distance, height)
    return line if line[0, 1] < line[-1, 1] else line[::-1], cell


def _hull(field: Array, axis: Axis, r: Array, h: Array, camera: Camera) -> Array:
    """[len(h), len(r)] pixels by which places beside the axis are inside the outline at every turn.

    The mean of what the left and what the right half of the outline say: a mask is never quite its own image.
    """
    first = unit(np.cross(axis.up, axis.foot))
    halves = []
    for half in (0.0, np.pi):
        least = np.full((len(h), len(r)), np.inf)
        for angle in half + np.linspace(-np.pi / 2, np.pi / 2, SETTINGS.turns // 2):
            out = np.cos(angle) * first + np.sin(angle) * np.cross(axis.up, first)
            points = axis.foot + r[None, :, None] * out + h[:, None, None] * axis.up
            x, y = np.moveaxis(project(points, camera)[0], -1, 0)
            inner = map_coordinates(field, [y - 0.5, x - 0.5], order=1, mode="nearest")
            beyond = np.maximum(np.maximum(-x, x - camera.width), np.maximum(-y, y - camera.height))
            least = np.minimum(least, inner - np.maximum(beyond, 0))
        halves.append(least)
    return (halves[0] + halves[1]) / 2


def _capped(line: Array, far: float, camera: Camera, cell: float, round_top: bool) -> Array | None:
    """A line from the lower to the upper end without what the camera does not see, and a round or flat upper end.

    line: [K, 2] (distance, height above the camera), `far` from the camera.
    """
    spline, along = splprep(line.T, s=len(line) * (SETTINGS.stairs * far / camera.focal) ** 2)
    smooth = np.stack(splev(along, spline), -1)
    step = unit(np.stack(splev(along, spline, der=1), -1))
    # The lower end is seen from above over its near rim, the upper one over its far rim.
    lower, upper = (
        np.abs(smooth[:, 1]) / np.maximum(far + side * smooth[:, 0], 0.1 * far) for side in (-1, 1)
    )
    half = np.arange(len(line)) < np.argmax(smooth[:, 0])
    limit = SETTINGS.flat * np.where(half, lower, upper)
    steep = np.flatnonzero(np.abs(step[:, 1]) > limit * np.abs(step[:, 0]))
    if len(steep) < 4:
        return None
    side = smooth[steep[0] : steep[-1] + 1]
    # A round end has the side's slope where it begins, and is level at the axis.
    slope = float(upper[steep[-1]]) if round_top else 0.0
    wide, top = side[-1]
    r = np.append(np.arange(cell, wide, cell)[::-1], 0)
    cap = np.stack([r, top + slope * (wide**2 - r**2) / (2 * max(wide, cell))], -1)
    return np.concatenate([side, cap])
