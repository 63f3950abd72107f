"""Extents of walls: read from provenance, and kept to by the mesh."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest
from geometry_scenes import room, trace

from materialist.errors import InputError
from materialist.geometry.build import build_geometry
from materialist.geometry.completion import continued_walls
from materialist.geometry.extents import PlaneExtent, read_extents
from materialist.geometry.planes import find_planes
from materialist.types import Camera

CAMERA = Camera(64, 48, 60.0)
NONE = np.zeros((48, 64), bool)


def wall_at(mesh, x: float, y: float) -> bool:
    """Whether a ray along -z from (x, y, -3) meets the wall at z = -6."""
    distance, face = trace(mesh, np.array([x, y, -3.0]), np.array([[0.0, 0, -1]]))
    return bool(face[0] >= 0 and distance[0] == pytest.approx(3, abs=0.05))


def test_a_wall_ends_where_it_is_told():
    depth, normal, _ = room(CAMERA)
    (wall,) = continued_walls(find_planes(depth, normal, CAMERA), depth, CAMERA)
    np.testing.assert_allclose(wall.usual.normal, (0, 0, 1), atol=0.02)
    half = 6 * CAMERA.width / (2 * CAMERA.focal)
    assert wall.seen.left == pytest.approx(-half, rel=0.03) and wall.seen.right == pytest.approx(half, rel=0.03)
    for right, up in ((half + 1, wall.seen.up), (half + 1, wall.seen.up + 2), (half + 3, wall.seen.up + 2)):
        ends = replace(wall.usual, left=-half - 0.5, right=right, up=up)
        mesh = build_geometry(depth, normal, CAMERA, extents=[ends]).mesh
        for x, y in ((half + 0.8, 0), (half + 2, 1), (half + 3.5, 0), (-half - 0.3, 0), (-half - 0.8, 0), (0, up + 0.2),
                     (0, up - 0.2)):  # fmt: skip
            inside = -half - 0.5 < x < right and y < up
            assert wall_at(mesh, x, y) == inside, (right, up, x, y)


def test_provenance_holds_ends():
    ends = PlaneExtent((0.0, 0.0, 1.0), -3.0, -1.0, 1.5, -1.0, 2.0)
    assert read_extents(json.loads(json.dumps({"ends": [asdict(ends)]}))) == (ends,)
    assert read_extents({}) == read_extents({"ends": None}) == ()
    for broken in (3, [{"normal": [0, 0, 1]}], [{**asdict(ends), "normal": [1]}], [{**asdict(ends), "up": "high"}]):
        with pytest.raises(InputError, match="ends of its walls"):
            read_extents({"ends": broken})
