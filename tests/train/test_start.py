"""Weights that a training begins from."""

import pytest
import torch

from materialist.errors import WeightsError
from materialist.predict.bundled.network import BundledArchitecture, BundledNetwork
from materialist.predict.clicks.network import ClickNet
from materialist.predict.unet import UNetArchitecture
from materialist.train.start import fill

TINY = {"widths": (8, 8, 16, 32), "blocks": (1, 1, 1, 1), "attention": 1, "decoder_blocks": (1, 1, 1), "fine": 8}


def bundled(**more):
    return BundledNetwork(BundledArchitecture(**TINY, **more)).eval()


def answers(network):
    image = torch.rand(1, 3, 64, 64, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        return network(image, torch.zeros(1, 2, 64, 64))


def test_a_network_without_encoder_goes_on_as_it_was(tmp_path):
    torch.manual_seed(0)
    before = bundled()
    before.save(tmp_path / "w.safetensors", {})
    after = bundled(encoder="lite2")
    fill(after, tmp_path / "w.safetensors")
    for name, value in answers(before).items():
        torch.testing.assert_close(answers(after)[name], value, atol=2e-3, rtol=2e-3)


def test_what_the_encoder_tells_is_taken_on(tmp_path):
    torch.manual_seed(0)
    before = bundled(encoder="lite2")
    for parameter in before.told.parameters():
        torch.nn.init.normal_(parameter, 0, 0.1)
    before.save(tmp_path / "w.safetensors", {})
    after = bundled(encoder="lite2")
    fill(after, tmp_path / "w.safetensors")
    assert (answers(after)["depth"] - answers(before)["depth"]).abs().max() < 0.01
    plain = bundled(encoder="lite2")
    assert (answers(plain)["depth"] - answers(before)["depth"]).abs().max() > 0.01


def test_the_encoder_is_not_stored_with_a_network(tmp_path):
    torch.manual_seed(0)
    network = ClickNet(UNetArchitecture((8, 8, 8, 8, 8), (1, 1, 1, 1, 1), "lite2"))
    network.save(tmp_path / "w.safetensors", {"step": 1})
    assert (tmp_path / "w.safetensors").stat().st_size < 300_000
    found, facts = ClickNet.load(tmp_path / "w.safetensors")
    assert facts == {"step": 1}
    torch.testing.assert_close(found.encoder.stem.weight, network.encoder.stem.weight)


def test_other_weights_are_refused(tmp_path):
    bundled().save(tmp_path / "w.safetensors", {})
    with pytest.raises(WeightsError, match="is not a checkpoint of BundledNetwork"):
        fill(BundledNetwork(BundledArchitecture(**(TINY | {"fine": 16}))), tmp_path / "w.safetensors")
