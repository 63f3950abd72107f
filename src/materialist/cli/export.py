"""`materialist export SCENE --to FORMAT -o OUT`."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.options import Device, DeviceOption, Force, Json, SceneArgument, Seed, output_option
from materialist.cli.outcome import report_success


class Format(StrEnum):
    """What other programs read."""

    glb = "glb"
    blend = "blend"
    usd = "usd"
    mitsuba = "mitsuba"
    html = "html"


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("export")(export)


def export(
    scene: SceneArgument,
    output: Annotated[
        Path,
        output_option("OUT", "NAME.glb, .blend, .usdz or .html; or a folder (blend, usd, mitsuba)."),
    ],
    to: Annotated[Format, typer.Option("--to", help="Format.")],
    max_triangles: Annotated[
        int | None, typer.Option(metavar="N", help="Coarser mesh of at most N triangles; html: 60000 unless given.")
    ] = None,
    blender: Annotated[
        str | None, typer.Option(metavar="PROGRAM", help="blend: the blender program, or a Python that has bpy.")
    ] = None,
    shadow_catcher: Annotated[
        bool, typer.Option("--shadow-catcher", help="blend: show the photo, with the scene to catch shadows on it.")
    ] = False,
    fitted_material: Annotated[
        bool, typer.Option("--fitted-material", help="blend: the material model of the fit, not Blender's Principled.")
    ] = False,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Write a scene for another program: glTF, Blender, USD, Mitsuba, or one self-contained page of HTML.

    Nothing of it is random, and nothing is computed on a GPU.
    """
    from rich.console import Console

    from materialist.exporters.run import check_format
    from materialist.exporters.run import export as write
    from materialist.io.package import load_scene

    check_format(output, to.value)
    with Console(stderr=True).status(f"Writing {output}"):
        done = write(
            load_scene(scene),
            output,
            to=to.value,
            force=force,
            max_triangles=max_triangles,
            blender=blender,
            shadow_catcher=shadow_catcher,
            fitted_material=fitted_material,
        )
    files = [str(done.path), *map(str, done.beside)]
    report_success(
        "export", as_json, [f"Wrote {', '.join(files)}", *done.notes], output=str(done.path), beside=files[1:],
        notes=list(done.notes),
    )  # fmt: skip
