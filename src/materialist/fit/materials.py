"""Material properties optimisation (paper, Progressive Differentiable Rendering)."""

from collections.abc import Callable

import numpy as np
import torch

from materialist.buffers import placed
from materialist.errors import InputError
from materialist.fit.engine import MaterialProblem
from materialist.fit.fields import (
    ALL,
    MaterialField,
    MaterialMaps,
    MaterialMLP,
    MaterialRegions,
    MaterialUNet,
    Rows,
    Unified,
)
from materialist.fit.losses import consistency, rendering_loss, residual
from materialist.fit.optimise import StageResult, optimise
from materialist.fit.regions import albedo_regions
from materialist.fit.settings import MaterialSettings
from materialist.types import Camera, Progress

COLUMNS = {"albedo": slice(0, 3), "roughness": slice(3, 4), "metallic": slice(4, 5)}


def remapped(prior: torch.Tensor) -> torch.Tensor:
    """Roughness and metallic of [P, 5] maps moved to 0.7 x + 0.2, where gradients live (paper, Initialization)."""
    return torch.cat([prior[:, :3], 0.7 * prior[:, 3:] + 0.2], 1)


def material_field(
    start: torch.Tensor, settings: MaterialSettings, pixels: torch.Tensor, camera: Camera, *,
    inside: torch.Tensor | None = None, seed: int = 0,
) -> MaterialField:  # fmt: skip
    """A fresh field around `start` [P, 5]; with `inside` [P] bool, roughness and metallic are one value there."""
    torch.manual_seed(seed)
    fresh: dict[str, Callable[[], MaterialField]] = {
        "mlp": lambda: MaterialMLP(start, pixels, camera.height, camera.width), "maps": lambda: MaterialMaps(start),
        "unet": lambda: MaterialUNet(start, pixels, camera.height, camera.width),
        "regions": lambda: MaterialRegions(start, _regions(start, pixels, camera)),
    }  # fmt: skip
    if settings.field not in fresh:
        raise InputError(f"Material field is '{settings.field}'; choose mlp, maps, regions or unet.")
    field = fresh[settings.field]().to(start.device)
    return field if inside is None else Unified(field, inside)


def _regions(start: torch.Tensor, pixels: torch.Tensor, camera: Camera) -> torch.Tensor:
    """[P] the regions of the albedo of maps [P, 5]."""
    return placed(albedo_regions(start[:, :3].cpu().numpy(), pixels.numpy(), camera))


def fit_materials(
    problem: MaterialProblem, photo: torch.Tensor, field: MaterialField, prior: torch.Tensor,
    settings: MaterialSettings, *, seed: int = 0, progress: Progress | None = None,
) -> list[StageResult]:  # fmt: skip
    """Move `field` stage by stage: argmin L_re + delta L_cons.

    photo: [P, 3] linear. prior: [P, 5] maps that L_cons holds on to. seed: of the pixels that a step compares.
    """
    results = []
    for stage in settings.stages:
        with torch.no_grad():
            before = field()
        moves = torch.zeros(5, dtype=torch.bool)
        for name in stage.targets:
            moves[COLUMNS[name]] = True
        moves = moves.to(before.device)
        draw = _drawn(len(photo), settings.step_pixels, seed)

        def loss(_: int, before=before, moves=moves, draw=draw) -> torch.Tensor:
            rows = draw()
            values = torch.where(moves, field(rows), before[rows])
            error = residual(problem(values, rows), photo[rows], settings.encoding, white=settings.white)
            return rendering_loss(error, settings.loss) + consistency(values, prior[rows], settings)

        name = "materials" if moves.all() else "+".join(stage.targets)
        run = optimise(name, field.parameters(), loss, stage.schedule, after_step=field.confine, progress=progress)
        results.append(run)
    return results


def _drawn(count: int, most: int, seed: int) -> Callable[[], Rows]:
    """What draws the pixels of a step: all of `count`, or `most` of them at random."""
    if not most or count <= most:
        return lambda: ALL
    rng = np.random.default_rng(seed)
    return lambda: torch.from_numpy(rng.integers(count, size=most))
