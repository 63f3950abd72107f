"""Occlusion cuts: which neighbouring pixels of a depth map lie on different surfaces (paper, Mesh Reconstruction)."""

from dataclasses import dataclass

import numpy as np

from materialist.camera import unit, unproject
from materialist.types import Array, Camera


@dataclass(frozen=True)
class CutSettings:
    """Which steps in depth are the surface's own; tuned by eye unless derived."""

    # pixels beside a pair over which a slope must hold to count as the surface's own
    support: int = 3
    # degrees from grazing; a steep slope whose normals face the camera more than this is a smeared edge
    slanted: float = 25.0
    steady: float = 2.0  # factor by which a step may exceed a steady slope, as on a plane
    bending: float = (
        3.0  # added to that factor for each relative growth of the slope towards the pair
    )
    # largest such factor: the last step of a sphere's rim is 4.2 times the least (derived, tau = 6)
    max_factor: float = 5.0


SETTINGS = CutSettings()


@dataclass(frozen=True)
class Cuts:
    """Links between 4-neighbours: a pair is linked, cut (two surfaces, one behind the other), or has no surface."""

    link_x: Array
    """[H, W-1] bool: pixel (i, j) and (i, j+1) lie on one surface."""
    link_y: Array
    """[H-1, W] bool: pixel (i, j) and (i+1, j) lie on one surface."""
    cut_x: Array
    """[H, W-1] bool: both have a surface, and an occlusion boundary runs between them."""
    cut_y: Array
    """[H-1, W] bool: likewise for vertical pairs."""


def find_cuts(depth: Array, camera: Camera, tau: float, normal: Array | None = None) -> Cuts:
    """Cut the pixel grid at occlusion boundaries: pairs of 4-neighbours for which all of these hold.

    1. The pair is a leg of a triangle of the pixel-centre grid with arcsin(n . v) < tau (the paper's criterion).
    2. It makes an angle below sqrt(2) tau with the view ray itself, as the steeper leg of every such triangle does: it
       is cut across its slope, not along the boundary.
    3. Its step in inverse depth, linear on the screen for a plane, exceeds what the slope on either side lets expect,
       or the predicted normals, if given, deny that the surface is slanted (`CutSettings`).

    A pair that is below tau by itself needs no triangle: conditions 1 and 2 then hold, as in thin structures.

    depth: [H, W] planar scene units, 0 = no surface. tau: degrees. normal: [H, W, 3] predicted unit normals or None.
    """
    surface = depth > 0  # [H, W]
    points = unproject(depth, camera).astype(np.float64)  # [H, W, 3] scene units
    inverse = np.where(surface, 1.0 / np.where(surface, depth, 1.0), 0.0)  # [H, W] 1 / scene unit
    # --- Conditions 1 and 2: grazing pairs (paper) ---
    grazing_x, grazing_y = _grazing_pairs(points, surface, np.radians(tau))
    # --- Condition 3: steeper than the surface beside, or than the normals admit ---
    slanted = np.ones(depth.shape, bool)
    if normal is not None:
        # A plane whose edges a large tau takes for grazing is slanted, too.
        most = np.radians(min(90, max(SETTINGS.slanted, np.sqrt(2) * tau)))
        slanted = np.abs((unit(normal) * unit(points)).sum(-1)) <= np.sin(most)
    steep_x = _exceeds_slope(inverse, surface) | ~(slanted[:, :-1] | slanted[:, 1:])
    steep_y = _exceeds_slope(inverse.T, surface.T).T | ~(slanted[:-1] | slanted[1:])
    # --- Cut where all three hold, linked elsewhere ---
    pair_x = surface[:, :-1] & surface[:, 1:]
    pair_y = surface[:-1] & surface[1:]
    cut_x = pair_x & grazing_x & steep_x
    cut_y = pair_y & grazing_y & steep_y
    return Cuts(pair_x & ~cut_x, pair_y & ~cut_y, cut_x, cut_y)


def _grazing_pairs(points: Array, surface: Array, tau: float) -> tuple[Array, Array]:
    """Conditions 1 and 2 for horizontal [H, W-1] and vertical [H-1, W] pairs; tau in radians."""
    height, width = surface.shape
    angle_x = _edge_angle(points[:, :-1], points[:, 1:])  # [H, W-1] radians
    angle_y = _edge_angle(points[:-1], points[1:])  # [H-1, W] radians
    wide = np.sqrt(2) * tau
    near_x = np.zeros((height, width - 1), bool)  # leg of a grazing triangle
    near_y = np.zeros((height - 1, width), bool)
    # Both diagonals of every 2x2 block, so that the result does not depend on how the block is split.
    for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
        corner = _block(points, row, column)  # the right-angled vertex; [H-1, W-1, 3]
        along_x = _block(points, row, 1 - column)
        along_y = _block(points, 1 - row, column)
        # A triangle decides about those of its legs alone that nearly graze themselves.
        grazing = (
            _block(surface, row, column)
            & _block(surface, row, 1 - column)
            & _block(surface, 1 - row, column)
        )
        grazing &= (angle_x[row : row + height - 1] < wide) | (
            angle_y[:, column : column + width - 1] < wide
        )  # [H-1, W-1]
        angle = _triangle_angle(corner[grazing], along_x[grazing], along_y[grazing])
        grazing[grazing] = angle < tau
        near_x[row : row + height - 1] |= grazing
        near_y[:, column : column + width - 1] |= grazing
    # A pair below tau by itself is cut even where a thin structure leaves no whole triangle.
    return (angle_x < tau) | (near_x & (angle_x < wide)), (angle_y < tau) | (
        near_y & (angle_y < wide)
    )


def _block(grid: Array, row: int, column: int) -> Array:
    """One corner of every 2x2 block of [H, W, ...]: [H-1, W-1, ...]."""
    return grid[row : grid.shape[0] - 1 + row, column : grid.shape[1] - 1 + column]


def _triangle_angle(a: Array, b: Array, c: Array) -> Array:
    """arcsin |n . v| [...] in radians of triangles [..., 3], v the direction from the centroid to the camera."""
    normal = np.cross(b - a, c - a)
    centroid = a + b + c
    length = np.linalg.norm(normal, axis=-1) * np.linalg.norm(centroid, axis=-1)
    return np.arcsin(
        np.minimum(np.abs((normal * centroid).sum(-1)) / np.maximum(length, 1e-300), 1)
    )


def _edge_angle(a: Array, b: Array) -> Array:
    """Angle [...] in radians, [0, pi/2], between the segment a-b [..., 3] and the view ray through its middle."""
    edge = b - a
    view = a + b
    cross = np.linalg.norm(np.cross(edge, view), axis=-1)
    return np.arctan2(cross, np.abs((edge * view).sum(-1)))


def _exceeds_slope(inverse: Array, surface: Array) -> Array:
    """Condition 3 for horizontal pairs: [H, W-1] bool, from inverse depth [H, W] and its validity [H, W]."""
    width = inverse.shape[1]
    pair = surface[:, :-1] & surface[:, 1:]  # [H, W-1]
    step = np.where(pair, inverse[:, 1:] - inverse[:, :-1], 0.0)  # [H, W-1] 1 / (scene unit pixel)
    allowed = np.zeros_like(step)
    # --- On either side: the least slope within `support` pixels, as far as it is known ---
    for side in (-1, 1):
        least = np.full_like(step, np.inf)
        first = np.zeros_like(step)  # the slope next to the pair
        held = np.ones(step.shape, bool)  # no hole and no picture rim met so far
        for reach in range(1, min(SETTINGS.support, width - 2) + 1):
            here, there = (slice(reach, None), slice(None, -reach))[::side]
            reached = np.zeros(step.shape, bool)
            reached[:, here] = pair[:, there]
            held &= reached
            beside = np.zeros_like(step)  # slope at this reach, counted along the pair's own sign
            beside[:, here] = np.sign(step[:, here]) * step[:, there]
            least = np.where(held, np.minimum(least, beside), least)
            first = np.where(held & (reach == 1), beside, first)
        # --- What it allows: more where it grows towards the pair, as at a round rim ---
        steady = np.isfinite(least) & (least > 0)
        least = np.where(steady, least, 1)
        bending = first * (SETTINGS.steady + SETTINGS.bending * (first / least - 1))
        allowed = np.maximum(
            allowed, np.where(steady, np.minimum(bending, SETTINGS.max_factor * least), 0)
        )
    return np.abs(step) > allowed
