"""What things fall onto: the scene as a height field along gravity, cut into convex blocks.

Coordinates are those of the simulation: metres, z up. `to_up` [3, 3] and `factor` lead there from the camera frame.
"""

from dataclasses import dataclass

import numpy as np

from materialist.camera import unproject
from materialist.types import Array, Scene


@dataclass(frozen=True)
class GroundSettings:
    """Extent and precision of the ground; lengths are in longest sides of the falling things; tuned by eye."""

    cells: int = 128  # along each side of the field; a power of two
    half_side: float = 6.0  # of the field
    min_wall_height: float = 0.15  # over the floor, from which upright surfaces count
    max_bump: float = 0.004  # distance of a block's points from its plane
    block_depth: float = 2.0  # by which a block reaches below the field
    max_blocks: int = 1500  # `max_bump` is relaxed until there are no more
    min_back_cosine: float = 0.05  # of a face's normal with a ray that comes from behind it


SETTINGS = GroundSettings()


@dataclass(frozen=True)
class Field:
    """Heights over a square of ground, z up."""

    corner: Array
    """[2] x and y of the first grid point."""
    cell: float
    """Distance of grid points."""
    height: Array
    """[n + 1, n + 1] z of the surface at (x, y) = corner + cell * (column, row); NaN where there is none."""


def ground_field(
    scene: Scene, to_up: Array, factor: float, *, places: Array, tops: Array, metres: float
) -> Field:
    """Heights of a scene with its bodies, under and around places.

    places: [n, 2] x and y over which things fall. metres: longest side of the falling things.
    tops: [n] z from which the ground is seen, over each place and over what lies nearest to it.
    """
    from materialist.render.scene import RenderScene

    half = SETTINGS.half_side * metres + float(np.ptp(places, axis=0).max()) / 2
    steps = np.linspace(-half, half, SETTINGS.cells + 1)
    middle = places.mean(0)
    x, y = np.meshgrid(middle[0] + steps, middle[1] + steps)
    target = RenderScene(scene.geometry, scene.camera, bodies=scene.bodies)

    def top(x: Array, y: Array) -> Array:
        nearest = ((np.stack([x, y], -1)[:, None] - places) ** 2).sum(-1).argmin(1)
        return tops[nearest]

    # --- Rays along gravity meet floors and table tops ---
    start = np.stack([x.ravel(), y.ravel(), top(x.ravel(), y.ravel())], -1)
    height = _met(target, start, to_up, factor).reshape(x.shape)
    # Rays along gravity miss what is upright: where visible points stand out of the field, they raise it.
    # --- Upright surfaces ---
    points = (
        unproject(scene.depth, scene.camera)[scene.depth > 0].astype(np.float64) @ to_up.T * factor
    )
    cell = 2 * half / SETTINGS.cells
    low = np.nanmin(height) if np.isfinite(height).any() else 0.0
    column, row = np.round((points[:, :2] - [x[0, 0], y[0, 0]]) / cell).astype(int).T
    inside = (column >= 0) & (column <= SETTINGS.cells) & (row >= 0) & (row <= SETTINGS.cells)
    inside &= points[:, 2] < top(points[:, 0], points[:, 1])
    column = column[inside]
    row = row[inside]
    z = points[inside, 2]
    upright = (
        z > np.nan_to_num(height[row, column], nan=low - metres) + SETTINGS.min_wall_height * metres
    )
    # The highest of several points in a cell counts; fmax ignores the NaN of empty cells.
    np.fmax.at(height, (row[upright], column[upright]), z[upright])
    return Field(np.array([x[0, 0], y[0, 0]]), cell, height)


def _met(target, points: Array, to_up: Array, factor: float) -> Array:
    """z [n] of what rays downwards from points [n, 3] meet first in a `RenderScene`, NaN for nothing.

    A ray that meets a back face first begins in a solid: it meets that at its start.
    """
    from materialist.buffers import floats

    mi = target.mi
    start = points / factor @ to_up  # back in the camera frame
    origin = mi.Point3f(*(floats(mi, start[:, k]) for k in range(3)))
    hit = target.mi_scene.ray_intersect(
        mi.Ray3f(origin, mi.Vector3f(*(float(-v) for v in to_up[2])))
    )
    distance = np.where(np.array(hit.is_valid()), np.array(hit.t, np.float64) * factor, np.nan)
    distance[np.array(hit.n, np.float64).T @ to_up[2] < -SETTINGS.min_back_cosine] = 0
    return points[:, 2] - distance


def blocks(ground: Field, *, metres: float) -> list[Array]:
    """Corners [8, 3] of convex blocks whose tops are the field, for things whose longest side is `metres`.

    Large where the ground is plane: a square is halved in both directions until its grid points lie on a plane.
    """
    cells = ground.height.shape[0] - 1
    for relaxed in range(8):
        corners: list[Array] = []
        max_bump = SETTINGS.max_bump * metres * 2**relaxed
        _split(ground, (0, 0, cells), max_bump, SETTINGS.block_depth * metres, corners)
        if len(corners) <= SETTINGS.max_blocks:
            break
    return corners


def _split(
    ground: Field, square: tuple[int, int, int], max_bump: float, depth: float, corners: list[Array]
) -> None:
    """Add the corners [8, 3] of each block of a square (row, column, cells along a side) to the list."""
    row, column, n = square
    part = ground.height[row : row + n + 1, column : column + n + 1]
    known = np.isfinite(part)
    if known.sum() < (4 if n == 1 else 1):
        return
    tops = part[[0, 0, -1, -1], [0, -1, 0, -1]]
    # --- Plane enough for one block? Else its four quarters ---
    if n > 1:
        y, x = np.mgrid[: n + 1, : n + 1]
        system = np.stack([np.ones(x.size), x.ravel(), y.ravel()], -1)
        plane = np.linalg.lstsq(system, part.ravel(), rcond=None)[0] if known.all() else np.zeros(3)
        if not known.all() or np.abs(system @ plane - part.ravel()).max() > max_bump:
            half = n // 2
            for r in (row, row + half):
                for c in (column, column + half):
                    _split(ground, (r, c, half), max_bump, depth, corners)
            return
        tops = np.array([[1, 0, 0], [1, n, 0], [1, 0, n], [1, n, n]]) @ plane
    # --- One block: its top on the field, its bottom flat below ---
    x = ground.corner[0] + ground.cell * (column + n * np.array([0, 1, 0, 1]))
    y = ground.corner[1] + ground.cell * (row + n * np.array([0, 0, 1, 1]))
    corners.append(
        np.concatenate([np.stack([x, y, z], -1) for z in (tops, np.full(4, tops.min() - depth))])
    )


def depth_in(ground: Field, points: Array) -> float:
    """How deep points [n, 3] lie in the ground at most; < 0 over it. A cell counts as high as its highest corner."""
    column, row = np.floor((points[:, :2] - ground.corner) / ground.cell).astype(int).T
    z = ground.height
    cells = np.stack([z[:-1, :-1], z[:-1, 1:], z[1:, :-1], z[1:, 1:]]).max(0)  # NaN beside a hole
    inside = (column >= 0) & (row >= 0) & (column < cells.shape[1]) & (row < cells.shape[0])
    deep = cells[row[inside], column[inside]] - points[inside, 2]
    return float(np.nanmax(deep)) if np.isfinite(deep).any() else -np.inf
