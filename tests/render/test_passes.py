"""Samples per pixel: stratified as Mitsuba would, in passes of bounded size."""

import numpy as np
import pytest
from render_scenes import uniform, wall

from materialist.render import scene as module
from materialist.render.scene import RenderScene
from materialist.types import Camera

CAMERA = Camera(9, 5, 50.0)


def test_rounding_is_the_samplers():
    scene = RenderScene(wall(CAMERA), CAMERA, device="cpu")
    for spp in (1, 2, 3, 5, 7, 13, 16, 57, 64, 100, 128, 455, 1000):
        rounded = module._stratified(spp)
        sampler = scene.mi.load_dict({"type": "multijitter", "sample_count": rounded})
        assert sampler.sample_count() == rounded >= spp, "Mitsuba would round it again, and warn"
        assert rounded <= spp + np.sqrt(spp) + 1


@pytest.mark.parametrize("spp", [1, 10, 64])
def test_many_small_passes_make_the_same_picture(monkeypatch, spp):
    scene = RenderScene(wall(CAMERA), CAMERA, device="cpu")
    scene.set_materials(uniform(CAMERA))
    scene.set_envmap(np.ones((4, 8, 3), np.float32))
    whole = scene.render(spp=1024, max_depth=2).mean()
    monkeypatch.setattr(module, "_WAVEFRONT", 9 * 5 * 4)
    calls = []
    load = scene.mi.render
    monkeypatch.setattr(scene.mi, "render", lambda *a, **k: calls.append((k["spp"], k["seed"])) or load(*a, **k))
    image = scene.render_path(spp=spp, seed=2, max_depth=2)
    assert image.shape == (5, 9, 3) and image.mean() == pytest.approx(whole, rel=0.1 / np.sqrt(spp) + 0.01)
    assert len({seed for _, seed in calls}) == len(calls) == -(-spp // 4)
    assert spp <= sum(n for n, _ in calls) <= spp + 2 * len(calls) and max(n for n, _ in calls) <= 4
