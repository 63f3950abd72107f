"""Environment map optimisation (paper, Progressive Differentiable Rendering)."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import nn

from materialist.errors import InputError
from materialist.fit.engine import LightProblem
from materialist.fit.fields import EnvmapMLP, EnvmapSH, EnvmapTexels, resize_envmap
from materialist.fit.loop import Progress, StageResult, optimise
from materialist.fit.losses import l1_l2, log_chroma, log_total_variation, residual, too_pure
from materialist.fit.settings import LightSettings
from materialist.transport.light import LightMatrix

START_RADIANCE, START_ALBEDO = 0.6, 0.35
"""Grey level at which plain texels start at most, and the reflectance by which a darker photo tells where: texels that
hardly reach anything stay near it, and must not be brighter than what lights the photo."""
SEEN = 0.5
"""Share of its light that must reach the scene for a texel to be free to differ from its neighbours."""
STIFFEST = 3.0
"""Largest factor on the smoothness of texels that are hidden."""


def start_radiance(photo: torch.Tensor, most: float = START_RADIANCE) -> float:
    """Where the light of a photo [..., 3] linear starts."""
    return float(min(max(float(photo.mean()) / START_ALBEDO, 1e-3), most))


def envmap_field(settings: LightSettings, *, seed: int = 0, start: float = START_RADIANCE) -> nn.Module:
    """A fresh field of the kind the settings name; plain texels begin at `start`."""
    torch.manual_seed(seed)
    if settings.field == "mlp":
        return EnvmapMLP()
    if settings.field == "mlp-uv":
        return EnvmapMLP(coordinates="uv")
    if settings.field == "sh":
        return EnvmapSH(3)
    if settings.field == "texels":
        return EnvmapTexels(torch.full((settings.height, 2 * settings.height, 3), start))
    raise InputError(f"Light field is '{settings.field}'; choose mlp, mlp-uv, texels or sh.")


def fit_light(
    problem: LightProblem,
    photo: torch.Tensor,
    field: nn.Module,
    settings: LightSettings,
    *,
    steps: int | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    slack: nn.Parameter | None = None,
) -> StageResult:
    """Move `field` so that the rendering matches the photo: argmin_E L1 + L2.

    Args:
        photo: [H * W, 3] linear.
        steps: at most this many, instead of the schedule's.
        slack: takes the albedo that every row of the problem's matrix came to; see `slack_albedo`.
    """
    target = photo[problem.pixels]
    pure = too_pure(target)
    jitter = torch.Generator().manual_seed(seed)
    schedule = settings.schedule if steps is None else replace(settings.schedule, max_steps=steps)
    parameters: list = [{"params": list(field.parameters())}]
    price = settings.slack or 0.0
    slack = slack_albedo(problem, settings) if slack is None else slack
    if slack is not None:
        given = slack.detach().clone()
        parameters.append({"params": [slack], "lr": 0.02})

    weight = None if problem.matrix is None else stiffness(problem.matrix)

    def loss(_: int) -> torch.Tensor:
        envmap = _seen(field, settings, problem.height, jitter)
        radiance = problem.render(envmap) if slack is None else problem.render(envmap, slack)
        value = l1_l2(residual(radiance, target, settings.encoding, clipped=settings.clipped, pure=pure))
        if slack is not None:
            value = value + price * (slack - given).abs().mean()
        if settings.smooth or settings.chroma:
            log = envmap.clamp_min(1e-6).log()
            value = value + settings.smooth * log_total_variation(log, weight) + settings.chroma * log_chroma(log)
        return value

    def into_range() -> None:
        if slack is not None:
            slack.clamp_(0, 1)

    return optimise("light", parameters, loss, schedule, after_step=into_range, progress=progress)


def slack_albedo(problem: LightProblem, settings: LightSettings) -> nn.Parameter | None:
    """[Q, 3] the given albedo of the matrix's rows, as something that the light fit may change; None if it may not."""
    if settings.slack is None or problem.matrix is None:
        return None
    return nn.Parameter(problem.matrix.albedo.clone())


def _seen(field: nn.Module, settings: LightSettings, height: int, jitter: torch.Generator) -> torch.Tensor:
    """[height, 2 height, 3] of a field whose map has `settings.height` rows.

    A coarser map is what is optimised, enlarged. A finer one is costly to evaluate: a coarser light matrix is served by
    random points of its texels.
    """
    if settings.height <= height:
        return resize_envmap(field(settings.height), height)
    return field(height, None if settings.field == "texels" else jitter)


def stiffness(matrix: LightMatrix) -> torch.Tensor:
    """[h, 2h] weight of each texel in the smoothness of the light: 1 where it is seen, more where it is hidden.

    A light that reaches the scene through slits of the geometry alone can be made to explain anything by making it
    bright enough, and a path tracer finds it by luck.
    """
    return (SEEN / matrix.open.clamp_min(1e-6)).clamp(1, STIFFEST).view(matrix.shape)
