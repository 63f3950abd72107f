"""Wavefront files as people write them: polygons that bulge inwards, numbers from the end, several libraries."""

import numpy as np
import pytest

from materialist.edits.insert.mesh_folder import MeshFolder
from materialist.edits.insert.mesh_obj import prepared
from materialist.edits.insert.meshes import read_model

CORNER = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv .2 .2 0\nv .2 1 0\nv 0 1 0\n"
NOTCH = "v 0 0 0\nv 3 0 0\nv 3 3 0\nv 1.5 1 0\nv 0 3 0\n"
ARROW = "v 0 0 0\nv 4 0 0\nv 1 1 0\nv 0 4 0\n"


def areas(path):
    """The signed areas, along Z, of the triangles of a file."""
    (body,) = read_model(path).parts
    a, b, c = (body.vertices[body.faces[:, k]] for k in range(3))
    return np.cross(b - a, c - a)[:, 2] / 2


def shoelace(points):
    x, y = np.array(points).T
    return 0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum()


@pytest.mark.parametrize("points, first", [(CORNER, 2), (CORNER, 6), (NOTCH, 1), (ARROW, 2), (ARROW, 3)])
@pytest.mark.parametrize("turn", [1, -1])
def test_a_polygon_that_bulges_inwards_is_filled_once(tmp_path, points, first, turn):
    count = points.count("v")
    order = [(first - 1 + turn * k) % count + 1 for k in range(count)]
    (tmp_path / "a.obj").write_text(points + "f " + " ".join(map(str, order)) + "\n")
    corners = [[float(x) for x in line.split()[1:3]] for line in points.splitlines()]
    found = areas(tmp_path / "a.obj")
    assert len(found) == count - 2 and (np.sign(found) == turn).all()
    np.testing.assert_allclose(found.sum(), turn * shoelace(corners), rtol=1e-5)


def test_its_corners_keep_their_textures_and_normals(tmp_path):
    coordinates = "".join(f"vt {k / 10} 0\n" for k in range(6))
    text = CORNER + coordinates + "vn 0 0 1\nf " + " ".join(f"{k}/{k}/1" for k in (2, 3, 4, 5, 6, 1)) + "\n"
    (tmp_path / "a.obj").write_text(text)
    (body,) = read_model(tmp_path / "a.obj").parts
    for vertex, uv in zip(body.vertices, body.uv):
        k = next(
            k for k, line in enumerate(CORNER.splitlines()) if np.allclose(vertex, list(map(float, line.split()[1:])))
        )
        np.testing.assert_allclose(uv[0], k / 10, atol=1e-6)


def test_what_a_fan_fills_stays_as_it_is(tmp_path):
    text = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nf 1/1 2/1 3/1\n"
    assert prepared(text, MeshFolder(tmp_path)) == text


def test_numbers_count_back_from_their_line(tmp_path):
    """trimesh counts them from the end of the file."""
    (tmp_path / "a.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 0 0 5\nv 2 0 5\nv 0 2 5\nf -3// -2// -1//\n"
    )
    np.testing.assert_allclose(sorted(areas(tmp_path / "a.obj")), [0.5, 2])


@pytest.mark.parametrize("lines", ["mtllib red.mtl blue.mtl", "mtllib red.mtl\nmtllib blue.mtl", "mtllib my blue.mtl"])
def test_several_libraries(tmp_path, lines):
    (tmp_path / "red.mtl").write_text("newmtl red\nKd 1 0 0\n")
    for name in ("blue.mtl", "my blue.mtl"):
        (tmp_path / name).write_text("newmtl blue\nKd 0 0 1")
    (tmp_path / "a.obj").write_text(f"{lines}\n{NOTCH}usemtl blue\nf 1 2 3\n")
    model = read_model(tmp_path / "a.obj")
    assert model.parts[0].surface.albedo.tolist() == [[[0, 0, 1]]] and not model.warnings


def test_a_library_of_several_that_is_missing_is_told(tmp_path):
    (tmp_path / "red.mtl").write_text("newmtl red\nKd 1 0 0\n")
    (tmp_path / "a.obj").write_text(f"mtllib none.mtl red.mtl\n{NOTCH}usemtl red\nf 1 2 3\n")
    model = read_model(tmp_path / "a.obj")
    assert model.parts[0].surface.albedo.tolist() == [[[1, 0, 0]]] and "none.mtl" in model.warnings[0]


def test_what_cannot_be_read_comes_back_as_it_is(tmp_path):
    for text in (b"v 0 0 x\nf 1 2 3 4\n", b"v 0 0 0\nf 1 2 3 9\n", b"v 0 0 0\nf 0 0 0 0\n"):
        assert prepared(text, MeshFolder(tmp_path)) == text
