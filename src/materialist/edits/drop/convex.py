"""Shapes as a few convex pieces, which is what collisions are computed with."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np

from materialist.errors import SetupError
from materialist.types import Array


@dataclass(frozen=True)
class ConvexSettings:
    """When one hull stands for a mesh, and how CoACD takes others apart; tuned by eye."""

    same: float = 1.05  # volume of the hull over that of the shape up to which the hull alone stands for it
    concave: float = 0.12  # concavity that is left in a piece (CoACD's threshold)
    pieces: int = 16  # most pieces
    fine: int = 1500  # triangles from which a mesh is thinned out before it is taken apart
    coarse: int = 24  # cells along the longest side to which it is thinned out


DEFAULT = ConvexSettings()


def hull(points: Array) -> Array:
    """[n, 3] corners of the convex hull of points [m, 3], m >= 4; flat ones are given a thickness."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        size = max(float(np.ptp(points, axis=0).max()), 1e-9)
        thick = np.concatenate([points, *(points + shift for shift in 0.01 * size * np.eye(3))])
        return thick[ConvexHull(thick).vertices]


def convex_pieces(vertices: Array, faces: Array, *, seed: int = 0) -> list[Array]:
    """Corners [n, 3] of convex pieces that together make up a mesh: one hull where that is nearly all of it.

    Raises SetupError where coacd is not installed and the mesh is not nearly convex.
    """
    from scipy.spatial import ConvexHull
    from trimesh import Trimesh

    vertices = np.asarray(vertices, np.float64)
    outer, mesh = hull(vertices), Trimesh(vertices, faces, validate=True)
    if mesh.is_watertight and ConvexHull(outer).volume <= DEFAULT.same * abs(mesh.volume):
        return [outer]
    try:
        import coacd
    except ImportError as error:
        raise SetupError(
            "Falling objects need two more packages; install them with: pip install 'materialist[physics]'"
        ) from error
    logging.getLogger("coacd").setLevel(logging.ERROR)
    coacd.set_log_level("error")
    if len(faces) > DEFAULT.fine:
        cell = max(float(np.ptp(vertices, axis=0).max()), 1e-30) / DEFAULT.coarse
        mesh = Trimesh(np.round(vertices / cell) * cell, faces, validate=True)
    parts = coacd.run_coacd(
        coacd.Mesh(mesh.vertices, mesh.faces), threshold=DEFAULT.concave, max_convex_hull=DEFAULT.pieces,
        preprocess_resolution=30, resolution=400, mcts_nodes=8, mcts_iterations=20, mcts_max_depth=2, seed=seed,
    )  # fmt: skip
    return [hull(np.asarray(points, np.float64)) for points, _ in parts if len(points) >= 4] or [outer]
