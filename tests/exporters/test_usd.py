"""The USD stage, read back and put before the official validators."""

import sys

import numpy as np
import pytest
from export_scenes import room

import materialist as mt
from materialist.exporters.parts import scene_parts

pxr = pytest.importorskip("pxr", reason="needs usd-core: pip install 'materialist[usd]'")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("usd")
    return folder, [mt.export(room(), folder / name, to="usd").path for name in ("room.usdz", "room")]


def test_official_validators(written):
    from pxr import Usd, UsdGeom, UsdValidation

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
    from pxr import Usd, UsdGeom

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
    view = np.array(camera.transform)
    np.testing.assert_array_equal(view, np.eye(4))


def test_the_centre_of_the_light_lies_ahead(written):
    """OpenEXR's latlong, which a dome light uses, has +Z in its centre and +X at a quarter of its width."""
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(written[1][1]))
    turn = np.array(UsdGeom.Xformable(stage.GetPrimAtPath("/Scene/Light")).ComputeLocalToWorldTransform(0))[:3, :3]
    np.testing.assert_allclose(np.array([0, 0, 1]) @ turn, [0, 0, -1], atol=1e-12)
    # Ours turns to +X to the right of the centre: three quarters of the width, OpenEXR's -X.
    np.testing.assert_allclose(np.array([-1, 0, 0]) @ turn, [1, 0, 0], atol=1e-12)


def test_without_the_extra(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pxr", None)
    monkeypatch.delitem(sys.modules, "materialist.exporters.usd", raising=False)
    with pytest.raises(mt.SetupError, match=r"pip install 'materialist\[usd\]'"):
        mt.export(room(), tmp_path / "a.usdz")
    assert list(tmp_path.iterdir()) == []
