"""Open vessels: one closed surface around the wall, of the volume of that wall, without a lid."""

from itertools import pairwise

import numpy as np
import pytest
from test_revolution import AXIS, CAMERA, FOOT, UP, ground, profile_from, standing, volume  # noqa: F401 (a fixture)

from materialist.bench.glass_scenes import is_closed
from materialist.solids.revolution import Meridian, swept
from materialist.solids.vessel import vessel

POT = [[0.0, 0.0], [0.3, 0.0], [0.3, 0.7], [0.0, 0.7]]


@pytest.fixture
def pot(ground):  # noqa: F811
    """The profile of a cylinder as seen from above, standing on FOOT."""
    fine = np.concatenate([np.linspace(a, b, 40, endpoint=False) for a, b in pairwise(POT)] + [[POT[-1]]])
    return profile_from(standing(fine), ground)[0]


def test_a_cylinder_becomes_a_pot(pot):
    profile, wall = pot, 0.05
    shell = swept(profile, AXIS, CAMERA, wall=wall, open_top=True)
    assert is_closed(shell)
    solid, hollow = swept(profile, AXIS, CAMERA), swept(profile, AXIS, CAMERA, wall=wall)
    high = Meridian(AXIS).of(solid.vertices.astype(float))[:, 1].max() - profile.floor
    glass = np.pi * (0.3**2 - 0.25**2) * (high - wall) + np.pi * 0.3**2 * wall
    assert volume(shell) == pytest.approx(glass, rel=0.15)  # the inner corner is round, and full of glass
    assert volume(shell) < volume(hollow) - 0.5 * np.pi * 0.25**2 * wall  # the lid is gone
    # Along the axis, from above, nothing is met before the bottom.
    place = Meridian(AXIS).of(shell.vertices.astype(float))
    middle = place[:, 0] < 0.1
    assert place[middle, 1].max() < profile.floor + 1.5 * wall
    # The inside looks at the axis, the outside away from it.
    away = shell.vertices - FOOT
    out = away - (away @ UP)[:, None] * UP
    facing = (out * shell.normals).sum(-1) / np.maximum(place[:, 0], 1e-6)
    side = (place[:, 1] > 0.2) & (place[:, 1] < 0.5)
    assert (facing[side & (place[:, 0] > 0.28)] > 0.9).all() and (facing[side & (place[:, 0] < 0.27)] < -0.9).all()
    assert (side & (place[:, 0] < 0.27)).any()


def test_what_has_no_room_inside_or_is_a_ring_is_no_vessel(pot):
    from test_revolution import RING

    assert vessel(pot, 0.4) is None
    assert vessel(profile_from(standing(RING))[0], 0.03) is None
    assert vessel(pot, 0.05) is not None
