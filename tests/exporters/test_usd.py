"""The USD stage, read back and put before the official validators."""

from dataclasses import replace

import numpy as np
import pytest
from export_scenes import CHECKS, GLASS, GLOW, LAMP, room, with_bodies
from PIL import Image

pytest.importorskip("pxr", reason="needs usd-core: pip install 'materialist-photo[usd]'")
from pxr import Usd, UsdGeom, UsdLux, UsdShade, UsdValidation

import materialist as mt
from materialist.exporters.parts import scene_parts


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("usd")
    return folder, [
        mt.export(room(), folder / name, to="usd").path for name in ("room.usdz", "room")
    ]


def test_official_validators(written):
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    for path in written[1]:
        stage = Usd.Stage.Open(str(path))
        errors = UsdValidation.ValidationContext(validators).Validate(stage)
        assert [error.GetMessage() for error in errors] == []
    # They do find faults.
    stage.ClearDefaultPrim()
    UsdGeom.Mesh(stage.GetPrimAtPath("/Scene/surface")).GetFaceVertexCountsAttr().Set([3])
    assert UsdValidation.ValidationContext(validators).Validate(stage)


def test_the_stage_says_what_the_scene_says(written):
    scene = room()
    part = scene_parts(scene)[0]
    stage = Usd.Stage.Open(str(written[1][0]))
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Scene/surface"))
    np.testing.assert_array_equal(np.array(mesh.GetPointsAttr().Get()), part.mesh.vertices)
    st = np.array(UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st").Get())
    np.testing.assert_allclose(1 - st[:, 1], part.mesh.uv[:, 1], atol=1e-7)  # v up
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/Scene/Photo")).GetCamera()
    assert camera.GetFieldOfView(camera.FOVHorizontal) == pytest.approx(scene.camera.fov, abs=1e-4)
    assert camera.aspectRatio == pytest.approx(64 / 40)
    words = stage.GetRootLayer().customLayerData["materialist"]
    assert "no metre" in words["scale"] and "Rec.709" in stage.GetRootLayer().documentation
    view = np.array(camera.transform)
    np.testing.assert_array_equal(view, np.eye(4))


def test_the_centre_of_the_light_lies_ahead(written):
    """OpenEXR's latlong, which a dome light uses, has +Z in its centre and +X at a quarter of its width."""
    stage = Usd.Stage.Open(str(written[1][1]))
    turn = np.array(
        UsdGeom.Xformable(stage.GetPrimAtPath("/Scene/Light")).ComputeLocalToWorldTransform(0)
    )[:3, :3]
    np.testing.assert_allclose(np.array([0, 0, 1]) @ turn, [0, 0, -1], atol=1e-12)
    # Ours turns to +X to the right of the centre: three quarters of the width, OpenEXR's -X.
    np.testing.assert_allclose(np.array([-1, 0, 0]) @ turn, [1, 0, 0], atol=1e-12)


def test_bodies_have_textures_and_it_is_said_that_nothing_refracts(tmp_path):
    done = mt.export(with_bodies(CHECKS, GLASS), tmp_path / "usd", to="usd")
    assert any("without refraction and tint of glass;" in note for note in done.notes)
    np.testing.assert_array_equal(
        np.asarray(Image.open(tmp_path / "usd" / "body0_base_color.png")), CHECKS.albedo * 255
    )
    stage = Usd.Stage.Open(str(done.path))
    texture = UsdShade.Shader(stage.GetPrimAtPath("/Scene/Materials/body0/base_color"))
    assert (
        texture.GetInput("file").Get().path == "./body0_base_color.png"
        and texture.GetInput("wrapS").Get() == "repeat"
    )
    own = UsdShade.Shader(stage.GetPrimAtPath("/Scene/Materials/surface/base_color"))
    assert (
        own.GetInput("file").Get().path == "./base_color.png"
        and own.GetInput("wrapS").Get() == "clamp"
    )
    glass = UsdShade.Shader(stage.GetPrimAtPath("/Scene/Materials/body1/surface"))
    assert glass.GetInput("opacity").Get() == 0 and glass.GetInput("ior").Get() == pytest.approx(
        1.4
    )


def test_lamps_and_what_glows(tmp_path):
    scene = replace(with_bodies(GLOW), lamps=(LAMP,))
    stage = Usd.Stage.Open(str(mt.export(scene, tmp_path / "usd", to="usd").path))
    sphere = UsdLux.SphereLight(stage.GetPrimAtPath("/Scene/lamp0"))
    radiance = sphere.GetIntensityAttr().Get() * np.array(sphere.GetColorAttr().Get())
    np.testing.assert_allclose(radiance, LAMP.radiance, rtol=1e-5)
    place = UsdGeom.Xformable(sphere).ComputeLocalToWorldTransform(0).ExtractTranslation()
    np.testing.assert_allclose(place, LAMP.position)
    glow = (
        UsdShade.Shader(stage.GetPrimAtPath("/Scene/Materials/body0/surface"))
        .GetInput("emissiveColor")
        .Get()
    )
    np.testing.assert_allclose(glow, [3, 1.5, 0.75])
