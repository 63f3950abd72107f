"""Mesh files as bodies: what is read, what is refused, and that nothing outside of the folder is opened."""

import numpy as np
import pytest
import trimesh
from made_meshes import (
    box_file,
    floor_scene,
    gltf_file,
    tetrahedron_glb,
    textured_obj,
    triangles_glb,
)
from PIL import Image

from materialist.color import srgb_to_linear
from materialist.edits.core.surfaces import edge_faults
from materialist.edits.insert import meshes
from materialist.edits.insert.formats.limits import MeshLimits
from materialist.edits.insert.insert import insert
from materialist.edits.insert.meshes import files_beside, read_model, repainted
from materialist.edits.insert.normals import creased_normals
from materialist.errors import InputError
from materialist.exporters.run import export

RED = np.eye(3)[0]
GREEN = np.eye(3)[1]
BLUE = np.eye(3)[2]
WHITE = np.ones(3)
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"


def write(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "glb"])
def test_a_box_of_every_format(tmp_path, suffix):
    model = read_model(box_file(tmp_path / f"box.{suffix}"), up="y")
    np.testing.assert_allclose(np.ptp(model.vertices, axis=0), [1, 2, 0.5], atol=1e-5)
    np.testing.assert_allclose(
        model.vertices.min(0) + model.vertices.max(0), [0, 2, 0], atol=1e-5
    )  # stands at 0
    assert model.closed and not model.warnings
    (body,) = model.parts
    corners = body.vertices[body.faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (((corners.mean(1) - model.vertices.mean(0)) * flat).sum(1) > 0).all()
    assert body.vertices.dtype == body.normals.dtype == body.uv.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(body.normals, axis=1), 1, atol=1e-5)


def test_edges_of_a_box_stay_and_a_ball_is_smooth(tmp_path):
    (body,) = read_model(box_file(tmp_path / "box.stl")).parts
    assert np.allclose(np.abs(body.normals).max(1), 1, atol=1e-6)
    ball = trimesh.creation.icosphere(3)
    number, normals = creased_normals(ball.vertices, ball.faces, 40)
    np.testing.assert_allclose(normals[number], ball.vertices[ball.faces], atol=0.02)
    assert len(normals) == len(ball.vertices)


def test_a_texture_lies_as_the_file_says(tmp_path):
    path = textured_obj(tmp_path)
    (body,) = read_model(path).parts
    surface = body.surface
    np.testing.assert_allclose(surface.albedo, [[RED, GREEN], [BLUE, WHITE]], atol=1e-6)
    np.testing.assert_allclose(surface.metallic, 0.25)
    np.testing.assert_allclose(surface.roughness, (2 / 8) ** 0.25)
    top_left = np.argmin(np.abs(body.vertices - [-0.5, 1, 0]).sum(1))
    np.testing.assert_allclose(body.uv[top_left], [0, 0], atol=1e-6)  # v runs down
    assert {file.name for file in files_beside(path)} == {"quad.mtl", "quad.png"}


def test_gltf_values_and_data_beside_it(tmp_path):
    (body,) = read_model(gltf_file(tmp_path, "tri.bin")).parts
    np.testing.assert_allclose(body.surface.albedo[0, 0], [0.2, 0.4, 0.6], atol=1e-6)
    np.testing.assert_allclose(
        [body.surface.roughness.item(), body.surface.metallic.item()], [0.3, 1], atol=1e-6
    )
    np.testing.assert_allclose(sorted(body.uv.tolist()), [[0, 0], [0, 1], [1, 0]], atol=1e-6)


def test_colours_of_vertices_become_texels(tmp_path):
    ball = trimesh.creation.icosphere(1)
    ball.visual.vertex_colors = np.where(
        ball.vertices[:, :1] > 0, [[255, 0, 0, 255]], [[0, 0, 255, 255]]
    )
    ball.export(tmp_path / "ball.ply")
    (body,) = read_model(tmp_path / "ball.ply").parts
    albedo = body.surface.albedo
    uv = body.uv
    h, w = albedo.shape[:2]
    seen = albedo[(uv[:, 1] * h).astype(int), (uv[:, 0] * w).astype(int)]
    right = body.vertices[body.faces][:, :, 0].min(1) > 0.1
    np.testing.assert_allclose(
        seen[body.faces[right].ravel()], np.tile(RED, (3 * right.sum(), 1)), atol=1e-3
    )


@pytest.mark.parametrize(
    ("made", "where"),
    [
        *(
            ("mtl", where)
            for where in (
                "../secret.mtl",
                "/etc/hostname",
                "sub/../../secret.mtl",
                "http://a.b/c.mtl",
            )
        ),
        *(
            ("texture", where)
            for where in ("../secret.png", "..\\secret.png", "file:///etc/hostname", "link.png")
        ),
        *(("uri", f"{where}tri.bin") for where in ("../", "%2e%2e/", "http://a.b/", "file:", "/")),
        *(
            ("image", f"{where}tri.bin")
            for where in ("../", "%2e%2e/", "http://a.b/", "file:", "/")
        ),
    ],
)
def test_what_lies_outside_is_never_followed(tmp_path, made, where):
    folder = tmp_path / "in"
    (folder / "sub").mkdir(parents=True)
    (tmp_path / "secret.mtl").write_text("newmtl paint\nKd 1 0 0\n")
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "secret.png")
    (folder / "link.png").symlink_to(tmp_path / "secret.png")
    gltf_file(tmp_path, "tri.bin")
    if made in ("mtl", "texture"):
        path = textured_obj(folder, **{made: where})
    else:
        path = gltf_file(folder, **{"uri": "tri.bin", made: where})
    with pytest.raises(InputError, match="outside of its folder"):
        read_model(path)


def test_missing_and_damaged_textures_are_told_and_a_constant_serves(tmp_path, monkeypatch):
    for path in (
        textured_obj(tmp_path, texture="gone.png"),
        gltf_file(tmp_path, "tri.bin", image="gone.png"),
    ):
        model = read_model(path)
        assert any("gone.png is missing" in note for note in model.warnings)
        assert model.parts[0].surface.albedo.shape == (1, 1, 3)
    path = textured_obj(tmp_path)
    good = (tmp_path / "quad.png").read_bytes()
    (tmp_path / "quad.png").write_bytes(good[: len(good) * 2 // 3])
    model = read_model(path)
    assert any("cannot be read" in note for note in model.warnings)
    np.testing.assert_allclose(model.parts[0].surface.albedo, 0.5)
    monkeypatch.setattr(meshes, "LIMITS", MeshLimits(picture_pixels=3))
    with pytest.raises(InputError, match="4 pixels in one picture, more than 3"):
        read_model(textured_obj(tmp_path))


def test_what_an_mtl_says_beyond_its_colours(tmp_path):
    write(tmp_path / "m.obj", f"mtllib m.mtl\nusemtl a\n{TRIANGLE}f 1/1 2/2 3/3\n")

    def read(lines):
        write(tmp_path / "m.mtl", f"newmtl a\nKd 1 0 0\n{lines}\n")
        return read_model(tmp_path / "m.obj")

    assert read("Ke 2 1 0").parts[0].surface.emission == (2.0, 1.0, 0.0)
    assert read("Ke nan inf -1").parts[0].surface.emission == (0.0, 0.0, 0.0)
    for lines, words in (
        ("d 0.4", "transparency"),
        ("Tr 0.3", "transparency"),
        ("map_Bump c.png", "map_bump"),
    ):
        assert [words in note for note in read(lines).warnings] == [True], lines
    assert not read("d 1\nTr 0\nKe 0 0 0").warnings


def test_greys_of_16_bits_keep_their_values_and_large_textures_shrink(tmp_path, monkeypatch):
    values = np.linspace(0, 65535, 40).astype(np.uint16)[None].repeat(4, 0)
    Image.fromarray(values).save(tmp_path / "colour.png")
    write(tmp_path / "a.mtl", "newmtl a\nmap_Kd colour.png\n")
    write(tmp_path / "a.obj", f"mtllib a.mtl\n{TRIANGLE}usemtl a\nf 1/1 2/2 3/3\n")
    albedo = read_model(tmp_path / "a.obj").parts[0].surface.albedo
    np.testing.assert_allclose(
        albedo[0, :, 1], srgb_to_linear(np.linspace(0, 1, 40, dtype=np.float32)), atol=2e-3
    )
    monkeypatch.setattr(meshes, "LIMITS", MeshLimits(texture=20))
    small = read_model(tmp_path / "a.obj").parts[0].surface.albedo
    assert small.shape == (2, 20, 3)


def test_bad_meshes_have_a_sentence_each(tmp_path, monkeypatch):
    obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    bad = [
        (write(tmp_path / "a.obj", ""), "is empty"),
        (write(tmp_path / "b.obj", "v 0 0 0\nv 1 0 0\n"), "no triangles"),
        (write(tmp_path / "c.obj", obj.replace("v 0 1 0", "v nan 1 0")), "NaN"),
        (write(tmp_path / "d.obj", obj.replace("v 0 1 0", "v 2 0 0")), "no triangles"),
        (write(tmp_path / "e.obj", obj.replace("f 1 2 3", "f 1 2 9")), "mesh|readable|faces"),
        (write(tmp_path / "f.glb", b"glTF" + b"\0" * 40), "not a readable GLB"),
        (write(tmp_path / "g.fbx", "x"), "ends in"),
        (tmp_path / "missing.obj", "cannot be read"),
        (write(tmp_path / "h.obj", obj.replace("1 2 3", "-3 -2 -4")), "does not exist"),
        (
            write(tmp_path / "i.stl", b"\0" * 80 + (10**7).to_bytes(4, "little") + b"\0" * 100),
            "mesh|readable|tri",
        ),
        (gltf_file(tmp_path, "gone.bin"), r"gone\.bin"),
        (write(tmp_path / "k.stl", b"solid \xff\xfe\x80" * 20), "STL mesh .damaged"),
        (
            write(
                tmp_path / "l.glb",
                b"glTF" + np.uint32([2, 500_020, 500_000]).tobytes() + b"JSON" + b'{"a":' * 100_000,
            ),
            "not a readable GLB",
        ),
        (
            tetrahedron_glb(tmp_path / "j.glb", None, ("KHR_draco_mesh_compression",)),
            "KHR_draco_mesh_compression",
        ),
        (
            tetrahedron_glb(tmp_path / "k.glb", None, ("KHR_lights_punctual",)),
            "KHR_lights_punctual",
        ),
    ]
    for path, sentence in bad:
        with pytest.raises(InputError, match=sentence) as error:
            read_model(path)
        assert "\n" not in str(error.value)
    box = box_file(tmp_path / "box.ply")
    with pytest.raises(InputError, match="points up"):
        read_model(box, up="x")
    for limits, sentence in (
        (MeshLimits(faces=11), "Decimate"),
        (MeshLimits(megabytes=1e-5), "MB"),
    ):
        monkeypatch.setattr(meshes, "LIMITS", limits)
        with pytest.raises(InputError, match=sentence):
            read_model(box)


def test_what_is_not_manifold_or_not_closed_is_told(tmp_path):
    fins = "v 0 0 0\nv 0 1 0\nv 1 0 0\nv -1 0 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 2 5\n"
    model = read_model(write(tmp_path / "fins.obj", fins))
    assert any("not manifold: 1 edges" in note for note in model.warnings) and not model.closed
    assert any("not closed" in note for note in repainted(model, "glass").warnings)
    box = trimesh.creation.box()
    assert edge_faults(np.asarray(box.vertices), np.asarray(box.faces)) == (0, 0)
    assert edge_faults(np.asarray(box.vertices), np.asarray(box.faces)[1:]) == (3, 0)


def test_an_inside_out_mesh_is_turned(tmp_path):
    box = trimesh.creation.box()
    trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False).export(tmp_path / "box.ply")
    (body,) = read_model(tmp_path / "box.ply").parts
    assert (((body.vertices - [0, 0.5, 0]) * body.normals).sum(1) > 0).all()


def test_a_mesh_far_from_its_origin_keeps_its_shape(tmp_path):
    box = trimesh.creation.box((0.2, 0.3, 0.4))
    box.apply_translation((500000, 4000000, 100))
    lines = [
        *(f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in box.vertices),
        *(f"f {a} {b} {c}" for a, b, c in box.faces + 1),
    ]
    model = read_model(write(tmp_path / "far.obj", "\n".join(lines)))
    np.testing.assert_allclose(np.ptp(model.vertices, axis=0), [0.2, 0.3, 0.4], atol=1e-3)


def test_glass_and_emission_of_gltf(tmp_path):
    glass = {
        "pbrMetallicRoughness": {
            "baseColorFactor": [0.5, 1, 1, 1],
            "roughnessFactor": 0.0,
            "metallicFactor": 0.0,
        },
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 0.9},
            "KHR_materials_ior": {"ior": 1.33},
        },
    }
    (body,) = read_model(tetrahedron_glb(tmp_path / "a.glb", glass)).parts
    assert body.surface.transmission == pytest.approx(0.9) and body.surface.ior == pytest.approx(
        1.33
    )
    np.testing.assert_allclose(body.surface.tint, [0.5, 1, 1])
    strength = {
        "KHR_materials_emissive_strength": {"emissiveStrength": 4},
        "KHR_materials_sheen": {},
    }
    lamp = {"emissiveFactor": [1, 0.5, 0], "alphaMode": "BLEND", "extensions": strength}
    model = read_model(tetrahedron_glb(tmp_path / "b.glb", lamp))
    np.testing.assert_allclose(model.parts[0].surface.emission, [4, 2, 0])
    assert any("transparency" in note for note in model.warnings)
    assert any("KHR_materials_sheen" in note for note in model.warnings)


@pytest.mark.parametrize("name", [{}, {"name": "paint"}])
def test_materials_of_gltf_need_no_names(tmp_path, name):
    glass = {"extensions": {"KHR_materials_transmission": {"transmissionFactor": 0.9}}}
    model = read_model(triangles_glb(tmp_path / "two.glb", [name | glass, name]))
    assert {
        part.vertices[0, 0] < 0: round(part.surface.transmission, 3) for part in model.parts
    } == {
        True: 0.9,
        False: 0,
    }


def test_textures_of_gltf_lie_where_the_file_puts_them(tmp_path):
    put = {"KHR_texture_transform": {"offset": [0.5, 0.25], "rotation": np.pi / 2, "scale": [2, 3]}}
    pbr = {"baseColorTexture": {"index": 0, "extensions": put}}
    model = read_model(
        triangles_glb(
            tmp_path / "two.glb",
            [{"pbrMetallicRoughness": pbr}, {}],
            KHR_lights_punctual={"lights": []},
        )
    )
    moved, plain = sorted(model.parts, key=lambda part: part.vertices[0, 0])
    np.testing.assert_allclose(plain.uv, [[0, 0], [1, 0], [0, 1]], atol=1e-6)
    np.testing.assert_allclose(moved.uv, [[0.5, 0.25], [0.5, -1.75], [3.5, 0.25]], atol=1e-6)
    assert "two.glb: its lighting is left out." in model.warnings


@pytest.mark.parametrize(
    "material",
    [
        {
            "extensions": {
                "KHR_materials_ior": {"ior": "x"},
                "KHR_materials_transmission": {"transmissionFactor": 1},
            }
        },
        {"pbrMetallicRoughness": {"baseColorFactor": {}}},
        {
            "pbrMetallicRoughness": {
                "baseColorTexture": {"extensions": {"KHR_texture_transform": {"scale": [1, 2, 3]}}}
            }
        },
    ],
)
def test_materials_that_say_nonsense_are_refused(tmp_path, material):
    with pytest.raises(InputError, match="has a material that cannot be read"):
        read_model(triangles_glb(tmp_path / "two.glb", [material, {}]))


def test_our_own_glass_comes_back_as_glass(tmp_path):
    scene = insert(floor_scene(), box_file(tmp_path / "box.ply"), (24, 26), material="glass")
    export(scene, tmp_path / "scene.glb")
    back = read_model(tmp_path / "scene.glb")
    glass = [part.surface for part in back.parts if part.surface.transmission > 0]
    assert len(glass) == 1 and glass[0].transmission == 1 and glass[0].ior == pytest.approx(1.5)
