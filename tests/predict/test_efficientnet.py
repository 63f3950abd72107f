"""The encoder that the networks share."""

import pytest
import torch

from materialist.predict.efficientnet import shipped

FIGURES = (
    (24, -1.2621, 8.2813, 9.2987, 8.4701, -5.9386),
    (48, -0.5538, 7.8424, 9.9643, -6.1738, 6.2877),
    (120, -0.2624, 4.4237, 8.6887, -10.2042, -2.9417),
    (352, 0.0155, 1.9152, 0.4106, 0.0495, -0.7167),
)
"""Channels, mean, spread and three values that efficientnet_lite_pytorch 0.1.0 has for `picture`, in float32."""


def picture():
    """Two ramps and a ripple, 260 x 260: the size for which that package pads."""
    rows, columns = torch.meshgrid(
        torch.linspace(0, 1, 260), torch.linspace(0, 1, 260), indexing="ij"
    )
    return torch.stack([rows, columns, (6 * rows * columns).sin() * 0.5 + 0.5])[None]


def test_the_package_has_the_classifier_it_names():
    """Against the reference implementation with the same checkpoint; the package stores int8."""
    encoder = shipped("lite2")
    with torch.no_grad():
        found = encoder(picture())
    for one, (channels, mean, spread, *values) in zip(found, FIGURES, strict=True):
        assert one.shape[1] == channels
        assert one.mean().item() == pytest.approx(mean, abs=0.01)
        assert one.std().item() == pytest.approx(spread, rel=4e-3)
        places = [one[0, 0, 0, 0], one[0, -1, -1, -1], one[0, 7, 1, 1]]
        assert [v.item() for v in places] == pytest.approx(values, abs=0.03 * spread)
