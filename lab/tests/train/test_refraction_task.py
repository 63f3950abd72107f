"""The training of RefractionNet, on two shapes."""

import os
import signal

import made_runs
import numpy as np
import pytest
import torch
from torch.utils.data import default_collate

from materialist.predict.refraction.crop import BACK_X, MASK, NORMAL_X, SIDE
from materialist.predict.refraction.network import RefractionNet
from materialist_lab.procedural.thickness import dataset
from materialist_lab.procedural.thickness.errors import mean_errors
from materialist_lab.train import checkpoint
from materialist_lab.train.trainer import Trainer


@pytest.fixture(scope="module")
def views(tmp_path_factory):
    folder = tmp_path_factory.mktemp("views")
    dataset.produce(folder, dataset.ViewPlan(shapes=2, views=3))
    return folder


def test_ctrl_c_leaves_a_checkpoint_and_says_how_to_go_on(run, tmp_path, monkeypatch):
    monkeypatch.setattr(
        Trainer, "_step", lambda self, batch: os.kill(os.getpid(), signal.SIGINT) or {"loss": 0.0}
    )
    plan = ["--shapes", "1", "--views", "2", "--heldout", "1", "--batch", "1"]
    code, _, _ = run("train", "refraction", "-o", tmp_path / "run", "--steps", 9, *plan)
    assert code == 130 and checkpoint.load(tmp_path / "run", "refraction")["schedule"]["step"] == 0


def test_it_leaves_weights_that_score_as_it_said_and_begin_another_run(views, tmp_path):
    trainer = made_runs.trainer(made_runs.refraction(views, views), tmp_path / "run", steps=1)
    figures = trainer.fit()
    assert figures.keys() >= {"solid", "symmetry", "hollow", "back", "back_symmetry"}
    file = tmp_path / "run" / checkpoint.WEIGHTS
    network, facts = RefractionNet.load(file)
    assert facts["step"] == 1 and facts["recipe"]["batch"] == 2
    assert mean_errors(network, dataset.load_views(views))["solid"] == pytest.approx(
        figures["solid"], rel=1e-2
    )
    again = made_runs.trainer(made_runs.refraction(views, init=file), tmp_path / "second", steps=1)
    for result, expected in zip(
        again.network.parameters(), trainer.averaged.parameters(), strict=True
    ):
        torch.testing.assert_close(
            result.detach(), expected.detach(), atol=1e-6, rtol=1e-3
        )  # stored as float16


def test_bad_weights_to_begin_with_are_said_before_views_are_made(refused, tmp_path):
    (tmp_path / "bad.safetensors").write_bytes(b"nothing")
    for name in ("bad.safetensors", "missing.safetensors"):
        assert name in refused(
            "train", "refraction", "-o", tmp_path / "run", "--steps", 1, "--init", tmp_path / name
        )
    assert not (tmp_path / "run").exists()


def test_a_mirrored_view_is_a_view_of_the_mirrored_shape(views):
    """Mirrored views keep what the mirror image of a shape would have: x turns around, in front and behind."""
    task = made_runs.refraction(views)
    seen = set()
    whole = default_collate([task.draw(k, SIDE, np.random.default_rng(k)) for k in range(6)])
    varied = task.vary(whole, SIDE, torch.Generator().manual_seed(0))
    for k in range(6):
        turned = not torch.equal(varied["target"][k], whole["target"][k].float())
        seen.add(turned)
        for name, channel, sign in (
            ("maps", NORMAL_X, -1),
            ("maps", NORMAL_X + 1, 1),
            ("target", BACK_X, -1),
            ("target", BACK_X + 1, 1),
            ("target", 0, 1),
        ):
            before = whole[name][k, channel].float()
            assert torch.equal(
                varied[name][k, channel], sign * before.flip(-1) if turned else before
            )
    assert seen == {True, False}
    small = task.vary(whole, SIDE // 2, torch.Generator().manual_seed(0))
    assert small["maps"].shape[2:] == small["target"].shape[2:] == (SIDE // 2, SIDE // 2)
    assert set(small["maps"][:, MASK].unique().tolist()) == {0, 1}
