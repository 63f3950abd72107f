"""A body of revolution as an open vessel: a wall around air, and no lid."""

from __future__ import annotations

import numpy as np

from materialist.solids.profile import Profile
from materialist.types import Array

Line = tuple[Array, Array]
"""Places [K, 2] (distance from the axis, height) and their unit outward normals [K, 2]."""
SIDE = 0.5
"""Least outward part of the normals of a side; above the last of it is the lid."""
UNDER = 3.5
"""How far below the rim the lid is still felt by what lies a wall deep, in walls."""
LIP = 12
"""Points of the rounded rim."""


def vessel(profile: Profile, wall: float) -> Line | None:
    """The line around the wall of an open vessel: up its outside, over a round rim, down its inside.

    Args:
        wall: its thickness, scene units.

    Returns:
        The line, glass to its left, from the axis to the axis; None where the profile is no single body around its
        axis, or has no room inside.
    """
    outer, inner = _around(profile.lines()), _around(profile.lines(wall))
    if outer is None or inner is None:
        return None
    place, lean = outer
    top = _last_side(outer)
    rim = None if top is None else _last_side(outer, place[top, 1] - wall / 2)  # the round lip ends where the side did
    within = None if rim is None else _last_side(inner, place[rim, 1] - UNDER * wall)
    if rim is None or within is None:
        return None
    # Next to the lid the inside is as far from the outside as the wall is thick.
    near = np.flatnonzero((place[: rim + 1, 1] > inner[0][within, 1]) & (lean[: rim + 1, 0] > SIDE))[::-1]
    upper = place[near] - wall * lean[near]
    if not len(near) or upper[:, 0].min() <= 0 or inner[0][within, 0] >= place[: rim + 1, 0].max():
        return None
    inside = np.concatenate([upper, inner[0][: within + 1][::-1]])
    facing = -np.concatenate([lean[near], inner[1][: within + 1][::-1]])
    r, height = upper[0, 0], place[rim, 1]
    half, middle = (place[rim, 0] - r) / 2, (place[rim, 0] + r) / 2
    angle = np.pi * np.arange(1, LIP) / LIP
    round_ = np.stack([np.cos(angle), np.sin(angle)], -1)
    lip = np.array([middle, height]) + half * round_
    return np.concatenate([place[: rim + 1], lip, inside]), np.concatenate([lean[: rim + 1], round_, facing])


def _around(lines: list[Line]) -> Line | None:
    """The only line, from the axis below to the axis above; None if there are others, or it is a ring."""
    if len(lines) != 1 or max(lines[0][0][0, 0], lines[0][0][-1, 0]) > 1e-6:
        return None
    place, lean = lines[0]
    return (place, lean) if place[0, 1] < place[-1, 1] else None


def _last_side(line: Line, below: float = np.inf) -> int | None:
    """The last point of a line, up to a height, that is on a side."""
    place, lean = line
    sides = np.flatnonzero((lean[:, 0] > SIDE) & (place[:, 1] <= below))
    return int(sides[-1]) if len(sides) else None
