"""The material fit against minima found another way."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.optimize import minimize_scalar

from materialist.color import CLIPPED
from materialist.fit.fields import ALL, MaterialMaps
from materialist.fit.losses import encode
from materialist.fit.materials import fit_materials
from materialist.fit.settings import DEFAULT, MaterialSettings, MaterialStage, Schedule

WEIGHT = 0.7


def shaded(light):
    """Rendering where a pixel's radiance is light [P, 3] times albedo."""
    return lambda maps, rows: maps[:, :3] * light[rows]


def fitted(light, photo, prior, white=math.inf, step_pixels=0):
    """[P, 5] maps by steps of Adam."""
    schedule = Schedule(learning_rate=0.02, max_steps=400, decay_every=100, decay=0.3, patience=0)
    settings = replace(
        DEFAULT.materials,
        weights=(WEIGHT, 1.0, 1.0),
        white=white,
        stages=(MaterialStage(("albedo",), schedule),),
        step_pixels=step_pixels,
    )
    field = MaterialMaps(prior)
    fit_materials(shaded(light), photo, field, prior, settings)
    return field().detach()


def test_albedo_lies_between_the_prior_and_what_the_photo_asks_for():
    """argmin (s(render A) - s(photo))^2 + w (s(A) - s(A0))^2, s the sRGB curve, for every channel by itself."""
    rng = np.random.default_rng(0)
    light = rng.uniform(0.5, 2, (6, 3))
    photo = rng.uniform(0.05, 0.9, (6, 3))
    prior = np.concatenate([rng.uniform(0.1, 0.9, (6, 3)), np.full((6, 2), 0.5)], 1)
    found = fitted(*(torch.from_numpy(x.astype(np.float32)) for x in (light, photo, prior)))

    def s(x):
        return encode(torch.tensor(x), "srgb").item()

    for place in np.ndindex(6, 3):

        def cost(a, k=place):
            return (s(a * light[k]) - s(photo[k])) ** 2 + WEIGHT * (s(a) - s(prior[k])) ** 2

        best = minimize_scalar(cost, bounds=(0, 1), method="bounded").x
        assert abs(found[place].item() - best) < 0.01
    torch.testing.assert_close(found[:, 3:], torch.full((6, 2), 0.5))


def test_a_clipped_photo_asks_for_nothing_darker():
    light = torch.full((1, 3), 2.0)
    prior = torch.full((1, 5), 0.6)
    torch.testing.assert_close(fitted(light, torch.ones(1, 3), prior, white=CLIPPED), prior)
    assert (fitted(light, torch.ones(1, 3), prior)[:, :3] < 0.57).all()


def test_few_pixels_a_step_find_what_all_find():
    rng = np.random.default_rng(1)
    light, photo = (
        torch.from_numpy(rng.uniform(0.3, 0.9, (40, 3)).astype(np.float32)) for _ in range(2)
    )
    prior = torch.full((40, 5), 0.5)
    by_all = fitted(light, photo, prior)
    by_some = fitted(light, photo, prior, step_pixels=20)
    assert float((by_all - prior).abs().max()) > 0.1
    torch.testing.assert_close(by_some, by_all, atol=0.03, rtol=0)


@pytest.mark.parametrize(("count", "seen"), [(100, 100), (3200, 400), (16000, 1000)])
def test_a_step_sees_a_share_of_the_pixels_and_a_least_number_of_them(count, seen):
    settings = MaterialSettings(step_pixels=400, step_share=1 / 16)
    sizes = []

    class Seen(MaterialMaps):
        def forward(self, rows=ALL):
            values = super().forward(rows)
            sizes.append(len(values))
            return values

    prior = torch.full((count, 5), 0.5)
    stage = MaterialStage(("albedo", "roughness", "metallic"), Schedule(max_steps=1))
    fit_materials(
        lambda maps, rows: maps[:, :3],
        prior[:, :3],
        Seen(prior),
        prior,
        replace(settings, stages=(stage,)),
    )
    assert sizes[-1] == seen
