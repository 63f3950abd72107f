"""The paper's preset is the paper's numbers (Implementation Details), or the published code's."""

import math
from dataclasses import replace

import pytest
import torch

from materialist.errors import InputError
from materialist.fit.light import envmap_field
from materialist.fit.settings import DEFAULT, PAPER, Schedule, preset
from materialist.io.photo import HDR_CLIP

PAPER_NUMBERS = {
    "light.field": "mlp",
    "light.height": 256,
    "light.encoding": "srgb",  # published code
    "light.white": math.inf,
    "light.schedule.learning_rate": 1e-3,
    "light.schedule.decay_every": 100,
    "light.schedule.decay": 0.8,
    "light.schedule.patience": 100,
    "light.schedule.min_improvement": 0.01,
    "light.schedule.max_steps": 500,
    "light.again.learning_rate": 1e-4,  # published code
    "light.again.decay": 1,  # published code
    "light.smooth": 0,
    "light.chroma": 0,
    "materials.field": "mlp",
    "materials.remap": True,
    "materials.encoding": "srgb",  # published code
    "materials.white": math.inf,
    "materials.delta": 0.1,  # published code; the paper's text has 0.5
    "materials.weights": (1, 1, 1),
    "materials.loss": "balanced",  # published code
    "materials.stages.0.targets": ("roughness", "metallic"),
    "materials.stages.1.targets": ("albedo", "roughness", "metallic"),
    "materials.stages.0.schedule.learning_rate": 3e-4,
    "materials.stages.1.schedule.learning_rate": 3e-4,
    "materials.stages.1.schedule.least_rate": 1.2e-4,  # published code
    "materials.stages.0.schedule.decay_every": 100,
    "materials.stages.1.schedule.decay": 0.8,
    "materials.stages.0.schedule.patience": 200,
    "materials.stages.1.schedule.patience": 200,
    "materials.stages.1.schedule.min_improvement": 0.005,
}


def test_paper_preset():
    for name, number in PAPER_NUMBERS.items():
        value = PAPER
        for part in name.split("."):
            value = value[int(part)] if part.isdigit() else getattr(value, part)
        assert value == number, name


def test_unknown_names_are_told():
    with pytest.raises(InputError, match="quick"):
        preset("quick")
    with pytest.raises(InputError, match="cube"):
        envmap_field(replace(DEFAULT.light, field="cube"), torch.ones(4, 8, 3))


@pytest.mark.parametrize(
    ("name", "encodings"), [("paper", ("log1p", "log1p")), ("default", ("srgb", "srgb"))]
)
def test_hdr_photos_are_compared_as_log_in_the_paper_and_as_ours_compares_all(name, encodings):
    settings = preset(name, hdr=True)
    assert (settings.light.encoding, settings.materials.encoding) == encodings
    assert (
        settings.light.white
        == settings.materials.white
        == (math.inf if name == "paper" else HDR_CLIP)
    )
    assert preset(name) == {"paper": PAPER, "default": DEFAULT}[name]


def test_the_learning_rate_falls_in_steps_to_the_least():
    schedule = Schedule(learning_rate=1.0, decay_every=10, decay=0.5, least_rate=0.2)
    rates = [schedule.rate(step) for step in (0, 9, 10, 25, 30, 99)]
    assert rates == [1, 1, 0.5, 0.25, 0.2, 0.2]


@pytest.mark.parametrize("settings", [PAPER, DEFAULT], ids=["paper", "default"])
def test_a_step_cap_holds_in_every_stage_and_adds_none(settings):
    cut = settings.at_most(7)
    schedules = [cut.light.schedule, *(stage.schedule for stage in cut.materials.stages)]
    if settings.light.again is not None:
        schedules.append(cut.light.again)
    assert [one.max_steps for one in schedules] == [7] * len(schedules)
    assert (cut.light.again is None) == (settings.light.again is None)
    assert settings.at_most(10**6) == settings


def test_a_large_picture_is_rendered_again_with_fewer_paths():
    paths = {side: DEFAULT.rerender_paths(side * side) for side in (256, 512, 1024, 2048, 8192)}
    assert paths == {256: 32, 512: 16, 1024: 8, 2048: 4, 8192: 2}
    assert PAPER.rerender_paths(2048 * 2048) == 64
