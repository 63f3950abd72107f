"""OBJ files as solids of true size."""

import zipfile

import numpy as np
import pytest
from made_catalog import grain, make_archive

from materialist.errors import InputError
from materialist_lab.procedural.catalog.archive import entries
from materialist_lab.procedural.catalog.creases import creased
from materialist_lab.procedural.catalog.reading import ReadingSettings, read_catalog_model
from materialist_lab.procedural.catalog.support import level_places
from materialist_lab.procedural.objects import shapes as s


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    path = make_archive(tmp_path_factory.mktemp("catalog") / "made.sh3f")
    named = {entry.key: entry for entry in entries(path)}

    def model(number):
        with zipfile.ZipFile(path) as file:
            return read_catalog_model(file, named[f"made-{number:03d}"])

    return model


def test_a_model_has_the_size_of_its_entry_and_stands_at_the_origin(read):
    points = np.concatenate([solid.vertices for solid in read(1).solids])
    np.testing.assert_allclose(points.min(0), [-0.6, 0, -0.3], atol=1e-9)
    np.testing.assert_allclose(points.max(0), [0.6, 0.75, 0.3], atol=1e-9)


def test_materials_come_by_name_and_number(read):
    looks = {look.family: look for look in read(1).looks}
    assert set(looks) == {"wood", "metal"}
    assert looks["wood"].picture and not looks["metal"].picture
    assert looks["metal"].shine < looks["wood"].shine
    np.testing.assert_array_equal(read(1).pictures[looks["wood"].picture], grain())


def test_plain_surfaces_get_texture_coordinates_in_metres(read):
    parts = read(1)
    legs = parts.solids[[look.family for look in parts.looks].index("metal")]
    a, b = (legs.vertices[legs.faces[:, k]] for k in (0, 1))
    across = np.linalg.norm(legs.uv[legs.faces[:, 0]] - legs.uv[legs.faces[:, 1]], axis=-1)
    np.testing.assert_allclose(across, np.linalg.norm(a - b, axis=-1), rtol=1e-6)


@pytest.mark.parametrize(("number", "reason"), [(7, "glass"), (8, "holes")])
def test_what_cannot_be_shown_is_refused(read, number, reason):
    with pytest.raises(InputError, match=reason):
        read(number)


def test_a_rotation_turns_the_file_into_the_frame_of_the_catalogue(read):
    """Rows (1 0 0), (0 0 -1), (0 1 0): what points up in the file points to the front."""
    parts = read(9)
    top = parts.solids[[look.family for look in parts.looks].index("wood")]
    assert top.vertices[:, 2].min() > 0.1
    points = np.concatenate([solid.vertices for solid in parts.solids])
    np.testing.assert_allclose(np.ptp(points, axis=0), [0.3, 0.2, 0.4], atol=1e-9)


def test_things_can_stand_on_a_table_and_not_under_it(read):
    places = level_places(read(1).solids)
    free = [place for place in places if place.clearance > 0.1]
    assert len(free) == 1
    height, left, right, back, front, clearance = free[0]
    assert height == pytest.approx(0.75) and clearance > 5
    assert (left, right, back, front) == pytest.approx((-0.6, 0.6, -0.3, 0.3))


def test_a_shelf_has_the_clearance_below_the_next_one():
    boards = [s.moved(s.slab((1.0, 0.02, 0.3)), (0, y, 0)) for y in (0.1, 0.5)]
    low, high = level_places(boards)
    assert low.height == pytest.approx(0.12) and low.clearance == pytest.approx(0.38, abs=0.02)
    assert high.height == pytest.approx(0.52) and high.clearance > 5


def test_edges_stay_sharp_and_round_bodies_smooth():
    box = s.box(np.ones(3))
    _, faces, normals = creased(box.vertices, box.faces, 0.7)
    flat = s.face_normals(box.vertices, box.faces)
    flat /= np.linalg.norm(flat, axis=-1, keepdims=True)
    np.testing.assert_allclose(np.abs((normals[faces] * flat[:, None]).sum(-1)), 1, atol=1e-6)
    ball = s.ball(32)
    source, _, normals = creased(ball.vertices, ball.faces, 0.7)
    assert np.abs((normals * ball.vertices[source]).sum(-1)).min() > 0.99


def test_what_is_too_fine_is_left_out(tmp_path):
    path = make_archive(tmp_path / "made.sh3f")
    with zipfile.ZipFile(path) as file, pytest.raises(InputError, match="too many faces"):
        read_catalog_model(file, entries(path)[0], ReadingSettings(faces=10))
