"""glTF: each thing that a file may do with its numbers, against a value known by hand."""

import numpy as np
import pytest
from made_gltf import CORNERS, FACES, GltfBuilder, write_glb
from mesh_measures import area, colours, size

from materialist.edits.insert import meshes
from materialist.edits.insert.formats.limits import MeshLimits
from materialist.edits.insert.meshes import read_model
from materialist.errors import InputError

RED = [255, 0, 0]
GREEN = [0, 255, 0]
BLUE = [0, 0, 255]
WHITE = [255, 255, 255]
PICTURE = [[RED, GREEN], [BLUE, WHITE]]
LINEAR = {"red": [1, 0, 0], "green": [0, 1, 0], "blue": [0, 0, 1], "white": [1, 1, 1]}
CLAMP = {"wrapS": 33071, "wrapT": 33071}
MIRROR = {"wrapS": 33648, "wrapT": 33648}
MOVED = {"KHR_texture_transform": {"offset": [0.5, 0.5]}}


@pytest.fixture
def made():
    return GltfBuilder()


def textured(made, tmp_path, uv, *, sampler=None, name="TEXCOORD_0", accessor=None, **info):
    """A tetrahedron all of whose corners have one texture coordinate, or those of an array."""
    material = made.textured(PICTURE, sampler, **info)
    uv = np.broadcast_to(np.asarray(uv), (4, 2))
    number = made.accessor(uv, **(accessor or {}))
    made.tetrahedron(**{name: number})
    made.tree["meshes"][0]["primitives"][0]["material"] = material
    return read_model(made.write(tmp_path / "a.glb"))


@pytest.mark.parametrize(
    ("kind", "top"),
    [("uint8", 255), ("uint16", 65535), ("int8", 127), ("int16", 32767), ("float32", 1)],
)
@pytest.mark.parametrize(("place", "colour"), [((0.75, 0.25), "green"), ((0.25, 0.75), "blue")])
def test_texture_coordinates_of_every_type(made, tmp_path, kind, top, place, colour):
    uv = (np.array(place) * top).astype(kind)
    normalized = {} if kind == "float32" else {"normalized": True}
    assert colours(textured(made, tmp_path, uv, accessor=normalized)) == [LINEAR[colour]]


@pytest.mark.parametrize(
    ("sampler", "place", "colour"),
    [
        (None, (5.75, 0.25), "green"),
        (None, (-0.25, 0.25), "green"),
        (CLAMP, (5.75, 0.25), "green"),
        (CLAMP, (-9.0, 0.25), "red"),
        (CLAMP, (0.25, 3.0), "blue"),
        (CLAMP, (1e5, 1e5), "white"),
        (MIRROR, (1.25, 0.25), "green"),
        (MIRROR, (1.75, 0.25), "red"),
        (MIRROR, (0.25, -0.25), "red"),
        (MIRROR, (-0.75, 1.75), "green"),
        ({"wrapS": 33071}, (5.75, 1.75), "white"),
    ],
)
def test_what_lies_outside_of_a_texture(made, tmp_path, sampler, place, colour):
    assert colours(textured(made, tmp_path, np.float32(place), sampler=sampler)) == [LINEAR[colour]]


def test_a_triangle_across_the_border_of_a_clamped_texture_keeps_its_scale(made, tmp_path):
    across = np.float32([[-1, 0.25], [3, 0.25], [-1, 0.25], [-1, 0.25]])
    (body,) = textured(made, tmp_path, across, sampler=CLAMP).parts
    albedo = body.surface.albedo
    width = albedo.shape[1]
    row = albedo[int(body.uv[0, 1] * albedo.shape[0])]
    low = body.uv[:, 0].min()
    high = body.uv[:, 0].max()
    for share, colour in ((0.1, "red"), (0.3, "red"), (0.45, "green"), (0.9, "green")):
        column = int((low + share * (high - low)) * width)
        assert row[column].tolist() == LINEAR[colour], share


def test_a_clamped_texture_too_far_outside_is_cut_with_a_word(made, tmp_path, monkeypatch):
    monkeypatch.setattr(meshes, "LIMITS", MeshLimits(texture_pixels=64))
    across = np.float32([[-50, 0.25], [50, 0.25], [0, 0.25], [0, 0.25]])
    model = textured(made, tmp_path, across, sampler=CLAMP)
    assert model.parts[0].surface.albedo.size <= 3 * 64
    assert any("clamped" in note for note in model.warnings)


def test_the_set_of_coordinates_that_the_texture_names(made, tmp_path):
    first = made.accessor(np.float32([[0.25, 0.25]] * 4))
    second = made.accessor(np.float32([[0.75, 0.75]] * 4))
    third = made.accessor(np.float32([[0.25, 0.75]] * 4))
    sets = {"TEXCOORD_0": first, "TEXCOORD_1": second, "TEXCOORD_2": third}
    transform = {"KHR_texture_transform": {"texCoord": 2}}
    for k, (info, colour) in enumerate(
        (({"texCoord": 1}, "white"), ({"extensions": transform}, "blue"))
    ):
        number = made.tetrahedron(**sets)
        made.tree["meshes"][number]["primitives"][0]["material"] = made.textured(PICTURE, **info)
        made.tree["nodes"][0]["mesh"] = number
        assert colours(read_model(made.write(tmp_path / f"{k}.glb"))) == [LINEAR[colour]]
    number = made.tetrahedron()
    made.tree["meshes"][number]["primitives"][0]["material"] = 0
    made.tree["nodes"][0]["mesh"] = number
    assert any(
        "coordinates are missing" in n
        for n in read_model(made.write(tmp_path / "none.glb")).warnings
    )


def test_a_roughness_that_lies_otherwise_than_the_colour_is_named(made, tmp_path):
    made.textured(PICTURE)
    material = made.textured(PICTURE)
    pbr = made.tree["materials"][material]["pbrMetallicRoughness"]
    for info, named in (({"index": 0}, False), ({"index": 0, "extensions": MOVED}, True)):
        pbr["metallicRoughnessTexture"] = info
        uv = made.accessor(np.float32([[0.75, 0.25]] * 4))
        number = made.tetrahedron(TEXCOORD_0=uv)
        made.tree["meshes"][number]["primitives"][0]["material"] = material
        made.tree["nodes"][0]["mesh"] = number
        model = read_model(made.write(tmp_path / "a.glb"))
        assert any("roughness texture" in note for note in model.warnings) is named
        assert (model.parts[0].surface.roughness.size > 1) is not named
        assert colours(model) == [LINEAR["green"]]


def test_sparse_numbers(made, tmp_path):
    base = made.accessor(CORNERS)
    far = made.sparse(4, 3, [3], [[0, 0, 9]], base)
    made.mesh({"POSITION": far}, indices=made.accessor(FACES.ravel()))
    assert size(read_model(made.write(tmp_path / "a.glb"))) == [1, 1, 9]
    alone = made.sparse(4, 3, [1, 2, 3], 2 * np.eye(3))
    made.tree["nodes"][0]["mesh"] = made.mesh(
        {"POSITION": alone}, indices=made.accessor(FACES.ravel())
    )
    assert size(read_model(made.write(tmp_path / "b.glb"))) == [2, 2, 2]


@pytest.mark.parametrize("indexed", [False, True])
@pytest.mark.parametrize(("mode", "square"), [(6, [0, 1, 2, 3]), (5, [0, 1, 3, 2])])
def test_fans_and_strips_face_one_way(made, tmp_path, mode, square, indexed):
    corners = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    order = np.array(square, np.uint16)
    position = made.accessor(corners if indexed else corners[order])
    made.mesh(
        {"POSITION": position}, mode=mode, **({"indices": made.accessor(order)} if indexed else {})
    )
    model = read_model(made.write(tmp_path / "a.glb"))
    assert area(model) == pytest.approx(1)
    np.testing.assert_allclose(model.parts[0].normals, [[0, 0, 1]] * 4, atol=1e-6)


def test_lines_and_points_are_named(made, tmp_path):
    made.tetrahedron()
    for mode in (0, 1, 3):
        made.tree["meshes"][0]["primitives"].append({"attributes": {"POSITION": 0}, "mode": mode})
    assert read_model(made.write(tmp_path / "a.glb")).warnings == (
        "a.glb: its points and lines is left out.",
    )


def test_a_skin_stands_where_its_joints_are(made, tmp_path):
    joints = made.accessor(np.tile(np.uint8([0, 1, 0, 0]), (4, 1)))
    weights = made.accessor(np.tile(np.float32([0.5, 0.5, 0, 0]), (4, 1)))
    made.tetrahedron(JOINTS_0=joints, WEIGHTS_0=weights)
    inverse = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    inverse[1, 3, :3] = [-7, 0, 0]  # stored by columns: undoes the second joint's place
    made.tree["skins"] = [
        {"joints": [1, 2], "inverseBindMatrices": made.accessor(inverse.reshape(2, 16))}
    ]
    made.tree["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0], "scale": [9, 9, 9]},
        {"scale": [1, 3, 1]},
        {"translation": [7, 0, 0], "scale": [1, 5, 1]},
    ]
    made.tree["scenes"][0]["nodes"] = [0, 1, 2]
    assert size(read_model(made.write(tmp_path / "a.glb"))) == [1, 4, 1]


@pytest.mark.parametrize(
    ("weights", "height"), [({"mesh": [0.5]}, 2.5), ({"node": [1.0], "mesh": [0]}, 4), ({}, 1)]
)
def test_morph_targets_by_their_weights(made, tmp_path, weights, height):
    made.tetrahedron()
    target = {"POSITION": made.sparse(4, 3, [2], [[0, 3, 0]])}
    made.tree["meshes"][0]["primitives"][0]["targets"] = [target]
    if "mesh" in weights:
        made.tree["meshes"][0]["weights"] = weights["mesh"]
    if "node" in weights:
        made.tree["nodes"][0]["weights"] = weights["node"]
    assert size(read_model(made.write(tmp_path / "a.glb"))) == [1, height, 1]


def test_instances_stand_where_they_are_put(made, tmp_path):
    made.tetrahedron()
    half = np.int16(32767 * np.sqrt(0.5))
    places = {
        "TRANSLATION": made.accessor(np.float32([[0, 0, 0], [5, 0, 0]])),
        "ROTATION": made.accessor(
            np.array([[0, 0, 0, 32767], [0, 0, half, half]], np.int16), normalized=True
        ),
        "SCALE": made.accessor(np.float32([[1, 1, 1], [2, 2, 2]])),
    }
    made.tree["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": places}}
    made.tree["nodes"][0]["scale"] = [1, 1, 4]
    model = read_model(made.write(tmp_path / "a.glb"))
    assert size(model) == pytest.approx(
        [5, 2, 8], abs=1e-3
    )  # turned about z, the second reaches from 3 to 5
    assert sum(len(part.faces) for part in model.parts) == 8


def test_quantised_positions_and_a_stride(made, tmp_path):
    made.tree["extensionsRequired"] = ["KHR_mesh_quantization"]
    rows = np.zeros((4, 4), np.int16)
    rows[:, :3] = CORNERS * 32767
    position = made.accessor(rows[:, :3], normalized=True)
    view = made.view(rows.tobytes())
    made.tree["bufferViews"][view]["byteStride"] = 8
    made.tree["accessors"][position]["bufferView"] = view
    made.mesh({"POSITION": position}, indices=made.accessor(FACES.ravel()))
    made.tree["nodes"][0]["scale"] = [2, 2, 2]
    assert size(read_model(made.write(tmp_path / "a.glb"))) == [2, 2, 2]


def test_nodes_below_each_other_and_scenes_beside(made, tmp_path):
    made.tetrahedron()
    half = float(np.sqrt(0.5))
    made.tree["nodes"] = [
        {"children": [1], "scale": [2, 2, 2]},
        {
            "mesh": 0,
            "rotation": [half, 0, 0, half],
            "matrix": np.diag([3.0, 1, 1, 1]).ravel().tolist(),
        },
        {"mesh": 0, "translation": [50, 0, 0]},
    ]
    made.tree["scenes"] = [{"nodes": [0]}, {"nodes": [2]}]
    model = read_model(made.write(tmp_path / "a.glb"))
    assert size(model) == [6, 2, 2]
    assert any("other scenes" in note for note in model.warnings)


def test_a_mirrored_node_keeps_its_outside(made, tmp_path):
    made.tetrahedron()
    made.tree["meshes"][0]["primitives"][0].pop("indices")
    made.tree["nodes"][0]["scale"] = [-1, 1, 1]
    position = made.accessor(CORNERS[[0, 1, 2]])  # seen from +z
    made.tree["meshes"][0]["primitives"][0]["attributes"] = {"POSITION": position}
    (body,) = read_model(made.write(tmp_path / "a.glb")).parts
    np.testing.assert_allclose(body.normals, [[0, 0, 1]] * 3, atol=1e-6)


@pytest.mark.parametrize(("kind", "top"), [("uint8", 255), ("uint16", 65535), ("float32", 1)])
def test_colours_of_vertices_are_multiplied_by_the_material(made, tmp_path, kind, top):
    values = np.tile(np.array([0.5 * top, 0.25 * top, 0, top]).astype(kind), (4, 1))
    made.tetrahedron(COLOR_0=made.accessor(values, normalized=kind != "float32"))
    made.tree["materials"] = [
        {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1], "roughnessFactor": 0.25}}
    ]
    made.tree["meshes"][0]["primitives"][0]["material"] = 0
    model = read_model(made.write(tmp_path / "a.glb"))
    np.testing.assert_allclose(colours(model), [[0.25, 0.25, 0]], atol=3e-3)
    assert model.parts[0].surface.roughness.item() == pytest.approx(0.25)


def test_specular_and_gloss_as_metal_and_roughness(made, tmp_path):
    name = "KHR_materials_pbrSpecularGlossiness"
    made.tetrahedron()
    made.tree["meshes"][0]["primitives"][0]["material"] = 0
    plastic = {"diffuseFactor": [0.6, 0.3, 0.1, 1], "specularFactor": [0.04] * 3}
    copper = {"diffuseFactor": [0, 0, 0, 1], "specularFactor": [0.9, 0.6, 0.3]}
    for gloss, albedo, metallic in ((plastic, [0.6, 0.3, 0.1], 0), (copper, [0.9, 0.6, 0.3], 1)):
        made.tree["materials"] = [{"extensions": {name: gloss | {"glossinessFactor": 0.7}}}]
        surface = read_model(made.write(tmp_path / "a.glb")).parts[0].surface
        np.testing.assert_allclose(surface.albedo[0, 0], albedo, atol=0.02)
        np.testing.assert_allclose(
            [surface.metallic.item(), surface.roughness.item()], [metallic, 0.3], atol=0.02
        )


def test_a_texture_in_another_format_is_named(made, tmp_path):
    material = made.textured(PICTURE)
    made.tree["textures"][0] = {"extensions": {"KHR_texture_basisu": {"source": 0}}}
    made.tetrahedron()
    made.tree["meshes"][0]["primitives"][0]["material"] = material
    assert any(
        "format that is not read" in note
        for note in read_model(made.write(tmp_path / "a.glb")).warnings
    )


def test_textures_that_are_large_together_shrink_with_a_word(made, tmp_path, monkeypatch):
    monkeypatch.setattr(meshes, "LIMITS", MeshLimits(texture=64, texture_pixels=2000))
    material = made.textured(np.zeros((64, 64, 3)))
    made.tetrahedron(TEXCOORD_0=made.accessor(np.zeros((4, 2), np.float32)))
    made.tree["meshes"][0]["primitives"][0]["material"] = material
    model = read_model(made.write(tmp_path / "a.glb"))
    assert model.parts[0].surface.albedo.shape[:2] == (32, 32)
    assert model.warnings == (
        "a.glb: its textures are shrunk to 32 pixels, because they are large together.",
    )


def change(path, value):
    """A function that sets a value of the document, as in `change(("nodes", 0, "mesh"), 7)`."""

    def apply(tree):
        for key in path[:-1]:
            tree = tree[key]
        tree[path[-1]] = value

    return apply


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        (change(("accessors", 0, "count"), 5), "accessor 0 takes 60 bytes of a buffer view of 48"),
        (change(("bufferViews", 0, "byteLength"), 9999), "ends at byte 9999"),
        (change(("buffers", 0, "uri"), "gone.bin"), "gone.bin"),
        (change(("nodes", 0, "mesh"), 7), "number 7 of 1 meshes"),
        (change(("nodes", 0, "children"), [0]), "below itself"),
        (change(("nodes",), [{"children": [1, 2]}, {"children": [2]}, {"mesh": 0}]), "two parents"),
        (change(("accessors", 1, "componentType"), 5126), "takes|whole numbers"),
        (change(("meshes", 0, "primitives", 0, "indices"), 0), "numbers are needed"),
        (change(("accessors", 0, "type"), "VEC2"), "numbers are needed"),
        (change(("bufferViews", 0, "byteStride"), 4), "takes"),
        (change(("asset", "version"), "1.0"), "version 1.0"),
        (change(("accessors", 0, "count"), -1), "is no count"),
        (change(("meshes", 0, "primitives"), 3), "damaged"),
        (change(("nodes", 0, "matrix"), [1, 2, 3]), "damaged"),
    ],
)
def test_documents_that_do_not_hold_together(made, tmp_path, changes, sentence):
    made.tetrahedron()
    changes(made.tree)
    with pytest.raises(InputError, match=sentence):
        read_model(made.write(tmp_path / "a.glb"))


def test_a_truncated_glb_says_by_how_much(made, tmp_path):
    made.tetrahedron()
    path = made.write(tmp_path / "a.glb")
    data = path.read_bytes()
    path.write_bytes(data[:-20])
    with pytest.raises(
        InputError, match=f"should have {len(data)} bytes, and has {len(data) - 20}"
    ):
        read_model(path)
    with pytest.raises(InputError, match="not a readable GLB"):
        read_model(write_glb(tmp_path / "b.glb", b"[]"))
