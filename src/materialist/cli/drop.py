"""`materialist drop SCENE MESH ... --at X,Y -o OUT.mp4`."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from materialist.cli.options import (
    MESH_FILES,
    Denoise,
    Device,
    DeviceOption,
    Force,
    FramesPerSecond,
    FullRender,
    Json,
    MeshMaterial,
    SceneArgument,
    Seed,
    output_option,
)
from materialist.cli.outcome import report_success
from materialist.cli.picture import check_paths, check_saved, check_video, numbers
from materialist.cli.progress import StageProgress


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("drop")(drop)


def drop(
    scene: SceneArgument,
    meshes: Annotated[list[Path], typer.Argument(metavar="MESH...", help=MESH_FILES)],
    output: Annotated[Path, output_option("OUT", "A .mp4, or a folder of frames.")],
    at: Annotated[
        list[str], typer.Option("--at", metavar="X,Y", help="Over which pixel of the working size; one, or one each.")
    ],
    frames: Annotated[int, typer.Option(metavar="N", help="Length of the film.")] = 48,
    fps: FramesPerSecond = 24,
    height: Annotated[float, typer.Option(help="Over the ground, in longest sides.")] = 1.5,
    spin: Annotated[float, typer.Option(help="Turns per second about an axis that the seed chooses.")] = 0.3,
    scale: Annotated[float, typer.Option(help="Factor on the size; 1 is a sixth of the picture's width there.")] = 1.0,
    material: MeshMaterial = "as-is",
    gravity: Annotated[
        str | None, typer.Option(metavar="X,Y,Z", help="Its direction in the camera frame: X right, Y up, Z back.")
    ] = None,
    metres: Annotated[float, typer.Option(help="What the longest side is taken for; small things fall fast.")] = 0.2,
    up: Annotated[str, typer.Option(help="Axis of the files that points up: y, z; auto: z for STL.")] = "auto",
    spp: Annotated[int, typer.Option(help="Paths per pixel, of each rendering.")] = 32,
    denoise: Denoise = True,
    full_render: FullRender = False,
    save: Annotated[
        Path | None, typer.Option("--save", metavar="SCENE2", help="Write the scene of the last frame.")
    ] = None,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Let meshes fall onto what the photo shows, and film it."""
    from materialist.edits.composite.composite import developed, pictures
    from materialist.edits.core.notes import warnings_since
    from materialist.edits.drop.drop import drop as simulate
    from materialist.edits.insert.meshes import read_model
    from materialist.io.package import load_scene, save_scene
    from materialist.io.video import write_frames

    check_paths(spp)
    check_saved(output, save, force, full_render)
    check_video(output, fps, force, device.value)
    start = time.monotonic()
    places: Any = [numbers(text, 2, "--at") for text in at]
    direction: Any = numbers(gravity, 3, "--gravity") if gravity else None
    models = [read_model(path, up=up) for path in meshes]
    loaded = load_scene(scene)
    film = simulate(
        loaded, models, places, frames=frames, fps=fps, height=height, spin=spin, scale=scale, material=material,
        gravity=direction, metres=metres, seed=seed,
    )  # fmt: skip
    last: Any = None

    def taken(progress: Any) -> Iterator[Any]:
        nonlocal last
        options: dict[str, Any] = {"denoise": denoise, "full_render": full_render, "device": device.value}
        for picture in pictures(loaded, film, spp=spp, seed=seed, progress=progress, **options):
            last = picture
            yield picture

    with StageProgress(quiet=as_json) as progress:
        write_frames(output, taken(progress), fps=fps, force=force)
    if save is not None:
        save_scene(developed(loaded, film[-1], last, seed=seed, device=device.value), save, force=force)
    shown = [f"Look at {output}", *([f"The edited scene is {save}"] if save is not None else [])]
    warnings = warnings_since(loaded, film[-1])
    report_success(
        "drop", as_json, [*(f"Note: {note}" for note in warnings), *shown], video=str(output),
        frames=frames, fps=fps, scene=str(save) if save else None, warnings=warnings,
        edits=film[-1].provenance.get("edits", []), seconds=time.monotonic() - start,
    )  # fmt: skip
