"""Settings of the fit: what `--preset paper` and `--preset default` mean."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, replace

from materialist.errors import InputError
from materialist.fit.loop import Schedule
from materialist.fit.losses import Encoding


@dataclass(frozen=True)
class LightSettings:
    """Environment map optimisation."""

    field: str = "mlp"
    """`mlp` (directions), `mlp-uv`, `texels`, or `sh`."""
    height: int = 256
    """Rows of the field's map: 256 or, in the ablation, 16."""
    encoding: Encoding = "linear"
    clipped: bool = False
    """A rendering brighter than a clipped photo channel is no error."""
    schedule: Schedule = dataclasses.field(default_factory=Schedule)
    refit_steps: int = 0
    """Steps of every light fit after the first; 0: the light is fitted once."""
    slack: float | None = None
    """If set, every pixel of the light fit may change its albedo within [0, 1] at this L1 price, so that a wrong
    albedo does not colour the light, and light too dim to reach the photo with any albedo is an error."""
    smooth: float = 0.0
    """Weight of total variation of log radiance."""
    chroma: float = 0.0
    """Weight of the colourfulness of log radiance."""
    fine: int | None = None
    """Rows of the map of `texels` where the prior explains the photo so well (`FitSettings.trust`) that what is left of
    its highlights and shadows tells of the light."""


@dataclass(frozen=True)
class MaterialStage:
    """One run of the optimiser over some of the materials."""

    targets: tuple[str, ...]
    schedule: Schedule


@dataclass(frozen=True)
class MaterialSettings:
    """Material properties optimisation."""

    field: str = "mlp"
    """`mlp`, `maps` or `unet`."""
    remap: bool = True
    """Start roughness and metallic from 0.7 x + 0.2 (paper, Default Automatic Optimization Schedule)."""
    encoding: Encoding = "linear"
    clipped: bool = False
    delta: float = 0.5
    """Scale of L_cons."""
    weights: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Weights of albedo, roughness and metallic in L_cons."""
    smooth: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Weights of the edge-aware total variation of the change of albedo, roughness and metallic."""
    stages: tuple[MaterialStage, ...] = ()
    other_metallic: float | None = None
    """If set, the first fit of `maps` also starts from this metallic, and every region goes on from what fitted it
    better: between a dielectric and a metal the loss has a barrier that no gradient crosses."""
    dielectric: float = 1.0
    """Price of making a metal of what the prior calls a dielectric, as a multiple of its weight in L_cons."""
    doubt: float = 0.0
    """Least gain in cost (encoded error and price of leaving the prior, a pixel) for which a surface that the prior
    calls a dielectric goes on from `other_metallic`."""


MAX_TRUST = 100.0
FINE_TRUST = 4.0
"""Trust from which the light is looked for on the finer map."""


@dataclass(frozen=True)
class FitSettings:
    """Everything that a preset fixes."""

    light: LightSettings
    materials: MaterialSettings
    rounds: int = 1
    """Alternations of light and materials; between them, what surfaces send to each other is updated."""
    corrections: int = 0
    """Fixed-point corrections of the material fit against the path tracer."""
    correction_spp: int = 16
    trust: float | None = None
    """Mean absolute error (encoded) of the best light under the prior's materials from which the prior is doubted:
    below it, leaving the prior grows dearer with the third power. None: no such scaling."""
    light_grid: int = 32
    """Rows of the envmap that the transport engine's light matrix resolves."""

    def trust_at(self, error: float) -> float:
        """How much dearer it is to leave the prior: (trust / e)^3, e the error of the best light for it, which is what
        materials or geometry have wrong."""
        return min(max(((self.trust or 0) / max(error, 1e-6)) ** 3, 1.0), MAX_TRUST)

    @property
    def fine_light(self) -> LightSettings | None:
        """The light on its finer map, if there is one; an edge in it costs what it costs on the coarse map."""
        light = self.light
        if light.fine is None or self.trust is None:
            return None
        return replace(light, height=light.fine, smooth=light.smooth * light.fine / light.height)

    def finer(self, error: float) -> LightSettings | None:
        """The same where the coarse light leaves so small an error that it is asked for."""
        return self.fine_light if self.trust_at(error) >= FINE_TRUST else None


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

_FAST = Schedule(learning_rate=0.02, max_steps=36, decay_every=24, decay=0.6, patience=0)

DEFAULT = FitSettings(
    light=LightSettings(
        field="texels",
        height=16,
        encoding="srgb",
        clipped=True,
        schedule=Schedule(learning_rate=0.05, max_steps=150, decay_every=60, decay=0.6, patience=0),
        refit_steps=60,
        slack=0.03,
        smooth=0.01,
        chroma=0.05,
        fine=32,
    ),
    materials=MaterialSettings(
        field="maps",
        remap=False,
        encoding="srgb",
        clipped=True,
        delta=1.0,
        weights=(0.02, 0.01, 0.021),
        smooth=(0.002, 0.1, 0.03),
        stages=(MaterialStage(("albedo", "roughness", "metallic"), _FAST),),
        other_metallic=0.95,
        dielectric=3.3,
        doubt=0.004,
    ),
    rounds=3,
    corrections=2,
    correction_spp=4,
    trust=0.08,
    light_grid=16,
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
