"""A surface of revolution: one profile swept around its axis, as a closed body or an open vessel."""

from dataclasses import dataclass

import numpy as np

from materialist.camera import project, unit
from materialist.geometry.planes import axes
from materialist.solids.profile import Profile
from materialist.solids.shell import Shell, inside_out, joined_shells
from materialist.types import Array, Camera


@dataclass(frozen=True)
class RevolutionSettings:
    """How a profile is swept."""

    min_step_cells: float = 0.5  # of a step along a ray
    corners: int = 256  # of the swept circles
    min_side_lean: float = 0.5  # outward part of the normals of a side; above the side is the lid
    # wall thicknesses below the rim to which the lid changes the inside; by eye
    lid_reach: float = 3.5
    lip_points: int = 12  # of the rounded rim of an open vessel
    foot_share: float = (
        0.05  # of the object's outline, from below, at which its ground is looked for; by eye
    )


SETTINGS = RevolutionSettings()


@dataclass(frozen=True)
class Axis:
    """The axis, and the coordinates of the half plane beside it: distance and height above its foot, scene units."""

    up: Array
    """[3] unit."""
    foot: Array
    """[3] scene units."""

    def of(self, points: Array) -> Array:
        """[..., 2] (distance, height) of points [..., 3]."""
        away = points - self.foot
        height = away @ self.up
        return np.stack([np.linalg.norm(away - height[..., None] * self.up, axis=-1), height], -1)

    def spread(self, points: Array, leaning: Array) -> Array:
        """[N, 3] unit normals at points [N, 3] where the profile leans by [N, 2]."""
        away = points - self.foot
        out = unit(away - (away @ self.up)[:, None] * self.up)
        return unit(leaning[:, :1] * out + leaning[:, 1:] * self.up)


@dataclass(frozen=True)
class Revolution:
    """A body that a profile sweeps around an axis."""

    axis: Axis
    profile: Profile

    def body(self, camera: Camera, *, wall: float | None = None) -> Shell:
        """The closed body; with `wall` (scene units) a second surface is added inside.

        Every edge has two faces that run through it in opposite directions.
        """
        outer = [_swept(*line, self.axis, camera) for line in self.profile.lines()]
        inner = (
            [_swept(*line, self.axis, camera) for line in self.profile.lines(wall)] if wall else []
        )
        return joined_shells([*outer, *map(inside_out, inner)])

    def vessel(self, camera: Camera, wall: float) -> Shell | None:
        """The body as one surface around a wall (scene units), open at the top; None where the profile has no room."""
        line = _vessel_line(self.profile, wall)
        return None if line is None else _swept(*line, self.axis, camera)

    def thickness(self, depth: Array, inside: Array, rays: Array) -> Array:
        """[H, W] float32 scene units along rays: from the front [H, W] planar depth to the last surface of the body."""
        nearest, reach = self._reach(rays[inside])
        last = self._met(rays[inside], nearest + reach, -2 * reach)
        thickness = np.zeros(depth.shape, np.float32)
        thickness[inside] = np.maximum(np.nan_to_num(last) - depth[inside], 0) * np.linalg.norm(
            rays[inside], axis=-1
        )
        return thickness

    def front(self, inside: Array, rays: Array) -> tuple[Array, Array]:
        """[H, W] planar depth at which rays enter the body, and its unit normals [H, W, 3] there; 0 where they pass."""
        depth = np.zeros(inside.shape)
        normal = np.zeros((*inside.shape, 3))
        nearest, reach = self._reach(rays[inside])
        depth[inside] = np.nan_to_num(self._met(rays[inside], nearest - reach, 2 * reach))
        points = rays[inside] * depth[inside][:, None]
        normal[inside] = self.axis.spread(points, self.profile.slope(self.axis.of(points)))
        return depth, normal * (depth > 0)[..., None]

    def _reach(self, rays: Array) -> tuple[Array, Array]:
        """[N] planar depths of rays [N, 3]: nearest to the body's middle, and how far the body goes from there."""
        # A bounding sphere around the middle of the axis.
        wide, high = self.profile.size
        middle = self.axis.foot + (self.profile.floor + high / 2) * self.axis.up
        length = np.linalg.norm(rays, axis=-1)
        return rays @ middle / length**2, np.hypot(wide, high / 2) / length

    def _met(self, rays: Array, start: Array, way: Array) -> Array:
        """[N] planar depth of the first point in the body from `start` [N] on, up to start + way; NaN where none is.

        `profile.at` bounds the distance to the body: it tells the next step (sphere tracing, Hart 1996).
        """
        depth = np.full(len(rays), np.nan)
        here = start
        length = np.linalg.norm(rays, axis=-1)
        along = np.sign(way)
        left = np.arange(len(rays))
        last = here
        before = np.ones(len(rays))
        # `value` is in cells: a step is never longer than the distance, nor below half a cell.
        while len(left):
            value = self.profile.at(self.axis.of(rays[left] * here[:, None]))
            # The ray has entered: the zero lies between the last two values, linearly.
            inner = value < 0
            share = before / np.maximum(before - value, 1e-12)
            depth[left[inner]] = (last + np.clip(share, 0, 1) * (here - last))[inner]
            step = (
                along[left]
                * np.maximum(value, SETTINGS.min_step_cells)
                * self.profile.cell
                / length[left]
            )
            on = ~inner & (np.abs(here + step - start[left]) < np.abs(way[left]))
            last = here[on]
            before = value[on]
            here = (here + step)[on]
            left = left[on]
        return depth


def ground_height(axis: Axis, behind: Array | None, inside: Array, rays: Array) -> float:
    """Height above the foot of what stands behind the lowest part of the object; -inf where there is nothing.

    There the object meets its ground. Farther up the ground is seen behind it, and a relief may rise or fall there.
    """
    if behind is None or not (known := inside & (np.asarray(behind) > 0)).any():
        return -np.inf
    # The lowest part of the object on the screen, by the height of its rays.
    level = rays @ axis.up
    low = level[inside].min()
    lowest = known & (level <= low + SETTINGS.foot_share * np.ptp(level[inside]))
    if not lowest.any():
        return -np.inf
    points = rays[lowest] * np.asarray(behind)[lowest][:, None]
    return float(np.median((points - axis.foot) @ axis.up))


def _swept(line: Array, leaning: Array, axis: Axis, camera: Camera) -> Shell:
    """One line [K, 2] with normals [K, 2], the body to its left, swept around the axis; ends at the axis are poles."""
    angle = 2 * np.pi * np.arange(SETTINGS.corners) / SETTINGS.corners
    out = np.stack([np.cos(angle), np.sin(angle)], -1) @ axes(axis.up)  # [A, 3]
    ring = bool(np.allclose(line[0], line[-1]))
    rows = line[:-1] if ring else line
    lean = leaning[:-1] if ring else leaning

    # --- Every point of the line on every turn: K rings of A corners ---
    points = axis.foot + rows[:, None, :1] * out + rows[:, None, 1:] * axis.up  # [K, A, 3]
    normals = lean[:, None, :1] * out + lean[:, None, 1:] * axis.up

    # --- Two triangles for each quad between neighbouring rings ---
    index = np.arange(points.shape[0] * SETTINGS.corners).reshape(-1, SETTINGS.corners)
    if not ring:  # a pole is one vertex
        index[0], index[-1] = index[0, 0], index[-1, 0]
    below = index if ring else index[:-1]
    above = np.roll(index, -1, 0) if ring else index[1:]
    a = below
    b = np.roll(below, -1, 1)
    c = np.roll(above, -1, 1)
    d = above
    faces = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    # At a pole one side of a quad has no length: its triangle is dropped.
    faces = faces[
        (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    ]
    # Only vertices that some face has, numbered anew.
    used, faces = np.unique(faces, return_inverse=True)
    vertices = points.reshape(-1, 3)[used]
    normals = normals.reshape(-1, 3)[used]
    place = project(vertices, camera)[0] / [camera.width, camera.height]
    return Shell(
        vertices.astype(np.float32),
        faces.reshape(-1, 3).astype(np.int32),
        normals.astype(np.float32),
        np.clip(place, 0, 1).astype(np.float32),
    )


def _vessel_line(profile: Profile, wall: float) -> tuple[Array, Array] | None:
    """The line around the wall of an open vessel: up its outside, over a round rim, down its inside.

    Places [K, 2] (distance, height) of the line and their unit outward normals [K, 2], glass to its left, from the
    axis to the axis; None where the profile is no single body around its axis, or has no room inside a `wall`.
    """
    # --- The lines of the outside and of the inside, where each is a single one ---
    outer = _around(profile.lines())
    inner = _around(profile.lines(wall))
    if outer is None or inner is None:
        return None
    place, lean = outer

    # --- Where the side ends below the lid, outside and inside ---
    top = _last_side(outer)
    # The lip adds half a wall of height: it begins that much lower, and ends where the side did.
    rim = None if top is None else _last_side(outer, place[top, 1] - wall / 2)
    within = None if rim is None else _last_side(inner, place[rim, 1] - SETTINGS.lid_reach * wall)
    if rim is None or within is None:
        return None

    # --- The inside, from the rim down ---
    # Next to the lid the inside is as far from the outside as the wall is thick.
    near = np.flatnonzero(
        (place[: rim + 1, 1] > inner[0][within, 1]) & (lean[: rim + 1, 0] > SETTINGS.min_side_lean)
    )[::-1]
    upper = place[near] - wall * lean[near]
    if not len(near) or upper[:, 0].min() <= 0 or inner[0][within, 0] >= place[: rim + 1, 0].max():
        return None
    inside = np.concatenate([upper, inner[0][: within + 1][::-1]])
    facing = -np.concatenate([lean[near], inner[1][: within + 1][::-1]])

    # --- The lip: half a circle between outside and inside ---
    r = upper[0, 0]
    height = place[rim, 1]
    half = (place[rim, 0] - r) / 2
    middle = (place[rim, 0] + r) / 2
    angle = np.pi * np.arange(1, SETTINGS.lip_points) / SETTINGS.lip_points
    round_ = np.stack([np.cos(angle), np.sin(angle)], -1)
    lip = np.array([middle, height]) + half * round_
    whole = np.concatenate([place[: rim + 1], lip, inside])
    return whole, np.concatenate([lean[: rim + 1], round_, facing])


def _around(lines: list[tuple[Array, Array]]) -> tuple[Array, Array] | None:
    """The only line, from the axis below to the axis above; None if there are others, or it is a ring."""
    if len(lines) != 1 or max(lines[0][0][0, 0], lines[0][0][-1, 0]) > 1e-6:
        return None
    place, lean = lines[0]
    return (place, lean) if place[0, 1] < place[-1, 1] else None


def _last_side(line: tuple[Array, Array], below: float = np.inf) -> int | None:
    """The last point of a line, up to a height, that is on a side."""
    place, lean = line
    sides = np.flatnonzero((lean[:, 0] > SETTINGS.min_side_lean) & (place[:, 1] <= below))
    return int(sides[-1]) if len(sides) else None
