"""Runs: they learn, stop on time, go on where they stopped, and leave weights that predict."""

import json
import os
import signal
from dataclasses import replace
from pathlib import Path

import made_runs
import psutil
import pytest
import torch

from materialist.errors import InputError, OutputError, WeightsError
from materialist.predict.bundled.predictor import BundledPredictor
from materialist_lab.procedural.thickness.dataset import ViewPlan, produce
from materialist_lab.train import checkpoint
from materialist_lab.train.bundled import RECIPE
from materialist_lab.train.schedule import Budget, TrainingSchedule
from materialist_lab.train.task import Recipe
from materialist_lab.train.trainer import RunOptions


@pytest.fixture(scope="module")
def tasks(data, tmp_path_factory):
    """Kind of run -> what makes its task."""
    place = tmp_path_factory.mktemp("views")
    made_runs.write_click_views(place / "clicks")
    produce(place / "shapes", ViewPlan(shapes=1, views=3))
    return {
        "matnet": lambda: made_runs.bundled(data),
        "clicks": lambda: made_runs.clicks(place / "clicks"),
        "refraction": lambda: made_runs.refraction(place / "shapes"),
    }


@pytest.fixture(scope="module")
def run(data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "run"
    notes: list[str] = []
    made_runs.trainer(
        made_runs.bundled(data, samples=2, rate=5e-3), folder, steps=15, notes=notes, report_steps=3
    ).fit()
    return folder, notes


def during(trainer, number, act):
    """Call `act` in the step with that number, counted from 1."""
    step = trainer._step
    count = [0]

    def counted(batch):
        terms = step(batch)
        count[0] += 1
        if count[0] == number:
            act()
        return terms

    trainer._step = counted


def weights_of(trainer):
    return torch.cat(
        [p.detach().flatten() for n in (trainer.network, trainer.averaged) for p in n.parameters()]
    )


def test_a_run_learns_and_tells(run):
    folder, notes = run
    curve, scored = (
        [json.loads(line) for line in (folder / name).read_text().splitlines()]
        for name in (checkpoint.CURVE, checkpoint.SCORES)
    )
    assert [line["step"] for line in curve] == [3, 6, 9, 12, 15]
    # It learns, and the rate falls.
    assert curve[-1]["loss"] < 0.8 * curve[0]["loss"]
    assert curve[-1]["rate"] < curve[0]["rate"] and curve[-1]["per_second"] > 0
    assert "no LPIPS" in notes[0]
    assert {"albedo_psnr", "normal_angle", "depth_si_log_rmse"} <= scored[-1].keys()
    assert scored[-1]["of"] == "samples trained on"
    assert (folder / "sheet.png").stat().st_size > 1000


def test_a_run_that_cannot_be_scored_says_why(tasks, tmp_path):
    notes: list[str] = []
    trainer = made_runs.trainer(tasks["refraction"](), tmp_path / "run", steps=1, notes=notes)
    trainer.fit()
    assert "step 1  no scores, since the data are too few to keep some aside" in notes
    assert not (tmp_path / "run" / checkpoint.SCORES).exists()


def test_its_averaged_weights_predict_and_begin_another_run(run, data):
    folder, _ = run
    predictor = BundledPredictor(folder / checkpoint.WEIGHTS)
    assert predictor.facts["step"] == 15 and predictor.facts["data"]["seed"] == [5]
    # Weights are stored in half precision.
    state = checkpoint.load(folder, "matnet")
    begun = made_runs.bundled(data)
    begun.init = folder / checkpoint.WEIGHTS
    for weights in (predictor.network.state_dict(), begun.network().state_dict()):
        for name, tensor in weights.items():
            torch.testing.assert_close(tensor, state["averaged"][name], atol=2e-3, rtol=2e-3)
    assert any(not torch.equal(state["averaged"][n], state["network"][n]) for n in state["network"])
    # A network with one more head begins with what there is.
    wider = made_runs.bundled(data, architecture=replace(made_runs.NETWORK, spread=True))
    wider.init = folder / checkpoint.WEIGHTS
    grown = wider.network().state_dict()  # with an untrained head of its own
    torch.testing.assert_close(grown["head.weight"], begun.network().state_dict()["head.weight"])
    assert float(grown["spread.out.weight"].abs().sum()) == 0
    # Another width is another network.
    other = made_runs.bundled(data, architecture=replace(made_runs.NETWORK, fine=16))
    other.init = folder / checkpoint.WEIGHTS
    with pytest.raises(WeightsError, match="is not a checkpoint of BundledNetwork"):
        other.network()


@pytest.mark.parametrize(
    "kind", [pytest.param("matnet", marks=pytest.mark.slow), "clicks", "refraction"]
)
def test_a_run_that_was_killed_ends_as_one_that_was_not(kind, tasks, tmp_path):
    # Bit for bit: order, variants, moments and averages go on where they stopped.
    whole = made_runs.trainer(tasks[kind](), tmp_path / "whole", steps=6)
    whole.fit()
    cut = made_runs.trainer(tasks[kind](), tmp_path / "cut", steps=6)
    # As a terminal or a scheduler stops a job: workers and trainer together.
    during(cut, 3, lambda: os.kill(os.getpid(), signal.SIGTERM))
    assert cut.fit() == {} and cut.schedule.step == 3
    rest = made_runs.trainer(tasks[kind](), tmp_path / "cut", steps=6, resume=True)
    rest.fit()
    assert rest.schedule.step == 6
    torch.testing.assert_close(weights_of(rest), weights_of(whole), atol=0, rtol=0)


def test_a_termination_of_the_whole_group_is_a_stop_like_any_other(data, tmp_path):
    trainer = made_runs.trainer(made_runs.bundled(data), tmp_path / "run", steps=10_000, workers=1)
    during(
        trainer,
        1,
        lambda: [p.terminate() for p in (*psutil.Process().children(), psutil.Process())],
    )
    assert trainer.fit() == {}
    assert checkpoint.load(tmp_path / "run", "matnet")["schedule"]["step"] == 1


def test_a_run_whose_data_break_keeps_what_it_learnt(data, tmp_path):
    def broken():
        raise InputError("Four files in a row cannot be read.")

    trainer = made_runs.trainer(made_runs.bundled(data), tmp_path / "run", steps=10)
    during(trainer, 3, broken)
    with pytest.raises(InputError, match="Four files"):
        trainer.fit()
    assert checkpoint.load(tmp_path / "run", "matnet")["schedule"]["step"] == 3


def test_a_run_is_not_overwritten_nor_mixed_up(run, data, tasks, tmp_path):
    folder, _ = run
    with pytest.raises(OutputError, match="add --resume"):
        made_runs.trainer(tasks["matnet"](), folder, steps=1)
    other = made_runs.bundled(data, architecture=made_runs.BundledArchitecture(fine=16))
    with pytest.raises(InputError, match="another network"):
        made_runs.trainer(other, folder, steps=1, resume=True)
    for kind in ("clicks", "refraction"):
        with pytest.raises(
            InputError, match=f"holds a run of `train matnet`, not of `train {kind}`"
        ):
            made_runs.trainer(tasks[kind](), folder, steps=1, resume=True)
    (tmp_path / "file").write_text("")
    for place in ("file", "file/run"):
        with pytest.raises(OutputError, match="cannot be written"):
            made_runs.trainer(tasks["clicks"](), tmp_path / place, steps=1)


def test_checkpoints_are_whole_or_refused(tmp_path):
    checkpoint.save(tmp_path, {"kind": "matnet", "step": 1})
    # What cannot be stored must not spoil what is there.
    with pytest.raises(AttributeError):
        checkpoint.save(tmp_path, {"kind": "matnet", "step": 2, "bad": lambda: None})
    assert checkpoint.load(tmp_path, "matnet")["step"] == 1
    path = tmp_path / checkpoint.NAME
    # A disk that was full.
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(WeightsError, match="is damaged"):
        checkpoint.load(tmp_path, "matnet")


def test_pictures_grow_with_the_run(data, tmp_path):
    assert [RECIPE.side_at(p) for p in (0, 0.29, 0.3, 0.74, 0.75, 1)] == [
        128,
        128,
        192,
        192,
        256,
        256,
    ]
    assert RECIPE.changed(side=96).side_at(0) == 96
    # Three of six steps at half of the side.
    task = made_runs.bundled(data, side=64, growth=((0.5, 32),))
    trainer = made_runs.trainer(task, tmp_path / "run", steps=6)
    losses = task.losses
    sides = []
    task.losses = lambda network, batch: (
        sides.append(batch["image"].shape[-1]),
        losses(network, batch),
    )[1]
    trainer.fit()
    assert sides == [32] * 3 + [64] * 3, "in the middle of a pass of two steps"


def test_the_rate_rises_falls_and_is_restarted():
    schedule = TrainingSchedule(Budget(steps=100))
    assert schedule.rate(10, 0.1) == pytest.approx(0.1)
    # Half a cosine: the mean of 1 and 0.1 in the middle.
    schedule.step = 50
    assert schedule.rate(10, 0.1) == pytest.approx(0.55)
    unfinished = schedule.as_dict()
    schedule.step = 100
    assert schedule.rate(10, 0.1) == pytest.approx(0.1) and schedule.done
    same = TrainingSchedule(Budget(steps=100), unfinished)
    assert same.rate(10, 0.1) == pytest.approx(0.55), "the same budget goes on"
    # 100 of 1000 steps are done.
    longer = TrainingSchedule(Budget(steps=900), schedule.as_dict())
    assert longer.progress == pytest.approx(0.1) and not longer.done
    longer.step = 150
    assert longer.rate(10, 0.1) > 0.9, "a longer whole goes on near its peak"
    shorter = TrainingSchedule(Budget(steps=10), schedule.as_dict())
    shorter.step = 105
    assert shorter.rate(0, 0.1) < 0.2, "a short budget at the end anneals"
    done = {**TrainingSchedule(Budget(minutes=1)).as_dict(), "seconds": 60.0, "done": True}
    assert TrainingSchedule(Budget(minutes=1), done).progress == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Budget(), "--steps or --minutes"),
        (lambda: Budget(steps=3, minutes=1.0), "--steps or --minutes"),
        (lambda: Budget(minutes=-1.0), "more than 0"),
        (lambda: RunOptions(workers=-1), "--workers is -1"),
        (lambda: RECIPE.changed(side=100), "multiple of 32"),
        (lambda: RECIPE.changed(batch=0), "batch is 0"),
        (lambda: RECIPE.changed(rate=3.0), "rate is 3"),
    ],
)
def test_settings_that_cannot_be(make, said):
    with pytest.raises(InputError, match=said):
        make()


def test_bfloat16_is_taken_where_the_processor_has_it(monkeypatch):
    cpu = torch.device("cpu")
    recipe = Recipe(side=32, batch=1, rate=1e-3)
    for flags, expected in (("avx2 fma", False), ("avx512_bf16", True), ("amx_bf16", True)):
        monkeypatch.setattr(Path, "read_text", lambda *_, flags=flags, **__: f"flags : {flags}")
        assert recipe.uses_bfloat16(cpu) is expected
        assert recipe.changed(bfloat16=not expected).uses_bfloat16(cpu) is not expected
