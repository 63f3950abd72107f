"""The paper's preset is the paper's numbers (Implementation Details)."""

import math
from dataclasses import replace

import pytest
import torch

from materialist.errors import InputError
from materialist.fit.light import envmap_field
from materialist.fit.settings import DEFAULT, PAPER, preset
from materialist.io.photo import HDR_CLIP

PAPER_NUMBERS = {
    "light.field": "mlp",
    "light.height": 256,
    "light.encoding": "linear",
    "light.white": math.inf,
    "light.schedule.learning_rate": 1e-3,
    "light.schedule.decay_every": 100,
    "light.schedule.decay": 0.8,
    "light.schedule.patience": 100,
    "light.schedule.min_improvement": 0.01,
    "light.schedule.max_steps": 500,
    "light.smooth": 0,
    "light.chroma": 0,
    "materials.field": "mlp",
    "materials.remap": True,
    "materials.encoding": "linear",
    "materials.white": math.inf,
    "materials.delta": 0.5,
    "materials.weights": (1, 1, 1),
    "materials.loss": "l1+l2",
    "materials.stages.0.targets": ("roughness", "metallic"),
    "materials.stages.1.targets": ("albedo", "roughness", "metallic"),
    "materials.stages.0.schedule.learning_rate": 3e-4,
    "materials.stages.1.schedule.learning_rate": 3e-4,
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
