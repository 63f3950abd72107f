"""The paper's recipe on a MatNet of a few thousand parameters."""

import json
from dataclasses import replace

import made_samples
import numpy as np
import pytest
import torch
from made_matnet import TINY, made_network

from materialist.errors import WeightsError
from materialist.io.samples import SampleFolder
from materialist.predict.matnet.network import MatNet
from materialist.predict.weights import metadata
from materialist.train.matnet import PaperTask, freeze, load_start, resized
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
    """The samples show the plane n . p = -1.2, or its mirror image; each pixel keeps its ray."""
    seen = set()
    for seed in range(8):
        sample = task.prepare(source.read(0), 32, np.random.default_rng(seed))
        assert sample.image.shape == (32, 32, 3) and sample.image.max() <= 1
        surface = sample.mask > 0
        upright = sample.normal[surface][0, 1] > 0
        seen.add(bool(upright))
        normal = made_samples.NORMAL * [1, 1 if upright else -1, 1]
        points = np.dstack([sample.rays, -np.ones(surface.shape)]) * sample.depth[..., None]
        np.testing.assert_allclose((points @ normal)[surface], -1.2, rtol=2e-3)
        np.testing.assert_allclose(sample.normal[surface] @ normal, 1, atol=1e-3)
    assert seen == {True, False}


@pytest.mark.parametrize("size", [22, 96])
def test_colours_at_the_sky_are_those_of_the_surface(source, size):
    """Next to the sky, which has no albedo, a surface of one paint keeps it; the picture itself is mixed."""
    sample = source.read(0)
    surface = sample.mask[..., None] > 0
    painted = replace(sample, albedo=np.where(surface, np.float32([0.6, 0.4, 0.2]), 0),
                      metallic=sample.mask * np.float32(0.8))  # fmt: skip
    scaled = resized(painted, size, size)
    here = scaled.mask > 0
    assert 0.2 < here.mean() < 0.95
    np.testing.assert_allclose(scaled.albedo[here], np.broadcast_to([0.6, 0.4, 0.2], (here.sum(), 3)), atol=1e-5)
    np.testing.assert_allclose(scaled.roughness[here], 0.4, atol=1e-5)
    np.testing.assert_allclose(scaled.metallic[here], 0.8, atol=1e-5)


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
