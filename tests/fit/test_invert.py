"""From the prior to the re-rendering: what a result holds."""

from dataclasses import replace

import numpy as np
import pytest
from transport_scenes import furnished_room, windowed_sky

from materialist.fit import invert
from materialist.fit.invert import FitResult, FitSetup
from materialist.fit.settings import PAPER, Schedule
from materialist.render.scene import RenderScene
from materialist.types import Photo, Prediction


@pytest.fixture(scope="module")
def setup():
    """A tiny room with its true maps, and three steps a stage."""
    camera, geometry, truth = furnished_room(16)
    scene = RenderScene(geometry, camera)
    scene.set_materials(truth)
    scene.set_envmap(windowed_sky(16))
    linear = np.clip(scene.render(spp=64), 0, 1)
    depth = np.full(linear.shape[:2], 3, np.float32)
    normal = np.broadcast_to(np.array([0, 0, 1], np.float32), linear.shape).copy()
    stages = tuple(replace(s, schedule=Schedule(max_steps=3)) for s in PAPER.materials.stages)
    light = replace(PAPER.light, schedule=Schedule(max_steps=3))
    settings = replace(PAPER, light=light, materials=replace(PAPER.materials, stages=stages))
    prior = Prediction(truth, normal, depth)
    return FitSetup(Photo(linear, camera, linear), prior, settings, envmap_height=16, device="cpu", spp=4)


def test_a_result_has_two_independent_halves(setup):
    told = {}
    result = invert.invert(replace(setup, completion="none"), found=told.__setitem__)
    assert result.spp == 4 and not np.array_equal(*result.halves)
    np.testing.assert_allclose(result.rerender, np.mean(result.halves, 0), rtol=1e-6)
    assert told["light"] is result.envmap and told["materials"] is result.materials
    names = [stage["name"] for stage in result.stages]
    assert names[:4] == ["geometry", "scene", "engine", "trace"] and names[-1] == "rerender"
    assert isinstance(result, FitResult)
