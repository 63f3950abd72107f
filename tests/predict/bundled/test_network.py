"""The bundled network and what happens around it, with random weights."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch
from made_matnet import check_conventions, made_photo
from safetensors.torch import load_file, save_file

from materialist.errors import WeightsError
from materialist.predict.bundled import inference
from materialist.predict.bundled.network import BundledArchitecture, BundledNetwork
from materialist.predict.bundled.predictor import BundledPredictor

TINY = BundledArchitecture(
    widths=(8, 8, 16, 32), blocks=(1, 1, 1, 1), attention=1, decoder_blocks=(1, 1, 1), fine=8
)


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(0)
    return BundledNetwork(TINY).eval()


@pytest.fixture
def file(network, tmp_path):
    path = tmp_path / "own.safetensors"
    network.save(path, {"step": 7})
    return path


def test_the_spread_is_the_expected_error_and_changes_no_map(network, tmp_path):
    torch.manual_seed(1)
    with_spread = BundledNetwork(replace(TINY, spread=True))
    with_spread.load_state_dict(network.state_dict(), strict=False)
    with_spread.save(tmp_path / "spread.safetensors", {"step": 7})
    network.save(tmp_path / "plain.safetensors", {"step": 7})
    photo = made_photo(45, 61)
    plain = BundledPredictor(tmp_path / "plain.safetensors").predict(photo)
    found = BundledPredictor(tmp_path / "spread.safetensors").predict(photo)
    assert plain.spread == {}
    assert set(found.spread) == {"albedo", "roughness", "metallic", "normal", "depth"}
    for values in found.spread.values():
        assert values.shape == (45, 61)
        np.testing.assert_allclose(values, 0.1, rtol=0.02)
    np.testing.assert_array_equal(plain.materials.albedo, found.materials.albedo)


def test_the_spread_teaches_its_own_head_alone():
    network = BundledNetwork(replace(TINY, spread=True))
    maps = network(torch.rand(1, 3, 32, 32), torch.zeros(1, 2, 32, 32))
    maps["spread"].sum().backward()
    moved = {name.partition(".")[0] for name, p in network.named_parameters() if p.grad is not None}
    assert moved == {"spread"}


def test_features_of_patches_begin_by_telling_nothing(network, tmp_path):
    with_patches = BundledNetwork(replace(TINY, patches="dinov2-vits14")).eval()
    with_patches.load_state_dict(network.state_dict(), strict=False)
    image = torch.rand(1, 3, 64, 96)
    rays = torch.zeros(1, 2, 64, 96)
    with torch.no_grad():
        plain = network(image, rays)
        untrained = with_patches(image, rays)
        torch.nn.init.normal_(with_patches.patch_terms[1].weight, std=0.1)
        changed = with_patches(image, rays)
    for name, values in plain.items():
        torch.testing.assert_close(untrained[name], values)
    assert (changed["normal"] - plain["normal"]).abs().max() > 1e-3
    # The file holds what was learnt here, and not the transformer.
    with_patches.save(tmp_path / "patches.safetensors", {})
    stored = load_file(tmp_path / "patches.safetensors")
    assert not any(name.startswith("encoder_patches.") for name in stored)
    again, _ = BundledNetwork.load(tmp_path / "patches.safetensors")
    with torch.no_grad():
        torch.testing.assert_close(
            again(image, rays)["normal"], changed["normal"], atol=2e-2, rtol=0
        )


def test_the_transformer_does_not_learn_with_the_network():
    network = BundledNetwork(replace(TINY, patches="dinov2-vits14"))
    network(torch.rand(1, 3, 32, 32), torch.zeros(1, 2, 32, 32))["depth"].square().sum().backward()
    moved = {name.partition(".")[0] for name, p in network.named_parameters() if p.grad is not None}
    assert "patch_terms" in moved
    assert "encoder_patches" not in moved


@pytest.mark.parametrize("size", [(32, 32), (45, 61), (97, 33), (7, 150)])
def test_any_size(file, size):
    answers = []
    predictor = BundledPredictor(file)
    predictor.on_materials = answers.append
    prediction = predictor.predict(made_photo(*size))
    # The first answer's materials at once, then those of all of them.
    assert [one.albedo.shape[:2] for one in answers] == [prediction.depth.shape] * len(answers)
    assert answers[-1].albedo is prediction.materials.albedo and len(answers) <= 2
    check_conventions(prediction, size)
    known = prediction.depth > 0
    assert known.any()
    assert np.median(prediction.depth[known]) == pytest.approx(
        inference.SETTINGS.median_depth, rel=0.05
    )


def test_bad_weights_are_refused(file, tmp_path):
    whole = file.read_bytes()
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(WeightsError, match="truncated or damaged"):
        BundledPredictor(broken)
    tensors = load_file(file)
    tensors["head.bias"] = torch.full_like(tensors["head.bias"], float("nan"))
    meta = {
        "format": BundledNetwork.FORMAT,
        "architecture": json.dumps(TINY.as_dict()),
        "facts": "{}",
    }
    save_file(tensors, broken, meta)
    with pytest.raises(WeightsError, match="NaN"):
        BundledPredictor(broken)
    del tensors["head.bias"]
    save_file(tensors, broken, meta)
    with pytest.raises(WeightsError, match=r"Missing.*head\.bias"):
        BundledPredictor(broken)
    save_file(tensors, broken, {})
    with pytest.raises(WeightsError, match="has format None"):
        BundledPredictor(broken)
    save_file(tensors, broken, {**meta, "architecture": '{"widths": [1]}'})
    with pytest.raises(WeightsError, match="describes no usable network"):
        BundledPredictor(broken)
