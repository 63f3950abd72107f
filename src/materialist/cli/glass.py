"""`materialist glass SCENE (--mask PNG | --click X,Y) [--ior 1.5] [--transmission 1] ... -o OUT`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from materialist.cli.options import (
    Background,
    Box,
    Clicks,
    Denoise,
    Device,
    DeviceOption,
    Force,
    FullRender,
    Inpainter,
    Json,
    MaskFile,
    Method,
    PictureOutput,
    Save,
    SceneArgument,
    Seed,
    Shadow,
    Spp,
    With,
)
from materialist.cli.picture import check_before, chosen_inpainter, chosen_region, write_result


class Model(StrEnum):
    """How light goes through."""

    closed = "closed"
    two_interface = "two-interface"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("glass")(glass)


def glass(
    scene: SceneArgument,
    output: PictureOutput,
    mask: MaskFile = None,
    click: Clicks = None,
    box: Box = None,
    method: With = Method.network,
    ior: Annotated[float, typer.Option(help="Index of refraction, 1 to 3: water 1.33, glass 1.5.")] = 1.5,
    transmission: Annotated[float, typer.Option(help="Share of light that enters; the rest is the old surface.")] = 1.0,
    tint: Annotated[str, typer.Option(metavar="R,G,B", help="Its colour, linear, or #rrggbb.")] = "1,1,1",
    roughness: Annotated[float, typer.Option(help="0 is clear, 0.3 frosted.")] = 0.0,
    hollow: Annotated[bool, typer.Option("--hollow", help="A wall around air.")] = False,
    open_top: Annotated[bool, typer.Option("--open", help="Hollow, and open at the top, as a vase.")] = False,
    model: Annotated[Model, typer.Option(help="closed: path-traced; two-interface: as in the paper.")] = Model.closed,
    thickness: Annotated[
        str,
        typer.Option(metavar="auto|network|symmetry|FILE", help="How thick it is; a file has scene units."),
    ] = "auto",
    background: Background = None,
    inpaint: Inpainter = None,
    shadow: Shadow = "auto",
    preview: Annotated[
        bool, typer.Option("--preview", help="Sooner: working size, without its shadow and caustics.")
    ] = False,
    spp: Spp = 96,
    denoise: Denoise = True,
    full_render: FullRender = False,
    save: Save = None,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Turn an object to glass: what is behind it is continued, and seen through it."""
    from materialist.edits.core.notes import PICTURED
    from materialist.edits.glass.glass import glass as change
    from materialist.errors import InputError
    from materialist.io.package import load_scene
    from materialist.option_kinds import parse_colour
    from materialist.options import Glass

    if model is Model.two_interface and full_render:
        raise InputError(f"{PICTURED}--full-render would not show it; take --model closed, or leave that out.")
    check_before(output, save, spp, force, device=device.value, full_render=full_render)
    if preview and (save is not None or full_render or not denoise):
        raise InputError("--preview writes a picture and nothing else: leave --save, --full-render, --no-denoise out.")
    r, g, b = (float(c) for c in parse_colour(tint, "tint"))
    look: dict[str, Any] = {"ior": ior, "transmission": transmission, "tint": (r, g, b), "roughness": roughness}
    Glass(**look)
    loaded = load_scene(scene)
    region = chosen_region(loaded, click, box, mask, method, device.value)
    options: dict[str, Any] = {
        "hollow": "open" if open_top else hollow, "model": model.value, "thickness": thickness,
        "background": background, "inpaint": chosen_inpainter(inpaint, seed, device.value),
        "shadow": shadow, "seed": seed,
    }  # fmt: skip
    if preview:
        _preview(loaded, region, look, options, output, spp, device.value, as_json, force)
        return
    edited = change(loaded, region, **look, **options)
    source = edited.provenance["edits"][-1]["thickness"]
    write_result(
        "glass", loaded, edited, output, save=save, spp=spp, seed=seed, denoise=denoise, full_render=full_render,
        device=device.value, as_json=as_json, force=force,
        lines=[f"{int(region.sum())} pixels are glass; thickness: {source}."],
    )  # fmt: skip


def _preview(
    loaded: Any, region: Any, look: dict[str, Any], options: dict[str, Any], output: Path, spp: int, device: str,
    as_json: bool, force: bool,
) -> None:  # fmt: skip
    """Write what the studio shows while its sliders move, and say what it leaves out."""
    import time

    from materialist.cli.outcome import report_success
    from materialist.cli.progress import StageProgress
    from materialist.edits.composite.output import write_composite
    from materialist.edits.core.notes import warnings_since
    from materialist.edits.glass.preview import GlassPreview

    start = time.monotonic()
    with StageProgress(quiet=as_json) as progress:
        progress("body", 0, 1)
        made = GlassPreview(loaded, region, device=device, **options)
        progress("render", 0, 1)
        picture = made.picture(**look, spp=spp, seed=options["seed"])
    write_composite(output, picture, loaded.photo, force=force)
    size, source = f"{picture.shape[1]} x {picture.shape[0]}", made.edited.provenance["edits"][-1]["thickness"]
    warnings = warnings_since(loaded, made.edited)
    lines = [
        f"{int(region.sum())} pixels are glass; thickness: {source}.",
        f"A preview: {size}, the size that the scene was worked out at, without the shadow and caustics of the glass.",
        *(f"Note: {note}" for note in warnings),
        f"Look at {output}",
    ]
    report_success(
        "glass", as_json, lines, image=str(output), scene=None, preview=True, seconds=time.monotonic() - start,
        thickness=source, warnings=warnings, **look,
    )  # fmt: skip
