"""`materialist glass SCENE (--mask PNG | --click X,Y) [--ior 1.5] [--transmission 1] ... -o OUT`."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

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
    method: With = Method.grabcut,
    ior: Annotated[float, typer.Option(help="Index of refraction, 1 to 3: water 1.33, glass 1.5.")] = 1.5,
    transmission: Annotated[float, typer.Option(help="Share of light that enters; the rest is the old surface.")] = 1.0,
    tint: Annotated[str, typer.Option(metavar="R,G,B", help="Its colour, linear, or #rrggbb.")] = "1,1,1",
    roughness: Annotated[float, typer.Option(help="0 is clear, 0.3 frosted.")] = 0.0,
    hollow: Annotated[bool, typer.Option("--hollow", help="A wall around air.")] = False,
    model: Annotated[Model, typer.Option(help="closed: path-traced; two-interface: as in the paper.")] = Model.closed,
    thickness: Annotated[
        str,
        typer.Option(metavar="auto|half-turn|network|symmetry|FILE", help="How thick it is; a file has scene units."),
    ] = "auto",
    background: Background = None,
    inpaint: Inpainter = None,
    shadow: Shadow = 0.0,
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
    from materialist.edit.glass import glass as change
    from materialist.edit.material import parse_colour
    from materialist.io.package import load_scene

    check_before(output, save, spp, force)
    r, g, b = (float(c) for c in parse_colour(tint))
    loaded = load_scene(scene)
    region = chosen_region(loaded, click, box, mask, method)
    edited = change(
        loaded, region, ior=ior, transmission=transmission, tint=(r, g, b), roughness=roughness, hollow=hollow,
        model=model.value, thickness=thickness, background=background,
        inpaint=chosen_inpainter(inpaint, seed, device.value), shadow=shadow, seed=seed,
    )  # fmt: skip
    source = edited.provenance["edits"][-1]["thickness"]
    write_result(
        "glass", loaded, edited, output, save=save, spp=spp, seed=seed, denoise=denoise, full_render=full_render,
        device=device.value, as_json=as_json, force=force,
        lines=[f"{int(region.sum())} pixels are glass; thickness: {source}."],
    )  # fmt: skip
