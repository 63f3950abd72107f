"""Our MatNet against the published one: names, shapes and numbers (../shared/parity)."""

import json
import zlib
from math import prod

import numpy as np
import pytest
import torch

from materialist.predict.matnet.network import MatNet
from materialist.predict.matnet.predictor import infer_matnet

MAPS = ("albedo", "roughness", "metallic", "normal", "depth")


def filled(name: str, shape: list[int]) -> torch.Tensor:
    """One tensor of the fixture's recipe."""
    r = torch.randn(shape, generator=torch.Generator().manual_seed(zlib.crc32(name.encode())))
    if len(shape) >= 2:
        return r / prod(shape[1:]) ** 0.5
    if name.endswith("gamma") or ("norm" in name and name.endswith("weight")):
        return 1 + 0.1 * r
    return 0.1 * r


@pytest.fixture(scope="module")
def expected(real_data) -> dict[str, np.ndarray]:
    return dict(np.load(real_data("parity/matnet_vitb_io.npz")))


@pytest.fixture(scope="module")
def keys(real_data) -> dict[str, list[int]]:
    return json.loads(real_data("parity/matnet_vitb_keys.json").read_text())


@pytest.fixture(scope="module")
def network(keys) -> MatNet:
    network = MatNet("vitb")
    network.load_state_dict(
        {name: filled(name, shape) for name, shape in keys.items()}, strict=True
    )
    return network.eval()


def worst(found: np.ndarray, wanted: np.ndarray) -> float:
    """Largest difference, relative to the largest value."""
    assert found.shape == wanted.shape
    return float(np.abs(found - wanted).max() / np.abs(wanted).max())


def test_names_and_shapes_are_the_published_ones(keys):
    with torch.device("meta"):
        ours = {name: list(x.shape) for name, x in MatNet("vitb").state_dict().items()}
    assert len(keys) == 303
    assert ours == keys


def test_forward_is_the_published_one(network, expected):
    image = torch.from_numpy(expected["image"]).permute(2, 0, 1)[None]
    with torch.no_grad():
        outputs = network(image)
    for name in MAPS:
        assert worst(outputs[name][0].numpy(), expected[f"forward_{name}"]) < 1e-4, name


def test_inference_is_the_published_one(network, expected):
    outputs = infer_matnet(network, expected["image"], input_size=140)
    for name in MAPS:
        assert worst(outputs[name], expected[f"infer140_{name}"]) < 1e-4, name
