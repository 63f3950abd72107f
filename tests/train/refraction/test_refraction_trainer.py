"""The trainer of RefractionNet, on two shapes."""

import json
import os
import shutil
import signal

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from materialist.cli import app
from materialist.cli.outcome import run_to_exit_code
from materialist.errors import InputError, OutputError
from materialist.predict.refraction.crop import BACK_X, MASK, MIRROR, NORMAL_X, SIDE
from materialist.predict.refraction.network import RefractionNet
from materialist.procedural.thickness import dataset as lessons
from materialist.procedural.thickness import errors as scores
from materialist.train import checkpoint
from materialist.train.budget import Budget
from materialist.train.refraction import trainer
from materialist.train.refraction.trainer import Recipe, Trainer

RECIPE = Recipe(batch=4, warm_up=1, side=32, rate=1e-3)


@pytest.fixture(scope="module")
def views(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lessons")
    lessons.produce(folder, lessons.Plan(shapes=2, views=3))
    return folder


def test_ctrl_c_leaves_a_checkpoint_and_says_how_to_go_on(views, tmp_path, monkeypatch):
    monkeypatch.setattr(Trainer, "_step", lambda self, batch: os.kill(os.getpid(), signal.SIGINT) or {"loss": 0.0})
    plan = ["--data", str(views.parent / "set"), "--shapes", "1", "--views", "2", "--heldout", "1", "--batch", "1"]
    code = run_to_exit_code(app, ["train", "refraction", "-o", str(tmp_path / "run"), "--steps", "9", *plan])
    assert code == 130 and checkpoint.load(tmp_path / "run")["step"] == 0


def test_a_damaged_description_is_no_crash(tmp_path):
    lessons.produce(tmp_path / "set", lessons.Plan(shapes=1, views=1))
    (tmp_path / "set" / lessons.DESCRIPTION).write_text("")
    with pytest.raises(InputError, match="name another folder"):
        lessons.produce(tmp_path / "set", lessons.Plan(shapes=1, views=1))


def test_it_learns_resumes_and_leaves_weights(views, tmp_path):
    run = tmp_path / "run"
    torch.manual_seed(0)
    Trainer(run, views, views, budget=Budget(steps=3), recipe=RECIPE).run()
    with pytest.raises(OutputError, match="holds a run already"):
        Trainer(run, views, None, budget=Budget(steps=1), recipe=RECIPE)
    resumed = Trainer(run, views, views, budget=Budget(steps=3), recipe=RECIPE, resume=True)
    assert resumed.clock.step == 3
    figures = resumed.run()
    assert figures.keys() >= {"solid", "symmetry", "hollow", "back", "back_symmetry"}
    network, facts = RefractionNet.load(run / "weights.safetensors")
    assert facts["step"] == 6 and facts["recipe"]["batch"] == 4
    again = scores.score(network, lessons.load(views))
    assert again["solid"] == pytest.approx(figures["solid"], rel=1e-2)
    assert len((run / "scores.jsonl").read_text().splitlines()) == 2


def test_a_run_begins_with_given_weights(views, tmp_path):
    torch.manual_seed(0)
    first = Trainer(tmp_path / "first", views, None, budget=Budget(steps=3), recipe=RECIPE)
    first.run()
    init = tmp_path / "first" / "weights.safetensors"
    second = Trainer(tmp_path / "second", views, None, budget=Budget(steps=1), recipe=RECIPE, init=init)
    assert second.clock.step == 0
    for found, wanted in ((second.network, first.averaged), (second.averaged, first.averaged)):
        for a, b in zip(found.parameters(), wanted.parameters(), strict=True):
            torch.testing.assert_close(a.detach(), b.detach(), atol=1e-6, rtol=1e-3)  # stored as float16
    before = [p.detach().clone() for p in second.network.parameters()]
    second.run()
    assert any(not a.equal(b) for a, b in zip(before, second.network.parameters(), strict=True))


def test_bad_weights_to_begin_with_are_said_before_views_are_made(tmp_path):
    (tmp_path / "bad.safetensors").write_bytes(b"nothing")
    command = ["train", "refraction", "-o", str(tmp_path / "run"), "--steps", "1", "--init"]
    for name in ("bad.safetensors", "missing.safetensors"):
        assert run_to_exit_code(app, [*command, str(tmp_path / name)]) == 2
    assert not (tmp_path / "run").exists()


def test_the_loss_falls(views):
    torch.manual_seed(1)
    batch = trainer.prepared(trainer.smaller(lessons.load(views), 32), np.arange(6), np.random.default_rng(0))
    network = trainer.RefractionNet()
    optimizer = torch.optim.Adam(network.parameters(), 2e-3)
    history = []
    for _ in range(30):
        loss = sum(trainer.losses(network(batch["maps"]), batch, RECIPE).values())
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        history.append(loss.item())
    assert history[-1] < 0.9 * history[0]


def test_smaller_views_keep_their_thickness(views):
    full = lessons.load(views)
    rng = np.random.default_rng
    a, b = (trainer.prepared(trainer.smaller(full, side), np.arange(6), rng(0)) for side in (SIDE, 32))
    assert b["maps"].shape[-1] == b["target"].shape[-1] == 32
    for name, channel in (("maps", MIRROR), ("target", 0)):
        mean = [(x[name][:, channel] * x["maps"][:, MASK]).sum() / x["maps"][:, MASK].sum() for x in (a, b)]
        assert mean[0].item() == pytest.approx(mean[1].item(), rel=0.06)


def test_relative_errors():
    truth = np.ones((2, 4, 4))
    inside = np.zeros((2, 4, 4), bool)
    inside[:, 1:3] = True
    assert scores.relative_error(truth * [[[1.5]], [[1.0]]], truth, inside).tolist() == [0.5, 0]
    mixed = np.where(np.arange(4) < 2, 2.0, 0.01) * truth
    assert scores.pixel_error(mixed * 1.25, mixed, inside).tolist() == pytest.approx([0.25, 0.25])


def test_angles_between_backs():
    turned = np.zeros((1, 3, 4, 4))
    turned[:, 0], turned[:, 2] = np.sin(np.radians(30)), -np.cos(np.radians(30))
    straight = np.zeros((1, 3, 4, 4))
    straight[:, 2] = -1
    assert scores.degrees(turned, straight, np.ones((1, 4, 4), bool)).tolist() == pytest.approx([30])


def test_a_mirrored_view_is_a_view_of_the_mirrored_shape(views):
    """Flipped lessons keep what the mirror image of a shape would have: x turns around, in front and behind."""
    full = {name: value[:1] for name, value in lessons.load(views).items()}
    seeds = [s for s in range(20) if np.random.default_rng(s).random(1)[0] < 0.5]
    flipped = trainer.prepared(full, np.array([0]), np.random.default_rng(seeds[0]))
    for name, channel, sign in (("maps", NORMAL_X, -1), ("maps", NORMAL_X + 1, 1), ("target", BACK_X, -1),
                                ("target", BACK_X + 1, 1), ("target", 0, 1)):  # fmt: skip
        np.testing.assert_array_equal(flipped[name][0, channel].numpy(), sign * full[name][0, channel, :, ::-1])


def test_a_damaged_file_of_views_is_named(views, tmp_path):
    shutil.copytree(views, tmp_path / "views")
    os.truncate(tmp_path / "views" / "00001.npz", 500)
    with pytest.raises(InputError, match=r"00001\.npz cannot be read .*; delete it"):
        lessons.load(tmp_path / "views")


def test_bad_recipes_are_refused():
    with pytest.raises(InputError, match="side is 40"):
        Recipe(side=40)
    with pytest.raises(InputError, match="batch is 0"):
        Recipe(batch=0)


def test_the_command_makes_views(tmp_path):
    options = ["--shapes", "1", "--views", "1", "--heldout", "1", "--data-only", "--json"]
    result = CliRunner().invoke(app, ["train", "refraction", "-o", str(tmp_path / "run"), *options])
    assert result.exit_code == 0, result.output
    assert json.loads(result.stdout.splitlines()[-1])["data"].endswith("views")
    assert (tmp_path / "run" / "views" / "train" / "00000.npz").is_file()
