"""The albedo solved pixel by pixel, against minima found another way."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.optimize import minimize_scalar

from materialist.color import CLIPPED
from materialist.fit import albedo
from materialist.fit.albedo import solve_albedo
from materialist.fit.losses import decode, encode
from materialist.fit.settings import DEFAULT

WEIGHT = 0.7
SETTINGS = replace(DEFAULT.materials, weights=(WEIGHT, 1.0, 1.0))


def made(count=40, seed=0):
    """Light, highlights and photo [P, 3], prior [P, 5]."""
    rng = np.random.default_rng(seed)
    light = rng.uniform(0.02, 3, (count, 3))
    shine = rng.uniform(0, 0.3, (count, 3))
    photo = rng.uniform(0, 0.9, (count, 3))
    prior = np.concatenate([rng.uniform(0.02, 0.95, (count, 3)), np.full((count, 2), 0.5)], 1)
    return [torch.from_numpy(x.astype(np.float32)) for x in (light, shine, photo, prior)]


def solved(light, shine, photo, prior, settings=SETTINGS):
    problem = lambda maps, rows: maps[:, :3] * light[rows] + shine[rows]  # noqa: E731
    return solve_albedo(problem, photo, prior, settings)


@pytest.mark.parametrize("white", (np.inf, CLIPPED))
def test_it_is_the_minimum_for_every_channel_by_itself(white):
    light, shine, photo, prior = made()
    photo[:5] = 1.0  # clipped
    maps, result = solved(light, shine, photo, prior, replace(SETTINGS, white=white))

    def s(x):
        return encode(torch.tensor(x, dtype=torch.float64), "srgb").item()

    for place in np.ndindex(len(photo), 3):

        def cost(a, k=place):
            error = s(a * light[k].item() + shine[k].item()) - s(photo[k].item())
            if photo[k] >= white:
                error = min(error, 0)
            return error**2 + WEIGHT * (s(a) - s(prior[k].item())) ** 2

        best = minimize_scalar(cost, bounds=(0, 1), method="bounded", options={"xatol": 1e-6})
        assert cost(maps[place].item()) <= best.fun + 1e-6
    torch.testing.assert_close(maps[:, 3:], prior[:, 3:])
    assert result.losses[1] < result.losses[0]


def test_strips_are_solved_as_all_together(monkeypatch):
    everything = solved(*made())
    monkeypatch.setattr(albedo, "STRIP_PIXELS", 7)
    strips = solved(*made())
    torch.testing.assert_close(strips[0], everything[0])
    assert strips[1].losses == pytest.approx(everything[1].losses)


def test_a_stop_leaves_the_prior():
    light, _, photo, prior = made()
    problem = lambda maps, rows: maps[:, :3] * light[rows]  # noqa: E731
    maps, _ = solve_albedo(problem, photo, prior, SETTINGS, stop=lambda: True)
    torch.testing.assert_close(maps, prior)


@pytest.mark.parametrize("encoding", ("linear", "srgb", "log1p"))
def test_decoding_undoes_encoding(encoding):
    radiance = torch.linspace(0, 1, 200)
    torch.testing.assert_close(decode(encode(radiance, encoding), encoding), radiance)
