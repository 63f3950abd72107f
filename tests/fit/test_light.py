"""The smoothness of the light: hidden texels are stiff, seen ones free."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from transport_scenes import furnished_room

from materialist.fit.engine import LightProblem
from materialist.fit.fields import EnvmapMLP
from materialist.fit.light import SEEN, STIFFEST, fit_light, stiffness
from materialist.fit.loop import Schedule
from materialist.fit.settings import LightSettings
from materialist.transport.cache import TransportCache
from materialist.transport.light import light_matrix

HEIGHT = 8


@pytest.fixture(scope="module")
def matrix():
    camera, geometry, materials = furnished_room(24)
    cache = TransportCache(geometry, camera, diffuse_samples=16, specular_samples=4)
    return light_matrix(cache, materials, np.arange(len(cache.pixels)), HEIGHT)


def test_openness_is_the_share_of_light_that_arrives(matrix):
    arrives = matrix.parts[0].sum(0)
    assert matrix.open.shape == (2 * HEIGHT * HEIGHT,)
    assert float(matrix.open.min()) >= 0 and float(matrix.open.max()) <= 1 + 1e-5
    # A texel of which nothing arrives is closed; one without pixels that face it counts as open.
    assert ((matrix.open < 1e-6) | (arrives > 0) | (matrix.open == 1)).all()
    # What is behind the room's walls is hidden, what stands over the open side is seen.
    assert float(matrix.open.min()) < 0.05 and float(matrix.open[arrives > 0].max()) > 0.8


def test_hidden_texels_are_stiff(matrix):
    weight = stiffness(replace(matrix, open=torch.linspace(0, 1, 2 * HEIGHT * HEIGHT)))
    assert weight.shape == (HEIGHT, 2 * HEIGHT)
    flat = weight.flatten()
    assert float(flat[0]) == STIFFEST and float(flat[-1]) == 1
    middle = 2 * HEIGHT * HEIGHT // 4
    assert float(flat[middle]) == pytest.approx(SEEN / (middle / (2 * HEIGHT * HEIGHT - 1)))
    assert (flat.diff() <= 0).all()


@pytest.mark.parametrize("rows, asked", [(4, (4, False)), (8, (8, False)), (16, (8, True))])
def test_a_map_of_few_texels_is_what_is_fitted(rows, asked):
    """The ablation of 32 x 16 constrains the map; a finer one than the light matrix is sampled inside its texels."""

    class Recorded(EnvmapMLP):
        def forward(self, height, jitter=None):
            heights.add((height, jitter is not None))
            return super().forward(height, jitter)

    heights, taken = set(), []
    problem = LightProblem(
        torch.arange(2), HEIGHT, lambda envmap: (taken.append(envmap), envmap[:1, :2].flatten(0, 1))[1]
    )
    settings = LightSettings(field="mlp", height=rows, schedule=Schedule(max_steps=2))
    fit_light(problem, torch.ones(2, 3), Recorded(), settings)
    assert heights == {asked} and all(envmap.shape == (HEIGHT, 2 * HEIGHT, 3) for envmap in taken)
