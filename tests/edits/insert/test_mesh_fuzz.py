"""Mesh files with random damage: a model or an InputError, within a gigabyte, whatever is in them."""

import json
import struct
from contextlib import contextmanager
from copy import deepcopy

import numpy as np
import psutil
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from made_gltf import GltfBuilder, write_glb
from made_meshes import box_file, textured_obj

from materialist.edits.insert.meshes import read_model
from materialist.errors import InputError

resource = pytest.importorskip("resource", reason="needs POSIX limits")
FEW = settings(
    max_examples=40, deadline=20_000, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@contextmanager
def one_more_gigabyte():
    """Within, the process gets one more gigabyte of memory, and then a MemoryError."""
    used = psutil.Process().memory_info().vms
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + (1 << 30), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def try_to_read(path):
    """Read the file; what comes must be whole."""
    with one_more_gigabyte():
        try:
            model = read_model(path)
        except InputError as error:
            assert "\n" not in str(error) and len(str(error)) < 600
            return
    for part in model.parts:
        assert (
            np.isfinite(part.vertices).all()
            and np.isfinite(part.normals).all()
            and np.isfinite(part.uv).all()
        )
        assert len(part.faces) and 0 <= part.faces.min() <= part.faces.max() < len(part.vertices)
        assert len(part.normals) == len(part.uv) == len(part.vertices)
        for values in (part.surface.albedo, part.surface.roughness, part.surface.metallic):
            assert values.min() >= 0 and values.max() <= 1


def rich_glb(path):
    """A glTF with a texture, colours, a skin, a morph target, instances, a sparse accessor and a fan."""
    made = GltfBuilder()
    half = np.full((4, 2), 0.5, np.float32)
    joints = np.zeros((4, 4), np.uint8)
    weights = np.tile(np.float32([1, 0, 0, 0]), (4, 1))
    attributes = {"TEXCOORD_0": half, "JOINTS_0": joints, "WEIGHTS_0": weights, "COLOR_0": weights}
    made.tetrahedron(**{name: made.accessor(values) for name, values in attributes.items()})
    primitive = made.tree["meshes"][0]["primitives"][0]
    sampler = {"wrapS": 33071, "wrapT": 33648}
    transform = {"KHR_texture_transform": {"offset": [0.1, 0.2], "rotation": 1, "scale": [3, 4]}}
    primitive["material"] = made.textured([[[9, 8, 7], [1, 2, 3]]], sampler, extensions=transform)
    made.tree["materials"][0] |= {
        "emissiveFactor": [1, 0, 0],
        "extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.5}},
    }
    primitive["targets"] = [{"POSITION": made.sparse(4, 3, [1], [[1, 2, 3]])}]
    made.tree["meshes"][0]["weights"] = [0.5]
    made.tree["skins"] = [
        {
            "joints": [1],
            "inverseBindMatrices": made.accessor(np.eye(4, dtype=np.float32).reshape(1, 16)),
        }
    ]
    made.mesh({"POSITION": made.sparse(4, 3, [1, 2, 3], np.eye(3))}, mode=6)
    places = {"TRANSLATION": made.accessor(np.float32([[0, 0, 0], [5, 0, 0]]))}
    made.tree["nodes"] = [
        {"mesh": 0, "skin": 0},
        {"children": [2], "rotation": [0, 0, 0, 1]},
        {"mesh": 1, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": places}}},
    ]
    made.tree["scenes"][0]["nodes"] = [0, 1]
    return made.write(path)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A file of every kind, each of which is read."""
    folder = tmp_path_factory.mktemp("meshes")
    made = {"glb": rich_glb(folder / "a.glb"), "obj": textured_obj(folder)}
    made |= {kind: box_file(folder / f"box.{kind}") for kind in ("ply", "stl")}
    text = folder / "text.ply"
    rows = "0 0 0 255 0 0\n1 0 0 255 0 0\n1 1 0 255 0 0\n0 1 0 255 0 0\n4 0 1 2 3\n3 0 1 2\n"
    colours = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    axes = "".join(f"property float {name}\n" for name in "xyz")
    head = f"ply\nformat ascii 1.0\nelement vertex 4\n{axes}{colours}element face 2\n"
    text.write_text(f"{head}property list uchar int vertex_indices\nend_header\n{rows}")
    made["text.ply"] = text
    made["text.stl"] = folder / "text.stl"
    corners = "".join("vertex {} {} {}\n".format(*v) for v in ((0, 0, 0), (1, 0, 0), (0, 1, 0)))
    made["text.stl"].write_text(
        f"solid a\nfacet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\nendsolid\n"
    )
    for path in made.values():
        assert read_model(path).parts
    return made


INSERTED = [b" ", b"\n", b"/", b"-", b"9" * 12, b"\xff" * 8, b"1e999 "]
SPOTS = st.floats(0, 1, exclude_max=True)
CHANGES = st.lists(
    st.one_of(
        st.tuples(st.just("set"), SPOTS, st.binary(min_size=1, max_size=4)),
        st.tuples(
            st.just("insert"),
            SPOTS,
            st.sampled_from([b" ", b"\n", b"/", b"-", b"9" * 12, b"\xff" * 8, b"1e999 "]),
        ),
        st.tuples(st.just("cut"), SPOTS, st.integers(1, 40)),
        st.tuples(st.just("end"), SPOTS, st.none()),
    ),
    min_size=1,
    max_size=6,
)


def changed(data, changes):
    """The bytes after some damage; spots are shares of their length."""
    for kind, spot, value in changes:
        at = int(spot * len(data))
        if kind == "set":
            data = data[:at] + value + data[at + len(value) :]
        elif kind == "insert":
            data = data[:at] + value + data[at:]
        elif kind == "cut":
            data = data[:at] + data[at + value :]
        else:
            data = data[:at]
    return data


@pytest.mark.parametrize("kind", ["glb", "obj", "ply", "stl", "text.ply", "text.stl"])
@FEW
@given(changes=CHANGES)
@example(changes=[])
def test_damaged_bytes(whole, tmp_path, kind, changes):
    path = tmp_path / f"a.{kind.rpartition('.')[2]}"
    path.write_bytes(changed(whole[kind].read_bytes(), changes))
    try_to_read(path)


@FEW
@given(changes=CHANGES)
def test_a_damaged_mtl(whole, tmp_path, changes):
    for name in ("quad.obj", "quad.png"):
        (tmp_path / name).write_bytes((whole["obj"].parent / name).read_bytes())
    (tmp_path / "quad.mtl").write_bytes(
        changed((whole["obj"].parent / "quad.mtl").read_bytes(), changes)
    )
    try_to_read(tmp_path / "quad.obj")


VALUES = st.one_of(
    st.sampled_from(
        [
            None,
            True,
            -1,
            0,
            1,
            2,
            5,
            255,
            5121,
            5126,
            10**6,
            2**31,
            2**63,
            1e300,
            0.5,
            "",
            "x",
            "VEC4",
        ]
    ),
    st.sampled_from(
        [[], {}, [0], [1, 2], {"a": 1}, [[]], "../a", "data:,x", float("nan"), float("inf")]
    ),
)


def places(tree):
    """Every (container, key) of the document."""
    pairs = tree.items() if isinstance(tree, dict) else enumerate(tree)
    for key, value in list(pairs):
        yield tree, key
        if isinstance(value, dict | list):
            yield from places(value)


@settings(FEW, max_examples=100)
@given(
    changes=st.lists(st.tuples(SPOTS, st.one_of(VALUES, st.just("remove"))), min_size=1, max_size=3)
)
def test_documents_with_other_values(whole, tmp_path, changes):
    data = whole["glb"].read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    tree = json.loads(data[20 : 20 + length])
    for spot, value in changes:
        every = list(places(tree))
        container, key = every[int(spot * len(every))]
        if value == "remove":
            del container[key]
        else:
            container[key] = deepcopy(value)
    try_to_read(write_glb(tmp_path / "a.glb", json.dumps(tree).encode(), data[28 + length :]))
