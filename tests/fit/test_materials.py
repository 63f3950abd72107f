"""The second start for metallic."""

from dataclasses import replace

import torch

from materialist.fit.engine import MaterialProblem
from materialist.fit.materials import better_start
from materialist.fit.settings import DEFAULT

SETTINGS = replace(DEFAULT.materials, clipped=False, second_steps=1)


def priors(metallic):
    maps = torch.full((len(metallic), 5), 0.4)
    maps[:, 4] = torch.tensor(metallic)
    return maps


def start_of(metallic, gain, **changes):
    """What pixels of this predicted metallic start from, where a metal renders closer to the photo by `gain`."""
    prior = priors([metallic] * 4)
    photo = torch.full((4, 3), 0.5)
    # Rendering errs by `gain` for a dielectric, and not at all for a metal; nothing else matters.
    problem = MaterialProblem(lambda m: photo + gain * (m[:, 4:].detach() < 0.5) + 0 * m[:, :3], None)
    settings = replace(SETTINGS, encoding="linear", **changes)
    return better_start(problem, photo, prior.clone(), prior, settings, lambda cost: cost)[:, 4].mean().item()


def test_a_surface_becomes_a_metal_only_where_it_gains_more_than_its_price():
    cheap, dear = (SETTINGS.weights[2] * factor for factor in (1, SETTINGS.metal_factor))
    assert start_of(0.3, 1.5 * cheap) > 0.9  # the prior is not sure
    assert start_of(0.0, 1.5 * cheap) < 0.1
    assert start_of(0.0, 2.5 * dear) > 0.9
    assert start_of(0.0, 1.5 * cheap, metal_factor=1.0) > 0.9


def test_a_region_of_one_metallic_decides_as_one():
    """Two pixels gain more than the other two lose: alone they part, under one mask all of them start as metal."""
    gain = torch.tensor([0.6, 0.6, -0.2, -0.2])[:, None]
    photo, prior = torch.full((4, 3), 0.5), priors([0.3] * 4)
    metal = lambda m: (m[:, 4:].detach() > 0.5).float()  # noqa: E731
    problem = MaterialProblem(
        lambda m: photo + gain.clamp(min=0) * (1 - metal(m)) - gain.clamp(max=0) * metal(m) + 0 * m[:, :3], None
    )
    settings = replace(SETTINGS, encoding="linear")

    def found(inside):
        start = better_start(problem, photo, prior.clone(), prior, settings, lambda cost: cost, inside=inside)
        return (start[:, 4] > 0.5).tolist()

    assert found(None) == [True, True, False, False]
    assert found(torch.ones(4, dtype=torch.bool)) == [True] * 4
    assert found(torch.tensor([False, False, True, True])) == [True, True, False, False]
