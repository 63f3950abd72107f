"""The GLB, read back by another program's rules."""

import io
import json
import shutil
import struct
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from export_scenes import room
from made_meshes import box_file
from PIL import Image

from materialist.camera import project
from materialist.color import linear_to_srgb
from materialist.edits.insert.meshes import read_model, repainted
from materialist.exporters.glb import glb_bytes, write_hdr
from materialist.exporters.parts import body_parts, scene_parts

VALIDATE = """
const validator = require('gltf-validator');
validator.validateBytes(new Uint8Array(require('fs').readFileSync(process.argv[1])))
  .then((report) => console.log(JSON.stringify(report.issues)));
"""


@pytest.fixture(scope="module")
def parsed():
    """(scene, parts, JSON, binary chunk)."""
    scene = room()
    parts = scene_parts(scene)
    data = glb_bytes(scene, parts)
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert kind == b"JSON"
    binary_size, kind = struct.unpack_from("<I4s", data, 20 + size)
    assert kind == b"BIN\0" and 28 + size + binary_size == len(data)
    return scene, parts, json.loads(data[20 : 20 + size]), data[28 + size :]


def values(document, binary, index):
    """An accessor's values [N, components]."""
    accessor = document["accessors"][index]
    view = document["bufferViews"][accessor["bufferView"]]
    kind = {5126: "<f4", 5125: "<u4"}[accessor["componentType"]]
    columns = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}[accessor["type"]]
    data = np.frombuffer(binary, kind, accessor["count"] * columns, view["byteOffset"])
    return data.reshape(-1, columns)


def picture(document, binary, index):
    view = document["bufferViews"][document["images"][index]["bufferView"]]
    data = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    return np.asarray(Image.open(io.BytesIO(data)))


def test_the_surface_looks_up_its_own_pixel(parsed):
    scene, _, document, binary = parsed
    primitive = document["meshes"][0]["primitives"][0]
    vertices, uv = (values(document, binary, primitive["attributes"][k]) for k in ("POSITION", "TEXCOORD_0"))
    faces = values(document, binary, primitive["indices"]).reshape(-1, 3)
    # Through the camera of the file, a triangle's middle lies in the texel that its middle looks up. The first two
    # triangles of every pixel are the surface; later ones are continued under silhouettes.
    camera = document["cameras"][0]["perspective"]
    middle = vertices[faces].mean(1)  # [F, 3]
    up = np.tan(camera["yfov"] / 2)
    column = (middle[:, 0] / -middle[:, 2] / (up * camera["aspectRatio"]) + 1) / 2 * 64
    row = (1 - middle[:, 1] / -middle[:, 2] / up) / 2 * 40
    texel = uv[faces].mean(1) * (64, 40)
    seen = 2 * int((scene.depth > 0).sum())
    assert (np.floor(np.stack([column, row], 1)) == np.floor(texel))[:seen].mean() > 0.99
    expected = project(middle, scene.camera)[0]
    np.testing.assert_allclose(np.stack([column, row], 1), expected, atol=1e-3)


def test_textures(parsed):
    scene, _, document, binary = parsed
    materials = scene.materials
    color, packed = picture(document, binary, 0), picture(document, binary, 1)
    assert color.shape == packed.shape == (40, 64, 3)
    assert np.abs(color / 255 - linear_to_srgb(materials.albedo)).max() <= 0.5 / 255 + 1e-6
    assert np.abs(packed[..., 1] / 255 - materials.roughness).max() <= 0.5 / 255 + 1e-6
    assert np.abs(packed[..., 2] / 255 - materials.metallic).max() <= 0.5 / 255 + 1e-6
    assert all(material["doubleSided"] for material in document["materials"])


def test_planes_have_textures_of_one_pixel(parsed):
    _, parts, document, binary = parsed
    pbr, m = document["materials"][2]["pbrMetallicRoughness"], parts[2].materials
    color, packed = (
        picture(document, binary, pbr[k]["index"]) for k in ("baseColorTexture", "metallicRoughnessTexture")
    )
    assert np.abs(color[0, 0] / 255 - linear_to_srgb(m.albedo[0, 0])).max() <= 0.5 / 255 + 1e-6
    assert packed[0, 0, 1] / 255 == pytest.approx(float(m.roughness[0, 0]), abs=0.5 / 255)


def test_the_light_beside_it(tmp_path):
    import cv2

    write_hdr(tmp_path / "a.hdr", room().envmap)
    back = cv2.imdecode(np.fromfile(tmp_path / "a.hdr", np.uint8), cv2.IMREAD_UNCHANGED)[..., ::-1]
    assert np.abs(back - room().envmap).max() < room().envmap.max() / 128


def test_official_validator(tmp_path):
    """Needs node and the npm package gltf-validator, installed globally or where NODE_PATH says."""
    if shutil.which("node") is None:
        pytest.skip("needs node")
    import os

    roots = subprocess.run(["npm", "root", "-g"], capture_output=True, text=True) if shutil.which("npm") else None
    paths = [os.environ.get("NODE_PATH", ""), roots.stdout.strip() if roots else ""]
    if not any((Path(p) / "gltf-validator").is_dir() for path in paths for p in path.split(os.pathsep) if p):
        pytest.skip("needs the npm package gltf-validator (npm install -g gltf-validator)")
    file = tmp_path / "room.glb"
    environment = os.environ | {"NODE_PATH": os.pathsep.join(path for path in paths if path)}
    glass = repainted(read_model(box_file(tmp_path / "box.ply")), "glass")
    for scene in (room(completion="planes"), room(completion="none"), replace(room(), bodies=glass.parts)):
        file.write_bytes(glb_bytes(scene, [*scene_parts(scene), *body_parts(scene)]))
        done = subprocess.run(["node", "-e", VALIDATE, str(file)], capture_output=True, text=True, env=environment)
        issues = json.loads(done.stdout)
        assert issues["numErrors"] == issues["numWarnings"] == 0, issues["messages"]
