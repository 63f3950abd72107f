"""The benchmark of glass: its scenes are what they claim, its figures look inside the mask alone."""

import json

import numpy as np
import pytest

from materialist import bench
from materialist.bench import glass
from materialist.bench import glass_models as models
from materialist.bench import glass_scenes as scenes
from materialist.predict.refraction.thickness import Thickness

GREY = np.full((16, 32, 3), 0.5, np.float32)


@pytest.fixture(scope="module")
def scene(mitsuba):
    return scenes.GlassScene(scenes.things(None, 1)[0], 40)


@pytest.fixture(scope="module")
def true(scene):
    return Thickness(scene.front.thickness, scene.front.thickness)


def case(scene, picture, ior=1.3, gain=1.0, envmap=GREY):
    return models.Case(scene, envmap, picture, picture, gain, ior, "case", spp=16)


def test_objects_are_closed_and_as_symmetric_as_they_say():
    for thing in scenes.things(None, 4):
        assert scenes.is_closed(thing.solid)
        z = thing.solid.vertices[:, 2]
        if thing.group == "symmetric":
            assert z.min() == pytest.approx(-z.max(), rel=0.02)


def test_figures_look_inside_the_mask_alone(scene):
    truth = np.random.default_rng(1).random((40, 40, 3)).astype(np.float32)
    one = case(scene, truth, gain=0.5)
    outside = np.where(scene.mask[..., None], truth, 0)
    found = glass.figures(one, outside, Thickness(scene.front.thickness * 1.5, scene.front.thickness))
    assert found["psnr_symmetric"] == np.inf and found["ssim_symmetric"] == pytest.approx(1)
    assert found["thickness_symmetric"] == pytest.approx(0.5, rel=1e-4)
    worse = glass.figures(one, outside * 0.8, None)
    assert worse["psnr_symmetric"] < 30 and worse["ssim_symmetric"] < 1 and "thickness_symmetric" not in worse


@pytest.mark.parametrize("background", ["envmap", pytest.param("room", marks=pytest.mark.slow)])
def test_the_whole_benchmark_runs(tmp_path, background):
    small = {"shapes": 1, "envmaps": 1, "iors": "1.2", "size": 32, "spp": 4, "reference": 4, "draws": 1, "pictures": 1}
    folder = bench.run("glass", output=tmp_path / "report", background=background, **small)
    assert (folder / "sheet.png").is_file()
    report = json.loads((folder / "report.json").read_text())
    assert {"closed, true d", "two_interface, true d"} <= report["means"].keys()
