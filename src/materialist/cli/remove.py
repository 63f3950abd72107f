"""`materialist remove SCENE (--mask PNG | --click X,Y | --box ...) [--background PNG] -o OUT`."""

from __future__ import annotations

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


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("remove")(remove)


def remove(
    scene: SceneArgument,
    output: PictureOutput,
    mask: MaskFile = None,
    click: Clicks = None,
    box: Box = None,
    method: With = Method.network,
    background: Background = None,
    inpaint: Inpainter = None,
    shadow: Shadow = "auto",
    spp: Spp = 256,
    denoise: Denoise = True,
    full_render: FullRender = False,
    save: Save = None,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Take an object out of the photo, with its shadow and its reflections."""
    from materialist.edits.remove.remove import remove as take_away
    from materialist.io.package import load_scene

    check_before(output, save, spp, force, device=device.value, full_render=full_render)
    loaded = load_scene(scene)
    region = chosen_region(loaded, click, box, mask, method, device.value)
    inpainter = chosen_inpainter(inpaint, seed, device.value)
    edited = take_away(loaded, region, background=background, inpaint=inpainter, shadow=shadow, seed=seed)
    write_result(
        "remove", loaded, edited, output, save=save, spp=spp, seed=seed, denoise=denoise, full_render=full_render,
        device=device.value, as_json=as_json, force=force, lines=[f"{int(region.sum())} pixels taken away."],
    )  # fmt: skip
