"""`bench photo-alone`: its photos are of nothing that was trained on, and its rows are what they say."""

from dataclasses import replace

import numpy as np
import pytest

from materialist.errors import InputError
from materialist.fit.settings import PAPER
from materialist_lab.bench.edits import true_scene
from materialist_lab.bench.photo_alone import (
    SCENE_SEED,
    PhotoAloneBench,
    light_error,
    unseen_sample,
    with_truth,
)
from materialist_lab.procedural import arrangements, lights
from materialist_lab.procedural.options import HELD_OUT
from materialist_lab.procedural.synthetic import make_sample


@pytest.mark.slow
def test_captures_are_those_that_no_training_set_may_use(monkeypatch, tmp_path):
    """By name: of all files, only the held-out ones are asked for."""
    asked = []
    for folder, ending, names in (
        ("meshes", ".ply", ("train", "spot_cow", "bunny")),
        ("envmaps", ".exr", ("museum", "forest")),
    ):
        (tmp_path / folder).mkdir()
        for name in names:
            (tmp_path / folder / f"{name}{ending}").touch()

    def load(path):
        asked.append(path.stem)
        return arrangements.shapes.box(np.full(3, 0.3))

    monkeypatch.setattr(arrangements.shapes, "load", load)
    monkeypatch.setattr(lights, "_capture", lambda path, turn: asked.append(path.stem))
    for scene in range(24):
        arrangements.arrangement(scene, seed=SCENE_SEED, data=tmp_path, unseen=True)
        lights.environment(scene, seed=SCENE_SEED, data=tmp_path, unseen=True)
    assert set(asked) == {"train", "spot_cow", "museum"} and set(asked) <= HELD_OUT
    (tmp_path / "meshes" / "train.ply").unlink()
    (tmp_path / "meshes" / "spot_cow.ply").unlink()
    with pytest.raises(InputError, match=r"no \.ply"):
        arrangements.arrangement(1, seed=SCENE_SEED, data=tmp_path, unseen=True)


@pytest.mark.slow
def test_arrangements_are_those_of_no_other_seed(mitsuba):
    """By seed: benchmarks that settings are tuned with have seed 0; training has scenes of another generator."""
    sample, _ = unseen_sample(0, None, 24)
    tuned = make_sample(0, 0, 0, size=24, spp=16)
    assert SCENE_SEED != 0 and not np.array_equal(sample.truth.depth, tuned.truth.depth)
    again, _ = unseen_sample(0, None, 24)
    np.testing.assert_allclose(sample.photo.linear, again.photo.linear, atol=1e-6)


def test_a_part_of_the_truth_replaces_that_part_alone(mitsuba):
    truth = make_sample(0, 0, 0, size=24, spp=16).truth
    prior = replace(
        truth,
        depth=truth.depth * 2,
        materials=replace(truth.materials, albedo=truth.materials.albedo / 2),
    )
    albedo, geometry = (with_truth(prior, truth, known) for known in ("albedo", "geometry"))
    assert albedo.depth is prior.depth and albedo.materials.albedo is truth.materials.albedo
    assert geometry.depth is truth.depth and geometry.materials is prior.materials


def test_the_error_of_a_light_knows_no_brightness():
    light = np.random.default_rng(0).random((16, 32, 3))
    assert light_error(3 * light, light) == pytest.approx(0, abs=1e-9)
    assert 0.1 < light_error(np.roll(light, 16, 1) ** 4, light**4) <= 1


@pytest.mark.slow
def test_a_run_has_maps_and_edits(measured, monkeypatch):
    from materialist import pipeline

    sample, _ = unseen_sample(0, None, 32)
    monkeypatch.setattr(
        pipeline, "invert", lambda photo, **_: replace(true_scene(sample), photo=photo)
    )
    small = {"scenes": 1, "size": 32, "spp": 4, "truth_spp": 16}
    report = measured("photo-alone", kinds="relight,insert", **small)
    rows = {row["method"]: row for row in report.rows}
    assert list(rows)[:2] == ["maps: prior", "maps: fitted"]
    assert rows["maps: fitted"]["albedo"] == 100 and rows["maps: fitted"]["light"] < 1e-6
    assert rows["relight: fitted"]["inside"] > rows["relight: untouched"]["inside"] + 3
    inverted = []
    monkeypatch.setattr(
        pipeline, "invert", lambda *_, **options: inverted.append(options) or true_scene(sample)
    )
    measured("photo-alone", kinds="relight", paper=3, **small)
    assert inverted[1]["engine"] == "path" and inverted[1]["settings"] == PAPER.at_most(3)
    assert (report.folder / "sheet.png").exists() and PhotoAloneBench().scenes >= 24
