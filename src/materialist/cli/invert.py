"""`materialist invert PHOTO -o SCENE`."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from materialist.cli.options import (
    Completion,
    Device,
    DeviceOption,
    Engine,
    FieldOfView,
    Force,
    Json,
    Preset,
    Seed,
    Strategy,
    WorkingSize,
    output_option,
    parse_size,
)
from materialist.cli.outcome import report_success
from materialist.cli.progress import StageProgress
from materialist.errors import InputError


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("invert")(invert)


def invert(
    photo: Annotated[str, typer.Argument(metavar="PHOTO", help="A photo file, or example:NAME (coffee, cat, ...).")],
    output: Annotated[Path, output_option("SCENE", "The scene package, a folder.")],
    predictor: Annotated[
        str,
        typer.Option(
            "--predictor",
            "--rest",
            help="auto, bundled[:FILE], matnet[:FILE], marigold, maps:DIR or constant; for every map not named below.",
        ),
    ] = "auto",
    albedo: Annotated[str | None, typer.Option(metavar="PREDICTOR", help="Where the albedo comes from.")] = None,
    roughness: Annotated[str | None, typer.Option(metavar="PREDICTOR", help="The same for roughness,")] = None,
    metallic: Annotated[str | None, typer.Option(metavar="PREDICTOR", help="metallic,")] = None,
    normal: Annotated[str | None, typer.Option(metavar="PREDICTOR", help="normals (also moge:DIR),")] = None,
    depth: Annotated[str | None, typer.Option(metavar="PREDICTOR", help="depth (also depth-anything, moge:DIR).")] = (
        None
    ),
    engine: Annotated[Engine, typer.Option(help="Cached light transport, or the paper's path tracing.")] = (
        Engine.transport
    ),
    preset: Annotated[Preset, typer.Option(help="Our schedule, or the paper's to the letter.")] = Preset.default,
    fov: FieldOfView = "auto",
    size: WorkingSize = 512,
    envmap_size: Annotated[str, typer.Option(metavar="WxH", help="Size of the environment map.")] = "512x256",
    completion: Annotated[
        Completion,
        typer.Option(
            help="Continue planes beyond what is seen; auto: unless that ruins the fit; planes,backs means planes."
        ),
    ] = (Completion.auto),
    tau: Annotated[float, typer.Option(help="Grazing angle below which the surface is cut, degrees.")] = 6.0,
    mask: Annotated[Path | None, typer.Option(metavar="PNG", help="Region with one roughness and metallic.")] = None,
    strategy: Annotated[Strategy, typer.Option(help="The paper's per-image strategies.")] = Strategy.default,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Decompose a photo into geometry, materials and light, and write it as a scene package."""
    from materialist.io.atomic import ensure_writable
    from materialist.io.package import save_scene
    from materialist.io.photo import read_photo

    # Everything that can be wrong is found before the work starts.
    width_height = parse_size(envmap_size)
    if not 0 < tau < 90:
        raise InputError(f"--tau is an angle between 0 and 90 degrees, not {tau:g}.")
    ensure_writable(output, force)
    parts = {"albedo": albedo, "roughness": roughness, "metallic": metallic, "normal": normal, "depth": depth}
    picture = read_photo(photo, size=size, fov=fov)
    region = _region(mask, picture) if mask else None
    from materialist import pipeline

    start = time.monotonic()
    with StageProgress(quiet=as_json) as progress:
        scene = pipeline.invert(
            picture,
            predictor=predictor,
            **{name: spec for name, spec in parts.items() if spec is not None},
            engine=engine.value,
            preset=preset.value,
            fov=fov,
            size=size,
            envmap_size=width_height,
            completion=completion.value,
            tau=tau,
            mask=region,
            strategy=strategy.value,
            seed=seed,
            device=device.value,
            progress=progress,
        )
    save_scene(scene, output, force=force)
    warnings = list(dict.fromkeys((*scene.photo.warnings, *scene.prior.warnings, *scene.report.warnings)))
    seconds = time.monotonic() - start
    facts = {
        "predictor": scene.prior.predictor,
        "sources": scene.prior.sources,
        **scene.report.metrics,
        "seconds": seconds,
        "warnings": warnings,
    }
    report_success("invert", as_json, _summary(output, scene, seconds, warnings), scene=str(output), **facts)


def _region(mask: Path, picture: Any) -> Any:
    """The mask as [H, W] bool at working size."""
    from materialist.io.image import read_mask

    return read_mask(mask, picture.linear.shape[:2], picture.original.shape[:2])


def _summary(output: Path, scene: Any, seconds: float, warnings: list[str]) -> list[str]:
    """What a person wants to know when it is done, and where to look."""
    quality = scene.report.metrics.get("rerender_psnr_path")
    figure = f", re-rendering {quality:.1f} dB" if quality is not None else ""
    lines = [f"{output}: done in {seconds:.0f} s with predictor {scene.prior.predictor}{figure}."]
    lines += [f"Note: {warning}" for warning in warnings]
    return [*lines, f"Look at {output / 'overview.png'}"]
