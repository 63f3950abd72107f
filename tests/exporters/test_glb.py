"""The GLB, read back by another program."""

import io
import json
import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from export_scenes import document, room
from made_meshes import box_file

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
def loaded():
    """(scene, name -> mesh that trimesh reads)."""
    scene = room()
    data = glb_bytes(scene, scene_parts(scene))
    return scene, trimesh.load_scene(io.BytesIO(data), file_type="glb", process=False).geometry


def test_the_surface_looks_up_its_own_pixel(loaded):
    scene, meshes = loaded
    surface = meshes["surface"]
    uv = surface.visual.uv * [1, -1] + [0, 1]  # trimesh turns v up
    # Through the camera of the file, a triangle's middle lies in the texel that its middle looks up. The first two
    # triangles of every pixel are the surface; later ones are continued under silhouettes.
    camera = document(scene)["cameras"][0]["perspective"]
    middle = surface.vertices[surface.faces].mean(1)  # [F, 3]
    up = np.tan(camera["yfov"] / 2)
    column = (middle[:, 0] / -middle[:, 2] / (up * camera["aspectRatio"]) + 1) / 2 * 64
    row = (1 - middle[:, 1] / -middle[:, 2] / up) / 2 * 40
    texel = uv[surface.faces].mean(1) * (64, 40)
    seen = 2 * int((scene.depth > 0).sum())
    assert (np.floor(np.stack([column, row], 1)) == np.floor(texel))[:seen].mean() > 0.99
    np.testing.assert_allclose(
        np.stack([column, row], 1), project(middle, scene.camera)[0], atol=1e-3
    )


def test_textures_those_of_planes_of_one_pixel(loaded):
    scene, meshes = loaded
    parts = {part.name: part.materials for part in scene_parts(scene)}
    for name, size in (("surface", (40, 64, 3)), ("plane1", (1, 1, 3))):
        materials = parts[name]
        found = meshes[name].visual.material
        color, packed = (
            np.asarray(t)[..., :3] for t in (found.baseColorTexture, found.metallicRoughnessTexture)
        )
        assert color.shape == packed.shape == size
        assert np.abs(color / 255 - linear_to_srgb(materials.albedo)).max() <= 0.5 / 255 + 1e-6
        assert np.abs(packed[..., 1] / 255 - materials.roughness).max() <= 0.5 / 255 + 1e-6
        assert np.abs(packed[..., 2] / 255 - materials.metallic).max() <= 0.5 / 255 + 1e-6
    assert all(material["doubleSided"] for material in document(scene)["materials"])


def test_the_light_beside_it(tmp_path):
    write_hdr(tmp_path / "a.hdr", room().envmap)
    back = cv2.imdecode(np.fromfile(tmp_path / "a.hdr", np.uint8), cv2.IMREAD_UNCHANGED)[..., ::-1]
    assert np.abs(back - room().envmap).max() < room().envmap.max() / 128


def test_official_validator(tmp_path):
    """Needs node and the npm package gltf-validator, installed globally or where NODE_PATH says."""
    if shutil.which("node") is None:
        pytest.skip("needs node")
    roots = (
        subprocess.run(["npm", "root", "-g"], capture_output=True, text=True)
        if shutil.which("npm")
        else None
    )
    paths = [os.environ.get("NODE_PATH", ""), roots.stdout.strip() if roots else ""]
    if not any(
        (Path(p) / "gltf-validator").is_dir() for path in paths for p in path.split(os.pathsep) if p
    ):
        pytest.skip("needs the npm package gltf-validator (npm install -g gltf-validator)")
    file = tmp_path / "room.glb"
    environment = os.environ | {"NODE_PATH": os.pathsep.join(path for path in paths if path)}
    glass = repainted(read_model(box_file(tmp_path / "box.ply")), "glass")
    for scene in (
        room(completion="planes"),
        room(completion="none"),
        replace(room(), bodies=glass.parts),
    ):
        file.write_bytes(glb_bytes(scene, [*scene_parts(scene), *body_parts(scene)]))
        done = subprocess.run(
            ["node", "-e", VALIDATE, str(file)], capture_output=True, text=True, env=environment
        )
        issues = json.loads(done.stdout)
        assert issues["numErrors"] == issues["numWarnings"] == 0, issues["messages"]
