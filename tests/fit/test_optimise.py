"""The optimisation loop: step sizes, early stopping, progress."""

import dataclasses

import numpy as np
import pytest
import torch

from materialist.fit.optimise import Adam, StageResult, optimise
from materialist.fit.settings import Schedule


def run(losses, schedule, **options) -> StageResult:
    """A loop whose loss takes the given values, whatever the parameter does."""
    parameter = torch.nn.Parameter(torch.zeros(1))
    return optimise(
        "test", [parameter], lambda step: losses(step) + 0 * parameter.sum(), schedule, **options
    )


def test_learning_rate_falls_in_steps():
    """Under a constant gradient Adam moves by the learning rate."""
    parameter = torch.nn.Parameter(torch.zeros(1))
    seen = []
    optimise(
        "test",
        [parameter],
        lambda _: -parameter.sum(),
        Schedule(learning_rate=0.1, max_steps=7, decay_every=3, decay=0.5, patience=0),
        after_step=lambda: seen.append(parameter.item()),
    )
    moves = [b - a for a, b in zip([0.0, *seen], seen, strict=False)]
    assert moves == pytest.approx([0.1, 0.1, 0.1, 0.05, 0.05, 0.05, 0.025], rel=1e-4)


def test_adam_is_torchs():
    start = torch.rand(2, 5, generator=torch.Generator().manual_seed(0))
    pairs = [[torch.nn.Parameter(start[k].clone()) for k in range(2)] for _ in range(2)]
    own = Adam(pairs[0])
    known = torch.optim.Adam(pairs[1], lr=0.03)
    for step in range(30):
        for some in pairs:
            (some[0] * (step % 3 - some[1]) ** 2).sum().backward()
        own.step(0.03)
        known.step()
        known.zero_grad()
    for mine, theirs in zip(*pairs, strict=True):
        assert mine.grad is None
        torch.testing.assert_close(mine, theirs)


@pytest.mark.parametrize(("fall", "stops"), [(0.99995, True), (0.9998, False)])
def test_stops_when_the_loss_falls_by_less_than_one_percent_in_100_steps(fall, stops):
    """0.99995^100 is 0.5 % less, 0.9998^100 is 2 % less."""
    result = run(
        lambda step: fall**step, Schedule(max_steps=500, patience=100, min_improvement=0.01)
    )
    assert result.steps == len(result.losses)
    if stops:
        assert 100 < result.steps <= 120
    else:
        assert result.steps == 500


def test_noise_of_steps_that_see_some_pixels_does_not_stop_them():
    """A loss that falls by 2 % in 200 steps, with as much noise in every step."""
    noise = np.random.default_rng(0).normal(1, 0.02, 1000)
    schedule = Schedule(max_steps=1000, patience=200, min_improvement=0.005)

    def steps(averaged):
        judged = dataclasses.replace(schedule, averaged=averaged)
        return run(lambda step: 0.9999**step * noise[step], judged).steps

    assert steps(1) < 1000
    assert steps(100) == 1000


def test_progress_and_summary():
    told = []
    result = run(
        lambda step: 2.0 / (step + 1), Schedule(max_steps=4), progress=lambda *a: told.append(a)
    )
    assert told == [("test", k, 4) for k in (0, 1, 2, 3, 4)]
    summary = result.summary()
    assert (summary["name"], summary["steps"]) == ("test", 4)
    assert (summary["loss_first"], summary["loss_last"]) == (2.0, 0.5)
    assert summary["loss_curve"] == [2.0, 1.0, 0.666667, 0.5]


def test_the_best_parameters_are_kept_when_asked():
    """A loss that is smallest at the third step, while the parameter walks on."""
    values = [3.0, 2.0, 1.0, 5.0, 4.0]
    for keep, expected in ((True, -0.2), (False, -0.5)):
        parameter = torch.nn.Parameter(torch.zeros(1))
        optimise(
            "test",
            [parameter],
            lambda k, p=parameter: values[k] + (p - p.detach()).sum(),
            Schedule(learning_rate=0.1, max_steps=5, patience=0, keep_best=keep),
        )
        assert parameter.item() == pytest.approx(expected, rel=1e-3)
