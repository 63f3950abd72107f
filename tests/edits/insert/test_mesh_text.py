"""OBJ, PLY and STL: each thing that a file may say, against a value known by hand."""

import struct

import numpy as np
import pytest
from mesh_measures import area, colours, size
from PIL import Image

from materialist.color import srgb_to_linear
from materialist.edits.insert import meshes
from materialist.edits.insert.formats.limits import MeshLimits
from materialist.edits.insert.meshes import read_model
from materialist.errors import InputError

BOX = [(x, y, z) for x in (0, 1) for y in (0, 2) for z in (0, 3)]
SIDES = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
BOX_LINES = [*("v {} {} {}".format(*v) for v in BOX), *("f {} {} {} {}".format(*f) for f in SIDES)]
U_SHAPE = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]
DART = [(0, 0), (4, 0), (1, 1), (0, 4)]
STAR = [(np.cos(a) * r, np.sin(a) * r) for a, r in zip(np.arange(10) * np.pi / 5, [2, 1] * 5)]
SRGB = srgb_to_linear(np.array([200, 100, 50], np.float32) / 255)


def write(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def shoelace(outline):
    x, y = np.array(outline, float).T
    return abs((x * np.roll(y, -1) - y * np.roll(x, -1)).sum()) / 2


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("plane", range(3))
@pytest.mark.parametrize("outline", [U_SHAPE, DART, DART[1:] + DART[:1], STAR, STAR[1:] + STAR[:1]])
@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_polygons_of_any_shape_keep_their_area_and_side(tmp_path, suffix, outline, plane, turned):
    outline = outline[::-1] if turned else outline
    points = np.roll([(x, y, 0) for x, y in outline], plane, axis=1)
    numbers = range(len(points))
    if suffix == "obj":
        lines = ["v {} {} {}".format(*p) for p in points] + [
            "f " + " ".join(str(k + 1) for k in numbers)
        ]
    else:
        header = ply_header("ascii", len(points), ("float x", "float y", "float z"), 1)
        rows = [" ".join(map(str, p)) for p in points]
        lines = [header + "\n".join(rows), f"{len(points)} " + " ".join(map(str, numbers))]
    model = read_model(write(tmp_path / f"a.{suffix}", "\n".join(lines)))
    assert area(model) == pytest.approx(shoelace(outline), rel=1e-5)
    facing = np.roll([0, 0, -1 if turned else 1], plane)
    (body,) = model.parts
    np.testing.assert_allclose(body.normals @ facing, 1, atol=1e-5)


@pytest.mark.parametrize(
    ("kd", "albedo", "is_told"),
    [("0.7", 0.7, False), ("xyz 0.2 0.2 0.2", 0.5, True), ("spectral a.rfl", 0.5, True)],
)
def test_colours_of_a_material_that_are_no_rgb(tmp_path, kd, albedo, is_told):
    write(tmp_path / "a.mtl", f"newmtl a\nKd {kd}\n")
    model = read_model(
        write(tmp_path / "a.obj", "\n".join(["mtllib a.mtl", "usemtl a", *BOX_LINES]))
    )
    assert colours(model) == [[pytest.approx(albedo)] * 3]
    assert any(f"Kd '{kd}'" in note for note in model.warnings) == is_told


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_lines_of_any_kind(tmp_path, end, mark):
    lines = [
        *BOX_LINES[:8],
        "# v 9 9 9",
        "",
        "f 1 2 \\",
        "4 3  # a side",
        "  " + BOX_LINES[9],
        *BOX_LINES[10:],
    ]
    assert size(read_model(write(tmp_path / "a.obj", mark + end.join(lines)))) == [1, 2, 3]


def test_lines_across_blocks(tmp_path, monkeypatch):
    monkeypatch.setattr("materialist.edits.insert.formats.text.BLOCK", 7)
    for k, end in enumerate(("\n", "\r\n", " \\\r\n\r\n")):
        path = write(tmp_path / f"{k}.obj", end.join(BOX_LINES))
        assert size(read_model(path)) == [1, 2, 3]
        assert read_model(path).closed


def test_numbers_that_count_backwards_do_so_from_their_line(tmp_path):
    triangle = "v {0} 0 0\nv {1} 0 0\nv {0} 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf -3/-3 -2/-2 -1/-1\n"
    model = read_model(write(tmp_path / "a.obj", triangle.format(0, 1) + triangle.format(5, 6)))
    assert area(model) == pytest.approx(1) and size(model) == [6, 1, 0]


@pytest.mark.parametrize(
    "corners",
    ["1 2 3", "1/1 2/2 3/3", "1//1 2//1 3//1", "1/1/1 2/2/1 3/3/1", "1/ 2/ 3/", "1 2/2 3/3/1"],
)
def test_corners_of_every_spelling(tmp_path, corners):
    lines = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt .25 .5\nvt 1 0\nvt 0 1\nvn 0 0 2\n"
    (body,) = read_model(write(tmp_path / "a.obj", f"{lines}f {corners}\n")).parts
    np.testing.assert_allclose(body.normals, [[0, 0, 1]] * 3)
    has_uv = "1/1" in corners
    np.testing.assert_allclose(np.sort(body.uv[:, 0]), [0, 0.25, 1] if has_uv else [0, 0, 0])


@pytest.mark.parametrize(
    "colour",
    ["200 100 50", "0.784313 0.392156 0.196078", "200 100 50 255", "0.784313 0.392156 0.196078 1"],
)
def test_colours_behind_vertices(tmp_path, colour):
    lines = [f"v {x} {y} 0 {colour}" for x, y in ((0, 0), (1, 0), (0, 1))]
    (seen,) = colours(read_model(write(tmp_path / "a.obj", "\n".join([*lines, "f 1 2 3"]))))
    np.testing.assert_allclose(seen, SRGB, atol=1e-3)


def test_a_fourth_coordinate_is_no_colour(tmp_path):
    lines = ["v 0 0 0 1", "v 1 0 0 1", "v 0 1 0 1", "f 1 2 3"]
    assert colours(read_model(write(tmp_path / "a.obj", "\n".join(lines)))) == [[0.5, 0.5, 0.5]]


def test_several_libraries_and_names_with_spaces(tmp_path):
    write(tmp_path / "a.mtl", "newmtl red paint\nKd 0.8 0.1 0.1\n")
    write(tmp_path / "b c.mtl", "newmtl blue\nKd 0.1 0.1 0.8\n")
    for k, lines in enumerate(
        (["mtllib a.mtl b.mtl", "mtllib b c.mtl"], ["mtllib b c.mtl", "mtllib a.mtl"])
    ):
        faces = ["usemtl red paint", "f 1 2 4", "usemtl blue", "f 5 7 8", "usemtl", "f 1 5 6"]
        path = write(tmp_path / f"{k}.obj", "\n".join([*lines, *BOX_LINES[:8], *faces]))
        model = read_model(path)
        np.testing.assert_allclose(
            colours(model), [[0.1, 0.1, 0.8], [0.5, 0.5, 0.5], [0.8, 0.1, 0.1]], atol=1e-3
        )
        assert any("b.mtl is missing" in note for note in model.warnings) is (k == 0)


def test_options_of_a_map(tmp_path):
    pixels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    Image.fromarray(pixels).save(tmp_path / "a b.png")
    lines = [
        "mtllib a.mtl",
        "v 0 0 0",
        "v 1 0 0",
        "v 0 1 0",
        "vt {} {}",
        "usemtl a",
        "f 1/1 2/1 3/1",
    ]
    for options, place, colour in (
        ("", (0.25, 0.25), [0, 0, 1]),
        ("-s 3 1 1", (0.25, 0.25), [1, 1, 1]),
        ("-o 0.5 0.5 0 -blendu on", (0.25, 0.25), [0, 1, 0]),
        ("-clamp on -s 1 1 1", (7.25, 0.25), [1, 1, 1]),
        ("-bm 0.5 -mm 0 1", (7.25, 0.75), [1, 0, 0]),
    ):
        write(tmp_path / "a.mtl", f"newmtl a\nmap_Kd {options} a b.png\n")
        model = read_model(write(tmp_path / "a.obj", "\n".join(lines).format(*place)))
        assert colours(model) == [colour], options
        assert not model.warnings


def ply_header(form, vertices, properties, faces, lists=("uchar int vertex_indices",)):
    lines = ["ply", f"format {form} 1.0", f"element vertex {vertices}"]
    lines += [f"property {one}" for one in properties]
    lines += [f"element face {faces}", *(f"property list {one}" for one in lists), "end_header", ""]
    return "\n".join(lines)


XYZ = ("float x", "float y", "float z")


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("mixed", [False, True])
@pytest.mark.parametrize(
    ("count", "index"), [("uchar", "int"), ("int", "uint"), ("ushort", "ushort"), ("char", "uchar")]
)
def test_binary_plys_of_every_type(tmp_path, order, mixed, count, index):
    form = f"binary_{'little' if order == '<' else 'big'}_endian"
    letters = {"uchar": "B", "char": "b", "ushort": "H", "int": "i", "uint": "I"}
    polygons = [[k - 1 for k in side] for side in SIDES]
    if mixed:
        a, b, c, d = polygons.pop()
        polygons = [[a, b, c], *polygons, [a, c, d]]
    data = b"".join(struct.pack(f"{order}3d", *v) for v in BOX)
    for polygon in polygons:
        data += struct.pack(
            f"{order}{letters[count]}{len(polygon)}{letters[index]}", len(polygon), *polygon
        )
    columns = ("double x", "double y", "double z")
    header = ply_header(form, 8, columns, len(polygons), (f"{count} {index} vertex_index",))
    model = read_model(write(tmp_path / "a.ply", header.encode() + data))
    assert size(model) == [1, 2, 3] and model.closed and area(model) == pytest.approx(22)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
@pytest.mark.parametrize("prefix", ["", "diffuse_"])
@pytest.mark.parametrize(("kind", "top"), [("uchar", 255), ("ushort", 65535), ("float", 1)])
def test_colours_of_ply(tmp_path, form, prefix, kind, top):
    values = [
        share * top if kind == "float" else round(share * top)
        for share in (200 / 255, 100 / 255, 50 / 255)
    ]
    names = tuple(f"{kind} {prefix}{name}" for name in ("red", "green", "blue"))
    corners = ((0, 0, 0), (1, 0, 0), (0, 1, 0))
    header = ply_header(form, 3, XYZ + names, 1)
    if form == "ascii":
        body = "".join(" ".join(map(str, (*c, *values))) + "\n" for c in corners) + "3 0 1 2\n"
        content = header + body
    else:
        letter = {"uchar": "B", "ushort": "H", "float": "f"}[kind]
        rows = b"".join(struct.pack(f"<3f3{letter}", *c, *values) for c in corners)
        content = header.encode() + rows + struct.pack("<B3i", 3, 0, 1, 2)
    (seen,) = colours(read_model(write(tmp_path / "a.ply", content)))
    np.testing.assert_allclose(seen, SRGB, atol=2e-3)


def test_colours_of_faces_and_coordinates_of_corners(tmp_path):
    head = "ply\nformat ascii 1.0\n{}element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    corners = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
    faces = "element face 2\nproperty list uchar int vertex_indices\n"
    coloured = faces + "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
    path = write(
        tmp_path / "a.ply",
        head.format("") + coloured + corners + "3 0 1 2 255 0 0\n3 0 2 3 0 255 0\n",
    )
    assert colours(read_model(path)) == [[0, 1, 0], [1, 0, 0]]
    pixels = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]], np.uint8)
    Image.fromarray(pixels).save(tmp_path / "a b.png")
    laid = faces + "property list uchar float texcoord\nend_header\n"
    rows = "3 0 1 2 6 .1 .1 .4 .1 .1 .4\n3 0 2 3 6 .9 .9 .6 .9 .9 .6\n"
    path = write(
        tmp_path / "b.ply", head.format("comment TextureFile a b.png\n") + laid + corners + rows
    )
    assert colours(read_model(path)) == [[0, 0, 1], [0, 1, 0]]


def test_strips_of_ply(tmp_path):
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    strips = "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    rows = "0 0 0\n1 0 0\n0 1 0\n1 1 0\n8 0 1 2 3 -1 0 1 2\n"
    assert area(read_model(write(tmp_path / "a.ply", head + strips + rows))) == pytest.approx(1.5)


def stl(facets, *, head=b"", count=None, colour=0):
    data = b"".join(struct.pack("<12fH", 0, 0, 0, *np.ravel(f), colour) for f in facets)
    return head.ljust(80, b"\0") + struct.pack("<I", len(facets) if count is None else count) + data


FACET = [[0, 0, 0], [1, 0, 0], [0, 2, 0]]


def test_stl_of_every_kind(tmp_path):
    for k, data in enumerate(
        (stl([FACET]), stl([FACET], head=b"solid blender"), stl([FACET]) + b"\0" * 100)
    ):
        assert area(read_model(write(tmp_path / f"{k}.stl", data))) == pytest.approx(1)
    text = "solid a\r\nFACET NORMAL 0 0 1\r\nOUTER LOOP\r\n"
    text += (
        "".join("  VERTEX {} {} {}\r\n".format(*c) for c in FACET)
        + "ENDLOOP\r\nENDFACET\r\nendsolid\r\n"
    )
    for data in (text, text.lower(), "\ufeff" + text.lower()):
        assert area(read_model(write(tmp_path / "a.stl", data))) == pytest.approx(1)
    coloured = read_model(write(tmp_path / "b.stl", stl([FACET], colour=0x801F)))
    assert coloured.warnings == ("b.stl: the colour of its facets is left out.",)


def test_counts_that_the_bytes_do_not_hold(tmp_path):
    little = "binary_little_endian"
    bad = [
        (
            write(tmp_path / "a.stl", stl([FACET], count=9)),
            "counts 9 facets, and it has bytes for 1",
        ),
        (write(tmp_path / "b.ply", ply_header("ascii", 10**9, XYZ, 1)), "more than 6 million"),
        (
            write(tmp_path / "c.ply", ply_header(little, 1000, XYZ, 1)),
            "1000 of 'vertex', at least 12000 bytes, and 0",
        ),
        (write(tmp_path / "d.ply", ply_header("ascii", 0, XYZ, 10**9)), "more than 2 million"),
        (
            write(
                tmp_path / "e.ply",
                ply_header(little, 1, XYZ, 1, ("uint int vertex_indices",)).encode()
                + b"\0" * 12
                + struct.pack("<I", 4 * 10**9)
                + b"\0" * 40,
            ),
            "row 1 of 'face' does not end",
        ),
        (
            write(tmp_path / "f.ply", "ply\nformat ascii 1.0\nelement vertex -3\nend_header\n"),
            "element vertex -3",
        ),
        (
            write(tmp_path / "g.ply", ply_header("ascii", 1, ("half x",), 0)),
            "the property 'half x'",
        ),
        (
            write(tmp_path / "h.ply", ply_header("ascii", 1, XYZ, 1) + "0 0 0\n3 0 0 7\n"),
            "do not exist",
        ),
        (
            write(tmp_path / "i.ply", ply_header("ascii", 1, XYZ, 1) + "0 x 0\n3 0 0 0\n"),
            "not a readable PLY",
        ),
        (write(tmp_path / "j.obj", "v 0 0 0\nf 1 1 1 x\n"), "not a readable OBJ"),
        (write(tmp_path / "k.obj", "v 0 0 0\nf 1 1 4\n"), "does not exist"),
        (write(tmp_path / "l.obj", "v 0 0 0\nf -2 1 1\n"), "does not exist"),
        (write(tmp_path / "m.obj", "v 0 0 0\nf" + " 1" * 600_000), "bytes in one line"),
    ]
    for path, sentence in bad:
        with pytest.raises(InputError, match=sentence):
            read_model(path)


def test_limits_have_a_sentence_each(tmp_path, monkeypatch):
    names = ["faces", "vertices", "polygon", "materials", "line_bytes", "megabytes"]
    lines = [*("v {} {} 0".format(*p) for p in U_SHAPE), "usemtl a", "f 1 2 3 4 5 6 7 8", "f 1 2 3"]
    path = write(tmp_path / "a.obj", "\n".join(lines))
    for name in names:
        monkeypatch.setattr(
            meshes, "LIMITS", MeshLimits(**{name: 1e-6 if name == "megabytes" else 1})
        )
        with pytest.raises(InputError, match=r"has .* more than 1(e-06)?; "):
            read_model(path)
