"""Depth that agrees with the normals, with steps where one surface hides another.

Networks know normals better than depth: their depth bends floors and walls, and steps at painted edges. Of depth we
keep the large scale and the steps between surfaces; its slopes come from the normals. Over log depth u,

    sum over neighbours of rho((u_q - u_p - g_pq) c_pq) + sum over pixels of (u_p - d_p)^2 / length^2

is made least, where d is the predicted log depth, g the change that the normals demand under perspective (exact on
planes) and c the squared cosine of the view angle, by which the first sum is one of squared angles. rho (Welsch) is
bounded: a step costs the same whatever its height. One that goes round a thing stays, since depth holds both sides
apart; one that ends on a surface, as along a painted edge, is closed by what lies around its end. It is minimised by
reweighted least squares, as in bilateral normal integration (Cao et al. 2022), which has no predicted depth.
"""

from dataclasses import dataclass

import numpy as np
import pyamg
from scipy.sparse import coo_matrix, csr_matrix, diags
from scipy.sparse.linalg import cg

from materialist.camera import unit
from materialist.geometry.regions import connected_regions, regions_without_strays
from materialist.geometry.silhouette import spacing
from materialist.types import Array


@dataclass(frozen=True)
class IntegrationSettings:
    """What decides between depth and normals, and how it is solved."""

    length: float = 0.5  # scale above which depth decides, share of the longer side; 3 made scenes
    steep: float = 1.0  # tangent of the unexplained slope that weighs 1/e; tuned on 3 made scenes
    grazing: float = 0.1  # least cosine of the view angle that a normal is taken to have; by eye
    rounds: int = 4  # reweighted solves; 12 move depth by 0.1 to 0.7 % (7 photos)
    parted: float = 3.0  # tangent of the unexplained slope from which two pixels part; by eye
    least: float = 0.0005  # share of the surface below which a region is a stray; by eye
    stray_pull: float = 1e-3  # part of the pull that is left to strays; so that they follow
    last_rounds: int = 2  # reweighted solves without strays
    tolerance: float = 1e-3  # residual at which a solve ends, share of its first one
    iterations: int = 100  # most steps of a solve
    coarsest: int = 500  # unknowns that multigrid solves directly
    hold: float = 1e-6  # pull to the start, as a share of the links; for single precision


SETTINGS = IntegrationSettings()


def integrated(depth: Array, normal: Array, rays: Array) -> Array:
    """[H, W] float32 planar depth that follows the normals, with the given one's large scale and occlusions.

    depth: [H, W] planar, scene units, 0 where there is no surface; so is the result. normal: [H, W, 3] unit, camera
    frame. rays: [H, W, 2 or 3] x and y (and -1) of the rays through the pixels at z = -1.
    """
    surface = depth > 0
    if surface.sum() < 9:
        return depth.astype(np.float32)
    # --- The sum: log depth d, pull 1 / length^2 in pixels, scale of rho ---
    grid = _Grid.of(surface, normal, rays)
    data = np.log(depth[surface].astype(np.float64))
    pull = np.full(len(data), (SETTINGS.length * max(depth.shape)) ** -2)
    scale = SETTINGS.steep * spacing(rays)
    # --- Reweighted least squares: the weights are rho's at the solution before ---
    log_depth = data
    for _ in range(SETTINGS.rounds):
        log_depth = grid.solved(grid.weights(log_depth, scale), pull, data, log_depth)
    log_depth = _without_strays(grid, log_depth, pull, data, spacing(rays))
    result = np.zeros(depth.shape, np.float32)
    result[surface] = np.exp(log_depth)
    return result


def _without_strays(
    grid: "_Grid", log_depth: Array, pull: Array, data: Array, angle: float
) -> Array:
    """[N] log depth whose strays, as the blurred rim of a thing, follow a neighbour in place of their own depth.

    log_depth: [N] from the solves before. pull, data: [N] as in `_Grid.solved`. angle: of a pixel, radians.
    """
    # --- Regions between steps that the normals do not explain; which are strays ---
    gap = np.abs(grid.step @ log_depth - grid.demanded)
    least = SETTINGS.least * len(data)
    linked = gap < SETTINGS.parted * angle
    pairs = grid.first, grid.second
    region, joined = regions_without_strays(pairs, linked, gap, least, len(data))
    alone = connected_regions(pairs, linked, len(data))
    stray = (np.bincount(alone)[alone] < least) & (np.bincount(region)[region] >= least)
    # --- Strays let go of their depth, and hold on to the neighbour they joined ---
    pull = np.where(stray, SETTINGS.stray_pull * pull, pull)
    within = region[grid.first] == region[grid.second]
    for _ in range(SETTINGS.last_rounds):
        weight = np.where(joined & ~linked, 1, grid.weights(log_depth, SETTINGS.steep * angle))
        log_depth = grid.solved(np.where(within, weight, 0), pull, data, log_depth)
    return log_depth


@dataclass(frozen=True)
class _Grid:
    """The pixels with a surface as N unknowns, and the P pairs of neighbours among them."""

    first: Array
    """[P] unknown of a pair's left or upper pixel."""
    second: Array
    """[P] of its right or lower one."""
    demanded: Array
    """[P] change of log depth from the first to the second by the normals."""
    facing: Array
    """[P] squared cosine of the view angle, mean of both."""
    step: csr_matrix
    """[P, N] differences, second - first."""

    @staticmethod
    def of(surface: Array, normal: Array, rays: Array) -> "_Grid":
        """Of a picture; arrays as in `integrated`."""
        # Numbers of the unknowns, and rays at z = -1.
        index = np.cumsum(surface.ravel()).reshape(surface.shape) - 1
        ray = np.stack([rays[..., 0], rays[..., 1], -np.ones(surface.shape)], -1).astype(np.float64)
        parts = []
        for near, far in (np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:]):
            # What a pair demands is the mean of what the normals of both pixels demand.
            both = surface[near] & surface[far]
            ends = [normal[side][both].astype(np.float64) for side in (near, far)]
            views = [ray[side][both] for side in (near, far)]
            change = (_change(ends[0], *views) + _change(ends[1], *views)) / 2
            cosine = [_cosine(end, view) for end, view in zip(ends, views, strict=True)]
            parts.append((index[near][both], index[far][both], change, cosine[0] * cosine[1]))
        first, second, demanded, facing = (np.concatenate(column) for column in zip(*parts))
        count = len(first)
        # The matrix of differences: -1 at the first pixel of a pair, +1 at the second.
        rows = np.tile(np.arange(count), 2)
        signs = np.repeat([-1.0, 1.0], count)
        shape = (count, int(surface.sum()))
        step = coo_matrix((signs, (rows, np.concatenate([first, second]))), shape).tocsr()
        return _Grid(first, second, demanded, facing, step)

    def excess(self, values: Array) -> Array:
        """[P] change of log depth [N] that the normals do not explain, less where they face away."""
        return (self.step @ values - self.demanded) * self.facing

    def weights(self, values: Array, scale: float) -> Array:
        """[P] how much each pair counts at log depth [N]: 1 where the normals explain it, 0 where a step is."""
        return np.exp(-((self.excess(values) / scale) ** 2))

    def solved(self, weight: Array, pull: Array, data: Array, start: Array) -> Array:
        """[N] the minimum of sum of weight (excess)^2 + sum of pull (u - data)^2, from `start`.

        Conjugate gradients with algebraic multigrid as preconditioner, which carries far what neighbours alone would
        pass on step by step, and knows no grid: steps and holes are weights of 0 to it.
        """
        strength = weight * self.facing**2
        system = (self.step.T @ diags(strength) @ self.step + diags(pull)).tocsr()
        right_side = self.step.T @ (strength * self.demanded) + pull * data
        limit = SETTINGS.tolerance * float(np.linalg.norm(right_side - system @ data))
        # What is missing to the start is solved for in single precision, which takes half the time: its error is far
        # below the tolerance.
        missing = (right_side - system @ start).astype(np.float32)
        single = system.astype(np.float32)
        # Single precision loses a weak pull beside strong links; without one, nothing holds a stray in its place.
        single = (single + diags(np.float32(SETTINGS.hold) * single.diagonal())).tocsr()
        multigrid = pyamg.ruge_stuben_solver(
            single, max_coarse=SETTINGS.coarsest, coarse_solver="splu", interpolation="direct"
        )
        change, _ = cg(
            single,
            missing,
            rtol=0.0,
            atol=limit,
            maxiter=SETTINGS.iterations,
            M=multigrid.aspreconditioner(),
        )
        return start + change


def _change(normal: Array, near: Array, far: Array) -> Array:
    """[P] change of log depth from rays [P, 3] `near` to rays `far` on planes with these normals [P, 3]."""
    size = -SETTINGS.grazing * np.linalg.norm(near, axis=-1)
    ahead = np.minimum((normal * near).sum(-1), size)
    turn = (normal * (far - near)).sum(-1) / ahead
    # Beyond the horizon of a plane there is no depth: the change stays finite.
    return -np.log1p(np.clip(turn, -0.5, 1))


def _cosine(normal: Array, ray: Array) -> Array:
    """[P] cosine of the view angle, at least `grazing`."""
    return np.maximum(-(normal * unit(ray)).sum(-1), SETTINGS.grazing)
