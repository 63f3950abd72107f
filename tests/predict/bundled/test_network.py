"""The bundled network and what happens around it, with random weights."""

import json

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from materialist.camera import pixel_rays
from materialist.errors import WeightsError
from materialist.predict.bundled import inference
from materialist.predict.bundled.network import BundledArchitecture, BundledNetwork
from materialist.predict.bundled.predictor import BundledPredictor
from materialist.types import Camera, Photo

TINY = BundledArchitecture(widths=(8, 8, 16, 32), blocks=(1, 1, 1, 1), attention=1, decoder_blocks=(1, 1, 1), fine=8)


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(0)
    return BundledNetwork(TINY).eval()


@pytest.fixture
def file(network, tmp_path):
    path = tmp_path / "own.safetensors"
    network.save(path, {"step": 7})
    return path


def _photo(height, width, fov=50.0, seed=0):
    linear = np.random.default_rng(seed).random((height, width, 3), dtype=np.float32)
    return Photo(linear=linear, camera=Camera(width, height, fov), original=linear)


@pytest.mark.parametrize("size", [(32, 32), (45, 61), (97, 33), (7, 150)])
def test_any_size(file, size):
    photo = _photo(*size)
    prediction = BundledPredictor(file).predict(photo)
    m = prediction.materials
    assert m.albedo.shape == (*size, 3) and m.roughness.shape == m.metallic.shape == prediction.depth.shape == size
    for array in (m.albedo, m.roughness, m.metallic):
        assert array.dtype == np.float32 and array.min() >= 0 and array.max() <= 1
    np.testing.assert_allclose(np.linalg.norm(prediction.normal, axis=-1), 1, atol=1e-4)
    known = prediction.depth > 0
    assert known.any() and np.isfinite(prediction.depth).all()
    assert np.median(prediction.depth[known]) == pytest.approx(inference.SETTINGS.median_depth, rel=0.05)


def test_rays_go_on_into_the_padding(network):
    """A picture of 40 columns is padded to 64, where the rays must be those of a wider camera."""
    captured = {}

    class Spy(torch.nn.Module):
        def forward(self, image, rays):
            captured["rays"] = rays
            return network(image, rays)

    camera = Camera(40, 40, 50.0)
    inference.infer(Spy(), np.zeros((40, 40, 3), np.float32), pixel_rays(camera)[..., :2].copy())
    rays = captured["rays"][0].permute(1, 2, 0).numpy()
    assert rays.shape == (64, 64, 2)
    np.testing.assert_allclose(rays[:40, :40], pixel_rays(camera)[..., :2], atol=1e-6)
    np.testing.assert_allclose(np.diff(rays[0, :, 0]), 1 / camera.focal, rtol=1e-3)
    np.testing.assert_allclose(np.diff(rays[:, 0, 1]), -1 / camera.focal, rtol=1e-3)


def test_bad_weights_are_refused(file, tmp_path):
    whole = file.read_bytes()
    broken = tmp_path / "broken.safetensors"
    broken.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(WeightsError, match="truncated or damaged"):
        BundledPredictor(broken)
    tensors = load_file(file)
    tensors["head.bias"] = torch.full_like(tensors["head.bias"], float("nan"))
    meta = {"format": BundledNetwork.FORMAT, "architecture": json.dumps(TINY.as_dict()), "facts": "{}"}
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
