"""From the prior to the re-rendering: which extents walls get, and what a result holds."""

from dataclasses import replace

import numpy as np
import pytest
from transport_scenes import furnished_room, windowed_sky

from materialist.fit import invert
from materialist.fit.invert import AUTO, FULL, FitResult, FitSetup, prepare
from materialist.fit.plane_extents import FoundExtents
from materialist.fit.settings import PAPER, Schedule
from materialist.geometry.extents import PlaneExtent
from materialist.render.scene import RenderScene
from materialist.types import Photo, Prediction

END = PlaneExtent((0.0, 0.0, 1.0), -3.0, -1.0, 1.0, -1.0, 1.0)


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


@pytest.mark.parametrize(
    ("completion", "found", "ends"),
    [(AUTO, FoundExtents((END,), 0.03, 0.05), (END,)), (AUTO, None, ()), (FULL, FoundExtents((END,), 0.03, 0.05), ())],
)
def test_only_auto_asks_the_light_for_extents(setup, monkeypatch, completion, found, ends):
    monkeypatch.setattr(invert, "find_extents", lambda *_, **__: found)
    prepared = prepare(replace(setup, completion=completion))
    assert (prepared.completion, prepared.ends) == (FULL, ends)
    assert bool(prepared.notes) == bool(ends)
    if ends:
        assert "error 0.030, not 0.050" in prepared.notes[0] and f"--completion {FULL}" in prepared.notes[0]


def test_a_result_has_two_independent_halves(setup):
    told = {}
    result = invert.invert(replace(setup, completion="none"), found=told.__setitem__)
    assert result.spp == 4 and not np.array_equal(*result.halves)
    np.testing.assert_allclose(result.rerender, np.mean(result.halves, 0), rtol=1e-6)
    assert told["light"] is result.envmap and told["materials"] is result.materials
    names = [stage["name"] for stage in result.stages]
    assert names[:4] == ["geometry", "scene", "engine", "trace"] and names[-1] == "rerender"
    assert isinstance(result, FitResult)
