"""Environment map optimisation (paper, Progressive Differentiable Rendering)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from materialist.buffers import placed, torch_device
from materialist.envmap import row_solid_angle
from materialist.errors import InputError
from materialist.fit.engine import LightProblem
from materialist.fit.fields import EnvmapMLP, EnvmapSH, EnvmapTexels, resize_envmap
from materialist.fit.losses import encoded_error, log_chroma, log_total_variation, rendering_loss
from materialist.fit.optimise import StageResult, Stop, never, optimise
from materialist.fit.settings import LightSettings
from materialist.types import Array, Progress


@dataclass(frozen=True)
class LightStart:
    """What the light is before the fit."""

    radiance: torch.Tensor
    """[h, 2h, 3] linear."""
    scale: torch.Tensor | None
    """[h, 2h, 1] scale of the error of its logarithm (Laplace); None where nothing is known of it."""


def start_light(
    photo: torch.Tensor, settings: LightSettings, prior: Array | None, problem: LightProblem
) -> LightStart:
    """Where the light begins, and how far it is trusted.

    Without a prior it is grey: as bright as the photo [P, 3] linear demands of an ordinary albedo, since texels that
    hardly reach anything stay near it. The prior is that of `Prediction.light`; it gets the exposure that renders the
    photo best.
    """
    # --- Without a predicted light: grey ---
    if prior is None or settings.field != "texels":
        grey = float(min(max(float(photo.mean()) / settings.start_albedo, 1e-3), settings.start))
        return LightStart(photo.new_full((settings.height, 2 * settings.height, 3), grey), None)
    # --- With one: radiance in three channels, the scale of its error in the fourth ---
    light = placed(np.ascontiguousarray(prior[..., :3]))
    scale = placed(prior[..., 3:].copy())
    radiance = resize_envmap(light, settings.height).clamp_min(1e-3)
    target = photo[problem.pixels]
    with torch.no_grad():
        rendered = problem.render(resize_envmap(radiance, problem.height))
    # Exposure k with least (k rendered - photo)^2, where the photo is not clipped.
    known = target < settings.white
    exposure = (target * rendered)[known].sum() / rendered[known].square().sum().clamp_min(1e-9)
    return LightStart(radiance * exposure, resize_envmap(scale, settings.height))


def envmap_field(settings: LightSettings, start: torch.Tensor, *, seed: int = 0) -> nn.Module:
    """A fresh field of the kind the settings name; texels begin at `start`, a map [h, 2h, 3]."""
    torch.manual_seed(seed)
    fresh: dict[str, Callable[[], nn.Module]] = {
        "mlp": EnvmapMLP,
        "mlp-uv": lambda: EnvmapMLP(coordinates="uv"),
        "texels": lambda: EnvmapTexels(resize_envmap(start, settings.height)),
        "sh": EnvmapSH,
    }
    if settings.field not in fresh:
        raise InputError(f"Light field is '{settings.field}'; choose mlp, mlp-uv, texels or sh.")
    return fresh[settings.field]().to(torch_device())


def fit_light(
    problem: LightProblem,
    photo: torch.Tensor,
    field: nn.Module,
    settings: LightSettings,
    start: LightStart,
    *,
    name: str = "light",
    seed: int = 0,
    progress: Progress | None = None,
    stop: Stop = never,
) -> StageResult:
    """Move `field` so that the rendering matches the photo: argmin_E L_E, with the materials of the problem.

    Beyond the paper, the difference of the light from `start` is kept smooth, white and small.
    photo: [H * W, 3] linear.
    """
    # --- What stays the same in every step ---
    target = photo[problem.pixels]
    before = resize_envmap(start.radiance, problem.height).clamp_min(1e-6).log()
    trust = None
    angle = placed(row_solid_angle(problem.height)).float().view(-1, 1, 1)
    # A texel's weight in the prior term: its solid angle over its scale of error.
    if start.scale is not None:
        trust = angle / angle.mean() / resize_envmap(start.scale, problem.height)
    jitter = torch.Generator().manual_seed(seed)

    def loss(_: int) -> torch.Tensor:
        envmap = _at_height(field, settings, problem.height, jitter)
        # L_E = L_1 + L_2 of encoded values (paper).
        error = encoded_error(
            problem.render(envmap), target, settings.encoding, white=settings.white
        )
        value = rendering_loss(error)
        # Beyond the paper: priors on the change of log radiance since the start.
        if settings.smooth or settings.chroma or settings.prior:
            change = envmap.clamp_min(1e-6).log() - before
            value = value + settings.smooth * log_total_variation(change)
            share = share_of_light(envmap.detach(), angle)
            value = value + settings.chroma * log_chroma(change, share)
            if trust is not None:
                value = value + settings.prior * (trust * change.abs()).mean()
        return value

    return optimise(name, field.parameters(), loss, settings.schedule, progress=progress, stop=stop)


def _at_height(
    field: nn.Module, settings: LightSettings, height: int, jitter: torch.Generator
) -> torch.Tensor:
    """[height, 2 height, 3] of a field of `settings.height` rows: enlarged, or at random points of finer texels."""
    if settings.height <= height:
        return resize_envmap(field(settings.height), height)
    return field(height, None if settings.field == "texels" else jitter)


def share_of_light(envmap: torch.Tensor, angle: torch.Tensor) -> torch.Tensor:
    """[h, 2h] power of the texels of a map [h, 2h, 3], 1 in the mean; angle: [h, 1, 1] solid angle of a row's texels.

    The colour of a lamp counts by what it lights: by its area alone a yellow one costs nothing.
    """
    power = (envmap.clamp_min(0).mean(-1, keepdim=True) * angle)[..., 0]
    return power / power.mean().clamp_min(1e-9)
