"""The XML as Mitsuba loads it, against our own target."""

from dataclasses import replace

import numpy as np
import pytest
from export_scenes import renderer, room

from materialist.exporters.mitsuba_xml import write_mitsuba
from materialist.exporters.parts import scene_parts
from materialist.pipeline import render_scene
from materialist.render.variant import setup
from materialist.types import Lamp

OWN = "scene_materialist.xml"


def test_it_renders_as_ours_does(tmp_path, capfd):
    scene = room()
    write_mitsuba(tmp_path, scene, scene_parts(scene))
    target = renderer(scene)
    mi = target.mi
    loaded = mi.load_file(str(tmp_path / OWN), parallel=False, spp=64, max_depth=3)
    ours = [target.render(spp=64, seed=seed, max_depth=3) for seed in (0, 1)]
    theirs = [np.array(mi.render(loaded, seed=seed)) for seed in (0, 2)]
    # Not the same random numbers for the same pixels, since shapes have another order: equal within noise.
    noise = np.sqrt(np.mean((ours[0] - ours[1]) ** 2))
    assert np.sqrt(np.mean((ours[0] - theirs[1]) ** 2)) < 1.15 * noise
    assert np.mean(theirs) == pytest.approx(np.mean(ours), rel=0.01)
    light = next(
        value
        for name, value in mi.traverse(loaded)
        if name.endswith(".data") and "bsdf" not in name
    )
    np.testing.assert_array_equal(np.array(light), np.array(target.params["light.data"]))
    assert "WARN" not in capfd.readouterr().out


def test_normals_that_lean_away_from_the_eye_are_ours(tmp_path):
    scene = room(completion="none")
    mesh = scene.geometry.mesh
    normals = mesh.normals + np.random.default_rng(0).normal(0, 1.0, mesh.normals.shape)
    normals = (normals / np.linalg.norm(normals, axis=-1, keepdims=True)).astype(np.float32)
    assert ((normals * mesh.vertices).sum(-1) > 0).mean() > 0.1
    scene = replace(scene, geometry=replace(scene.geometry, mesh=replace(mesh, normals=normals)))
    write_mitsuba(tmp_path, scene, scene_parts(scene))
    target = renderer(scene)
    loaded = target.mi.load_file(str(tmp_path / OWN), parallel=False, spp=256, max_depth=3)
    ours = target.render(spp=256, seed=1, max_depth=3)
    theirs = np.array(target.mi.render(loaded, seed=2))
    blocks = [image.reshape(5, 8, 8, 8, 3).mean((1, 3)) for image in (ours, theirs)]
    np.testing.assert_allclose(blocks[1], blocks[0], rtol=0.05)  # inside `twosided`: 0.19


def test_lamps_light_it_as_they_light_ours(tmp_path):
    scene = replace(room(), lamps=(Lamp((0.6, 0.3, -2.5), (30.0, 20.0, 5.0), 0.05),))
    write_mitsuba(tmp_path, scene, scene_parts(scene))
    mi = setup("auto")
    loaded = mi.load_file(str(tmp_path / OWN), parallel=False, spp=64)
    theirs = np.array(mi.render(loaded, seed=1))
    ours = render_scene(scene, spp=64)
    np.testing.assert_allclose(theirs.mean((0, 1)), ours.mean((0, 1)), rtol=0.03)
    assert ours.mean() > 1.3 * render_scene(replace(scene, lamps=()), spp=16).mean()
