"""Runs of one trainer in the folder of another, and runs from before checkpoints said whose they are."""

import made_runs
import made_samples
import numpy as np
import pytest
import torch

from materialist.errors import InputError, OutputError, WeightsError
from materialist.procedural.thickness import dataset as lessons
from materialist.train import checkpoint, small
from materialist.train.budget import Budget
from materialist.train.clicks import trainer as clicks
from materialist.train.export import export_run
from materialist.train.refraction import trainer as refraction


@pytest.fixture(scope="module")
def starts(tmp_path_factory):
    """For each kind of run, a function that begins one of a step, or goes on with it, in a folder."""
    place = tmp_path_factory.mktemp("data")
    data = made_samples.write_set(place / "set", 2)
    (place / "views").mkdir()
    thing = np.where(np.hypot(*np.mgrid[-32:32, -32:32]) < 14, 1, -1).astype(np.int16)
    normal = np.broadcast_to(np.int8([0, 0, 127]), (64, 64, 3))
    rgb = np.repeat(np.uint8(100 + 80 * thing)[..., None], 3, -1)
    np.savez(place / "views" / "0000000.npz", rgb=rgb, normal=normal, depth=np.ones((64, 64), np.float16), thing=thing)
    lessons.produce(place / "lessons", lessons.Plan(shapes=1, views=2))
    options = {"batch": 1, "warm_up": 1, "side": 32}
    click_recipe, refraction_recipe = clicks.Recipe(**options, last_side=32), refraction.Recipe(**options)
    step = Budget(steps=1)
    return {
        "matnet": lambda run, resume: made_runs.trainer(data, run, steps=1, resume=resume),
        "clicks": lambda run, resume: clicks.Trainer(
            run, place / "views", budget=step, recipe=click_recipe, resume=resume
        ),
        "refraction": lambda run, resume: refraction.Trainer(
            run, place / "lessons", None, budget=step, recipe=refraction_recipe, resume=resume
        ),
    }


@pytest.fixture(scope="module")
def runs(starts, tmp_path_factory):
    place = tmp_path_factory.mktemp("runs")
    for kind, start in starts.items():
        start(place / kind, False).run()
    return place


def without_kind(run, folder):
    """The run as it was written before checkpoints had a kind."""
    state = torch.load(run / checkpoint.NAME, weights_only=True)
    del state["kind"]
    folder.mkdir()
    torch.save(state, folder / checkpoint.NAME)
    return folder


@pytest.mark.parametrize("holds", ["matnet", "clicks", "refraction"])
def test_a_run_is_gone_on_with_by_its_own_trainer_alone(holds, starts, runs, tmp_path):
    old = without_kind(runs / holds, tmp_path / "old")
    for kind in starts.keys() - {holds}:
        with pytest.raises(InputError, match=f"holds a run of `train {holds}`, not of `train {kind}`"):
            starts[kind](runs / holds, True)
        with pytest.raises(InputError, match="holds a run of"):
            starts[kind](old, True)
    for folder in (runs / holds, old):
        starts[holds](folder, True).run()
        state = checkpoint.load(folder, kind=holds)
        assert state["step"] == 2 and state["kind"] == holds


def test_runs_of_other_kinds_are_not_exported(runs, tmp_path):
    file = tmp_path / "w.safetensors"
    for kind in ("clicks", "refraction"):
        with pytest.raises(InputError, match=f"holds a run of `train {kind}`"):
            export_run(runs / kind, file)
        with pytest.raises(InputError, match="holds a run of `train clicks or refraction`"):
            export_run(without_kind(runs / kind, tmp_path / kind), file)
    assert export_run(without_kind(runs / "matnet", tmp_path / "matnet"), file)["step"] >= 1
    with pytest.raises(WeightsError, match="materialist train clicks"):
        checkpoint.load(tmp_path / "nowhere", kind="clicks")


def test_a_file_is_no_folder_for_a_run(starts, tmp_path):
    (tmp_path / "file").write_text("")
    for start in starts.values():
        for place in ("file", "file/run"):
            with pytest.raises(OutputError, match="cannot be made"):
                start(tmp_path / place, False)


def test_the_curve_after_a_resumption_has_means_of_the_steps_there_were(starts, tmp_path, monkeypatch):
    """Steps whose loss is 1 have a mean of 1, however many of them a line is of."""
    monkeypatch.setattr(small, "REPORT_STEPS", 3)

    def step(run, _):
        run.clock.step += 1
        return {"loss": 1.0}

    monkeypatch.setattr(small.Run, "_step", step)
    for resume in (False, True, True, True):
        starts["refraction"](tmp_path / "run", resume).run()
    curve = checkpoint.read_lines(tmp_path / "run" / small.CURVE)
    assert [(line["step"], line["loss"]) for line in curve] == [(3, 1)]
