"""Figures of meshes that several tests need."""

import numpy as np


def volume(solid) -> float:
    """Volume inside a closed mesh whose faces look outwards."""
    a, b, c = (solid.vertices[solid.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)
