"""Small or compact mesh files that ask for much: refused, or read in bounded memory, each in a process of its own."""

import io
import json
import os
import struct
import subprocess
import sys

import numpy as np
import pytest
from made_gltf import CORNERS, FACES, GltfBuilder, write_glb
from made_meshes import box_file
from made_png import png_header
from PIL import Image

pytestmark = pytest.mark.skipif(
    not os.path.exists("/proc/self/status"),
    reason="needs the peak memory of a process as Linux tells it",
)  # ru_maxrss would begin with that of the process that starts it
PER_BYTE = 10
PLUS = 300e6
"""Peak memory of a process that reads a file: at most so many bytes for each of the file's, and so many more."""
READ = """
import json, os, sys
from pathlib import Path
from materialist.edits.insert.meshes import read_model
from materialist.errors import InputError

def answer(path):
    try:
        model = read_model(path)
        said = str(sum(len(part.faces) for part in model.parts))
    except InputError as error:
        said = str(error)
    (peak,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    print(json.dumps([int(peak.split()[1]) * 1024, said]), flush=True)

# What a model needs is loaded once.
answer(sys.argv[1])
for line in sys.stdin:
    child = os.fork()
    if child == 0:
        answer(line.rstrip())
        os._exit(0)
    if os.waitpid(child, 0)[1]:
        print(json.dumps([0, "the process died"]), flush=True)
"""


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    """read(path): (peak memory of a process that reads the file in bytes, number of triangles or the error)."""
    environment = os.environ | {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    first = box_file(tmp_path_factory.mktemp("first") / "box.ply")
    with subprocess.Popen(
        [sys.executable, "-c", READ, str(first)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=environment,
    ) as process:
        assert json.loads(process.stdout.readline())[1] == "12"

        def asked(path):
            process.stdin.write(f"{path}\n")
            process.stdin.flush()
            return json.loads(process.stdout.readline())

        yield asked
        process.stdin.close()


@pytest.fixture
def within(read):
    """within(path): the answer of a process that stayed within its memory."""

    def answer(path, plus=PLUS):
        peak, said = read(path)
        assert 0 < peak <= PER_BYTE * path.stat().st_size + plus, f"{peak / 1e6:.0f} MB"
        return said

    return answer


def sparse_zeros(path):
    made = GltfBuilder()
    made.mesh({"POSITION": made.sparse(400_000_000, 3, [1], [[1, 1, 1]])})
    return made.write(path)


def many_nodes(path):
    made = GltfBuilder()
    made.tetrahedron()
    made.tree["nodes"] = [{"mesh": 0}] * 200_000
    return made.write(path)


def deep_nodes(path):
    made = GltfBuilder()
    made.tetrahedron()
    made.tree["nodes"] = [{"children": [k + 1]} for k in range(5000)] + [{"mesh": 0}]
    return made.write(path)


def many_copies(path):
    made = GltfBuilder()
    made.tetrahedron()
    made.tree["meshes"][0]["primitives"] *= 1000
    made.tree["nodes"] = [{"mesh": 0}] * 1000
    made.tree["scenes"][0]["nodes"] = list(range(1000))
    return made.write(path)


def many_instances(path):
    made = GltfBuilder()
    made.tetrahedron()
    places = made.sparse(5_000_000, 3, [0], [[1, 1, 1]])
    made.tree["nodes"][0]["extensions"] = {
        "EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": places}}
    }
    return made.write(path)


def many_triangles(path):
    made = GltfBuilder()
    position = made.accessor(CORNERS)
    corners = made.accessor(np.resize(FACES.ravel(), 3_000_000).astype(np.uint8))
    made.mesh({"POSITION": position}, indices=corners, mode=5)
    return made.write(path)


def many_targets(path):
    made = GltfBuilder()
    made.tetrahedron()
    target = {"POSITION": made.sparse(4, 3, [0], [[0, 1, 0]])}
    made.tree["meshes"][0]["primitives"][0]["targets"] = [target] * 10_000
    made.tree["meshes"][0]["weights"] = [1] * 10_000
    return made.write(path)


def many_joints(path):
    made = GltfBuilder()
    joints = made.accessor(np.zeros((4, 4), np.uint8))
    weights = made.accessor(np.ones((4, 4), np.float32))
    sets = {f"JOINTS_{k}": joints for k in range(1000)} | {
        f"WEIGHTS_{k}": weights for k in range(1000)
    }
    made.tetrahedron(**sets)
    made.tree["skins"] = [{"joints": [0]}]
    made.tree["nodes"][0]["skin"] = 0
    return made.write(path)


def many_accessors(path):
    made = GltfBuilder()
    made.tetrahedron()
    made.tree["accessors"] += [made.tree["accessors"][0]] * 100_001
    return made.write(path)


def many_brackets(path):
    return write_glb(path, b'{"asset":[' + b"[]," * 900_000 + b"0]}")


def nested_brackets(path):
    return write_glb(path, b'{"a":' * 100_000)


def one_picture(path, encoded):
    made = GltfBuilder()
    made.tetrahedron(TEXCOORD_0=made.accessor(np.zeros((4, 2), np.float32)))
    material = made.textured([[[1, 2, 3]]])
    made.tree["images"][0]["bufferView"] = made.view(encoded)
    made.tree["meshes"][0]["primitives"][0]["material"] = material
    return made.write(path)


def large_picture(path):
    return one_picture(path, png_header(30_000, 8_000))


def header_of_vertices(path):
    lines = ["ply", "format binary_little_endian 1.0", "element vertex 4000000000"]
    path.write_text("\n".join([*lines, *(f"property float {k}" for k in "xyz"), "end_header", ""]))
    return path


def header_of_others(path):
    lines = [
        "ply",
        "format ascii 1.0",
        "element other 4000000000",
        "property list int int k",
        "end_header",
        "0 ",
    ]
    path.write_text("\n".join(lines))
    return path


def header_of_facets(path):
    path.write_bytes(b"\0" * 80 + struct.pack("<I", 4_000_000_000) + b"\0" * 500)
    return path


def long_polygon(path):
    path.write_text("v 0 0 0\nf" + " 1" * 10_000_000)
    return path


def many_faces(path):
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + "f 1 2 3\n" * 2_500_000)
    return path


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (sparse_zeros, "400 million vertices, more than 6 million"),
        (many_nodes, "0.2 million nodes, more than 0.1 million"),
        (deep_nodes, "1001 levels of nodes, more than 1000"),
        (many_copies, "copies of meshes, more than 20000"),
        (many_instances, "million copies of meshes|copies of meshes, more than 20000"),
        (many_triangles, "3 million triangles, more than 2 million"),
        (many_targets, "10000 morph targets in one mesh, more than 512"),
        (many_joints, "1000 sets of joints for a vertex, more than 8"),
        (many_accessors, "0.1 million accessors or buffer views, more than 0.1 million"),
        (many_brackets, "1.8 million entries in its JSON, more than 1.5 million"),
        (nested_brackets, "nests too deep"),
        (large_picture, "240 million pixels in one picture, more than 67.1 million"),
    ],
)
def test_small_gltf_files_that_ask_for_much(tmp_path, read, make, sentence):
    peak, said = read(make(tmp_path / "a.glb"))
    assert any(one in said for one in sentence.split("|")), said
    assert 0 < peak < PER_BYTE * (tmp_path / "a.glb").stat().st_size + PLUS


@pytest.mark.parametrize(
    ("name", "make", "sentence"),
    [
        ("a.ply", header_of_vertices, "more than 6 million"),
        ("b.ply", header_of_others, "counts 4000000000 of 'other'"),
        ("c.stl", header_of_facets, "counts 4000000000 facets, and it has bytes for 10"),
        ("d.obj", long_polygon, "bytes in one line, more than 1 million"),
        pytest.param("e.obj", many_faces, "triangles, more than 2 million", marks=pytest.mark.slow),
    ],
)
def test_other_files_that_ask_for_much(tmp_path, within, name, make, sentence):
    assert sentence in within(make(tmp_path / name))


def grid(side):
    """Vertices [n, 3] float32 and faces [m, 3] of a wavy sheet."""
    y, x = np.mgrid[:side, :side]
    points = (
        np.stack([x, y, 5 * np.sin(x / 9) * np.cos(y / 7)], -1).reshape(-1, 3).astype(np.float32)
    )
    corner = (y * side + x)[:-1, :-1].ravel()
    first = np.stack([corner, corner + 1, corner + side], -1)
    second = np.stack([corner + 1, corner + side + 1, corner + side], -1)
    return points, np.concatenate([first, second]).astype(np.uint32)


def obj_grid(path, side=320):
    points, faces = grid(side)
    with path.open("w") as file:
        file.writelines("v {:.5f} {:.5f} {:.5f}\n".format(*point) for point in points.tolist())
        file.writelines("f {} {} {}\n".format(*face) for face in (faces + 1).tolist())
    return path


def glb_grid(path, side=600):
    points, faces = grid(side)
    made = GltfBuilder()
    made.mesh({"POSITION": made.accessor(points)}, indices=made.accessor(faces.ravel()))
    return made.write(path)


def ply_grid(path, side=500):
    points, faces = grid(side)
    lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    lines += [*(f"property float {k}" for k in "xyz"), f"element face {len(faces)}"]
    lines += ["property list uchar int vertex_indices", "end_header", ""]
    rows = np.zeros(len(faces), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    path.write_bytes("\n".join(lines).encode() + points.tobytes() + rows.tobytes())
    return path


def stl_grid(path, side=400):
    points, faces = grid(side)
    rows = np.zeros(
        len(faces), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("colour", "<u2")]
    )
    rows["corners"] = points[faces]
    path.write_bytes(b"\0" * 80 + struct.pack("<I", len(rows)) + rows.tobytes())
    return path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "make", "side"),
    [
        ("a.obj", obj_grid, 320),
        ("a.glb", glb_grid, 600),
        ("a.ply", ply_grid, 500),
        ("a.stl", stl_grid, 400),
    ],
)
def test_ordinary_files_take_ten_times_their_size(tmp_path, within, name, make, side):
    assert within(make(tmp_path / name, side)) == str(2 * (side - 1) ** 2)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "make", "side"),
    [
        ("a.obj", obj_grid, 1000),
        ("a.glb", glb_grid, 1000),
        ("a.ply", ply_grid, 1000),
        ("a.stl", stl_grid, 1000),
    ],
)
def test_files_at_the_limit_take_ten_times_their_size(tmp_path, within, name, make, side):
    assert within(make(tmp_path / name, side)) == str(2 * (side - 1) ** 2)


@pytest.mark.slow
def test_the_most_that_a_compact_file_may_ask_for(tmp_path, read):
    """Two million triangles in one byte each, and the largest picture."""
    made = GltfBuilder()
    corners = made.accessor(np.resize(np.arange(250), 2_000_000).astype(np.uint8))
    points = np.random.default_rng(0).random((250, 3)).astype(np.float32)
    made.mesh({"POSITION": made.accessor(points)}, indices=corners, mode=5)
    peak, said = read(made.write(tmp_path / "a.glb"))
    assert int(said) > 1_900_000 and peak < 800e6
    made = GltfBuilder()
    loose = {"POSITION": np.resize(points, (3000, 3)), "NORMAL": np.ones((3000, 3), np.float32)}
    loose["TEXCOORD_0"] = np.zeros((3000, 2), np.float32)
    made.mesh({name: made.accessor(values) for name, values in loose.items()}, material=0)
    made.tree["materials"] = [{}]
    places = {
        "TRANSLATION": made.accessor(np.random.default_rng(0).random((2000, 3)).astype(np.float32))
    }
    made.tree["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": places}}
    peak, said = read(made.write(tmp_path / "c.glb"))
    assert int(said) > 1_900_000 and peak < 900e6
    file = io.BytesIO()
    Image.new("RGBA", (8192, 8192)).save(file, "PNG")
    peak, said = read(one_picture(tmp_path / "b.glb", file.getvalue()))
    assert said == "4" and peak < 600e6
