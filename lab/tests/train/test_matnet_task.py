"""The paper's recipe on a MatNet of a few thousand parameters."""

import json

import numpy as np
import pytest
import torch
from made_matnet import TINY, made_network
from numpy.lib.stride_tricks import sliding_window_view

from materialist.errors import WeightsError
from materialist.predict.matnet.network import MatNet
from materialist.predict.weights import metadata
from materialist_lab.data.samples import SampleFolder
from materialist_lab.train.matnet import MAPS, PaperTask, enlarged, freeze, load_start
from materialist_lab.train.stream import epoch


@pytest.fixture
def source(data):
    return SampleFolder(data)


@pytest.fixture
def network():
    return made_network().train()


@pytest.fixture
def task(source):
    return PaperTask(source, size=TINY)


def test_a_step_moves_what_learns_and_nothing_else(network, task):
    freeze(network)
    before = {k: v.clone() for k, v in network.state_dict().items()}
    batch = next(iter(epoch(task, number=1, side=32, batch=2, seed=0)))
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
    """Whatever is drawn is a square of the sample or of its mirror image, whose normals have the other y."""
    maps = {name: np.moveaxis(np.atleast_3d(getattr(source.read(0), name)), -1, 0) for name in MAPS}
    maps["image"] = maps["image"].clip(0, 1)
    flipped = {name: values[:, ::-1] for name, values in maps.items()}
    flipped["normal"] = flipped["normal"] * [[[1]], [[-1]], [[1]]]
    windows = [
        {n: sliding_window_view(v, (32, 32), (1, 2)) for n, v in whole.items()}
        for whole in (maps, flipped)
    ]
    seen = set()
    for seed in range(8):
        drawn = task.draw(0, 32, np.random.default_rng(seed))
        for upside_down, parts in enumerate(windows):
            same = [(v == drawn[n][:, None, None]).all((0, 3, 4)) for n, v in parts.items()]
            if np.all(same, axis=0).any():
                seen.add(upside_down)
                break
        else:
            pytest.fail(f"what is drawn by seed {seed} is no part of the sample")
    assert seen == {0, 1}


def test_colours_at_the_sky_are_those_of_the_surface():
    """Next to the sky, which has no albedo, a surface of one paint keeps it; the picture itself is mixed."""
    mask = torch.zeros(1, 24, 24)
    mask[:, 10:] = 1
    small = {
        name: mask.expand(3 if name in ("image", "albedo", "normal") else 1, -1, -1) * 0.6
        for name in MAPS
    }
    large = enlarged(small | {"mask": mask}, [80, 96])
    inside = large["mask"][0] > 0
    assert 0.2 < inside.float().mean() < 0.95 and large["image"][0][inside].min() < 0.5
    for name in ("albedo", "roughness", "metallic"):
        np.testing.assert_allclose(large[name][:, inside], 0.6, atol=1e-5)


def test_starting_from_other_checkpoints(network, tmp_path):
    torch.manual_seed(9)
    other = MatNet(TINY).state_dict()
    anything = {k: v for k, v in other.items() if not k.startswith("material_head.")}
    torch.save(anything, tmp_path / "depth_anything.pth")
    copied = load_start(network, tmp_path / "depth_anything.pth")
    assert anything.keys() <= set(copied) and any(
        name.startswith("material_head.") for name in copied
    )
    torch.testing.assert_close(
        network.state_dict()["pretrained.cls_token"], other["pretrained.cls_token"]
    )
    dino = {
        k.removeprefix("pretrained."): v for k, v in other.items() if k.startswith("pretrained.")
    }
    torch.save(dino, tmp_path / "dinov2.pth")
    assert len(load_start(MatNet(TINY), tmp_path / "dinov2.pth")) == len(dino)
    torch.save({"x": torch.ones(3)}, tmp_path / "else.pth")
    with pytest.raises(WeightsError, match="no encoder that fits"):
        load_start(MatNet(TINY), tmp_path / "else.pth")


def test_a_run_leaves_weights_that_the_predictor_takes_for_its_own(task, tmp_path):
    file = tmp_path / "w.safetensors"
    task.network().save(file, {"step": 1})
    assert metadata(file)["format"] == MatNet.FORMAT and json.loads(metadata(file)["facts"]) == {
        "step": 1
    }
    assert not any(
        p.requires_grad for n, p in task.network().named_parameters() if n.startswith("pretrained.")
    )
