"""A MatNet small enough for tests, and photos for it."""

import numpy as np
import torch

from materialist.predict.matnet import network as network_module
from materialist.predict.matnet.network import MatNet, Size
from materialist.types import Camera, Photo, Prediction

TINY = Size(width=32, blocks=4, heads=2, layers=(0, 1, 2, 3), pyramid=(8, 8, 8, 8), fused=8, grid=5)


def install(monkeypatch) -> None:
    """Make checkpoints of the tiny network loadable by their width."""
    monkeypatch.setitem(network_module.SIZES, "tiny", TINY)


def made_network(seed: int = 0) -> MatNet:
    """Random weights, none of them zero."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        network = MatNet(TINY)
        for parameter in network.parameters():
            parameter.data = torch.randn_like(parameter) * (
                0.3 if parameter.ndim < 2 else parameter[0].numel() ** -0.5
            )
    return network.eval()


def check_conventions(prediction: Prediction, size: tuple[int, int]) -> None:
    """Assert what every predictor's answer for a photo of that size keeps to."""
    assert prediction.materials.albedo.shape == prediction.normal.shape == (*size, 3)
    assert (
        prediction.depth.shape
        == prediction.materials.roughness.shape
        == prediction.materials.metallic.shape
        == size
    )
    for values in vars(prediction.materials).values():
        assert values.dtype == np.float32 and values.min() >= 0 and values.max() <= 1
    np.testing.assert_allclose(np.linalg.norm(prediction.normal, axis=-1), 1, atol=1e-5)
    assert (
        prediction.depth.min() >= 0
        and np.isfinite(prediction.depth).all()
        and prediction.depth.dtype == np.float32
    )


def made_photo(height: int = 20, width: int = 31, fov: float = 40.0) -> Photo:
    """Noise, not square, linear."""
    linear = np.random.default_rng(5).random((height, width, 3)).astype(np.float32)
    return Photo(linear=linear, camera=Camera(width, height, fov), original=linear)
