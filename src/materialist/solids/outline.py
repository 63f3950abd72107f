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
from scipy.ndimage import binary_dilation, binary_erosion, binary_fill_holes, map_coordinates
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation
from skimage.measure import find_contours

from materialist.camera import pixel_rays, project, unit
from materialist.geometry.silhouette import silhouette_field, surface_in
from materialist.solids.profile import Profile
from materialist.solids.revolution import Axis, Revolution, ground_height
from materialist.types import Array, Camera


@dataclass(frozen=True)
class OutlineSettings:
    """When an outline is taken for that of a surface of revolution, and how its hull is made."""

    # Which outlines are accepted.
    min_pixels: int = 64  # an object with fewer pixels is too small to judge
    max_filled_ratio: float = 1.02  # area with holes filled, over area: rings have holes; by eye
    min_mirror_overlap: float = 0.964  # share of the mask inside its mirror image; boxes have less
    min_coverage: float = 0.955  # share of the mask that the body covers
    min_lean: float = 0.12  # slope of the map's sideways normals over the body's; a flat face has 0
    min_step_ratio: float = 0.9  # of `_step_ratio`, over the normals of the side
    max_side_tilt: float = 0.5  # normals that look up or down by less than this are of the side
    min_view_sine: float = 0.3  # sine of the angle between axis and view; from above less shows

    # How far from above the object is seen, at most; from 40 made objects.
    # pixels between hull and outline: its axis stays as given, and another one is sought
    gaps: tuple[float, float] = (0.3, 2.5)
    max_axis_error: float = 16.0  # degrees by which the given axis may be off
    min_axis_error: float = 5.0  # degrees up to which an outline cannot tell
    axis_step: float = 2.0  # degrees between the axes that are tried
    gap_tolerance: float = 0.2  # pixels above the least gap: the first axis within it is taken
    beside: int = 3  # pixels beside what a hull leaves out, where nearer things are sought
    nearer: float = 0.97  # of its depth, from which a thing lies before it
    min_hidden: float = 0.3  # share of those pixels from which it may be hidden

    # How the body is scaled until it stands on the ground.
    max_ground_gap: float = 0.15  # heights between base and ground up to which the base is moved
    max_depth_change: float = 0.3  # relative change of depth up to which the ground is believed
    ground_clearance: float = 0.004  # part of its height that an object stays above the ground

    # How the hull is made.
    outline_noise: float = 0.1  # pixels (rms) by which an outline is smoothed; from 4 meshes
    hull_turns: int = 40  # turns at which a place beside the axis must stay inside the outline
    hull_cells: int = 120  # cells of the hull along the object
    max_cap_slope: float = 1.25  # caps: slopes up to this multiple of the camera's


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
    up: [3] unit, direction of the axis in the camera frame, from the surface it stands on; None: no such object.
    behind: [H, W] planar depth of what stands behind the object, 0 = nothing: the object ends above it.
    Raises InputError for maps of different sizes, or a mask without any surface.
    """
    # --- What can be judged: whole, without a hole, and large enough ---
    inside = surface_in(mask, depth, camera)
    is_cut = inside[[0, -1]].any() or inside[:, [0, -1]].any()
    has_hole = binary_fill_holes(inside).sum() > SETTINGS.max_filled_ratio * inside.sum()
    if up is None or is_cut or inside.sum() < SETTINGS.min_pixels or has_hole:
        return None
    rays = pixel_rays(camera).astype(np.float64)
    # Double precision: thickness is a small difference of two depths.
    depth = np.asarray(depth, np.float64)
    normal = np.asarray(normal, np.float64)
    fitted = _fitted_body(up, _ObjectMaps(inside, depth, normal, rays, behind, camera))
    if fitted is None:
        return None
    body, front = fitted
    return body, body.thickness(np.where(front > 0, front, depth), inside, rays)


class _ObjectMaps(NamedTuple):
    """The maps of the object."""

    inside: Array
    depth: Array
    normal: Array
    rays: Array
    behind: Array | None
    camera: Camera


def _fitted_body(up: Array, seen: _ObjectMaps) -> tuple[Revolution, Array] | None:
    """The body with its axis along `up`, and the depth [H, W] of its front, 0 beside it; None if it does not fit."""
    middle = seen.rays[seen.inside].mean(0)
    if np.linalg.norm(np.cross(up, middle)) < SETTINGS.min_view_sine * np.linalg.norm(middle):
        return None
    hull = _hull_by_outline(up, seen)
    if hull is None:
        return None
    across = hull.across
    up = hull.first.up

    # --- Two candidates from the visual hull: the upper end is round, or flat ---
    bodies = [_placed(hull, seen, round_top) for round_top in (True, False)]
    candidates = [
        (body, *body.front(seen.inside, seen.rays)) for body in bodies if body is not None
    ]
    if not candidates:
        return None

    # --- The better one by its normals must agree with the map ---
    body, front, leaning = max(
        candidates, key=lambda candidate: float((candidate[2] * seen.normal).sum())
    )
    covered = seen.inside & (front > 0)
    body_side = (leaning @ across)[covered]
    map_side = (seen.normal @ across)[covered]
    side = np.abs((leaning @ up)[covered]) < SETTINGS.max_side_tilt
    leans = (body_side * map_side).sum() >= SETTINGS.min_lean * (body_side * body_side).sum()
    if not leans or _step_ratio(body_side[side], map_side[side]) < SETTINGS.min_step_ratio:
        return None
    is_covered = covered.sum() > SETTINGS.min_coverage * seen.inside.sum()
    return (body, front) if is_covered and body.profile.lines() else None


class _VisualHull(NamedTuple):
    """The largest body around an axis that stays inside the outline."""

    first: Axis
    """Its axis, at distance 1."""
    across: Array
    """[3] unit normal of the upright plane at which the mask mirrors itself."""
    border: Array
    """[K, 2] from its lower to its upper end: distance from the axis, height."""
    cell: float
    """Size of a cell of the grid in which the border was sought."""


def _hull_by_outline(up: Array, seen: _ObjectMaps) -> _VisualHull | None:
    """The visual hull around an axis along `up`, or one seen less from above where that fills the outline better.

    The normal of a predicted ground is often 10 degrees off. Seen too much from above, circles become ellipses that are
    higher than those of the outline: no body with such an axis fills the corners of a flat base.
    """
    across, overlap = mirror_plane(seen.inside, seen.rays, up, seen.camera)
    if overlap < SETTINGS.min_mirror_overlap:
        return None
    # --- The given axis, where it fills the outline, or hardly any of it, or something hides the rest ---
    field = silhouette_field(seen.inside)
    given = _visual_hull(up, across, field, seen)
    if given is None:
        return None
    least = _missed(given, seen)
    if not SETTINGS.gaps[0] < _gap(least, seen) <= SETTINGS.gaps[1] or _is_hidden(least, seen):
        return given
    # --- Less and less from above, in the mirror plane, down to level with the camera ---
    hulls = [(_gap(least, seen), given)]
    view = unit(seen.rays[seen.inside].mean(0))
    sideways = across * np.sign(across @ np.cross(up, view))
    elevation = np.degrees(np.arcsin(np.clip(-(up @ view), -1, 1)))
    most = min(elevation, SETTINGS.max_axis_error)
    for lean in np.arange(SETTINGS.axis_step, most + 1e-6, SETTINGS.axis_step):
        leaned = Rotation.from_rotvec(np.radians(lean) * sideways).apply(up)
        hull = _visual_hull(leaned, across, field, seen)
        if hull is not None:
            hulls.append((_gap(_missed(hull, seen), seen), hull))
    # --- The first that fills the outline as well as any, unless the given one is nearly the same ---
    enough = min(gap for gap, _ in hulls) + SETTINGS.gap_tolerance
    chosen = next(hull for gap, hull in hulls if gap <= enough)
    cosine = np.clip(chosen.first.up @ up, -1, 1)
    return chosen if np.degrees(np.arccos(cosine)) > SETTINGS.min_axis_error else given


def _visual_hull(up: Array, across: Array, field: Array, seen: _ObjectMaps) -> _VisualHull | None:
    """The visual hull around the axis along `up` in the mirror plane with normal `across`; None where it is empty.

    field: [H, W] pixels to the outline, as of `silhouette_field`.
    """
    ahead = np.cross(across, up)
    first = Axis(up, ahead * np.sign(ahead @ seen.rays[seen.inside].mean(0)))
    border = _border(field, first, seen.camera)
    return None if border is None else _VisualHull(first, across, *border)


def _missed(hull: _VisualHull, seen: _ObjectMaps) -> Array:
    """[H, W] bool: pixels of the mask that the hull leaves out; all where it has no body."""
    far = float(np.linalg.norm(hull.first.foot))
    line = _capped(hull.border, far, seen.camera, hull.cell, round_top=True)
    if line is None:
        return seen.inside
    body = Revolution(hull.first, Profile.of(line, hull.cell, float(line[0, 1])))
    return seen.inside & (body.front(seen.inside, seen.rays)[0] == 0)


def _gap(missed: Array, seen: _ObjectMaps) -> float:
    """Pixels by which a hull stays inside the outline, a mean along it, from the pixels that it leaves out."""
    outline = seen.inside & ~binary_erosion(seen.inside)
    return float(missed.sum() / outline.sum())


def _is_hidden(missed: Array, seen: _ObjectMaps) -> bool:
    """Whether a nearer thing lies beside what a hull leaves out: it may hide the foot, and its edge tells nothing."""
    beside = binary_dilation(missed, np.ones((3, 3)), SETTINGS.beside) & ~seen.inside
    known = beside & (seen.depth > 0)
    if not missed.any() or not known.any():
        return False
    nearer = seen.depth[known] < SETTINGS.nearer * np.median(seen.depth[missed])
    return bool(nearer.mean() > SETTINGS.min_hidden)


def _step_ratio(body_side: Array, map_side: Array) -> float:
    """Residual of the best step function of `body_side` [N] fitted to `map_side` [N], over that of the best line.

    Both residuals are sums of squares. Towards the sides the normals of a round object turn evenly, those of a box
    turn in one step at its edge: a low ratio means a box.
    """
    order = np.argsort(body_side)
    x = body_side[order]
    y = map_side[order] - map_side.mean()
    if len(x) < 8:
        return np.inf
    total_squares = (y**2).sum()
    centred = x - x.mean()
    # Residual of linear regression: S_yy - S_xy^2 / S_xx.
    line = float(total_squares - (centred @ y) ** 2 / max(float((centred**2).sum()), 1e-12))
    # A step after the k-th value explains k m1^2 + (n - k) m2^2, with the means m1, m2 of its sides; y sums to 0.
    count = np.arange(1, len(y))
    total = np.cumsum(y)[:-1]
    explained = total**2 / count + total**2 / (len(y) - count)
    return float(total_squares - explained.max()) / max(line, 1e-9)


def mirror_plane(inside: Array, rays: Array, up: Array, camera: Camera) -> tuple[Array, float]:
    """The upright plane through the camera at which the mask mirrors itself best.

    Returns its unit normal [3], and the share of the mask that lies inside the mirrored mask.
    """
    object_rays = rays[inside]
    middle = object_rays.mean(0)
    first = unit(np.cross(up, -middle))  # across the plane through the middle of the mask
    second = np.cross(up, first)

    def plane(angle: float) -> Array:
        return np.cos(angle) * first + np.sin(angle) * second

    def mismatch(angle: float) -> float:
        return 1 - float(has_mirror_image(inside, rays, plane(angle), camera)[inside].mean())

    # The mismatch has steps of whole pixels: a coarse search first, then a local one that may not do worse.
    width = np.ptp(object_rays @ first) / np.linalg.norm(middle)
    best = min(np.linspace(-0.2, 0.2, 21) * width, key=mismatch)
    refined = minimize_scalar(
        mismatch, bounds=(best - 0.02 * width, best + 0.02 * width), method="bounded"
    )
    angle = min((best, float(refined.x)), key=mismatch)
    return plane(angle), 1 - mismatch(angle)


def has_mirror_image(inside: Array, rays: Array, across: Array, camera: Camera) -> Array:
    """[H, W] bool: pixels of a mask whose mirror image at the plane with normal `across` [3] is in the mask."""
    object_rays = rays[inside]
    mirrored = object_rays - 2 * (object_rays @ across)[:, None] * across
    # The pixel that each mirrored ray meets; none where it leaves the picture.
    place, ahead = project(mirrored, camera)
    x, y = np.floor(place).astype(int).T
    in_frame = (ahead > 0) & (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
    result = np.zeros(inside.shape, bool)
    result[inside] = inside[np.where(in_frame, y, 0), np.where(in_frame, x, 0)] & in_frame
    return result


def _placed(hull: _VisualHull, seen: _ObjectMaps, round_top: bool) -> Revolution | None:
    """The body where the depth map has its front, or as far away as the ground that it stands on.

    Its upper end is round, or flat.
    """
    first = hull.first
    cell = hull.cell
    line = _capped(hull.border, float(np.linalg.norm(first.foot)), seen.camera, cell, round_top)
    if line is None:
        return None

    # --- Scale: the body, traced at distance 1, against the depth map ---
    base = float(line[0, 1])
    high = float(np.ptp(line[:, 1]))
    front, _ = Revolution(first, Profile.of(line, cell, base)).front(seen.inside, seen.rays)
    both = seen.inside & (front > 0)
    away = float(np.median(seen.depth[both] / front[both])) if both.any() else 1.0

    # --- Ground: the base is moved to it where both nearly agree ---
    ground = ground_height(Axis(first.up, np.zeros(3)), seen.behind, seen.inside, seen.rays)
    floor = base * away
    if np.isfinite(ground):
        near = abs(ground - floor) < SETTINGS.max_ground_gap * high * away
        if not near and base < 0 and abs(ground / base / away - 1) < SETTINGS.max_depth_change:
            away = ground / base
        lowest = (base - SETTINGS.max_ground_gap * high) * away
        highest = (base + SETTINGS.max_ground_gap * high) * away
        floor = float(np.clip(ground + SETTINGS.ground_clearance * high * away, lowest, highest))

    # --- The whole line at its true scale ---
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
    # --- The grid of the half plane beside the axis: twice the object's extent, in cells ---
    extent = max(np.ptp(rows), np.ptp(columns)) * pixel * 1.3
    cell = extent / SETTINGS.hull_cells
    place, _ = project(axis.foot[None], camera)
    middle = (
        (camera.height / 2 - (rows.min() + rows.max()) / 2) * pixel / max(float(axis.up[1]), 0.3)
    )
    base = middle - float((camera.height / 2 - place[0, 1]) * pixel) / max(float(axis.up[1]), 0.3)
    low = base - 0.7 * extent
    r = np.arange(int(0.6 * extent / cell)) * cell
    h = low + np.arange(int(1.4 * extent / cell)) * cell
    # --- The border is the zero line of the hull's distance field ---
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
        # A place is in the hull where the smallest distance over all turns is still inside.
        least = np.full((len(h), len(r)), np.inf)
        for angle in half + np.linspace(-np.pi / 2, np.pi / 2, SETTINGS.hull_turns // 2):
            # Every place of the half plane, turned by the angle, on the screen.
            out = np.cos(angle) * first + np.sin(angle) * np.cross(axis.up, first)
            points = axis.foot + r[None, :, None] * out + h[:, None, None] * axis.up
            x, y = np.moveaxis(project(points, camera)[0], -1, 0)
            inner = map_coordinates(field, [y - 0.5, x - 0.5], order=1, mode="nearest")
            # Beyond the frame the field is unknown: the distance to the frame counts as outside.
            beyond = np.maximum(np.maximum(-x, x - camera.width), np.maximum(-y, y - camera.height))
            least = np.minimum(least, inner - np.maximum(beyond, 0))
        halves.append(least)
    return (halves[0] + halves[1]) / 2


def _capped(line: Array, far: float, camera: Camera, cell: float, round_top: bool) -> Array | None:
    """A line from the lower to the upper end without what the camera does not see, and a round or flat upper end.

    line: [K, 2] (distance, height above the camera), `far` from the camera.
    """
    # --- The line without the noise of its pixels, and its direction ---
    spline, along = splprep(
        line.T, s=len(line) * (SETTINGS.outline_noise * far / camera.focal) ** 2
    )
    smooth = np.stack(splev(along, spline), -1)
    step = unit(np.stack(splev(along, spline, der=1), -1))
    # --- Its side: what is steeper than the camera looks down or up on it ---
    # The lower end is seen from above over its near rim, the upper one over its far rim.
    height = np.abs(smooth[:, 1])
    lower = height / np.maximum(far - smooth[:, 0], 0.1 * far)
    upper = height / np.maximum(far + smooth[:, 0], 0.1 * far)
    half = np.arange(len(line)) < np.argmax(smooth[:, 0])
    limit = SETTINGS.max_cap_slope * np.where(half, lower, upper)
    # What is less steep than the line of sight is part of the hidden ends; the side lies between.
    steep = np.flatnonzero(np.abs(step[:, 1]) > limit * np.abs(step[:, 0]))
    if len(steep) < 4:
        return None
    side = smooth[steep[0] : steep[-1] + 1]
    # --- The cap on its upper end ---
    # A round end has the side's slope where it begins, and is level at the axis.
    slope = float(upper[steep[-1]]) if round_top else 0.0
    wide, top = side[-1]
    r = np.append(np.arange(cell, wide, cell)[::-1], 0)
    cap = np.stack([r, top + slope * (wide**2 - r**2) / (2 * max(wide, cell))], -1)
    return np.concatenate([side, cap])
