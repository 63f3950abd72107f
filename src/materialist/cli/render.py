"""`materialist render SCENE -o OUT`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.options import Device, DeviceOption, Force, Json, SceneArgument, Seed, output_option
from materialist.cli.outcome import report_success
from materialist.errors import InputError


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("render")(render)


def render(
    scene: SceneArgument,
    output: Annotated[Path, output_option("OUT", "A .png (sRGB) or .exr (linear).")],
    spp: Annotated[int, typer.Option(help="Samples per pixel.")] = 64,
    denoise: Annotated[bool, typer.Option("--denoise/--no-denoise", help="Remove noise (needs pyoidn).")] = False,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Path-trace a scene package."""
    from materialist.edits.composite.output import write_composite
    from materialist.edits.core.notes import PICTURED, is_pictured
    from materialist.io.image import ensure_image_writable
    from materialist.io.package import load_scene

    if not 1 <= spp <= 1_000_000:
        raise InputError(f"--spp is a number of samples from 1 to 1000000, not {spp}.")
    ensure_image_writable(output, force=force)
    loaded = load_scene(scene)
    from rich.console import Console

    from materialist import pipeline

    with Console(stderr=True).status(f"Rendering {spp} samples per pixel"):
        image = pipeline.render_scene(loaded, spp=spp, denoise=denoise, seed=seed, device=device.value)
    write_composite(output, image, loaded.photo, force=force)
    notes = [f"{PICTURED}a rendering does not show it."] if is_pictured(loaded) else []
    shown = [*(f"Note: {note}" for note in notes), f"Look at {output}"]
    report_success("render", as_json, shown, image=str(output), spp=spp, warnings=notes)
