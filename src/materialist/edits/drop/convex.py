"""Shapes as a few convex pieces, which is what collisions are computed with."""

from __future__ import annotations

import logging

import numpy as np

from materialist.edits.core.topology import edge_faults, places, volume
from materialist.errors import SetupError
from materialist.types import Array

SAME = 1.05
"""Volume of the hull over that of the shape up to which the hull alone stands for it."""
CONCAVE = 0.12
"""Concavity that is left in a piece (CoACD's threshold)."""
PIECES = 16
COARSE = 24
"""Cells along the longest side to which a fine mesh is thinned out before it is taken apart."""
FINE = 1500
"""Triangles from which a mesh counts as fine."""


def hull(points: Array) -> Array:
    """[n, 3] corners of the convex hull of points [m, 3], m >= 4; flat ones are given a thickness."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        size = max(float(np.ptp(points, axis=0).max()), 1e-9)
        shifts = np.eye(3) * 0.01 * size
        thick = np.concatenate([points, *(points + shift for shift in shifts)])
        return thick[ConvexHull(thick).vertices]


def convex_pieces(vertices: Array, faces: Array, *, seed: int = 0) -> list[Array]:
    """Corners [n, 3] of convex pieces that together make up a mesh: one hull where that is nearly all of it.

    Raises SetupError where coacd is not installed and the mesh is not nearly convex.
    """
    from scipy.spatial import ConvexHull

    vertices = np.asarray(vertices, np.float64)
    outer = hull(vertices)
    open_edges, _ = edge_faults(vertices, faces)
    if not open_edges and ConvexHull(outer).volume <= SAME * abs(volume(vertices, faces)):
        return [outer]
    try:
        import coacd
    except ImportError as error:
        raise SetupError(
            "Falling objects need two more packages; install them with: pip install 'materialist[physics]'"
        ) from error
    logging.getLogger("coacd").setLevel(logging.ERROR)
    coacd.set_log_level("error")
    v, f = thinned(vertices, faces) if len(faces) > FINE else _welded(vertices, faces)
    parts = coacd.run_coacd(
        coacd.Mesh(v, f), threshold=CONCAVE, max_convex_hull=PIECES, preprocess_resolution=30, resolution=400,
        mcts_nodes=8, mcts_iterations=20, mcts_max_depth=2, seed=seed,
    )  # fmt: skip
    return [hull(np.asarray(points, np.float64)) for points, _ in parts if len(points) >= 4] or [outer]


def thinned(vertices: Array, faces: Array) -> tuple[Array, Array]:
    """Vertices [V', 3] and faces [F', 3] int32 of a mesh [V, 3], [F, 3], coarser.

    The vertices of each cell of a grid of `COARSE` are put together at their mean.
    """
    extent = max(float(np.ptp(vertices, axis=0).max()), 1e-30)
    cell = np.floor((vertices - vertices.min(0)) / extent * COARSE).astype(np.int64)
    return _merged(vertices, faces, np.unique(cell, axis=0, return_inverse=True)[1].reshape(-1))


def _welded(vertices: Array, faces: Array) -> tuple[Array, Array]:
    return _merged(vertices, faces, places(vertices))


def _merged(vertices: Array, faces: Array, group: Array) -> tuple[Array, Array]:
    """Vertices of one group [V] at their mean, without the triangles that vanish or repeat."""
    count = np.bincount(group)
    mean = np.stack([np.bincount(group, vertices[:, k]) for k in range(3)], -1) / count[:, None]
    new = group[faces]
    new = new[(new[:, 0] != new[:, 1]) & (new[:, 1] != new[:, 2]) & (new[:, 2] != new[:, 0])]
    _, first = np.unique(np.sort(new, axis=1), axis=0, return_index=True)
    return mean, new[np.sort(first)].astype(np.int32)
