"""Material properties optimisation (paper, Progressive Differentiable Rendering)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import torch
from torch import nn

from materialist.errors import InputError
from materialist.fit.engine import MaterialProblem
from materialist.fit.fields import MaterialMaps, MaterialMLP, MaterialUNet, Unified
from materialist.fit.loop import Progress, StageResult, optimise
from materialist.fit.losses import consistency, l1_l2, residual, too_pure
from materialist.fit.neighbours import Neighbours
from materialist.fit.settings import MaterialSettings, MaterialStage
from materialist.types import Camera

_COLUMNS = {"albedo": slice(0, 3), "roughness": slice(3, 4), "metallic": slice(4, 5)}

DIELECTRIC = (0.2, 0.04)
"""Predicted metallic below which a surface may be, and is, a dielectric, the surer the lower."""


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


def prices(prior: torch.Tensor, settings: MaterialSettings) -> torch.Tensor:
    """[P, 3] weights of albedo, roughness and metallic in L_cons: metal is dearer where the prior says dielectric."""
    rows = torch.tensor(settings.weights, dtype=torch.float32).repeat(len(prior), 1)
    rows[:, 2] *= _dearer(prior, settings)
    return rows


def _dearer(prior: torch.Tensor, settings: MaterialSettings) -> torch.Tensor:
    """[P] how many times dearer metal is than its weight."""
    return 1 + (settings.dielectric - 1) * _below(prior[:, 4], DIELECTRIC[1])


def _below(metallic: torch.Tensor, limit: float) -> torch.Tensor:
    """1 at 0, 0 from the limit."""
    return 1 - (metallic / limit).clamp(0, 1)


def pure_dielectric(photo: torch.Tensor, prior: torch.Tensor) -> torch.Tensor:
    """[P, 3] bool: channels of photo [P, 3] that are `too_pure`, where the prior [P, 5] says dielectric.

    A metal's reflection is coloured, so that it can be what the photo shows.
    """
    return too_pure(photo) & (prior[:, 4:] < DIELECTRIC[0])


def better_start(
    problem: MaterialProblem,
    photo: torch.Tensor,
    start: torch.Tensor,
    prior: torch.Tensor,
    settings: MaterialSettings,
    smooth: Callable[[torch.Tensor], torch.Tensor],
    *,
    inside: torch.Tensor | None = None,
    steps: int = 25,
    progress: Progress | None = None,
) -> torch.Tensor:
    """[P, 5] maps to start from: `start`, or where it fits better after `steps` steps, another metallic.

    `smooth` averages a cost [P, 1] over each pixel's surroundings, so that whole regions decide; pixels `inside` [P]
    bool, which get one metallic (see `Unified`), decide together. Where the prior says dielectric, the other start must
    win by `settings.doubt`: what fits either way stays what it was.
    """
    assert settings.other_metallic is not None
    other = torch.cat([start[:, :4], torch.full_like(start[:, 4:], settings.other_metallic)], 1)
    share = torch.tensor([1 / 3, 1 / 3, 1 / 3, 1, 1])
    price = settings.delta * share * prices(prior, settings)[:, [0, 0, 0, 1, 2]]
    short = [MaterialStage(tuple(_COLUMNS), replace(s.schedule, max_steps=steps)) for s in settings.stages[-1:]]
    candidates, costs = [], []
    for maps in (start, other):
        field = MaterialMaps(maps)
        fit_materials(problem, photo, field, prior, replace(settings, stages=tuple(short)), progress=progress)
        with torch.no_grad():
            error = residual(
                problem.render(field()), photo, settings.encoding, clipped=settings.clipped,
                pure=pure_dielectric(photo, prior),
            )  # fmt: skip
            cost = (error.abs() + error.square()).mean(1) + ((field() - prior).abs() * price).sum(1)
        candidates.append(field().detach())
        costs.append(smooth(cost[:, None]))
    doubt = settings.doubt * _below(prior[:, 4], DIELECTRIC[0]) * _dearer(prior, settings)
    gain = costs[0] - costs[1] - smooth(doubt[:, None])  # of the other start
    if inside is not None:
        gain = torch.where(inside[:, None], gain[inside].mean(), gain)
    return torch.where(gain > 0, candidates[1], candidates[0])


def fit_materials(
    problem: MaterialProblem,
    photo: torch.Tensor,
    field: nn.Module,
    prior: torch.Tensor,
    settings: MaterialSettings,
    neighbours: Neighbours | None = None,
    *,
    factor: torch.Tensor | None = None,
    progress: Progress | None = None,
) -> list[StageResult]:
    """Move `field` stage by stage: argmin L_re + delta L_cons.

    Args:
        problem: rendering under a fixed light.
        photo: [P, 3] linear.
        prior: [P, 5] the maps that L_cons holds on to.
        neighbours: pixel pairs for the smoothness term; needed when `settings.smooth` is not zero.
        factor: [P, 3] multiplies the rendering: what the renderer is known to get wrong.
    """
    factor = torch.ones(1) if factor is None else factor
    objective = material_objective(problem, photo, prior, settings, neighbours, factor)
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
    neighbours: Neighbours | None,
    factor: torch.Tensor,
) -> Callable[[torch.Tensor], torch.Tensor]:
    """L_re + delta L_cons + smoothness as a function of the materials [P, 5]; in one kernel where there are tables."""
    if problem.tables is not None:
        from materialist.fit.fused import FusedLoss

        return FusedLoss(problem.tables, factor, photo, prior, settings, neighbours)

    price = prices(prior, settings)
    pure = pure_dielectric(photo, prior) if settings.clipped else torch.zeros(1, dtype=torch.bool)

    def objective(values: torch.Tensor) -> torch.Tensor:
        rendered = problem.render(values) * factor
        if pure.any():  # there the albedo alone is to blame
            by_albedo = problem.render(torch.cat([values[:, :3], values[:, 3:].detach()], 1)) * factor
            rendered = torch.where(pure, by_albedo, rendered)
        value = l1_l2(residual(rendered, photo, settings.encoding, clipped=settings.clipped))
        parts = [values[:, c] for c in _COLUMNS.values()]
        priors = [prior[:, c] for c in _COLUMNS.values()]
        value = value + settings.delta * consistency(parts, priors, price.unbind(1))
        if neighbours is not None:
            for weight, part, held in zip(settings.smooth, parts, priors, strict=True):
                if weight:
                    value = value + weight * neighbours.total_variation(part - held)
        return value

    return objective
