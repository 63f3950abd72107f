"""Material properties optimisation (paper, Progressive Differentiable Rendering)."""

from collections.abc import Callable

import numpy as np
import torch
from torch import nn

from materialist.buffers import placed
from materialist.errors import InputError
from materialist.fit.engine import MaterialProblem
from materialist.fit.fields import (
    ALL,
    MaterialMaps,
    MaterialMLP,
    MaterialUNet,
    Rows,
    Unified,
)
from materialist.fit.losses import consistency, encode, encoded_error, rendering_loss
from materialist.fit.optimise import StageResult, Stop, never, optimise
from materialist.fit.settings import MaterialSettings
from materialist.types import Camera, Progress

COLUMNS = {"albedo": slice(0, 3), "roughness": slice(3, 4), "metallic": slice(4, 5)}


def remapped(prior: torch.Tensor) -> torch.Tensor:
    """Roughness and metallic of [P, 5] maps moved to 0.7 x + 0.2, where gradients live (paper, Initialization)."""
    return torch.cat([prior[:, :3], 0.7 * prior[:, 3:] + 0.2], 1)


def material_field(
    start: torch.Tensor,
    settings: MaterialSettings,
    pixels: torch.Tensor,
    camera: Camera,
    *,
    inside: torch.Tensor | None = None,
    seed: int = 0,
) -> nn.Module:
    """A fresh field around `start` [P, 5]; with `inside` [P] bool, roughness and metallic are one value there."""
    torch.manual_seed(seed)
    fresh: dict[str, Callable[[], nn.Module]] = {
        "mlp": lambda: MaterialMLP(start, pixels, camera.height, camera.width),
        "maps": lambda: MaterialMaps(start),
        "unet": lambda: MaterialUNet(start, pixels, camera.height, camera.width),
    }
    if settings.field not in fresh:
        raise InputError(f"Material field is '{settings.field}'; choose mlp, maps or unet.")
    field = fresh[settings.field]().to(start.device)
    return field if inside is None else Unified(field, inside)


def fit_materials(
    problem: MaterialProblem,
    photo: torch.Tensor,
    field: nn.Module,
    prior: torch.Tensor,
    settings: MaterialSettings,
    *,
    seed: int = 0,
    progress: Progress | None = None,
    stop: Stop = never,
) -> list[StageResult]:
    """Move `field` stage by stage: argmin L_re + delta L_cons.

    photo: [P, 3] linear. prior: [P, 5] maps that L_cons holds on to. seed: of the pixels that a step compares.
    """
    # --- What stays the same in all steps ---
    results = []
    draw = _pixel_draw(len(photo), settings, seed)
    # Powers take most of a step, and these do not change.
    encoded_photo = encode(photo, settings.encoding)
    encoded_albedo = encode(prior[:, :3], settings.encoding)
    for stage in settings.stages:
        # --- Maps that the stage does not move stay as the field has them now ---
        held = {
            name: field().detach()[:, c] for name, c in COLUMNS.items() if name not in stage.targets
        }

        # --- L_re + delta L_cons ---
        def loss(_: int, held=held) -> torch.Tensor:
            rows = draw()
            moved = field(rows)
            values = torch.cat(
                [held[name][rows] if name in held else moved[:, c] for name, c in COLUMNS.items()],
                1,
            )
            # Both on the pixels of this step.
            radiance = problem(values, rows)
            error = encoded_error(
                radiance,
                photo[rows],
                settings.encoding,
                white=settings.white,
                encoded=encoded_photo[rows],
            )
            change = consistency(values, prior[rows], settings, encoded=encoded_albedo[rows])
            return rendering_loss(error, settings.loss) + change

        def into_range() -> None:
            # Only maps that are parameters themselves can leave [0, 1] in a step.
            base = field.field if isinstance(field, Unified) else field
            if isinstance(base, MaterialMaps):
                base.maps.clamp_(0, 1)

        # --- Until the stopping rule holds ---
        name = stage.name or ("+".join(stage.targets) if held else "materials")
        run = optimise(
            name,
            field.parameters(),
            loss,
            stage.schedule,
            after_step=into_range,
            progress=progress,
            stop=stop,
        )
        results.append(run)
    return results


def _pixel_draw(count: int, settings: MaterialSettings, seed: int) -> Callable[[], Rows]:
    """What names the pixels of a step: all of `count`, or some at random (`step_pixels`, `step_share`)."""
    most = max(settings.step_pixels, round(settings.step_share * count))
    if not settings.step_pixels or count <= most:
        return lambda: ALL
    rng = np.random.default_rng(seed)
    return lambda: placed(rng.integers(count, size=most))
