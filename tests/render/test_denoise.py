"""Denoising: noise goes, edges of the guides and the level of the light stay."""

import subprocess
import sys

import numpy as np
import pytest

from materialist.render.denoise import denoise


def noisy_step(sigma=0.3):
    """A picture of two flat halves with HDR values, its noisy version, and guides [48, 64, 3] that know the edge."""
    albedo = np.full((48, 64, 3), 0.2, np.float32)
    albedo[:, 30:] = 0.8
    clean = albedo * np.float32([4.0, 3.0, 2.0])
    noise = np.random.default_rng(0).gamma(1 / sigma**2, sigma**2, clean.shape)  # mean 1
    normal = np.zeros_like(albedo)
    normal[..., 2] = 1
    return clean, (clean * noise).astype(np.float32), albedo, normal


def rms(difference):
    return float(np.sqrt((difference**2).mean()))


def test_noise_goes_and_the_edge_stays():
    pytest.importorskip("pyoidn")
    clean, noisy, albedo, normal = noisy_step()
    result = denoise(noisy, albedo=albedo, normal=normal)
    assert result.dtype == np.float32 and result.shape == noisy.shape and (result >= 0).all()
    assert rms(result - clean) < 0.15 * rms(noisy - clean)
    assert abs(result.mean() / clean.mean() - 1) < 0.02
    step = result[:, 30].mean() - result[:, 29].mean()
    assert step > 0.9 * (clean[0, 30] - clean[0, 29]).mean()
    assert np.array_equal(result, denoise(noisy, albedo=albedo, normal=normal))


@pytest.mark.parametrize("shape", [(1, 1), (2, 40), (40, 3)])
def test_tiny_pictures_keep_their_light(shape):
    pytest.importorskip("pyoidn")
    flat = np.full((*shape, 3), 0.5, np.float32)
    result = denoise(flat, albedo=flat, normal=np.broadcast_to(np.float32([0, 0, 1]), flat.shape))
    assert result.shape == flat.shape
    assert result == pytest.approx(0.5, rel=0.15)


def test_pytorch_is_not_loaded_for_an_edit():
    """It would take seconds of each."""
    pytest.importorskip("pyoidn")
    script = """
import sys
from edit_scenes import flat_scene
from materialist.edits.composite.composite import composite
from materialist.edits.recipe import Step, apply
scene = flat_scene()
edited = apply(scene, [Step("relight", {"rotate": "20"}), Step("relight", {"ambient": "0.5"})])
composite(scene, edited, spp=2, denoise=True)
assert "torch" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", script], check=True)
