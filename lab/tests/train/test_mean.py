"""Means of weights."""

from dataclasses import replace

import pytest
import torch

from materialist.errors import InputError
from materialist.predict.bundled.network import BundledArchitecture, BundledNetwork
from materialist_lab.train.mean import write_mean

TINY = BundledArchitecture(
    widths=(8, 8, 16, 32), blocks=(1, 1, 1, 1), attention=1, decoder_blocks=(1, 1, 1), fine=8
)


@pytest.fixture
def files(tmp_path):
    """Weights without and with the transformer's features, and their networks."""
    torch.manual_seed(0)
    networks = BundledNetwork(TINY), BundledNetwork(replace(TINY, patches="dinov2-vits14"))
    torch.nn.init.constant_(networks[1].patch_terms[0].weight, 0.5)
    paths = [tmp_path / "first.safetensors", tmp_path / "second.safetensors"]
    for network, path in zip(networks, paths, strict=True):
        network.save(path, {"step": 3})
    return networks, paths


def test_the_mean_is_between_both_and_new_layers_come_by_their_share(files, tmp_path):
    (first, second), paths = files
    write_mean(*paths, tmp_path / "mean.safetensors", 0.25)
    mean, facts = BundledNetwork.load(tmp_path / "mean.safetensors")
    expected = 0.25 * second.head.weight + 0.75 * first.head.weight
    torch.testing.assert_close(mean.head.weight, expected, atol=1e-3, rtol=0)
    assert mean.patch_terms[0].weight.mean().item() == pytest.approx(0.125, abs=1e-4)
    assert facts["step"] == 3
    assert facts["mean"] == {"share": 0.25, "with": "first.safetensors"}


def test_the_newer_weights_come_second(files, tmp_path):
    _, (first, second) = files
    with pytest.raises(InputError, match=r"lacks patch_terms.*second"):
        write_mean(second, first, tmp_path / "mean.safetensors", 0.5)
    with pytest.raises(InputError, match="--share is 2"):
        write_mean(first, second, tmp_path / "mean.safetensors", 2)
    assert not (tmp_path / "mean.safetensors").exists()
