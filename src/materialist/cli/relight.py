"""`materialist relight SCENE (--envmap FILE | --rotate DEG | --sun AZ,EL | --lamp ...) [--frames N] -o OUT`."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from materialist.cli.options import (
    Box,
    Clicks,
    Denoise,
    Device,
    DeviceOption,
    Force,
    FramesPerSecond,
    FullRender,
    Json,
    MaskFile,
    Method,
    Save,
    SceneArgument,
    Seed,
    Spp,
    output_option,
)
from materialist.cli.outcome import report_success
from materialist.cli.picture import check_before, check_paths, check_video, chosen_region, numbers, write_result
from materialist.cli.progress import StageProgress
from materialist.errors import InputError

FPS = 24
"""Frames a second of a video, usually."""


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("relight")(relight)


def relight(
    scene: SceneArgument,
    output: Annotated[Path, output_option("OUT", "A .png or .exr; with --frames .mp4 or a folder.")],
    envmap: Annotated[Path | None, typer.Option(metavar="FILE", help="Another light: EXR or HDR, 2:1.")] = None,
    gain: Annotated[str, typer.Option(help="Factor on it; auto keeps the photo's mean light.")] = "auto",
    rotate: Annotated[float | None, typer.Option(metavar="DEG", help="Turn the light to the right.")] = None,
    sun: Annotated[
        list[str] | None, typer.Option(metavar="AZ,EL", help="A sun: degrees right of ahead, and above the horizon.")
    ] = None,
    sun_power: Annotated[float, typer.Option(help="Its light, relative to the mean light of the photo.")] = 1.0,
    lamp: Annotated[
        list[str] | None, typer.Option(metavar="X,Y,DEPTH,KELVIN,POWER", help="A lamp at a pixel and depth.")
    ] = None,
    ambient: Annotated[float, typer.Option(help="Factor on the light that was there.")] = 1.0,
    dim: Annotated[
        float | None, typer.Option(help="Factor on windows and lamps that the photo shows; they stay put.")
    ] = None,
    click: Clicks = None,
    box: Box = None,
    mask: MaskFile = None,
    frames: Annotated[
        int | None,
        typer.Option(metavar="N", help="A video: the light turns, or goes from --sun or --lamp to the next."),
    ] = None,
    fps: FramesPerSecond = FPS,
    spp: Spp = 256,
    denoise: Denoise = True,
    full_render: FullRender = False,
    save: Save = None,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Show the photo under other light."""
    from materialist.edits.light.relight import lamp as make_lamp
    from materialist.edits.light.relight import read_envmap
    from materialist.edits.light.relight import relight as change
    from materialist.io.package import load_scene

    if envmap is None and rotate is None and not sun and not lamp and (ambient, dim, frames) == (1.0, None, None):
        raise InputError("No light to change; give --envmap, --rotate, --sun, --lamp, --ambient or --dim.")
    alone = "--gain" if gain != "auto" and envmap is None else "--sun-power" if sun_power != 1.0 and not sun else ""
    alone = alone or ("--fps" if fps != FPS and frames is None else "")
    if dim is None:
        alone = alone or "--click" * bool(click) or "--box" * bool(box) or "--mask" * (mask is not None)
    if alone:
        needed = {"--gain": "--envmap", "--sun-power": "--sun", "--fps": "--frames"}.get(alone, "--dim")
        raise InputError(f"{alone} says nothing without {needed}; give that, too, or leave {alone} out.")
    suns = [(azimuth, elevation) for azimuth, elevation in (numbers(text, 2, "--sun") for text in sun or ())]
    wanted = [numbers(text, 5, "--lamp") for text in lamp or ()]
    if frames is None:
        if output.suffix.lower() == ".mp4":
            raise InputError(f"{output} is a video; say of how many frames with --frames, for example --frames 48.")
        check_before(output, save, spp, force, device=device.value, full_render=full_render)
        if len(suns) > 1:
            raise InputError("Several --sun are stations of a moving one; give --frames as well, or one --sun.")
    else:
        if save is not None:
            raise InputError("--save writes one scene; leave out --frames.")
        check_paths(spp)
        check_video(output, fps, force, device.value)
    options: dict[str, Any] = {"sun_power": sun_power, "ambient": ambient, "dim": dim}
    if envmap is not None:
        options |= {"envmap": read_envmap(envmap), "gain": gain if gain == "auto" else numbers(gain, 1, "--gain")[0]}
    loaded = load_scene(scene)
    if click or box or mask is not None:
        options["lights"] = chosen_region(loaded, click, box, mask, Method.network, device.value)
    lamps = tuple(make_lamp(loaded, *values) for values in wanted)
    shared: dict[str, Any] = {
        "spp": spp, "seed": seed, "denoise": denoise, "device": device.value, "full_render": full_render,
    }  # fmt: skip
    if frames is not None:
        moving = {**options, "rotate": rotate or 0.0, "suns": tuple(suns), "lamps": lamps}
        _video(loaded, output, frames, moving, shared, fps, as_json, force)
        return
    edited = change(loaded, rotate=rotate or 0.0, sun=suns[0] if suns else None, lamps=lamps, **options)
    unseen = "Walls, or what else the photo shows, keep the sun out; --sun 180,40 comes from behind the camera."
    write_result(
        "relight", loaded, edited, output, save=save, as_json=as_json, force=force, unseen=unseen if suns else "",
        **shared,
    )  # fmt: skip


def _video(
    scene: Any, output: Path, count: int, moving: dict[str, Any], shared: dict[str, Any], fps: int, as_json: bool,
    force: bool,
) -> None:  # fmt: skip
    from materialist.edits.composite.composite import pictures
    from materialist.edits.core.notes import warnings_since
    from materialist.edits.light.frames import moving_light
    from materialist.io.video import write_frames

    start = time.monotonic()
    last = scene

    def relit() -> Iterator[Any]:
        """One scene at a time: each has an environment map of its own."""
        nonlocal last
        for frame in moving_light(scene, count, **moving):
            last = frame
            yield frame

    with StageProgress(quiet=as_json) as progress:
        taken = pictures(scene, relit(), progress=progress, count=count, **shared)
        write_frames(output, taken, fps=fps, force=force)
    warnings = warnings_since(scene, last)
    report_success(
        "relight", as_json, [*(f"Note: {note}" for note in warnings), f"Look at {output}"], video=str(output),
        frames=count, fps=fps, warnings=warnings, seconds=time.monotonic() - start,
    )  # fmt: skip
