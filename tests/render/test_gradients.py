"""The differentiable rendering: its value is the path tracer's, its gradients those of finite differences."""

import numpy as np
import pytest
import torch
from render_scenes import random_maps, wall, with_floor

from materialist.render.scene import RenderScene
from materialist.types import Camera, Materials

CAMERA = Camera(5, 3, 50.0)
SIZE = (3, 5)
SPP = 16384
"""Tiny pictures take many samples cheaply: the noise of the mean loss is then well below a percent."""


@pytest.fixture(scope="module")
def corner():
    """A wall and, continued from its lowest row, a floor in front of it: light goes both ways."""
    label = np.full(SIZE, -1)
    label[2] = 0
    return RenderScene(with_floor(wall(CAMERA), label, height=-0.8), CAMERA, device="cpu")


def leaves(maps, envmap):
    arrays = (maps.albedo, maps.roughness, maps.metallic, envmap)
    return [torch.from_numpy(np.array(a, np.float32)).requires_grad_() for a in arrays]


def random_light(seed, height=6):
    return np.random.default_rng(seed).uniform(0.2, 2, (height, 2 * height, 3)).astype(np.float32)


def test_the_gradient_of_the_light_adds_up_to_the_picture(corner):
    """Radiance is linear in the light: <dL/dE, E> = L, and dL/dE of a texel is the picture that it alone makes."""
    maps = random_maps(8, SIZE)
    envmap = random_light(9)
    inputs = leaves(maps, envmap)
    corner.render_torch(*inputs, spp=16384, seed=1).sum().backward()
    gradient = inputs[3].grad.numpy()
    corner.set_materials(maps)
    corner.set_envmap(envmap)
    total = corner.render(spp=16384, seed=4).sum()
    assert float((gradient * envmap).sum()) == pytest.approx(float(total), rel=0.02)
    for texel in ((0, 3), (1, 1), (2, 11)):
        alone = np.zeros_like(envmap)
        alone[texel] = 1
        corner.set_envmap(alone)
        assert gradient[texel] == pytest.approx(
            corner.render(spp=16384, seed=5).sum((0, 1)), rel=0.08
        )


@pytest.fixture(scope="module")
def inputs():
    rng = np.random.default_rng(0)

    def draw(low, high, *shape):
        return torch.from_numpy(rng.uniform(low, high, shape).astype(np.float32))

    return {
        "albedo": draw(0.2, 0.8, 3, 5, 3),
        "roughness": draw(0.4, 0.8, 3, 5),
        "metallic": draw(0.2, 0.8, 3, 5),
        "envmap": draw(0.2, 2.0, 4, 8, 3),
    }


def loss(corner, inputs, weight, seed=0):
    return (weight * corner.render_torch(**inputs, spp=SPP, seed=seed, max_depth=3)).sum()


def test_the_value_is_the_path_tracers(corner, inputs):
    corner.set_materials(
        Materials(*(inputs[k].numpy() for k in ("albedo", "roughness", "metallic")))
    )
    corner.set_envmap(inputs["envmap"].numpy())
    expected = corner.render(spp=SPP, seed=1, max_depth=3)
    image = corner.render_torch(**inputs, spp=SPP, seed=2, max_depth=3)
    assert image.shape == (3, 5, 3) and image.dtype == torch.float32
    np.testing.assert_allclose(image.numpy(), expected, rtol=0.03)


@pytest.mark.parametrize(
    ("name", "step"), [("albedo", 0.05), ("roughness", 0.03), ("metallic", 0.05), ("envmap", 0.2)]
)
def test_gradients_are_finite_differences(corner, inputs, name, step):
    """Along a random direction of each input, the floor's share by way of the mean included."""
    rng = np.random.default_rng(1)
    weight = torch.from_numpy(rng.uniform(0.5, 1.5, (3, 5, 3)).astype(np.float32))
    direction = torch.from_numpy(rng.uniform(0.3, 1, inputs[name].shape).astype(np.float32))
    variable = inputs[name].clone().requires_grad_()
    loss(corner, {**inputs, name: variable}, weight).backward()
    analytic = float((variable.grad * direction).sum())
    ends = [
        float(loss(corner, {**inputs, name: inputs[name] + s * step * direction}, weight))
        for s in (1, -1)
    ]
    numeric = (ends[0] - ends[1]) / (2 * step)
    assert analytic == pytest.approx(numeric, rel=0.03), (analytic, numeric)
