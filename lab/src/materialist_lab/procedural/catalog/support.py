"""Level places on a model where things can stand: table tops, shelves, seats of benches."""

from typing import NamedTuple

import numpy as np

from materialist.types import Array
from materialist_lab.procedural.objects.shapes import Solid, face_normals

LEVEL = 0.995
"""Smallest y of the unit normal of a level face."""
MIN_SIDE = 0.1
"""Metres; smaller places are left out."""
FILLED = 0.72
"""Smallest share of a rectangle that level faces must cover."""
STEP = 0.012
"""Metres of height that faces of one place may differ by."""
MARGIN = 0.005
"""Metres from its edge and above it that other parts may reach into a place."""


class LevelPlace(NamedTuple):
    """A rectangle in the frame of a model, metres."""

    height: float
    left: float
    right: float
    back: float
    front: float
    clearance: float
    """To what is above it; large where nothing is."""


def level_places(solids: list[Solid]) -> list[LevelPlace]:
    """The level places of a model, lowest first."""
    centres, areas, corners = _level_faces(solids)
    if not len(centres):
        return []
    # --- Faces of about one height are one group: sorted, a group ends at a step ---
    order = np.argsort(centres)
    centres = centres[order]
    areas = areas[order]
    corners = corners[order]
    groups = np.split(np.arange(len(centres)), np.flatnonzero(np.diff(centres) > STEP) + 1)
    # --- The rectangle of each group, and what is above it ---
    everything = np.concatenate([solid.vertices[solid.faces] for solid in solids])
    low = everything.min(1)
    high = everything.max(1)
    places = [_place(corners[g], areas[g]) for g in groups]
    return [_with_clearance(place, low, high) for place in places if place is not None]


def _level_faces(solids: list[Solid]) -> tuple[Array, Array, Array]:
    """(height [F], area [F], corners [F, 3, 3]) of the faces that look straight up by their shading normals."""
    kept = []
    for solid in solids:
        # By the geometry level, and by the shading normals the upper side.
        flat = face_normals(solid.vertices, solid.faces)
        length = np.linalg.norm(flat, axis=-1)
        upward = np.abs(flat[:, 1]) > LEVEL * np.maximum(length, 1e-12)
        upward &= solid.normals[solid.faces][..., 1].mean(1) > 0.3
        kept.append((solid.vertices[solid.faces[upward]], length[upward] / 2))
    corners = np.concatenate([c for c, _ in kept]) if kept else np.zeros((0, 3, 3))
    areas = np.concatenate([a for _, a in kept]) if kept else np.zeros(0)
    return corners[..., 1].mean(1), areas, corners


def _place(corners: Array, areas: Array) -> LevelPlace | None:
    """The rectangle around faces of one height, where they fill it."""
    if areas.sum() < MIN_SIDE**2:
        return None
    # A few far faces must not stretch it: the outermost hundredth of the area is left out.
    middle = corners.mean(1)
    low = corners[..., [0, 2]].min((0, 1))
    high = corners[..., [0, 2]].max((0, 1))
    if areas.sum() / max(np.prod(high - low), 1e-9) < FILLED or (high - low).min() < MIN_SIDE:
        return None
    height = float(np.average(middle[:, 1], weights=areas))
    return LevelPlace(height, float(low[0]), float(high[0]), float(low[1]), float(high[1]), 10.0)


def _with_clearance(place: LevelPlace, low: Array, high: Array) -> LevelPlace:
    """The place with the room above it, below faces whose boxes reach from low [F, 3] to high [F, 3]."""
    inside = (high[:, 0] > place.left + MARGIN) & (low[:, 0] < place.right - MARGIN)
    inside &= (high[:, 2] > place.back + MARGIN) & (low[:, 2] < place.front - MARGIN)
    above = low[inside & (high[:, 1] > place.height + MARGIN), 1]
    return place._replace(clearance=float(above.min() - place.height) if len(above) else 10.0)
