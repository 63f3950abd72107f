"""`materialist insert SCENE MESH --at X,Y ... -o OUT`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.options import (
    MESH_FILES,
    Denoise,
    Device,
    DeviceOption,
    Force,
    FullRender,
    Json,
    MeshMaterial,
    PictureOutput,
    Save,
    SceneArgument,
    Seed,
    Spp,
)
from materialist.cli.picture import check_before, numbers, write_result


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("insert")(insert)


def insert(
    scene: SceneArgument,
    mesh: Annotated[Path, typer.Argument(metavar="MESH", help=MESH_FILES)],
    output: PictureOutput,
    at: Annotated[
        list[str], typer.Option("--at", metavar="X,Y", help="Where it stands, at working size; several: one each.")
    ],
    scale: Annotated[float, typer.Option(help="Factor on its size; 1 is a sixth of the picture's width there.")] = 1.0,
    turn: Annotated[float, typer.Option(metavar="DEG", help="Turn about its up axis.")] = 0.0,
    material: MeshMaterial = "as-is",
    size: Annotated[float | None, typer.Option(help="Its longest side in scene units, in place of the sixth.")] = None,
    up: Annotated[str, typer.Option(help="Axis of the file that points up: y, z; auto: z for STL.")] = "auto",
    spp: Spp = 256,
    denoise: Denoise = True,
    full_render: FullRender = False,
    save: Save = None,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Put a mesh into the photo: it stands on what is there, casts its shadow and is reflected."""
    from materialist.edits.insert.insert import insert as put
    from materialist.edits.insert.meshes import read_model
    from materialist.io.package import load_scene

    check_before(output, save, spp, force, device=device.value, full_render=full_render)
    places = [numbers(text, 2, "--at") for text in at]
    model = read_model(mesh, up=up)
    loaded = edited = load_scene(scene)
    for x, y in places:
        edited = put(edited, model, (x, y), scale=scale, turn=turn, material=material, size=size)
    longest = edited.provenance["edits"][-1]["size"]
    write_result(
        "insert", loaded, edited, output, save=save, spp=spp, seed=seed, denoise=denoise, full_render=full_render,
        device=device.value, as_json=as_json, force=force,
        lines=[f"{model.name}: longest side {longest:.3g} scene units."],
    )  # fmt: skip
