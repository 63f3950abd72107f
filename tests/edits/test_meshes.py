"""Mesh files as bodies: what is read, what is refused, and that nothing outside of the folder is opened."""

import struct
import zlib

import numpy as np
import pytest
import trimesh
from made_meshes import box_file, gltf_file, textured_obj
from PIL import Image

from materialist.color import srgb_to_linear
from materialist.edits.core.topology import edge_faults
from materialist.edits.insert.mesh_shape import creased_normals
from materialist.edits.insert.meshes import read_model, repainted
from materialist.errors import InputError
from materialist.io.image import read_map

RED, GREEN, BLUE, WHITE = np.eye(3)[0], np.eye(3)[1], np.eye(3)[2], np.ones(3)


@pytest.mark.parametrize("suffix", ["obj", "ply", "stl", "glb"])
def test_a_box_of_every_format(tmp_path, suffix):
    model = read_model(box_file(tmp_path / f"box.{suffix}"), up="y")
    np.testing.assert_allclose(np.ptp(model.vertices, axis=0), [1, 2, 0.5], atol=1e-5)
    assert model.closed and not model.warnings
    (body,) = model.parts
    corners = body.vertices[body.faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outwards = (corners.mean(1) - model.vertices.mean(0)) * flat
    assert (outwards.sum(1) > 0).all()
    assert body.vertices.dtype == body.normals.dtype == body.uv.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(body.normals, axis=1), 1, atol=1e-5)


def test_stl_stands_on_z(tmp_path):
    path = box_file(tmp_path / "box.stl", (1.0, 0.5, 2.0))
    np.testing.assert_allclose(np.ptp(read_model(path).vertices, axis=0), [1, 2, 0.5], atol=1e-5)
    np.testing.assert_allclose(np.ptp(read_model(path, up="y").vertices, axis=0), [1, 0.5, 2], atol=1e-5)


def test_edges_of_a_box_stay_and_a_ball_is_smooth(tmp_path):
    (body,) = read_model(box_file(tmp_path / "box.stl")).parts
    assert np.allclose(np.abs(body.normals).max(1), 1, atol=1e-6)
    ball = trimesh.creation.icosphere(3)
    normals = creased_normals(ball.vertices, ball.faces)
    np.testing.assert_allclose(normals, ball.vertices[ball.faces], atol=0.02)


def test_creased_normals_agree_with_a_loop():
    shape = trimesh.creation.cylinder(1, 2, sections=12)
    v, f = np.asarray(shape.vertices), np.asarray(shape.faces)
    cross = np.cross(v[f[:, 1]] - v[f[:, 0]], v[f[:, 2]] - v[f[:, 0]])
    unit = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    for face in range(0, len(f), 7):
        for k in range(3):
            around = [g for g in range(len(f)) if np.isclose(v[f[g]], v[f[face, k]]).all(1).any()]
            total = sum(cross[g] for g in around if unit[g] @ unit[face] > np.cos(np.radians(40)))
            expected = total / np.linalg.norm(total)
            np.testing.assert_allclose(creased_normals(v, f)[face, k], expected, atol=1e-9)


def test_a_texture_lies_as_the_file_says(tmp_path):
    (body,) = read_model(textured_obj(tmp_path)).parts
    surface = body.surface
    np.testing.assert_allclose(surface.albedo, [[RED, GREEN], [BLUE, WHITE]], atol=1e-6)
    np.testing.assert_allclose(surface.metallic, 0.25)
    np.testing.assert_allclose(surface.roughness, (2 / 8) ** 0.25)
    top_left = np.argmin(np.abs(body.vertices - [0, 1, 0]).sum(1))
    np.testing.assert_allclose(body.uv[top_left], [0, 0], atol=1e-6)  # v runs down


def test_gltf_values_and_data_beside_it(tmp_path):
    (body,) = read_model(gltf_file(tmp_path, "tri.bin")).parts
    np.testing.assert_allclose(body.surface.albedo[0, 0], [0.2, 0.4, 0.6], atol=1e-3)
    np.testing.assert_allclose([body.surface.roughness.item(), body.surface.metallic.item()], [0.3, 1], atol=1e-6)
    np.testing.assert_allclose(body.uv, [[0, 0], [1, 0], [0, 1]], atol=1e-6)  # glTF's v runs down, too


def test_colours_of_vertices_become_texels(tmp_path):
    ball = trimesh.creation.icosphere(1)
    ball.visual.vertex_colors = np.where(ball.vertices[:, :1] > 0, [[255, 0, 0, 255]], [[0, 0, 255, 255]])
    ball.export(tmp_path / "ball.ply")
    (body,) = read_model(tmp_path / "ball.ply").parts
    albedo, uv = body.surface.albedo, body.uv
    h, w = albedo.shape[:2]
    seen = albedo[(uv[:, 1] * h).astype(int), (uv[:, 0] * w).astype(int)]
    right = body.vertices[body.faces][:, :, 0].min(1) > 0.1
    np.testing.assert_allclose(seen[body.faces[right].ravel()], np.tile(RED, (3 * right.sum(), 1)), atol=1e-3)


@pytest.mark.parametrize("where", ["../secret.mtl", "/etc/hostname", "sub/../../secret.mtl", "http://a.b/c.mtl"])
def test_material_files_outside_are_never_followed(tmp_path, where):
    (tmp_path / "secret.mtl").write_text("newmtl paint\nKd 1 0 0\n")
    (tmp_path / "in" / "sub").mkdir(parents=True)
    path = textured_obj(tmp_path / "in", mtl=where)
    with pytest.raises(InputError, match="outside of its folder"):
        read_model(path)


@pytest.mark.parametrize("where", ["../secret.png", "..\\secret.png", "file:///etc/hostname", "link.png"])
def test_textures_outside_are_never_followed(tmp_path, where):
    (tmp_path / "in").mkdir()
    Image.new("RGB", (2, 2), (255, 0, 0)).save(tmp_path / "secret.png")
    (tmp_path / "in" / "link.png").symlink_to(tmp_path / "secret.png")
    with pytest.raises(InputError, match="outside of its folder"):
        read_model(textured_obj(tmp_path / "in", texture=where))


@pytest.mark.parametrize("uri", ["../tri.bin", "%2e%2e/tri.bin", "http://a.b/tri.bin", "file:tri.bin", "/tri.bin"])
def test_gltf_addresses_outside_are_never_followed(tmp_path, uri):
    (tmp_path / "in").mkdir()
    gltf_file(tmp_path, "tri.bin")
    with pytest.raises(InputError, match="outside of its folder"):
        read_model(gltf_file(tmp_path / "in", uri))
    with pytest.raises(InputError, match="outside of its folder"):
        read_model(gltf_file(tmp_path / "in", "tri.bin", image=uri))


def test_missing_textures_are_told_and_a_constant_serves(tmp_path):
    model = read_model(textured_obj(tmp_path, texture="gone.png"))
    assert any("gone.png is missing" in note for note in model.warnings)
    np.testing.assert_allclose(model.parts[0].surface.albedo, 0.5)
    model = read_model(gltf_file(tmp_path, "tri.bin", image="gone.png"))
    assert any("gone.png is missing" in note for note in model.warnings)
    with pytest.raises(InputError, match=r"gone\.bin"):
        read_model(gltf_file(tmp_path, "gone.bin"))


@pytest.mark.parametrize("key", ["map_Kd", "map_Pr"])
@pytest.mark.parametrize("what", ["damaged", "huge", "missing"])
def test_a_map_of_an_mtl_that_cannot_be_had_is_told(tmp_path, monkeypatch, key, what):
    from PIL import Image

    if what != "missing":
        Image.fromarray(np.full((64, 64, 3), 200, np.uint8)).save(tmp_path / "c.png")
    if what == "damaged":
        (tmp_path / "c.png").write_bytes(b"no picture")
    if what == "huge":
        monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 500)
    (tmp_path / "m.mtl").write_text(f"newmtl a\nKd 1 0 0\n{key} c.png\n")
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
    (tmp_path / "m.obj").write_text(f"mtllib m.mtl\nusemtl a\n{corners}f 1/1 2/2 3/3\n")
    model = read_model(tmp_path / "m.obj")
    wanted = "c.png is missing" if what == "missing" else "a texture cannot be read"
    assert len([note for note in model.warnings if wanted in note]) == 1, model.warnings
    np.testing.assert_allclose(model.parts[0].surface.albedo, [[[1, 0, 0]]])


def test_what_an_mtl_says_beyond_its_colours(tmp_path):
    """Glow is taken, options before a texture's name are not part of it, and what is not shown is told."""
    from PIL import Image

    for name in ("c.png", "my wood 2.png"):
        Image.fromarray(np.full((4, 4, 3), 255, np.uint8)).save(tmp_path / name)
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
    (tmp_path / "m.obj").write_text(f"mtllib m.mtl\nusemtl a\n{corners}f 1/1 2/2 3/3\n")

    def read(lines):
        (tmp_path / "m.mtl").write_text(f"newmtl a\nKd 1 0 0\n{lines}\n")
        return read_model(tmp_path / "m.obj")

    assert read("Ke 2 1 0").parts[0].surface.emission == (2.0, 1.0, 0.0)
    scaled = read("map_Kd -s 2 2 1 c.png")
    np.testing.assert_allclose(scaled.parts[0].surface.albedo, 1.0)
    assert ["such as -s" in note for note in scaled.warnings] == [True]
    for line in (
        "-o 0.5 -bm 1e-1 -mm 0 1 c.png",
        "-clamp on my wood 2.png",
        "my wood 2.png",
        "-s 2 2 my wood 2.png",
        "-s 1 1 1 -colorspace sRGB c.png",
    ):
        assert read(f"map_Kd {line}").parts[0].surface.albedo.mean() == 1
    assert read("map_Kd -s 2 2 1 c.png\r").parts[0].surface.albedo.mean() == 1, "as Windows ends lines"
    assert read("Ke nan inf -1").parts[0].surface.emission == (0.0, 0.0, 0.0)
    for lines, words in (("d 0.4", "transparency"), ("Tr 0.3", "transparency"), ("map_Bump -bm 0.5 c.png", "bump")):
        assert [words in note for note in read(lines).warnings] == [True], lines
    assert not read("d 1\nTr 0\nKe 0 0 0").warnings


def test_a_damaged_texture_is_told(tmp_path):
    path = textured_obj(tmp_path)
    good = (tmp_path / "quad.png").read_bytes()
    (tmp_path / "quad.png").write_bytes(good[: len(good) * 2 // 3])
    model = read_model(path)
    assert any("cannot be read" in note for note in model.warnings)
    np.testing.assert_allclose(model.parts[0].surface.albedo, 0.5)


def test_a_texture_that_is_far_too_large_is_told(tmp_path):
    """Of a material file's own maps, which PIL refuses by its header alone."""
    path = textured_obj(tmp_path)
    header = struct.pack(">IIBBBBB", 60000, 60000, 8, 2, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(bytes(1000))), (b"IEND", b""))
    chunks = [struct.pack(">I", len(x)) + n + x + struct.pack(">I", zlib.crc32(n + x)) for n, x in parts]
    (tmp_path / "huge.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))
    material = next(tmp_path.glob("*.mtl"))
    material.write_text(material.read_text() + "\nmap_Pr huge.png\n")
    model = read_model(path)
    assert any("cannot be read" in note for note in model.warnings)
    with pytest.raises(InputError, match="too large an image"):
        read_map(tmp_path / "huge.png")


def write(path, content):
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_bad_meshes_have_a_sentence_each(tmp_path):
    obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    bad = [
        (write(tmp_path / "a.obj", ""), "is empty"),
        (write(tmp_path / "b.obj", "v 0 0 0\nv 1 0 0\n"), "no triangles"),
        (write(tmp_path / "c.obj", obj.replace("v 0 1 0", "v nan 1 0")), "NaN"),
        (write(tmp_path / "d.obj", obj.replace("v 0 1 0", "v 2 0 0")), "no triangles"),
        (write(tmp_path / "e.obj", obj.replace("f 1 2 3", "f 1 2 9")), "mesh|readable"),
        (write(tmp_path / "f.glb", b"glTF" + b"\0" * 40), "not a readable GLB"),
        (write(tmp_path / "g.fbx", "x"), "ends in"),
        (tmp_path / "missing.obj", "cannot be read"),
        (write(tmp_path / "h.ply", "ply\nformat ascii 1.0\nelement face 10000000\nend_header\n"), "Decimate"),
        (write(tmp_path / "i.stl", b"\0" * 80 + (10**7).to_bytes(4, "little") + b"\0" * 100), "mesh|readable|tri"),
    ]  # fmt: skip
    for path, sentence in bad:
        with pytest.raises(InputError, match=sentence) as error:
            read_model(path)
        assert "\n" not in str(error.value)
    with pytest.raises(InputError, match="points up"):
        read_model(box_file(tmp_path / "box.ply"), up="x")


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
    assert ((body.vertices * body.normals).sum(1) > 0).all()


def ball(radius, centre, inwards=False):
    made = trimesh.creation.icosphere(subdivisions=1, radius=radius).apply_translation(centre)
    return trimesh.Trimesh(made.vertices, made.faces[:, ::-1] if inwards else made.faces, process=False)


@pytest.mark.parametrize("wrong", [(0,), (1,), (0, 1), (2,), (0, 1, 2)])
def test_each_piece_looks_outwards_and_a_cavity_inwards(tmp_path, wrong):
    """Two balls apart, the larger with a cavity; what is wound the wrong way in the file is found piece by piece."""
    balls = [ball(1, (0, 0, 0), 0 in wrong), ball(0.5, (3, 0, 0), 1 in wrong), ball(0.4, (0.2, 0, 0), 2 not in wrong)]
    together = trimesh.util.concatenate(balls)
    together.export(tmp_path / "a.ply")
    (body,) = read_model(tmp_path / "a.ply").parts
    corners = body.vertices[body.faces]
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for centre, out in (((0, 0, 0), True), ((3, 0, 0), True), ((0.2, 0, 0), None)):
        radius = {0: 1, 3: 0.5, 0.2: 0.4}[centre[0]]
        chosen = (np.abs(np.linalg.norm(corners - np.array(centre), axis=-1) - radius) < 1e-3).all(1)
        away = ((corners[chosen].mean(1) - centre) * flat[chosen]).sum(-1) > 0
        normals = ((corners[chosen] - centre) * body.normals[body.faces[chosen]]).sum(-1) > 0
        assert chosen.any() and (away == away[0]).all() and (normals == away[0]).all()
        if out is None:  # inside another: with the rest, as the file has it
            assert away[0] == ((2 in wrong) != (0 in wrong))
        else:
            assert away[0]


def test_open_pieces_stay_as_they_are(tmp_path):
    half = ball(1, (0, 0, 0), True)
    half.update_faces(np.arange(len(half.faces)) > 4)
    trimesh.util.concatenate([half, ball(0.5, (3, 0, 0), True)]).export(tmp_path / "a.ply")
    (body,) = read_model(tmp_path / "a.ply").parts
    far = body.vertices[:, :1] > 2
    away = ((body.vertices - np.where(far, [3, 0, 0], 0)) * body.normals).sum(1) > 0
    assert (away == far[:, 0]).all()


def test_other_materials(tmp_path):
    model = read_model(box_file(tmp_path / "box.ply"))
    assert repainted(model, "as-is") is model
    glass = repainted(model, "glass").parts[0].surface
    assert (glass.transmission, glass.ior) == (1, 1.5)
    mirror = repainted(model, "mirror").parts[0].surface
    assert mirror.metallic.min() == 1 and mirror.albedo.min() > 0.9 and mirror.roughness.max() < 0.1
    np.testing.assert_allclose(repainted(model, "#ff0000").parts[0].surface.albedo[0, 0], RED)
    np.testing.assert_allclose(repainted(model, "0.1,0.2,0.3").parts[0].surface.albedo[0, 0], [0.1, 0.2, 0.3])
    with pytest.raises(InputError, match="as-is, glass, mirror"):
        repainted(model, "wood")


def red_ball(*, spare=False, flat=False):
    """A red icosphere of radius 1, with a vertex of no face far away, or with a face without an area."""
    ball = trimesh.creation.icosphere(2)
    ball.visual.vertex_colors = np.tile(np.array([255, 0, 0, 255], np.uint8), (len(ball.vertices), 1))
    vertices, faces = ball.vertices, ball.faces
    if spare:
        vertices = np.concatenate([vertices, [[50.0, 50.0, 50.0]]])
    if flat:
        faces = np.concatenate([faces, [[0, 0, 1]]])
    colours = np.tile(np.array([255, 0, 0, 255], np.uint8), (len(vertices), 1))
    normals = np.concatenate([ball.vertices, np.tile([[0.0, 0.0, 1.0]], (int(spare), 1))])
    return trimesh.Trimesh(vertices, faces, vertex_normals=normals, vertex_colors=colours, process=False)


def test_a_face_without_an_area_leaves_the_colours(tmp_path):
    red_ball(flat=True).export(tmp_path / "ball.ply")
    (body,) = read_model(tmp_path / "ball.ply").parts
    assert len(body.faces) == 320
    used = body.surface.albedo.reshape(-1, 3)[:320]
    np.testing.assert_allclose(used, np.tile(RED, (320, 1)), atol=1e-6)


def test_a_vertex_of_no_face_is_nowhere(tmp_path):
    ball = red_ball(spare=True)
    ball.visual = trimesh.visual.ColorVisuals()
    ball.export(tmp_path / "ball.ply", vertex_normal=True)
    model = read_model(tmp_path / "ball.ply")
    np.testing.assert_allclose(np.ptp(model.vertices, axis=0), [2, 2, 2], atol=0.1)


def test_a_mesh_far_from_its_origin_keeps_its_shape(tmp_path):
    lines = (tmp_path / "box.obj", (0.2, 0.3, 0.4))
    text = []
    for line in box_file(*lines).read_text().splitlines():
        word = line.split()
        if word[:1] == ["v"]:
            moved = np.add(np.array(word[1:4], float), (500000, 4000000, 100))
            line = "v " + " ".join(f"{c:.4f}" for c in moved)
        text.append(line)
    (tmp_path / "far.obj").write_text("\n".join(text))
    np.testing.assert_allclose(np.ptp(read_model(tmp_path / "far.obj").vertices, axis=0), [0.2, 0.3, 0.4], atol=1e-3)
    near = read_model(tmp_path / "box.obj").vertices
    np.testing.assert_allclose(near[:, 1].min(), 0, atol=1e-6)


@pytest.mark.parametrize("lines", ["", "mtllib none.mtl\nusemtl a\n", "mtllib plain.mtl\nusemtl b\n"])
def test_coordinates_without_a_texture_are_the_usual_grey(tmp_path, lines):
    """trimesh makes up a dark picture there."""
    (tmp_path / "plain.mtl").write_text("newmtl a\nKd 1 0 0\n")
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n" + lines + "f 1/1 2/2 3/3\n"
    (tmp_path / "a.obj").write_text(text)
    assert np.unique(read_model(tmp_path / "a.obj").parts[0].surface.albedo) == 0.5


@pytest.mark.parametrize("wide", [40, 5000])
def test_greys_of_16_bits_keep_their_values(tmp_path, wide):
    values = np.linspace(0, 65535, wide).astype(np.uint16)[None].repeat(4, 0)
    Image.fromarray(values).save(tmp_path / "rough.png")
    Image.fromarray(values).save(tmp_path / "colour.png")
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd colour.png\nmap_Pr rough.png\n")
    (tmp_path / "a.obj").write_text(
        "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n"
    )
    surface = read_model(tmp_path / "a.obj").parts[0].surface
    assert surface.roughness.shape[1] == min(wide, 4096)
    np.testing.assert_allclose(surface.roughness[0], np.linspace(0, 1, surface.roughness.shape[1]), atol=1e-3)
    np.testing.assert_allclose(surface.albedo[0, :, 1], srgb_to_linear(surface.roughness[0]), atol=2e-3)
