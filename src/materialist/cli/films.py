"""`materialist relight` and `drop`: other light, and things that fall, as a picture or a film."""

from pathlib import Path
from typing import Annotated, Any

import typer

from materialist.cli.edits import MESH_FILES
from materialist.cli.options import FramesPerSecond, Place, Rendering, Run, SceneArgument, output_option
from materialist.cli.picture import check_before, chosen_region, flag_numbers, write_film, write_result
from materialist.errors import InputError
from materialist.options import Drop, Relight

FPS = 24


def relight(
    scene: SceneArgument,
    output: Annotated[Path, output_option("OUT", "A .png or .exr; with --frames .mp4 or a folder.")],
    options: Relight,
    lights: Place,
    rendering: Rendering,
    run: Run,
    sun: Annotated[
        list[str] | None, typer.Option(metavar="AZ,EL", help="A sun: degrees right of ahead, and above the horizon.")
    ] = None,
    sun_power: Annotated[float, typer.Option(help="Its light, relative to the mean light of the photo.")] = 1.0,
    frames: Annotated[
        int | None,
        typer.Option(metavar="N", help="A video: the light turns, or goes from --sun or --lamp to the next."),
    ] = None,
    fps: FramesPerSecond = FPS,
) -> None:
    """Show the photo under other light."""
    from materialist.io.package import load_scene

    suns = [(azimuth, elevation) for azimuth, elevation in (flag_numbers(text, 2, "--sun") for text in sun or ())]
    if options == Relight() and not suns and frames is None:
        raise InputError("No light to change; give --envmap, --rotate, --sun, --lamp, --ambient or --dim.")
    alone = [("--sun-power", "--sun")] if sun_power != 1.0 and not suns else []
    alone += [("--fps", "--frames")] if fps != FPS and frames is None else []
    alone += [(flag, "--dim") for flag in lights.named if options.dim is None]
    if alone:
        flag, needed = alone[0]
        raise InputError(f"{flag} says nothing without {needed}; give that, too, or leave {flag} out.")
    if frames is None:
        if output.suffix.lower() == ".mp4":
            raise InputError(f"{output} is a video; say of how many frames with --frames, for example --frames 48.")
        check_before(output, rendering, run)
        if len(suns) > 1:
            raise InputError("Several --sun are stations of a moving one; give --frames as well, or one --sun.")
    else:
        if rendering.save is not None:
            raise InputError("--save writes one scene; leave out --frames.")
        check_before(output, rendering, run, video=True)
    loaded = load_scene(scene)
    marked = chosen_region(loaded, lights, run) if lights.named else None
    wanted = Relight.given(options, sun_power=sun_power, lights=marked)
    if frames is not None:
        from materialist.edits.light.relight import moving_light

        film = moving_light(loaded, frames, wanted, suns=tuple(suns))
        write_film("relight", loaded, film, output, rendering, run, frames=frames, fps=fps)
        return
    from materialist.edits.light.relight import relight as change

    edited = change(loaded, wanted, sun=suns[0] if suns else None)
    write_result("relight", loaded, edited, output, rendering, run)


def drop(
    scene: SceneArgument,
    meshes: Annotated[list[Path], typer.Argument(metavar="MESH...", help=MESH_FILES)],
    output: Annotated[Path, output_option("OUT", "A .mp4, or a folder of frames.")],
    at: Annotated[
        list[str], typer.Option("--at", metavar="X,Y", help="Over which pixel of the working size; one, or one each.")
    ],
    options: Drop,
    run: Run,
    frames: Annotated[int, typer.Option(metavar="N", help="Length of the film.")] = 48,
    fps: FramesPerSecond = FPS,
    rendering: Rendering = Rendering(spp=32),  # noqa: B008
) -> None:
    """Let meshes fall onto what the photo shows, and film it; --save writes the scene of the last frame."""
    from materialist.edits.drop.drop import drop as simulate
    from materialist.edits.insert.meshes import read_model
    from materialist.io.package import load_scene

    check_before(output, rendering, run, video=True)
    places: Any = [flag_numbers(text, 2, "--at") for text in at]
    models = [read_model(path, up=options.up) for path in meshes]
    loaded = load_scene(scene)
    film = simulate(loaded, models, places, options, frames=frames, fps=fps)
    write_film("drop", loaded, film, output, rendering, run, frames=frames, fps=fps)
