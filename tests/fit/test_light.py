"""The map that the light fit moves."""

import pytest
import torch

from materialist.fit.engine import LightProblem
from materialist.fit.fields import EnvmapMLP
from materialist.fit.light import fit_light
from materialist.fit.settings import LightSettings, Schedule

HEIGHT = 8


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
