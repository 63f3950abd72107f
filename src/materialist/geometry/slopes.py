"""What a normal says about the depth next to it, and the depth that follows what normals say."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from materialist.types import Array

Pairs = tuple[Array, Array, Array, Array]
"""Linked neighbours, [P] each: the one, the other, the step wanted between them, and its weight."""
STEEPEST = 0.12
"""Smallest n.v that is followed (7 degrees): beyond, the slope runs to infinity."""


def slopes(normal: Array, rays: Array, steepest: float = STEEPEST) -> tuple[Array, Array]:
    """[H, W] change of log depth from one pixel to the next that the normals demand, to the right and downwards.

    n . d(z r) = 0 along the surface gives d log z = -n . dr / (n . r).

    Args:
        normal: [H, W, 3] unit, camera frame. rays: [H, W, 2 or 3] through the pixels at z = -1, evenly spaced.
        steepest: smallest n.v that is followed.
    """
    x, y = rays[..., 0], rays[..., 1]
    across = float(x[0, -1] - x[0, 0]) / max(x.shape[1] - 1, 1)
    down = float(y[-1, 0] - y[0, 0]) / max(y.shape[0] - 1, 1)
    facing = normal[..., 0] * x + normal[..., 1] * y - normal[..., 2]
    facing = np.minimum(facing, -steepest * np.sqrt(x**2 + y**2 + 1))  # n . r < 0 where the surface is seen
    return -normal[..., 0] * across / facing, -normal[..., 1] * down / facing


def between(demanded: tuple[Array, Array]) -> Iterator[tuple[Any, Any, Array]]:
    """Neighbours in a row, then in a column: index of the one, index of the other, and the slope midway.

    Args:
        demanded: [H, W] both, what `slopes` gives; the slope midway is [H, W - 1], then [H - 1, W].
    """
    for slope, near, far in (
        (demanded[0], np.s_[:, :-1], np.s_[:, 1:]),
        (demanded[1], np.s_[:-1], np.s_[1:]),
    ):
        yield near, far, (slope[near] + slope[far]) / 2


def least_squares_change(
    first: Array, second: Array, wanted: Array, weight: Array, pull: Array, *, rtol: float, maxiter: int
) -> Array:
    """[N] float64, min over u of sum of weight |u_second - u_first - wanted|^2 + sum of pull |u|^2.

    Conjugate gradients, preconditioned by the diagonal, as far as `rtol` and `maxiter` say.

    Args:
        first, second: [P] which of the N unknowns a pair joins. wanted, weight: [P]. pull: [N] above 0.
    """
    from scipy.sparse import coo_matrix, diags
    from scipy.sparse.linalg import cg

    rows, root = np.tile(np.arange(len(first)), 2), np.sqrt(weight)
    entries = (np.concatenate([-root, root]), (rows, np.concatenate([first, second])))
    step = coo_matrix(entries, (len(first), len(pull))).tocsr()
    system = (step.T @ step + diags(pull)).tocsr()
    change, _ = cg(system, step.T @ (root * wanted), rtol=rtol, maxiter=maxiter, M=diags(1 / system.diagonal()))
    return change
