"""What trimesh leaves out of glTF files."""

import numpy as np
import pytest
from made_meshes import TETRAHEDRON, box_file, floor_scene, tetrahedron_glb

from materialist.edits.insert.insert import insert
from materialist.edits.insert.meshes import read_model
from materialist.errors import InputError
from materialist.exporters.run import export

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
    from materialist.edits.insert.mesh_gltf import left_out, tiled

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


def glass_of(path, **extensions):
    material = {"pbrMetallicRoughness": {"metallicFactor": 0.0}, "extensions": extensions}
    return read_model(tetrahedron_glb(path, material))


def test_coloured_glass(tmp_path):
    """KHR_materials_volume: colour ** (thickness / distance), the base colour being white."""
    volume = {"attenuationColor": [0.25, 1, 0.81], "attenuationDistance": 0.4, "thicknessFactor": 0.2}
    clear = {"KHR_materials_transmission": {"transmissionFactor": 1.0}}
    model = glass_of(tmp_path / "a.glb", **clear, KHR_materials_volume=volume)
    np.testing.assert_allclose(model.parts[0].surface.tint, [0.5, 1, 0.9], rtol=1e-6)
    thin = {"attenuationColor": [0.25, 1, 0.81], "thicknessFactor": 0.2}  # light is never absorbed
    np.testing.assert_allclose(
        glass_of(tmp_path / "b.glb", **clear, KHR_materials_volume=thin).parts[0].surface.tint, [1, 1, 1]
    )


def test_what_is_glass_by_a_texture_stays_opaque_and_that_is_told(tmp_path):
    windows = {"transmissionFactor": 1.0, "transmissionTexture": {"index": 0}}
    model = glass_of(tmp_path / "a.glb", KHR_materials_transmission=windows)
    assert model.parts[0].surface.transmission == 0 and "what is glass in it" in model.warnings[0]


def test_what_is_shown_without_light_is_matt(tmp_path):
    model = read_model(tetrahedron_glb(tmp_path / "a.glb", {"extensions": {"KHR_materials_unlit": {}}}))
    surface = model.parts[0].surface
    assert (surface.metallic.max(), surface.roughness.min()) == (0, 1) and "KHR_materials_unlit" in model.warnings[0]


@pytest.mark.parametrize(
    "name, said, told",
    [("clearcoat", {"clearcoatFactor": 1.0}, True), ("clearcoat", {}, False), ("specular", {"specularFactor": 1}, 0),
     ("sheen", {"sheenColorFactor": [0.2, 0, 0]}, True), ("dispersion", {"dispersion": 3}, True)],
)  # fmt: skip
def test_layers_that_are_not_shown_are_told(tmp_path, name, said, told):
    model = glass_of(tmp_path / "a.glb", **{f"KHR_materials_{name}": said})
    assert bool(model.warnings) == told and all(name in note for note in model.warnings)


def test_a_transform_of_roughness_alone(tmp_path):
    from materialist.edits.insert.mesh_gltf import left_out, tiled

    move = {"index": 0, "extensions": {"KHR_texture_transform": {"scale": [2, 3]}}}
    alone = {"pbrMetallicRoughness": {"metallicRoughnessTexture": move}}
    np.testing.assert_allclose(tiled(np.array([[0.5, 1.0]]), alone), [[1, 3]])
    assert left_out([alone]) == []
    both = {"pbrMetallicRoughness": {"metallicRoughnessTexture": move, "baseColorTexture": {"index": 0}}}
    np.testing.assert_allclose(tiled(np.array([[0.5, 1.0]]), both), [[0.5, 1]])
    assert "turned" in left_out([both])[0]


def test_extensions_that_are_no_objects_are_passed_over(tmp_path):
    odd = {"KHR_materials_transmission": 3, "KHR_materials_volume": None, "KHR_materials_sheen": []}
    assert glass_of(tmp_path / "a.glb", **odd).parts[0].surface.transmission == 0
    odd = {"KHR_materials_transmission": {"transmissionFactor": 1}, "KHR_materials_volume": {"attenuationColor": "red"}}
    assert glass_of(tmp_path / "b.glb", **odd).parts[0].surface.tint == (1, 1, 1)


def test_fans_are_told(tmp_path):
    import json

    path = tetrahedron_glb(tmp_path / "a.glb", MATT)
    data = path.read_bytes()
    length = int.from_bytes(data[12:16], "little")
    header = json.loads(data[20 : 20 + length])
    fan = {**header["meshes"][0]["primitives"][0], "mode": 6}
    header["meshes"].append({"primitives": [fan]})
    header["nodes"].append({"mesh": len(header["meshes"]) - 1})
    header["scenes"][0]["nodes"].append(len(header["nodes"]) - 1)
    from materialist.edits.insert.mesh_gltf import _with_header

    path.write_bytes(_with_header(data, header))
    assert any("triangle fans" in note for note in read_model(path).warnings)
