"""The map that the light fit moves."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from materialist.envmap import row_solid_angle, texel_directions
from materialist.fit.engine import LightProblem
from materialist.fit.fields import EnvmapMLP, resize_envmap
from materialist.fit.light import LightStart, envmap_field, fit_light, share_of_light, start_light
from materialist.fit.settings import DEFAULT, LightSettings, Schedule

HEIGHT = 8


@pytest.mark.parametrize("rows, asked", [(4, (4, False)), (8, (8, False)), (16, (8, True))])
def test_a_map_of_few_texels_is_what_is_fitted(rows, asked):
    """The ablation of 32 x 16 constrains the map; a finer one than the light matrix is sampled inside its texels."""

    class Recorded(EnvmapMLP):
        def forward(self, height, jitter=None):
            heights.add((height, jitter is not None))
            return super().forward(height, jitter)

    heights = set()
    taken = []
    problem = LightProblem(
        torch.arange(2),
        HEIGHT,
        lambda envmap: (taken.append(envmap), envmap[:1, :2].flatten(0, 1))[1],
    )
    settings = LightSettings(field="mlp", height=rows, schedule=Schedule(max_steps=2))
    fit_light(
        problem, torch.ones(2, 3), Recorded(), settings, LightStart(torch.ones(8, 16, 3), None)
    )
    assert heights == {asked} and all(envmap.shape == (HEIGHT, 2 * HEIGHT, 3) for envmap in taken)


def _floor(rows=16):
    """A light problem of diffuse patches of albedo 0.5 whose light comes from the upper half alone."""
    d = torch.from_numpy(texel_directions(rows, 2 * rows)).reshape(-1, 3)
    angle = torch.from_numpy(row_solid_angle(rows)).float().repeat_interleave(2 * rows)
    normals = torch.nn.functional.normalize(
        torch.tensor([[0, 1.0, 0], [0.4, 1, 0], [-0.4, 1, 0], [0, 1, 0.4]]), dim=-1
    )
    seen = (normals @ d.T).clamp(min=0) * (d[:, 1] > 0) * angle * 0.5 / torch.pi
    return LightProblem(
        torch.arange(len(normals)), rows, lambda envmap: seen @ envmap.reshape(-1, 3)
    )


def test_a_predicted_light_gets_the_exposure_of_the_photo():
    problem = _floor()
    rng = np.random.default_rng(0)
    predicted = np.concatenate([rng.uniform(0.2, 1, (8, 16, 3)), np.ones((8, 16, 1))], -1).astype(
        np.float32
    )
    settings = replace(DEFAULT.light, height=16)
    rendered = problem.render(resize_envmap(torch.from_numpy(predicted[..., :3].copy()), 16))
    start = start_light(0.4 * rendered, settings, predicted, problem)
    torch.testing.assert_close(problem.render(start.radiance), 0.4 * rendered, rtol=1e-4, atol=1e-5)
    grey = start_light(0.4 * rendered, settings, None, problem)
    assert grey.scale is None and grey.radiance.unique().numel() == 1


def test_what_the_photo_tells_nothing_about_stays_as_predicted():
    """The lower half reaches nothing: it keeps its prediction; the upper half explains a photo twice as bright."""
    problem = _floor()
    settings = replace(DEFAULT.light, height=16, schedule=Schedule(0.1, 200, patience=0))
    predicted = np.ones((16, 32, 4), np.float32)
    predicted[8:, :, :3] = [0.7, 0.5, 0.3]
    target = 2 * problem.render(torch.from_numpy(predicted[..., :3].copy())) / 10
    start = LightStart(torch.from_numpy(predicted[..., :3] / 10), torch.full((16, 32, 1), 0.5))
    field = envmap_field(settings, start.radiance)
    fit_light(problem, target, field, settings, start)
    found = field(16).detach()
    torch.testing.assert_close(problem.render(found), target, rtol=0.05, atol=0.0)
    colour = found[12:].mean((0, 1))
    torch.testing.assert_close(
        colour / colour[0], torch.tensor([1, 5 / 7, 3 / 7]), rtol=0.05, atol=0.0
    )


def test_a_lamp_counts_by_what_it_lights():
    """A texel's share is its radiance times its solid angle, 1 in the mean."""
    angle = torch.from_numpy(row_solid_angle(HEIGHT)).float().view(-1, 1, 1)
    envmap = torch.ones(HEIGHT, 2 * HEIGHT, 3)
    envmap[3, 5] = torch.tensor([30.0, 30.0, 0.0])
    share = share_of_light(envmap, angle)
    assert share.shape == envmap.shape[:2] and float(share.mean()) == pytest.approx(1)
    assert float(share[3, 5] / share[3, 4]) == pytest.approx(20)
    assert float(share[0, 0] / share[3, 0]) == pytest.approx(float(angle[0] / angle[3]))
