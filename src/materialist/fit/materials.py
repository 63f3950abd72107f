"""Material properties optimisation (paper, Progressive Differentiable Rendering)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import torch
from torch import nn

from materialist.errors import InputError
from materialist.fit.engine import MaterialProblem
from materialist.fit.fields import MaterialMaps, MaterialMLP, MaterialUNet, Unified
from materialist.fit.fused import FusedLoss
from materialist.fit.losses import (
    EdgeWeights,
    consistency,
    fall_off,
    l1_l2,
    loss_weights,
    metal_factor,
    per_value,
    residual,
)
from materialist.fit.optimise import Progress, StageResult, optimise
from materialist.fit.settings import MaterialSettings, MaterialStage
from materialist.types import Camera

_COLUMNS = {"albedo": slice(0, 3), "roughness": slice(3, 4), "metallic": slice(4, 5)}


def remapped(prior: torch.Tensor) -> torch.Tensor:
    """Roughness and metallic of [P, 5] maps moved to 0.7 x + 0.2, where gradients live (paper, Initialization)."""
    return torch.cat([prior[:, :3], 0.7 * prior[:, 3:] + 0.2], 1)


def material_field(
    prior: torch.Tensor, settings: MaterialSettings, pixels: torch.Tensor, camera: Camera, *,
    inside: torch.Tensor | None = None, seed: int = 0,
) -> nn.Module:  # fmt: skip
    """A fresh field around `prior` [P, 5]; with `inside` [P] bool, roughness and metallic are one value there."""
    torch.manual_seed(seed)
    start = remapped(prior) if settings.remap else prior
    if settings.field == "mlp":
        field: nn.Module = MaterialMLP(start)
    elif settings.field == "maps":
        field = MaterialMaps(start)
    elif settings.field == "unet":
        field = MaterialUNet(start, pixels, camera.height, camera.width)
    else:
        raise InputError(f"Material field is '{settings.field}'; choose mlp, maps or unet.")
    return field if inside is None else Unified(field, inside)


def fit_materials(
    problem: MaterialProblem,
    photo: torch.Tensor,
    field: nn.Module,
    prior: torch.Tensor,
    settings: MaterialSettings,
    edges: EdgeWeights | None = None,
    *,
    factor: torch.Tensor | None = None,
    progress: Progress | None = None,
) -> list[StageResult]:
    """Move `field` stage by stage: argmin L_re + delta L_cons + smoothness.

    Args:
        problem: rendering under a fixed light.
        photo: [P, 3] linear.
        prior: [P, 5] the maps that L_cons holds on to.
        edges: for the smoothness of the change; needed when `settings.smooth` is not zero.
        factor: [P, 3] multiplies the rendering: what the renderer is known to get wrong.
    """
    objective = material_objective(problem, photo, prior, settings, edges, factor)
    results = []
    for stage in settings.stages:
        frozen = [name for name in _COLUMNS if name not in stage.targets]
        held = field().detach()

        def loss(_: int, frozen=frozen, held=held) -> torch.Tensor:
            values = field()
            if not frozen:
                return objective(values)
            return objective(torch.cat([(held if n in frozen else values)[:, c] for n, c in _COLUMNS.items()], 1))

        def into_range() -> None:
            base = field.field if isinstance(field, Unified) else field
            if isinstance(base, MaterialMaps):
                base.maps.clamp_(0, 1)

        name = "materials" if not frozen else "+".join(stage.targets)
        results.append(
            optimise(name, field.parameters(), loss, stage.schedule, after_step=into_range, progress=progress)
        )
    return results


def material_objective(
    problem: MaterialProblem,
    photo: torch.Tensor,
    prior: torch.Tensor,
    settings: MaterialSettings,
    edges: EdgeWeights | None = None,
    factor: torch.Tensor | None = None,
) -> Callable[[torch.Tensor], torch.Tensor]:
    """L_re + delta L_cons + smoothness as a function of the materials [P, 5]; in one kernel where there are tables."""
    factor = torch.ones(1) if factor is None else factor
    if problem.tables is not None:
        return FusedLoss(problem.tables, factor, photo, prior, settings, edges)
    weights, smooth = loss_weights(prior, settings), per_value(settings.smooth)

    def objective(values: torch.Tensor) -> torch.Tensor:
        error = residual(problem.render(values) * factor, photo, settings.encoding, clipped=settings.clipped)
        value = l1_l2(error) + consistency(values, prior, weights)
        return value if edges is None else value + (smooth * edges.total_variation(values - prior)).sum()

    return objective


def better_start(
    problem: MaterialProblem,
    photo: torch.Tensor,
    start: torch.Tensor,
    prior: torch.Tensor,
    settings: MaterialSettings,
    smooth: Callable[[torch.Tensor], torch.Tensor],
    *,
    inside: torch.Tensor | None = None,
    progress: Progress | None = None,
) -> torch.Tensor:
    """[P, 5] maps to start from: `start`, or where it fits better after a few steps, `settings.second_metallic`.

    Between a dielectric and a metal the loss has a barrier that no gradient crosses. `smooth` averages a cost [P, 1]
    over each pixel's surroundings, so that whole regions decide; pixels `inside` [P] bool, which get one metallic (see
    `Unified`), decide together. Where the prior says dielectric, the second start must win by `settings.metal_margin`.
    """
    assert settings.second_metallic is not None
    metal = torch.cat([start[:, :4], torch.full_like(start[:, 4:], settings.second_metallic)], 1)
    weights = loss_weights(prior, settings)
    short = [
        MaterialStage(tuple(_COLUMNS), replace(s.schedule, max_steps=settings.second_steps))
        for s in settings.stages[-1:]
    ]
    candidates, costs = [], []
    for maps in (start, metal):
        field = MaterialMaps(maps)
        fit_materials(problem, photo, field, prior, replace(settings, stages=tuple(short)), progress=progress)
        with torch.no_grad():
            found = field()
            error = residual(problem.render(found), photo, settings.encoding, clipped=settings.clipped)
            cost = (error.abs() + error.square()).mean(1) + ((found - prior).abs() * weights).sum(1)
        candidates.append(found)
        costs.append(smooth(cost[:, None]))
    margin = settings.metal_margin * fall_off(prior[:, 4], settings.dielectric_below) * metal_factor(prior, settings)
    gain = costs[0] - costs[1] - smooth(margin[:, None])  # of the second start
    if inside is not None:
        gain = torch.where(inside[:, None], gain[inside].mean(), gain)
    return torch.where(gain > 0, candidates[1], candidates[0])
