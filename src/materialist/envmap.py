"""The texels of an equirectangular environment map, in the project's convention (docs/conventions.md)."""

from __future__ import annotations

import numpy as np

from materialist.types import Array


def row_solid_angle(height: int) -> Array:
    """[h] solid angle of one texel of each row of an equirectangular [h, 2h] map, steradians."""
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    return (edges[:-1] - edges[1:]) * np.pi / height


def texel_directions(height: int, width: int) -> Array:
    """[h, w, 3] unit directions of texel centres, camera frame."""
    theta = np.pi * (np.arange(height) + 0.5)[:, None] / height
    phi = 2 * np.pi * ((np.arange(width) + 0.5)[None, :] / width - 0.5)
    return np.stack(
        np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)), -1
    ).astype(np.float32)
