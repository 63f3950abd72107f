"""The fused loss against the same terms in torch, values and gradients."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from materialist.fit.engine import MaterialProblem
from materialist.fit.losses import edge_weights
from materialist.fit.materials import material_objective
from materialist.fit.settings import DEFAULT
from materialist.render.variant import setup
from materialist.transport.cache import ROUGHNESS_LEVELS, Tables
from materialist.transport.shading import shade

HEIGHT, WIDTH = 9, 7


def problem(seed: int = 0, holes: bool = True):
    """Random tables, photo, prior and guide of a picture, with some pixels of sky."""
    setup("cpu")
    rng = np.random.default_rng(seed)
    pixels = np.flatnonzero(rng.random(HEIGHT * WIDTH) < (0.8 if holes else 2))
    count = len(pixels)
    draw = lambda *shape: torch.from_numpy(rng.random(shape).astype(np.float32))  # noqa: E731
    tables = Tables(draw(count, 9), draw(len(ROUGHNESS_LEVELS), count, 6))
    photo = draw(count, 3)
    photo[::4, 1] = 1.0
    edges = edge_weights(pixels, rng.random((HEIGHT, WIDTH, 3)).astype(np.float32))
    return tables, photo, draw(count, 5), edges, 0.5 + draw(count, 3)


def both(tables, photo, prior, edges, factor, settings):
    """The fused objective and its twin in torch."""
    cached = MaterialProblem(lambda m: shade(tables, m[:, :3], m[:, 3], m[:, 4]), tables)
    twin = replace(cached, tables=None)
    return [material_objective(p, photo, prior, settings, edges, factor) for p in (cached, twin)]


def value_and_gradient(objective, maps):
    leaf = maps.clone().requires_grad_()
    value = objective(leaf)
    value.backward()
    return value.item(), leaf.grad.numpy()


@pytest.mark.parametrize("encoding", ["linear", "srgb", "log1p"])
@pytest.mark.parametrize("clipped", [False, True])
@pytest.mark.parametrize("holes", [False, True])
def test_equals_the_terms_in_torch(encoding, clipped, holes):
    settings = replace(DEFAULT.materials, encoding=encoding, clipped=clipped, delta=0.7)
    tables, photo, prior, edges, factor = problem(1, holes)
    rng = np.random.default_rng(2)
    maps = torch.from_numpy(rng.random(prior.shape).astype(np.float32))
    fused, twin = both(tables, photo, prior, edges, factor, settings)
    value, gradient = value_and_gradient(fused, maps)
    expected, slope = value_and_gradient(twin, maps)
    assert value == pytest.approx(expected, rel=1e-5)
    assert gradient == pytest.approx(slope, rel=1e-3, abs=1e-5 * float(np.abs(slope).max()))


def test_dark_and_out_of_range_materials_stay_finite():
    tables, photo, prior, edges, factor = problem(5)
    black = Tables(0 * tables.diffuse, 0 * tables.specular)
    for maps in (torch.zeros_like(prior), torch.ones_like(prior)):
        for given in (tables, black):
            fused, twin = both(given, photo, prior, edges, factor, DEFAULT.materials)
            value, gradient = value_and_gradient(fused, maps)
            assert np.isfinite(value) and np.isfinite(gradient).all()
            assert value == pytest.approx(value_and_gradient(twin, maps)[0], rel=1e-5)


def test_gradient_is_the_finite_difference():
    settings = replace(DEFAULT.materials, clipped=False)
    tables, photo, prior, edges, factor = problem(7)
    fused, _ = both(tables, photo, prior, edges, factor, settings)
    maps = prior + 0.03
    _, gradient = value_and_gradient(fused, maps)
    rng, step = np.random.default_rng(8), 1e-3
    for column in range(5):
        direction = torch.zeros_like(maps)
        direction[:, column] = torch.from_numpy(rng.normal(size=len(maps)).astype(np.float32))
        ends = [fused(maps + s * direction).item() for s in (step, -step)]
        expected = float((torch.from_numpy(gradient) * direction).sum())
        assert (ends[0] - ends[1]) / (2 * step) == pytest.approx(expected, rel=0.1, abs=2e-4)


def test_total_variation_equals_a_loop():
    rng = np.random.default_rng(0)
    guide = rng.random((HEIGHT, WIDTH, 3)).astype(np.float32) * 0.3
    pixels = np.sort(rng.permutation(HEIGHT * WIDTH)[:40])
    values = rng.random((40, 2)).astype(np.float32)
    row_of, total = {int(p): k for k, p in enumerate(pixels)}, np.zeros(2)
    for p in pixels:
        i, j = divmod(int(p), WIDTH)
        for a, b in ((i + 1, j), (i, j + 1)):
            if a < HEIGHT and b < WIDTH and (q := a * WIDTH + b) in row_of:
                weight = np.exp(-np.abs(guide[a, b] - guide[i, j]).max() / 0.1)
                total += weight * np.abs(values[row_of[q]] - values[row_of[int(p)]])
    measured = edge_weights(pixels, guide).total_variation(torch.from_numpy(values))
    np.testing.assert_allclose(measured, total / 40, rtol=1e-5)
