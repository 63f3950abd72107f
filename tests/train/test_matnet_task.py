"""The paper's recipe on a MatNet of a few thousand parameters."""

import json

import made_samples
import numpy as np
import pytest
import torch
from made_matnet import TINY, made_network

from materialist.errors import WeightsError
from materialist.io.samples import SampleFolder
from materialist.predict.matnet.network import MatNet
from materialist.predict.weights import metadata
from materialist.train.matnet import PaperTask, freeze, load_start
from materialist.train.stream import epoch


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    return SampleFolder(made_samples.write_set(tmp_path_factory.mktemp("set"), 2))


@pytest.fixture
def network():
    return made_network().train()


@pytest.fixture
def task(source):
    return PaperTask(source, size=TINY)


def test_a_step_moves_what_learns_and_nothing_else(network, task):
    freeze(network)
    before = {k: v.clone() for k, v in network.state_dict().items()}
    batch = next(iter(epoch(task.examples, number=1, side=32, batch=2, seed=0)))
    optimizer = torch.optim.AdamW([p for p in network.parameters() if p.requires_grad], lr=1e-3)
    terms = task.losses(network, batch)
    assert set(terms) == {"albedo", "roughness", "metallic", "normal", "depth"}
    sum(terms.values()).backward()
    optimizer.step()
    moved = {k for k, v in network.state_dict().items() if not torch.equal(v, before[k])}
    assert not any(name.startswith("pretrained.") for name in moved)
    assert any(name.startswith("material_head.") for name in moved)
    depth = [name.split(".refinenet") for name in moved if name.startswith("depth_head.")]
    assert {rest[:1] for _, rest in depth} == set("1234"), "of the depth head, its four fusions"


def test_only_flips_upside_down_and_crops(task, source):
    seen = set()
    for seed in range(8):
        sample = task.prepare(source.read(0), 32, np.random.default_rng(seed))
        assert sample.image.shape == (32, 32, 3) and sample.image.max() <= 1
        surface = sample.mask > 0
        seen.add(bool(sample.normal[surface][0, 1] < 0))
        assert (sample.normal[surface][:, 0] == 0).all()
    assert seen == {True, False}


def test_starting_from_other_checkpoints(network, tmp_path):
    torch.manual_seed(9)
    other = MatNet(TINY).state_dict()
    anything = {k: v for k, v in other.items() if not k.startswith("material_head.")}
    torch.save(anything, tmp_path / "depth_anything.pth")
    copied = load_start(network, tmp_path / "depth_anything.pth")
    assert anything.keys() <= set(copied) and any(name.startswith("material_head.") for name in copied)
    torch.testing.assert_close(network.state_dict()["pretrained.cls_token"], other["pretrained.cls_token"])
    dino = {k.removeprefix("pretrained."): v for k, v in other.items() if k.startswith("pretrained.")}
    torch.save(dino, tmp_path / "dinov2.pth")
    assert len(load_start(MatNet(TINY), tmp_path / "dinov2.pth")) == len(dino)
    torch.save({"x": torch.ones(3)}, tmp_path / "else.pth")
    with pytest.raises(WeightsError, match="no encoder that fits"):
        load_start(MatNet(TINY), tmp_path / "else.pth")


def test_a_run_leaves_weights_that_the_predictor_takes_for_its_own(task, tmp_path):
    file = tmp_path / "w.safetensors"
    task.network().save(file, {"step": 1})
    assert metadata(file)["format"] == MatNet.FORMAT and json.loads(metadata(file)["facts"]) == {"step": 1}
    assert not any(p.requires_grad for n, p in task.network().named_parameters() if n.startswith("pretrained."))
