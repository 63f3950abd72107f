"""`materialist apply SCENE edits.yaml -o OUT`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from materialist.cli.options import (
    Denoise,
    Device,
    DeviceOption,
    Force,
    FullRender,
    Json,
    PictureOutput,
    Save,
    SceneArgument,
    Seed,
    Spp,
)
from materialist.cli.picture import check_before, write_result


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("apply")(apply)


def apply(
    scene: SceneArgument,
    edits: Annotated[Path, typer.Argument(metavar="EDITS", help="A YAML list of edits.")],
    output: PictureOutput,
    spp: Spp = 256,
    denoise: Denoise = True,
    full_render: FullRender = False,
    save: Save = None,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Replay a list of edits on a scene: materials and light, in one picture."""
    from materialist.edits.recipe import apply as replay
    from materialist.edits.recipe import read_recipe
    from materialist.io.package import load_scene

    check_before(output, save, spp, force, device=device.value, full_render=full_render)
    steps = read_recipe(edits)
    loaded = load_scene(scene)
    edited = replay(loaded, steps, seed=seed, device=device.value)
    write_result(
        "apply", loaded, edited, output, save=save, spp=spp, seed=seed, denoise=denoise, full_render=full_render,
        device=device.value, as_json=as_json, force=force, lines=[_count(steps)],
    )  # fmt: skip


def _count(steps: list[Any]) -> str:
    """How many edits were applied, and how many not."""
    skipped = sum(step.skipped for step in steps)
    done = len(steps) - skipped
    told = f"{done} edit{'s' * (done != 1)} applied"
    return f"{told}, {skipped} skipped." if skipped else f"{told}."
