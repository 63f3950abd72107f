"""Environment map optimisation (paper, Progressive Differentiable Rendering)."""

from __future__ import annotations

import torch
from torch import nn

from materialist.errors import InputError
from materialist.fit.engine import LightProblem
from materialist.fit.fields import EnvmapMLP, EnvmapSH, EnvmapTexels, resize_envmap
from materialist.fit.losses import log_chroma, log_total_variation, rendering_loss, residual
from materialist.fit.optimise import Progress, StageResult, optimise
from materialist.fit.settings import LightSettings
from materialist.transport.light import LightMatrix


def start_radiance(photo: torch.Tensor, settings: LightSettings) -> float:
    """Grey level at which texels start for a photo [..., 3] linear.

    Texels that hardly reach anything stay near it, and must not be brighter than what lights the photo.
    """
    return float(min(max(float(photo.mean()) / settings.start_albedo, 1e-3), settings.start))


def envmap_field(settings: LightSettings, *, seed: int = 0, start: float | torch.Tensor | None = None) -> nn.Module:
    """A fresh field of the kind the settings name; texels begin at `start`, a grey level or a map [h, 2h, 3]."""
    torch.manual_seed(seed)
    if settings.field == "mlp":
        return EnvmapMLP()
    if settings.field == "mlp-uv":
        return EnvmapMLP(coordinates="uv")
    if settings.field == "sh":
        return EnvmapSH(3)
    if settings.field == "texels":
        if isinstance(start, torch.Tensor):
            return EnvmapTexels(resize_envmap(start, settings.height))
        grey = settings.start if start is None else start
        return EnvmapTexels(torch.full((settings.height, 2 * settings.height, 3), grey))
    raise InputError(f"Light field is '{settings.field}'; choose mlp, mlp-uv, texels or sh.")


def fit_light(
    problem: LightProblem,
    photo: torch.Tensor,
    field: nn.Module,
    settings: LightSettings,
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> StageResult:
    """Move `field` so that the rendering matches the photo: argmin_E L_re, with the prior's materials.

    Args:
        photo: [H * W, 3] linear.
    """
    target = photo[problem.pixels]
    weight = None if problem.matrix is None else hidden_weights(problem.matrix, settings)
    jitter = torch.Generator().manual_seed(seed)

    def loss(_: int) -> torch.Tensor:
        envmap = _at_height(field, settings, problem.height, jitter)
        error = residual(problem.render(envmap), target, settings.encoding, clipped=settings.clipped)
        value = rendering_loss(error)
        if settings.smooth or settings.chroma:
            log = envmap.clamp_min(1e-6).log()
            value = value + settings.smooth * log_total_variation(log, weight)
            value = value + settings.chroma * log_chroma(log, settings.warm_cool)
        return value

    return optimise("light", field.parameters(), loss, settings.schedule, progress=progress)


def _at_height(field: nn.Module, settings: LightSettings, height: int, jitter: torch.Generator) -> torch.Tensor:
    """[height, 2 height, 3] of a field whose map has `settings.height` rows.

    A coarser map is what is optimised, enlarged. A finer one is costly to evaluate: a coarser light matrix is served by
    random points of its texels.
    """
    if settings.height <= height:
        return resize_envmap(field(settings.height), height)
    return field(height, None if settings.field == "texels" else jitter)


def hidden_weights(matrix: LightMatrix, settings: LightSettings) -> torch.Tensor:
    """[h, 2h] weight of each texel in the smoothness of the light: 1 where it is seen, more where it is hidden.

    A light that reaches the scene through slits of the geometry alone can be made to explain anything by making it
    bright enough, and a path tracer finds it by luck.
    """
    return (settings.free_from / matrix.open.clamp_min(1e-6)).clamp(1, settings.hidden_weight).view(matrix.shape)
