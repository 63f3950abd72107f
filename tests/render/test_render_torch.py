"""The differentiable rendering: its value is the path tracer's, its gradients are finite differences."""

import numpy as np
import pytest
import torch
from render_scenes import wall, with_floor

from materialist.render.scene import RenderScene
from materialist.types import Camera, Materials

CAMERA = Camera(5, 4, 50.0)
SPP = 16384
"""Tiny pictures take many samples cheaply: the noise of the mean loss is then well below a percent."""


@pytest.fixture(scope="module")
def scene():
    """A wall above a floor that continues its lowest row."""
    label = np.full((4, 5), -1)
    label[3] = 0
    return RenderScene(with_floor(wall(CAMERA), label, height=-0.9), CAMERA, device="cpu")


@pytest.fixture(scope="module")
def inputs():
    rng = np.random.default_rng(0)
    draw = lambda low, high, *shape: torch.from_numpy(rng.uniform(low, high, shape).astype(np.float32))  # noqa: E731
    return {
        "albedo": draw(0.2, 0.8, 4, 5, 3),
        "roughness": draw(0.4, 0.8, 4, 5),
        "metallic": draw(0.2, 0.8, 4, 5),
        "envmap": draw(0.2, 2.0, 4, 8, 3),
    }


def loss(scene, inputs, weight, seed=0):
    return (weight * scene.render_torch(**inputs, spp=SPP, seed=seed, max_depth=3)).sum()


def test_the_value_is_the_path_tracers(scene, inputs):
    scene.set_materials(Materials(*(inputs[k].numpy() for k in ("albedo", "roughness", "metallic"))))
    scene.set_envmap(inputs["envmap"].numpy())
    expected = scene.render(spp=SPP, seed=1, max_depth=3)
    image = scene.render_torch(**inputs, spp=SPP, seed=2, max_depth=3)
    assert image.shape == (4, 5, 3) and image.dtype == torch.float32
    np.testing.assert_allclose(image.numpy(), expected, rtol=0.03)


@pytest.mark.parametrize(("name", "step"), [("albedo", 0.05), ("roughness", 0.03), ("metallic", 0.05), ("envmap", 0.2)])
def test_gradients_are_finite_differences(scene, inputs, name, step):
    """Along a random direction of each input, the floor's share by way of the mean included."""
    rng = np.random.default_rng(1)
    weight = torch.from_numpy(rng.uniform(0.5, 1.5, (4, 5, 3)).astype(np.float32))
    direction = torch.from_numpy(rng.uniform(0.3, 1, inputs[name].shape).astype(np.float32))
    variable = inputs[name].clone().requires_grad_()
    loss(scene, {**inputs, name: variable}, weight).backward()
    analytic = float((variable.grad * direction).sum())
    ends = [float(loss(scene, {**inputs, name: inputs[name] + s * step * direction}, weight)) for s in (1, -1)]
    numeric = (ends[0] - ends[1]) / (2 * step)
    assert analytic == pytest.approx(numeric, rel=0.03), (analytic, numeric)
