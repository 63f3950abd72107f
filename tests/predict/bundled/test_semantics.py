"""Depth and normals from features alone, and how they are put together with those of the pixels."""

import dataclasses

import numpy as np
import pytest
import torch

from materialist.predict.bundled import inference
from materialist.predict.bundled.network import Architecture, BundledNetwork
from materialist.predict.bundled.semantics import SemanticGeometry
from materialist.train.tasks import BundledTask, geometry
from materialist.types import Camera

TINY = Architecture(widths=(8, 8, 16, 32), blocks=(1, 1, 1, 1), attention=1, decoder_blocks=(1, 1, 1), fine=8)


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(0)
    found = BundledNetwork(dataclasses.replace(TINY, encoder="lite2")).eval()
    torch.nn.init.normal_(found.semantics.head.weight, 0, 0.3)
    return found


def features(size=(64, 96), batch=2):
    generator = torch.Generator().manual_seed(1)
    shapes = [(batch, c, size[0] >> k, size[1] >> k) for c, k in zip((24, 48, 120, 352), (2, 3, 4, 5), strict=True)]
    return [torch.randn(*shape, generator=generator) for shape in shapes]


def test_maps_have_the_size_of_the_picture():
    found = SemanticGeometry((24, 48, 120, 352)).eval()(features())
    assert found["semantic_depth"].shape == (2, 1, 64, 96) and found["semantic_normal"].shape == (2, 3, 64, 96)
    torch.testing.assert_close(found["semantic_normal"].norm(dim=1), torch.ones(2, 64, 96), atol=1e-4, rtol=0)


def test_all_scales_are_heard():
    torch.manual_seed(0)
    part = SemanticGeometry((24, 48, 120, 352)).eval()
    given = features()
    before = part(given)["semantic_depth"]
    for k in range(4):
        changed = [*given[:k], -given[k], *given[k + 1 :]]
        assert (part(changed)["semantic_depth"] - before).abs().max() > 1e-4, k


def test_pixels_and_rays_are_not_heard(network):
    """What the features' part says changes neither with the rest of the network nor with the camera."""
    image, rays = torch.rand(1, 3, 64, 64), torch.zeros(1, 2, 64, 64)
    with torch.inference_mode():
        before = network(image, rays)
        kept = network.stem[0].weight.clone()
        network.stem[0].weight.mul_(-1)
        after = network(image, rays + 0.3)
        network.stem[0].weight.copy_(kept)
    torch.testing.assert_close(after["semantic_depth"], before["semantic_depth"])
    assert (after["depth"] - before["depth"]).abs().max() > 1e-4


def test_answers_are_put_together_by_their_weight(monkeypatch):
    rng = np.random.default_rng(0)
    own, semantic = rng.normal(3, 1, (9, 9)), rng.normal(-5, 1, (9, 9))
    up, right = np.zeros((9, 9, 3)), np.zeros((9, 9, 3))
    up[..., 1], right[..., 0] = 1, 1
    answer = {"depth": own, "normal": up, "semantic_depth": semantic, "semantic_normal": right, "mask": own}
    monkeypatch.setattr(inference, "SEMANTIC", 0.25)
    found = inference._blended(answer)
    assert set(found) == {"depth", "normal", "mask"}
    expected = 0.75 * (own - np.median(own)) + 0.25 * (semantic - np.median(semantic))
    np.testing.assert_allclose(found["depth"], expected - np.median(expected), atol=1e-12)
    np.testing.assert_allclose(found["normal"][0, 0], [0.25, 0.75, 0])
    alone = inference._blended({"depth": own, "normal": up})
    np.testing.assert_allclose(alone["depth"], own - np.median(own))


def test_a_mirrored_photo_has_mirrored_maps(network):
    linear = np.random.default_rng(0).random((64, 96, 3), dtype=np.float32)
    rays = inference.rays_of(Camera(96, 64, 50.0))
    there, back = (inference._mean_answer(network, p, rays, (96,), "cpu") for p in (linear, linear[:, ::-1].copy()))
    np.testing.assert_allclose(back["depth"][:, ::-1], there["depth"], atol=2e-4)
    np.testing.assert_allclose(back["normal"][:, ::-1] * [-1, 1, 1], there["normal"], atol=2e-4)


def test_both_are_taught(network):
    task, size = BundledTask(), (1, 1, 64, 64)
    image = torch.rand(1, 3, 64, 64)
    batch = {
        "image": image, "rays": torch.randn(1, 2, 64, 64) * 0.3, "albedo": image, "roughness": torch.rand(size),
        "metallic": torch.zeros(size), "normal": torch.tensor([0.0, 0, 1]).view(1, 3, 1, 1).expand(1, 3, 64, 64),
        "depth": torch.rand(size) + 1, "mask": torch.ones(size),
    }  # fmt: skip
    network.train()
    terms = task.terms(network, batch)
    out = network.eval()(image, batch["rays"])
    for name in geometry(out["depth"], out["normal"], batch):
        assert name in terms and f"semantic_{name}" in terms
    sum(terms.values()).backward()
    assert network.semantics.head.weight.grad.abs().sum() > 0
    assert all(p.grad is None for p in network.encoder.parameters())
    network.zero_grad()
