"""`materialist edit SCENE (--mask PNG | --click X,Y) ... -o OUT`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.options import (
    Box,
    Clicks,
    Denoise,
    Device,
    DeviceOption,
    Force,
    FullRender,
    Json,
    MaskFile,
    Method,
    PictureOutput,
    Save,
    SceneArgument,
    Seed,
    Spp,
    With,
)
from materialist.cli.picture import check_before, chosen_region, write_result
from materialist.errors import InputError


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("edit")(edit)


def edit(
    scene: SceneArgument,
    output: PictureOutput,
    mask: MaskFile = None,
    click: Clicks = None,
    box: Box = None,
    method: With = Method.network,
    hue: Annotated[float, typer.Option(help="Turn the albedo's hue, degrees.")] = 0.0,
    saturation: Annotated[float, typer.Option(help="-1 (grey) to 1.")] = 0.0,
    value: Annotated[float, typer.Option(help="-1 (black) to 1 (white).")] = 0.0,
    albedo: Annotated[str | None, typer.Option(metavar="R,G,B", help="One linear colour, or #rrggbb in sRGB.")] = None,
    roughness: Annotated[str | None, typer.Option(metavar="V|±D", help="Set to V, or shift by +D or -D.")] = None,
    metallic: Annotated[str | None, typer.Option(metavar="V|±D", help="The same for metallic.")] = None,
    texture: Annotated[Path | None, typer.Option(metavar="PNG", help="A picture laid on the surface.")] = None,
    texture_scale: Annotated[float, typer.Option(help="Its size; 1 covers the region once.")] = 1.0,
    spp: Spp = 256,
    denoise: Denoise = True,
    full_render: FullRender = False,
    save: Save = None,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Change the material of a region, and get the photo back with only that changed."""
    from materialist.edits.material.material import edit as change
    from materialist.edits.material.texture import read_texture
    from materialist.io.package import load_scene

    wanted = (hue, saturation, value, albedo, roughness, metallic, texture)
    if not any(v not in (0.0, None) for v in wanted):
        raise InputError("Nothing to change; give --hue, --saturation, --value, --albedo, --roughness or the like.")
    if texture is None and texture_scale != 1.0:
        raise InputError("--texture-scale says nothing without --texture; give that, too, or leave it out.")
    check_before(output, save, spp, force, device=device.value, full_render=full_render)
    loaded = load_scene(scene)
    picture = read_texture(texture) if texture else None
    region = chosen_region(loaded, click, box, mask, method, device.value)
    edited = change(
        loaded, region, hue=hue, saturation=saturation, value=value, albedo=albedo, texture=picture,
        texture_scale=texture_scale, roughness=roughness, metallic=metallic,
    )  # fmt: skip
    write_result(
        "edit", loaded, edited, output, save=save, spp=spp, seed=seed, denoise=denoise, full_render=full_render,
        device=device.value, as_json=as_json, force=force,
        lines=[f"{int(region.sum())} pixels edited, {float(region.mean()):.0%} of the photo."],
    )  # fmt: skip
