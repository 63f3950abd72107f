"""Inserted bodies in exports: their textures, their glass, and the picture that Mitsuba makes of them."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from export_scenes import (
    CHECKS,
    GLASS,
    GLOW,
    LAMP,
    blender_facts,
    document,
    renderer,
    room,
    with_bodies,
)

from materialist.edits.core.surfaces import uniform_surface
from materialist.exporters.glb import passing
from materialist.exporters.parts import body_parts
from materialist.exporters.run import export
from materialist.io.exr import read_exr
from materialist.render.scene import GLASS_DEPTH
from materialist.types import Body

FROSTED = uniform_surface(1.0, 0.9, 0.0, transmission=1.0, ior=1.5)
COATED = uniform_surface((0.2, 0.6, 0.3), 0.4, 0.0, transmission=0.5, ior=1.4)


def test_glb_has_textures_that_repeat_and_glass():
    scene = with_bodies(CHECKS, GLASS)
    content = document(scene)
    names = [node["name"] for node in content["nodes"]]
    assert names[-3:] == ["body0", "body1", "camera"]
    checks, glass = content["materials"][-2:]
    texture = content["textures"][checks["pbrMetallicRoughness"]["baseColorTexture"]["index"]]
    assert (
        content["samplers"][texture["sampler"]]["wrapS"] == 10497
        and len(document(room())["samplers"]) == 1
    )
    assert glass["extensions"]["KHR_materials_transmission"]["transmissionFactor"] == 1
    np.testing.assert_allclose(glass["extensions"]["KHR_materials_ior"]["ior"], 1.4)
    np.testing.assert_allclose(passing(body_parts(scene)[1]).albedo[0, 0], [0.9, 0.5, 0.4])
    assert content["extensionsUsed"] == [
        "KHR_materials_ior",
        "KHR_materials_transmission",
    ]  # the plates are open
    assert "extensionsUsed" not in document(room())


def test_glass_of_a_glb_has_the_mean_way_through_it():
    """A ball's is 4 r / 3; without any, viewers take glass for a thin wall."""
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.6)
    vertices = np.asarray(ball.vertices, np.float32)
    body = Body(
        vertices,
        np.asarray(ball.faces, np.int32),
        vertices / 0.6,
        np.zeros((len(vertices), 2), np.float32),
        GLASS,
    )
    content = document(replace(room(), bodies=(body,)))
    thick = content["materials"][-1]["extensions"]["KHR_materials_volume"]["thicknessFactor"]
    assert not content["materials"][-1]["doubleSided"], "as the extension demands"
    assert (
        thick == pytest.approx(0.8, rel=0.02)
        and "KHR_materials_volume" in content["extensionsUsed"]
    )


@pytest.mark.parametrize(
    "surface",
    [
        CHECKS,
        GLASS,
        GLOW,
        pytest.param(FROSTED, marks=pytest.mark.slow),
        pytest.param(COATED, marks=pytest.mark.slow),
    ],
    ids=["texture", "glass", "glow", "frosted", "coated"],
)
def test_mitsuba_renders_the_same_picture(tmp_path, surface):
    scene = with_bodies(surface)
    target = renderer(scene)
    expected = target.render(spp=64, seed=1, max_depth=GLASS_DEPTH)
    done = export(scene, tmp_path / "scene", to="mitsuba", residual=False)
    own = done.path.with_name("scene_materialist.xml")
    loaded = target.mi.load_file(str(own), parallel=False, spp=64, max_depth=GLASS_DEPTH)
    picture = np.array(target.mi.render(loaded, seed=2))[..., :3]
    plate = np.s_[16:24, 14:26]
    np.testing.assert_allclose(
        picture[plate].mean((0, 1)), expected[plate].mean((0, 1)), rtol=0.05, atol=0.01
    )
    np.testing.assert_allclose(picture.mean((0, 1)), expected.mean((0, 1)), rtol=0.03)


def test_what_a_format_does_not_show_is_told(tmp_path):
    scene = with_bodies(GLOW, GLASS, CHECKS)
    for to in ("blend", "mitsuba"):
        assert not any(
            "shows bodies without" in note for note in export(scene, tmp_path / to, to=to).notes
        )
    notes = export(scene, tmp_path / "a.html").notes
    assert any(
        "without textures but for their colours at the vertices and glass and glow;" in note
        for note in notes
    )
    mixed = with_bodies(uniform_surface(0.2, 0.1, 0.0, transmission=0.9))
    assert any(
        "transmission is below 1" in note
        for note in export(mixed, tmp_path / "m", to="mitsuba").notes
    )


def test_blender_gets_textures_glass_and_glow(tmp_path):
    """What Cycles makes of them: test_blender.py."""
    coat = uniform_surface(0.2, 0.01, 0.0, transmission=0.9, tint=(0.25, 1.0, 0.81))
    facts = blender_facts(with_bodies(GLOW, coat, CHECKS), tmp_path / "folder")
    parts = facts["parts"]
    assert parts["body0"]["emission"] == [3.0, 1.5, 0.75] and "glass" not in parts["body0"]
    assert parts["body1"]["glass"] == {
        "share": 0.9,
        "ior": 1.5,
        "roughness": 0.0,
        "tint": [0.25, 1.0, 0.81],
    }
    assert parts["surface"] == {"maps": "", "repeat": False} and parts["body2"] == {
        "maps": "body2_",
        "repeat": True,
    }
    np.testing.assert_array_equal(read_exr(tmp_path / "folder/body2_albedo.exr"), CHECKS.albedo)
    assert facts["bounces"] == 14
    assert blender_facts(with_bodies(CHECKS), tmp_path / "plain")["bounces"] == 2


def test_lamps_leave_for_gltf_and_blender(tmp_path):
    scene = replace(with_bodies(GLOW), lamps=(LAMP,))
    content = document(scene)
    (light,) = content["extensions"]["KHR_lights_punctual"]["lights"]
    np.testing.assert_allclose(
        light["intensity"] * 4 * np.pi * np.array(light["color"]), LAMP.power
    )
    (node,) = [node for node in content["nodes"] if node["name"] == "lamp0"]
    assert (
        node["translation"] == [0.9, 0.3, -2.6]
        and "KHR_lights_punctual" in content["extensionsUsed"]
    )
    blender = blender_facts(scene, tmp_path / "blend")
    assert blender["lamps"] == [
        {"position": [0.9, 0.3, -2.6], "power": [6.0, 4.5, 3.0], "radius": 0.12}
    ]
    done = export(scene, tmp_path / "again", to="blend")
    assert not any("none of the scene" in note for note in done.notes)
    assert any(
        "none of the scene's 1 lamp" in note for note in export(scene, tmp_path / "a.html").notes
    )


def test_bodies_that_the_photo_lacks_catch_no_shadows(tmp_path):
    """They are what is to be seen; those of a saved edit are in the photo."""
    scene = with_bodies(GLOW, CHECKS)

    def caught(scene, name):
        return blender_facts(scene, tmp_path / name)["in_photo"][3:]

    assert caught(scene, "a") == []
    stage = {"name": "edit", "edits": [], "bodies": 1}
    saved = replace(scene, report=replace(scene.report, stages=(*scene.report.stages, stage)))
    assert caught(saved, "b") == ["body0"]
    older = replace(scene, report=replace(scene.report, stages=({"name": "edit", "edits": []},)))
    assert caught(older, "c") == ["body0", "body1"]
