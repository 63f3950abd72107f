"""Settings of the fit: what `--preset paper` and `--preset default` mean.

The defaults of the classes are the paper's (Implementation Details), or leave out what the paper does not have.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, replace
from typing import Literal

from materialist.errors import InputError

Encoding = Literal["linear", "srgb", "log1p"]


@dataclass(frozen=True)
class Schedule:
    """Adam with a step-wise falling learning rate and early stopping; the defaults are those of the envmap."""

    learning_rate: float = 1e-3  # paper
    max_steps: int = 500  # paper
    decay_every: int = 100  # paper; steps
    decay: float = 0.8  # paper; factor on the learning rate
    patience: int = 100  # paper; stop when the loss improved too little over this many steps; 0: never
    min_improvement: float = 0.01  # paper; fraction of the loss
    keep_best: bool = False  # end with the parameters of the smallest loss, not with the last


@dataclass(frozen=True)
class LightSettings:
    """Environment map optimisation."""

    field: str = "mlp"  # `mlp` (directions), `mlp-uv`, `texels` or `sh`
    height: int = 256  # paper; rows of the field's map
    encoding: Encoding = "linear"
    clipped: bool = False  # a rendering brighter than a clipped photo channel is no error
    schedule: Schedule = dataclasses.field(default_factory=Schedule)
    refit_steps: int = 0  # steps of every light fit after the first; 0: as many as the first
    strict_steps: int = 120  # steps of the light fit that measures the prior's error; tuned by eye
    albedo_relaxation: float | None = None  # L1 weight of leaving the given albedo; None: it is fixed
    relaxation_rate: float = 0.02  # learning rate of that albedo; tuned by eye
    smooth: float = 0.0  # weight of the total variation of log radiance
    free_from: float = 0.5  # share of a texel's light that must arrive for it to be as free as others; tuned by eye
    hidden_weight: float = 3.0  # largest factor on the smoothness of hidden texels; tuned on 5 synthetic scenes
    chroma: float = 0.0  # weight of the colourfulness of log radiance
    start: float = 0.6  # grey radiance at which texels start at most; tuned by eye
    start_albedo: float = 0.35  # a darker photo starts texels at its mean over this; tuned by eye


@dataclass(frozen=True)
class MaterialStage:
    """One run of the optimiser over some of the materials."""

    targets: tuple[str, ...]
    schedule: Schedule


@dataclass(frozen=True)
class MaterialSettings:
    """Material properties optimisation; a triple is for albedo, roughness and metallic."""

    field: str = "mlp"  # `mlp`, `maps` or `unet`
    remap: bool = True  # start roughness and metallic from 0.7 x + 0.2 (paper, Initialization)
    encoding: Encoding = "linear"
    clipped: bool = False
    delta: float = 0.5  # paper; scale of L_cons
    weights: tuple[float, float, float] = (1.0, 1.0, 1.0)  # paper; in L_cons
    smooth: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the edge-aware total variation of the change
    stages: tuple[MaterialStage, ...] = ()
    second_metallic: float | None = None  # a second start, for each region the better one: the loss has a barrier
    second_steps: int = 25  # steps of each start before they are compared; tuned by eye
    metal_margin: float = 0.0  # least gain in cost, a pixel, for which a dielectric takes that start
    metal_factor: float = 1.0  # on the weight of metallic where the prior is sure of a dielectric
    dielectric_below: float = 0.2  # prior metallic from 0 to which `metal_margin` falls to 0; tuned on 26 photos
    surely_below: float = 0.04  # prior metallic from 0 to which `metal_factor` falls to 1; tuned on 26 photos


@dataclass(frozen=True)
class ExtentSettings:
    """Search for the extents of planes beyond the picture (`fit.plane_extents`)."""

    side: int = 96  # longer side, in pixels, at which the search looks at the photo; more is slower; tuned by eye
    pixels: int = 512  # of that, pixels whose light is looked at; tuned by eye
    levels: tuple[float, ...] = (0.0, 0.5, 1.0, 2.0)  # how far a side goes on, in the wall's visible size
    steps: int = 60  # of the light fit for each candidate; tuned by eye
    gain: float = 0.04  # least relative gain in error for which a side moves; tuned on 8 synthetic scenes


@dataclass(frozen=True)
class FitSettings:
    """Everything that a preset fixes."""

    light: LightSettings
    materials: MaterialSettings
    extents: ExtentSettings = dataclasses.field(default_factory=ExtentSettings)
    rounds: int = 1  # alternations of light and materials; between them, what surfaces send to each other is updated
    corrections: int = 0  # fixed-point corrections of the material fit against the path tracer
    correction_spp: int = 16
    explained: float | None = None
    """Mean absolute encoded error of the best light under the prior's materials above which the prior gets no more
    confidence than its loss weights say; None: never more. Tuned on 8 synthetic scenes."""
    confidence_power: float = 3.0  # how fast the prior's confidence grows below that error; tuned by eye
    max_confidence: float = 100.0
    light_grid: int = 32  # rows of the envmap that the transport engine's light matrix resolves
    rerender_spp: int = 64  # paths a pixel of the final re-rendering

    def confidence(self, error: float) -> float:
        """Factor >= 1 on what leaving the prior costs: (explained / error)^power, for the error that the best light
        leaves, which is what the prior's materials or geometry have wrong."""
        return min(max(((self.explained or 0) / max(error, 1e-6)) ** self.confidence_power, 1.0), self.max_confidence)


_MATERIAL = Schedule(learning_rate=3e-4, max_steps=2000, patience=200, min_improvement=0.005)

PAPER = FitSettings(
    light=LightSettings(schedule=Schedule(keep_best=True)),
    materials=MaterialSettings(
        stages=(
            MaterialStage(("roughness", "metallic"), _MATERIAL),
            MaterialStage(("albedo", "roughness", "metallic"), _MATERIAL),
        )
    ),
)
"""The paper's settings to the letter (Implementation Details); it gives no cap on material steps, so 2000 a stage."""

DEFAULT = FitSettings(
    light=LightSettings(
        field="texels",
        height=24,
        encoding="srgb",
        clipped=True,
        schedule=Schedule(learning_rate=0.05, max_steps=150, decay_every=60, decay=0.6, patience=0),
        refit_steps=60,
        albedo_relaxation=0.03,
        smooth=0.015,  # 0.01 tuned at 16 rows, times 24 / 16: the border of a lamp then costs as much on any map
        chroma=0.05,
    ),
    materials=MaterialSettings(
        field="maps",
        remap=False,
        encoding="srgb",
        clipped=True,
        delta=1.0,
        weights=(0.02, 0.01, 0.021),
        smooth=(0.002, 0.1, 0.03),
        stages=(
            MaterialStage(
                ("albedo", "roughness", "metallic"),
                Schedule(learning_rate=0.02, max_steps=36, decay_every=24, decay=0.6, patience=0),
            ),
        ),
        second_metallic=0.95,
        metal_factor=3.3,
        metal_margin=0.004,
    ),
    rounds=3,
    corrections=2,
    correction_spp=8,
    explained=0.08,
    light_grid=24,
)
"""Measured against the paper's settings in docs/benchmarks.md; the reasons are in docs/decisions.md."""

PRESETS = {"paper": PAPER, "default": DEFAULT}


def preset(name: str, *, hdr: bool = False) -> FitSettings:
    """Settings by name.

    For HDR photos the paper's loss compares log(1 + x) (paper, Handling HDR Images); ours sees them exposed as a
    photograph is, and nothing in them is clipped.
    """
    if name not in PRESETS:
        raise InputError(f"Preset is '{name}'; choose one of {', '.join(PRESETS)}.")
    settings = PRESETS[name]
    if not hdr:
        return settings
    encoding: Encoding = "log1p" if settings is PAPER else settings.light.encoding
    return replace(
        settings,
        light=replace(settings.light, encoding=encoding, clipped=False),
        materials=replace(settings.materials, encoding=encoding, clipped=False),
    )
