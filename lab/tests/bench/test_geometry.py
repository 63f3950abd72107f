"""`bench geometry`: angles, pieces, and which files are photographs."""

import numpy as np
import pytest

from materialist.camera import pixel_rays, unit
from materialist.geometry.build import build_geometry
from materialist.types import Camera
from materialist_lab.bench.geometry import (
    agreement,
    connection,
    photo_files,
    pieces,
    surface_normals,
)

CAMERA = Camera(40, 30, 50.0)


def _built(depth, normal):
    normals = np.broadcast_to(np.asarray(normal, np.float32), (30, 40, 3))
    return build_geometry(depth, normals, CAMERA, completion="none").mesh


def test_the_angle_is_that_between_the_plane_and_the_normals():
    normal = unit(np.array([0.0, 1, 0.7]))
    depth = -2.0 / (pixel_rays(CAMERA) @ normal)
    surface = depth > 0
    found = surface_normals(_built(depth, normal), surface)
    turned = np.broadcast_to(unit(np.array([0.2, 1, 0.7])), found.shape)
    expected = np.degrees(np.arccos(turned[0, 0] @ normal))
    figures = agreement(found, turned, surface)
    assert figures["angle"] == pytest.approx(expected, abs=0.05)
    assert figures["level"] == pytest.approx(expected, abs=0.05)


def test_a_thing_before_a_wall_is_a_piece_and_sky_is_none():
    depth = np.full((30, 40), 5.0)
    depth[10:20, 10:25] = 2.0
    depth[:4] = 0
    piece = pieces(_built(depth, (0, 0, 1)), depth > 0)
    assert (piece[:4] == -1).all()
    assert piece[15, 15] != piece[25, 30]
    figures = connection(piece)
    assert figures == {"pieces": 2, "rest": 0.0}


def test_photos_are_found_in_folders_and_masks_are_left_out(tmp_path):
    for name in ("a.jpg", "b/c.PNG", "b/c_mask.png", "b/note.txt"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    assert [path.name for path in photo_files(tmp_path)] == ["a.jpg", "c.PNG"]


@pytest.mark.slow
def test_the_command_measures_photos(measured, real_data):
    rows = measured("geometry", data=real_data("data"), size=64, limit=2, device="cpu").rows
    assert len(rows) == 2
    assert all(0 < row["angle"] < 90 and row["pieces"] >= 1 for row in rows)
