"""Cached shading and its gradients against the path tracer on the same scene."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from transport_scenes import away_from_edges, furnished_room, windowed_sky

from materialist.camera import project
from materialist.color import linear_to_srgb
from materialist.fit.engine import TransportEngine
from materialist.fit.losses import rendering_loss
from materialist.render.scene import RenderScene
from materialist.transport.shading import shade
from materialist.types import Materials


class Comparison:
    """One scene, rendered both ways."""

    def __init__(self, camera, geometry, materials, envmap, *, own=False):
        self.camera = camera
        self.materials = materials
        self.envmap = envmap
        self.path = RenderScene(geometry, camera)
        self.path.set_materials(materials)
        self.path.set_envmap(envmap)
        roughness = materials.roughness if own else None
        dark = np.zeros((camera.height, camera.width, 3), np.float32)
        self.engine = TransportEngine(geometry, camera, dark, roughness=roughness)
        depth = self.engine.cache.image(
            project(np.array(self.engine.cache.position).T, camera)[1][:, None]
        )[..., 0]
        self.surface = depth > 0
        self.away = away_from_edges(depth)

    def shaded(self, maps, bounces: int):
        """[H, W, 3] by gathering and shading once for direct light, and again for every bounce; the last one has
        gradients in the maps [H, W, C]."""
        maps = [m.reshape(self.surface.size, -1)[self.engine.pixels] for m in maps]
        image = None
        for _ in range(bounces):
            self.engine.radiance = None if image is None else image.detach().numpy()
            values = shade(self.engine.tables(self.envmap), maps[0], maps[1][:, 0], maps[2][:, 0])
            image = torch.zeros(self.surface.size, 3).index_copy(0, self.engine.pixels, values)
            image = image.view(*self.surface.shape, 3)
        return image

    def cached(self, bounces: int):
        """[H, W, 3] of the scene's own materials."""
        return self.shaded(_tensors(self.materials), bounces).numpy()

    def decibels(self, bounces: int, *, spp: int):
        """PSNR away from depth edges and over all surface pixels, with the noise of the reference taken out."""
        image = linear_to_srgb(self.cached(bounces))
        # Errors against two independent references: their noise has mean zero in the product.
        errors = [
            image - linear_to_srgb(self.path.render(spp=spp, seed=s, max_depth=bounces + 1))
            for s in (1, 2)
        ]
        square = (errors[0].astype(np.float64) * errors[1]).mean(-1)
        return [
            float(-10 * np.log10(max(square[mask].mean(), 1e-9)))
            for mask in (self.away, self.surface)
        ]


def _tensors(materials: Materials):
    arrays = (materials.albedo, materials.roughness, materials.metallic)
    return [torch.from_numpy(np.ascontiguousarray(a)) for a in arrays]


@pytest.fixture(scope="module")
def comparison():
    return Comparison(*furnished_room(64), windowed_sky())


@pytest.fixture(scope="module", params=["levels", "own roughness"])
def either(request, comparison):
    """Specular tables at all levels, or at the roughness of each pixel."""
    return (
        comparison
        if request.param == "levels"
        else Comparison(*furnished_room(64), windowed_sky(), own=True)
    )


@pytest.mark.parametrize(
    ("bounces", "away", "everywhere"),
    [pytest.param(1, 38, 32, marks=pytest.mark.slow), (3, 34, 30)],
    ids=["direct", "indirect"],
)
def test_cached_shading_equals_path_tracing(either, bounces, away, everywhere):
    assert either.surface.mean() > 0.95
    assert either.away.mean() > 0.5
    measured = either.decibels(bounces, spp=100)
    assert measured[0] >= away
    assert measured[1] >= everywhere


def test_cached_shading_has_no_bias(either):
    reference = either.path.render(spp=100, seed=3, max_depth=2)
    ratio = either.cached(1)[either.away].mean() / reference[either.away].mean()
    assert ratio == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize(
    "max_depth",
    [pytest.param(2, marks=pytest.mark.slow, id="direct"), pytest.param(4, id="indirect")],
)
def test_cached_gradients_point_where_path_replay_says(comparison, max_depth):
    cosines = gradient_cosines(comparison, max_depth, spp=36, image_spp=100)
    assert min(cosines) >= 0.95, cosines


def gradient_cosines(
    c: Comparison, max_depth: int, *, spp: int, image_spp: int = 256
) -> list[float]:
    """Cosines of the gradients of L1 + L2 in albedo, roughness and metallic, noise of the reference taken out."""
    c.path.set_materials(c.materials)
    target = torch.from_numpy(c.path.render(spp=image_spp, seed=7, max_depth=max_depth))
    # Darker all over: where a rendering meets the photo, the gradient of L1 is a coin toss in both.
    start = replace(
        c.materials,
        albedo=c.materials.albedo * 0.6,
        roughness=np.clip(c.materials.roughness + 0.15, 0, 1),
        metallic=c.materials.metallic * 0.6 + 0.2,
    )
    c.path.set_materials(start)
    image = torch.from_numpy(
        c.path.render(spp=image_spp, seed=9, max_depth=max_depth)
    ).requires_grad_()
    weight = torch.autograd.grad(rendering_loss(image - target, "l1+l2"), image)[0]
    leaves = [t.requires_grad_() for t in _tensors(start)]
    light = torch.from_numpy(c.envmap)
    first, second = (
        torch.autograd.grad(
            (
                weight * c.path.render_torch(*leaves, light, spp=spp, seed=s, max_depth=max_depth)
            ).sum(),
            leaves,
        )
        for s in (11, 21)
    )
    c.path.set_materials(c.materials)
    cached = torch.autograd.grad(
        rendering_loss(c.shaded(leaves, max_depth - 1) - target, "l1+l2"), leaves
    )
    return [
        # The reference's own noise has mean zero in first . second, so this is the cosine with its expectation.
        float((g * (a + b)).sum() / 2 / (g.norm() * (a * b).sum().sqrt()))
        for g, a, b in zip(cached, first, second)
    ]
