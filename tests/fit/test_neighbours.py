"""Edge-aware smoothness against a loop."""

import math

import numpy as np
import pytest
import torch

from materialist.fit.neighbours import neighbours

H, W = 5, 7


def slow_twin(pixels, guide, values, tolerance: float = 0.1) -> float:
    row_of, total = {int(p): k for k, p in enumerate(pixels)}, 0.0
    for p in pixels:
        i, j = divmod(int(p), W)
        for a, b in ((i + 1, j), (i, j + 1)):
            if a < H and b < W and (q := a * W + b) in row_of:
                weight = math.exp(-float(np.abs(guide[a, b] - guide[i, j]).max()) / tolerance)
                total += weight * float((values[row_of[q]] - values[row_of[int(p)]]).abs().sum())
    return total / values.numel()


@pytest.mark.parametrize("everywhere", [True, False])
def test_total_variation_equals_a_loop(everywhere):
    rng = np.random.default_rng(0)
    guide = rng.random((H, W, 3)).astype(np.float32) * 0.3
    pixels = np.arange(H * W) if everywhere else np.sort(rng.permutation(H * W)[:23])
    values = torch.from_numpy(rng.random((len(pixels), 2)).astype(np.float32))
    measured = neighbours(pixels, guide).total_variation(values)
    assert float(measured) == pytest.approx(slow_twin(pixels, guide, values), rel=1e-5)


def test_an_edge_in_the_photo_lets_the_maps_jump():
    guide = np.zeros((H, W, 3), np.float32)
    guide[:, 3:] = 1
    values = torch.from_numpy(np.repeat(np.arange(W) >= 3, 1)[None, :].repeat(H, 0).reshape(-1, 1).astype(np.float32))
    pixels = np.arange(H * W)
    free, priced = (neighbours(pixels, g).total_variation(values) for g in (guide, np.zeros_like(guide)))
    assert float(priced) == pytest.approx(1 / W)
    assert float(free) < 1e-3 * float(priced)
