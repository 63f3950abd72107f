"""Runs: they learn, stop on time, go on where they stopped, and several processes make one network."""

import json
import os
import signal
import socket

import made_runs
import made_samples
import numpy as np
import psutil
import pytest
import torch

from materialist.errors import InputError, OutputError, WeightsError
from materialist.io.samples import SampleFolder
from materialist.predict.bundled.network import BundledArchitecture, BundledNetwork, srgb
from materialist.predict.bundled.predictor import BundledPredictor
from materialist.predict.weights import sha256
from materialist.train import checkpoint, stream
from materialist.train.budget import Budget, Clock
from materialist.train.export import export_run
from materialist.train.recipes import recipe
from materialist.train.tasks import BundledTask, relative_log_depth
from materialist.train.trainer import CURVE, SCORES, Habits


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return made_samples.write_set(tmp_path_factory.mktemp("data"), 4)


@pytest.fixture(scope="module")
def run(data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs") / "run"
    notes: list[str] = []
    trainer = made_runs.trainer(data, folder, steps=60, samples=2, notes=notes, rate=5e-3)
    trainer.run()
    return folder, notes


def test_a_run_learns_and_tells(run):
    folder, notes = run
    curve = checkpoint.read_lines(folder / CURVE)
    assert [line["step"] for line in curve] == [20, 40, 60]
    assert curve[-1]["loss"] < 0.8 * curve[0]["loss"]
    assert curve[-1]["rate"] < curve[0]["rate"] and curve[-1]["per_second"] > 0
    assert "no LPIPS" in notes[0]
    scores = checkpoint.read_lines(folder / SCORES)
    assert {"albedo_psnr", "normal_angle", "depth_si_log_rmse"} <= scores[-1].keys()
    assert (folder / "sheet.png").stat().st_size > 1000


def test_a_run_goes_on(run, data):
    folder, _ = run
    before = checkpoint.load(folder)
    notes: list[str] = []
    trainer = made_runs.trainer(data, folder, steps=3, resume=True, notes=notes)
    assert any("Resumed at step 60" in note for note in notes)
    for name, tensor in trainer.network.state_dict().items():
        torch.testing.assert_close(tensor, before["network"][name])
    moments = trainer.optimizer.state_dict()["state"][0]["exp_avg_sq"]
    torch.testing.assert_close(moments, before["optimizer"]["state"][0]["exp_avg_sq"])
    trainer.run()
    after = checkpoint.load(folder)
    assert after["step"] == 63 and after["epoch"] > before["epoch"] and after["seconds"] > before["seconds"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_run_that_is_told_to_end_leaves_a_checkpoint(data, tmp_path, number):
    before = signal.getsignal(number)
    trainer = made_runs.trainer(data, tmp_path / "run", steps=10_000)
    step, seen = trainer._step, []

    def third_step_is_the_last(batch):
        seen.append(step(batch))
        if len(seen) == 3:
            os.kill(os.getpid(), number)
        return seen[-1]

    trainer._step = third_step_is_the_last
    assert trainer.run() == {}
    assert checkpoint.load(tmp_path / "run")["step"] == 3
    assert trainer.interrupted is (number == signal.SIGINT) and signal.getsignal(number) == before


def test_a_termination_of_the_whole_group_is_a_stop_like_any_other(data, tmp_path):
    trainer = made_runs.trainer(data, tmp_path / "run", steps=10_000, workers=1)
    step = trainer._step

    def terminated(batch):
        for process in (*psutil.Process().children(), psutil.Process()):
            process.terminate()
        return step(batch)

    trainer._step = terminated
    assert trainer.run() == {}
    assert checkpoint.load(tmp_path / "run")["step"] == 1


def test_a_run_is_not_overwritten_nor_mixed_up(run, data):
    folder, _ = run
    with pytest.raises(OutputError, match="add --resume"):
        made_runs.trainer(data, folder, steps=1)
    with pytest.raises(InputError, match="another network"):
        made_runs.trainer(data, folder, steps=1, resume=True, network={**made_runs.NETWORK, "fine": 16})


def test_the_averaged_weights_are_exported_and_predict(run, tmp_path):
    folder, _ = run
    file = tmp_path / "w.safetensors"
    facts = export_run(folder, file)
    assert facts["megabytes"] < 1
    predictor = BundledPredictor(file)
    assert predictor.facts["step"] == facts["step"] and predictor.facts["data"]["seed"] == 5
    state = checkpoint.load(folder)
    for name, tensor in predictor.network.state_dict().items():
        torch.testing.assert_close(tensor, state["averaged"][name], atol=2e-3, rtol=2e-3)
    moved = max(float((state["averaged"][n] - state["network"][n]).abs().max()) for n in state["network"])
    assert moved > 0, "an average is not the last step"
    with pytest.raises(OutputError, match="exists"):
        export_run(folder, file)


def test_the_mean_with_other_weights_is_exported(run, tmp_path):
    folder, _ = run
    alone, other, mean = (tmp_path / f"{name}.safetensors" for name in ("alone", "other", "mean"))
    export_run(folder, alone)
    network, facts = BundledNetwork.load(alone)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter += 0.5
    network.save(other, facts)
    export_run(folder, mean, average_with=other)
    found, told = BundledNetwork.load(mean)
    assert told["averaged with"] == sha256(other)[:16] and "scores" not in told
    mixed = found.state_dict()
    for name, tensor in BundledNetwork.load(alone)[0].named_parameters():
        torch.testing.assert_close(mixed[name], tensor + 0.25, atol=4e-3, rtol=4e-3)


def test_no_mean_with_another_network(run, tmp_path):
    file, other = tmp_path / "w.safetensors", tmp_path / "other.safetensors"
    with pytest.raises(WeightsError, match=r"no weights at .*nowhere"):
        export_run(run[0], file, average_with=tmp_path / "nowhere.safetensors")
    BundledNetwork(BundledArchitecture.from_dict({**made_runs.NETWORK, "fine": 16})).save(other, {})
    with pytest.raises(WeightsError, match="differ in fine; give weights of the same"):
        export_run(run[0], file, average_with=other)
    state = checkpoint.load(run[0])
    (tmp_path / "paper").mkdir()
    checkpoint.save(tmp_path / "paper", state | {"recipe": state["recipe"] | {"task": "paper"}})
    with pytest.raises(InputError, match="leave it out for the paper's"):
        export_run(tmp_path / "paper", file, average_with=other)
    assert not file.exists()


def test_an_export_to_no_folder_is_refused(run, tmp_path):
    (tmp_path / "file").write_text("")
    for place in ("file", "nowhere"):
        with pytest.raises(OutputError, match="cannot be written"):
            export_run(run[0], tmp_path / place / "w.safetensors")


def test_figures_of_samples_trained_on_are_said_to_be(run, tmp_path):
    """Four samples are too few to keep any aside, forty are enough."""
    folder, notes = run
    assert any("of samples trained on" in note for note in notes)
    assert checkpoint.read_lines(folder / SCORES)[-1]["of"] == "samples trained on"
    enough, told = made_samples.write_set(tmp_path / "set", stream.KEPT_ASIDE), []
    trainer = made_runs.trainer(enough, tmp_path / "run", steps=1, samples=2, notes=told)
    assert trainer.scored_on == ""
    trainer.run()
    assert trainer.scored_on == "samples kept aside" and not any("trained on" in note for note in told)
    assert checkpoint.read_lines(tmp_path / "run" / SCORES)[-1]["of"] == "samples kept aside"


@pytest.mark.parametrize("habit", ["workers", "score_samples"])
def test_habits_that_cannot_be(habit):
    with pytest.raises(InputError, match=f"--{habit.replace('_', '-')} is -1; give 0 or more"):
        Habits(**{habit: -1})


def test_checkpoints_are_whole_or_refused(tmp_path):
    checkpoint.save(tmp_path, {"step": 1})
    with pytest.raises(AttributeError):
        checkpoint.save(tmp_path, {"step": 2, "bad": lambda: None})
    assert checkpoint.load(tmp_path)["step"] == 1
    path = tmp_path / checkpoint.NAME
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(WeightsError, match="is damaged"):
        checkpoint.load(tmp_path)
    with pytest.raises(WeightsError, match="give the folder of a run"):
        checkpoint.load(tmp_path / "nowhere")


def test_a_cut_off_line_of_a_curve_is_left_out(tmp_path):
    file = tmp_path / "curve.jsonl"
    checkpoint.append_line(file, {"step": 1})
    file.write_text(file.read_text() + '{"step": 2, "lo')
    assert checkpoint.read_lines(file) == [{"step": 1}]


def test_two_processes_train_one_network(data, tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    run = tmp_path / "run"
    torch.multiprocessing.spawn(made_runs.one_of_two, (port, data, run), nprocs=2)
    first, second = (torch.load(run / f"weights{k}.pt", weights_only=True) for k in range(2))
    for name in first:
        torch.testing.assert_close(first[name], second[name], atol=0, rtol=0)
    assert checkpoint.load(run)["step"] == 3
    start = made_runs.trainer(data, tmp_path / "other", steps=1).network.state_dict()
    assert any(not torch.equal(start[name], first[name]) for name in first)


def test_the_processes_share_the_samples(data):
    source, task = SampleFolder(data), BundledTask()
    args = {"number": 1, "size": 32, "seed": 0, "workers": 0}
    alone = list(stream.epoch(source, task, batch=4, **args))
    shares = [list(stream.epoch(source, task, batch=2, rank=r, world=2, **args)) for r in range(2)]
    assert len(alone) == len(shares[0]) == len(shares[1]) == 1
    together = torch.cat([shares[0][0]["image"], shares[1][0]["image"]])
    key = lambda x: sorted(float(p.sum()) for p in x)  # noqa: E731
    np.testing.assert_allclose(key(together), key(alone[0]["image"]), rtol=1e-6)


def test_one_bad_file_does_not_end_a_run(tmp_path, caplog):
    source = SampleFolder(made_samples.write_set(tmp_path, 4))
    bad = tmp_path / "samples" / "0000002.npz"
    bad.write_bytes(b"no sample")
    args = {"number": 1, "size": 32, "seed": 0, "workers": 0, "batch": 4}
    assert len(list(stream.epoch(source, BundledTask(), **args))) == 1
    assert "0000002.npz" in caplog.text
    for path in (tmp_path / "samples").iterdir():
        path.write_bytes(b"no sample")
    with pytest.raises(InputError, match="cannot be read"):
        list(stream.epoch(source, BundledTask(), **args))


def test_kept_aside_samples_are_never_trained_on():
    trained = stream.trained_on(range(100))
    assert len(trained) == 98 and not {39, 79} & set(trained)
    assert stream.trained_on(range(5)) == [0, 1, 2, 3, 4]


def test_a_sample_that_goes_moves_no_other_one(tmp_path):
    """Which samples are kept aside is told by their own numbers, not by their places."""
    (tmp_path / "samples").mkdir()
    for k in range(90):
        (tmp_path / "samples" / f"{k:07d}.npz").touch()
    source = SampleFolder(tmp_path)
    before = {source.number(k) for k in stream.trained_on(source)}
    (tmp_path / "samples" / "0000005.npz").unlink()
    source.refresh()
    assert {source.number(k) for k in stream.trained_on(source)} == before - {5}
    assert not {39, 79} & before


def test_samples_kept_aside_that_cannot_be_read_are_left_out(tmp_path, caplog):
    source = SampleFolder(made_samples.write_set(tmp_path, 3))
    (tmp_path / "samples" / "0000001.npz").write_bytes(b"no sample")
    assert len(stream.kept_aside(source, 3)) == 2 and "0000001.npz" in caplog.text
    trainer = made_runs.trainer(tmp_path, tmp_path / "run", steps=1)
    for path in (tmp_path / "samples").iterdir():
        path.write_bytes(b"no sample")
    assert stream.kept_aside(source, 3) == [] and trainer.score() == {}


def test_the_error_of_a_loading_worker_is_one_sentence_and_ends_them(tmp_path):
    """Not the worker's traceback; and nothing is left that could keep the command from ending."""
    import multiprocessing

    source = SampleFolder(made_samples.write_set(tmp_path, 4))
    for path in (tmp_path / "samples").iterdir():
        path.write_bytes(b"no sample")
    with pytest.raises(InputError, match="cannot be read") as caught:
        list(stream.epoch(source, BundledTask(), number=1, size=32, seed=0, workers=1, batch=2))
    assert "Traceback" not in str(caught.value)
    del caught
    assert not multiprocessing.active_children()


def test_the_rate_rises_falls_and_is_restarted():
    clock = Clock(Budget(steps=100))
    assert clock.rate(10, 0.1) == pytest.approx(0.1)
    clock.step = 50
    assert clock.rate(10, 0.1) == pytest.approx(0.55)
    clock.step = 100
    assert clock.rate(10, 0.1) == pytest.approx(0.1) and clock.done
    longer = Clock(Budget(steps=900), step=100)
    assert longer.progress == pytest.approx(0.1) and not longer.done
    longer.step = 150
    assert longer.rate(10, 0.1) > 0.9, "a longer whole goes on near its peak"
    shorter = Clock(Budget(steps=10), step=100)
    shorter.step = 105
    assert shorter.rate(0, 0.1) < 0.2, "a short budget at the end anneals"


def test_minutes_are_counted_over_all_starts():
    clock = Clock(Budget(minutes=1), seconds=60)
    assert clock.progress == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("bad", [{}, {"steps": 3, "minutes": 1.0}, {"steps": 0}, {"minutes": -1.0}])
def test_budgets_that_say_nothing(bad):
    with pytest.raises(InputError):
        Budget(**bad)


@pytest.mark.parametrize("bad", [{"size": 100}, {"batch": 0}, {"rate": 3.0}])
def test_recipes_that_cannot_work(bad):
    with pytest.raises(InputError, match=str(next(iter(bad.values())))[:1]):
        recipe("bundled", **bad)
    with pytest.raises(InputError, match="no training recipe"):
        recipe("nonsense")


def test_recipes_survive_json():
    for name in ("bundled", "paper"):
        assert json.loads(json.dumps(recipe(name).as_dict()))["name"] == name


def test_targets_of_the_bundled_network():
    values = torch.tensor([0.0, 0.002, 0.18, 1.0])
    np.testing.assert_allclose(srgb(values), [0, 0.02584, 0.46135, 1], atol=1e-4)
    depth = torch.tensor([1.0, 2.0, 4.0, 0.0]).view(1, 1, 2, 2)
    found = relative_log_depth(depth, (depth > 0).float()).flatten()
    np.testing.assert_allclose(found, [-np.log(2), 0, np.log(2), 0], atol=1e-6)


def test_crops_grow_with_the_run(data, tmp_path):
    assert [recipe("bundled").size_at(p) for p in (0, 0.59, 0.6, 0.79, 0.8, 1)] == [128, 128, 192, 192, 256, 256]
    assert recipe("bundled", size=96).size_at(0) == 96
    trainer = made_runs.trainer(data, tmp_path / "run", steps=6, size=64, growth=((0.5, 32),))
    step, sides = trainer._step, []

    def noted(batch):
        sides.append(batch["image"].shape[-1])
        return step(batch)

    trainer._step = noted
    trainer.run()
    assert sides == [32] * 3 + [64] * 3, "in the middle of a pass of two steps"
