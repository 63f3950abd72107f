"""What trimesh leaves out of glTF files."""

import numpy as np
import pytest
from made_meshes import TETRAHEDRON, box_file, floor_scene, tetrahedron_glb

from materialist.edit.insert import insert
from materialist.edit.meshes import read_model
from materialist.errors import InputError
from materialist.export.run import export

FLOAT, BYTE, SHORT = 5126, 5121, 5123
MATT = {"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.3}}


def half_red(alpha=1.0):
    return np.tile(np.array([0.5, 0, 0, alpha], "<f4"), (4, 1))


def shade(body):
    """[3] the albedo where the body's texture coordinates point."""
    texture = body.surface.albedo
    column = (body.uv[:, 0] * texture.shape[1]).astype(int) % texture.shape[1]
    row = (body.uv[:, 1] * texture.shape[0]).astype(int) % texture.shape[0]
    return texture[row, column]


def test_colours_of_vertices_are_linear_and_multiply_the_material(tmp_path):
    alone = read_model(tetrahedron_glb(tmp_path / "a.glb", COLOR_0=(half_red(), FLOAT, False)))
    np.testing.assert_allclose(shade(alone.parts[0]), np.tile([0.5, 0, 0], (12, 1)), atol=0.005)
    paint = {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1], "metallicFactor": 0.0}}
    both = read_model(tetrahedron_glb(tmp_path / "b.glb", paint, COLOR_0=(half_red(), FLOAT, False)))
    np.testing.assert_allclose(shade(both.parts[0]), np.tile([0.25, 0, 0], (12, 1)), atol=0.005)
    assert not both.warnings


def test_normalized_texture_coordinates(tmp_path):
    uv = np.array([[0, 0], [65535, 0], [0, 65535], [65535, 65535]], "<u2")
    (body,) = read_model(tetrahedron_glb(tmp_path / "a.glb", MATT, TEXCOORD_0=(uv, SHORT, True))).parts
    for place, wanted in zip(TETRAHEDRON, uv / 65535, strict=True):
        here = (body.vertices == place).all(1)
        np.testing.assert_allclose(body.uv[here], np.tile(wanted, (here.sum(), 1)), atol=1e-6)


def test_quantized_positions(tmp_path):
    path = tetrahedron_glb(tmp_path / "a.glb", MATT, ("KHR_mesh_quantization",))
    plain = read_model(path).vertices
    places = np.pad((TETRAHEDRON * 65535).astype("<u2"), [(0, 0), (0, 1)])
    whole = tetrahedron_glb(
        tmp_path / "b.glb", MATT, ("KHR_mesh_quantization",), POSITION=(places[:, :3].copy(), SHORT, True)
    )
    np.testing.assert_allclose(read_model(whole).vertices, plain, atol=1e-5)


def test_tiles_and_what_is_left_out(tmp_path):
    from materialist.edit.mesh_gltf import left_out, tiled

    move = {"KHR_texture_transform": {"scale": [2, 3], "offset": [0.5, 0]}}
    reference = {"index": 0, "extensions": move}
    material = {"pbrMetallicRoughness": {"baseColorTexture": reference}, "normalTexture": {"index": 0}}
    np.testing.assert_allclose(tiled(np.array([[0.5, 1.0]]), material), [[1.5, 3.0]])
    assert left_out([material]) == ["its normal map"]
    move["KHR_texture_transform"]["rotation"] = 1.0
    assert "turned" in " ".join(left_out([material]))
    glowing = {"emissiveFactor": [1, 1, 1], "emissiveTexture": {"index": 0}, "alphaMode": "BLEND"}
    path = tetrahedron_glb(tmp_path / "a.glb", {**MATT, "emissiveFactor": [0, 0, 0], "alphaMode": "BLEND"})
    assert read_model(path).warnings == ("a.glb: its transparency (taken as opaque) left out.",)
    assert left_out([glowing])[0] == "its glowing texture"


def test_glass_and_glow(tmp_path):
    glass = {
        "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1], "roughnessFactor": 0.0, "metallicFactor": 0.0},
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 0.9}, "KHR_materials_ior": {"ior": 1.33},
        },
    }  # fmt: skip
    (body,) = read_model(tetrahedron_glb(tmp_path / "a.glb", glass)).parts
    assert body.surface.transmission == pytest.approx(0.9) and body.surface.ior == pytest.approx(1.33)
    np.testing.assert_allclose(body.surface.tint, [0.5, 1, 1])
    lamp = {**MATT, "emissiveFactor": [1, 0.5, 0],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}}}  # fmt: skip
    (body,) = read_model(tetrahedron_glb(tmp_path / "b.glb", lamp)).parts
    np.testing.assert_allclose(body.surface.emission, [4, 2, 0])


@pytest.mark.parametrize("metal", [False, True])
def test_specular_and_glossiness(tmp_path, metal):
    said = {"diffuseFactor": [1, 0, 0, 1], "glossinessFactor": 0.8, "specularFactor": [0.04] * 3}
    if metal:
        said |= {"diffuseFactor": [0, 0, 0, 1], "specularFactor": [0.9, 0.7, 0.3]}
    material = {"extensions": {"KHR_materials_pbrSpecularGlossiness": said}}
    path = tetrahedron_glb(tmp_path / "a.glb", material, ("KHR_materials_pbrSpecularGlossiness",))
    surface = read_model(path).parts[0].surface
    np.testing.assert_allclose(surface.albedo[0, 0], [0.9, 0.7, 0.3] if metal else [1, 0, 0], atol=1e-6)
    np.testing.assert_allclose([surface.metallic[0, 0], surface.roughness[0, 0]], [metal, 0.2], atol=1e-6)


def test_a_required_extension_that_is_not_read(tmp_path):
    path = tetrahedron_glb(tmp_path / "a.glb", None, ("KHR_draco_mesh_compression",))
    with pytest.raises(InputError, match="needs the glTF extension KHR_draco_mesh_compression"):
        read_model(path)


def test_our_own_glass_comes_back_as_glass(tmp_path):
    scene = insert(floor_scene(), box_file(tmp_path / "box.ply"), (24, 26), material="glass")
    export(scene, tmp_path / "scene.glb")
    back = read_model(tmp_path / "scene.glb")
    glass = [part.surface for part in back.parts if part.surface.transmission > 0]
    assert len(glass) == 1 and glass[0].transmission == 1 and glass[0].ior == pytest.approx(1.5)
