"""`materialist invert`, `render` and `export`: scene packages made, rendered, and written for other programs."""

import time
from pathlib import Path
from typing import Annotated, Any

import typer

import materialist as mt
from materialist.cli.options import PictureFile, PictureOutput, Run, SceneArgument, output_option
from materialist.cli.outcome import report_success
from materialist.cli.progress import stage_progress
from materialist.cli.stopping import FitStop
from materialist.errors import InputError
from materialist.options import ExportOptions, InvertOptions


def invert_command(
    photo: Annotated[
        str,
        typer.Argument(metavar="PHOTO", help="A photo file, or example:NAME (coffee, cat, ...)."),
    ],
    output: Annotated[Path, output_option("SCENE", "The scene package, a folder.")],
    options: InvertOptions,
    run: Run,
) -> None:
    """Decompose a photo into geometry, materials and light, and write it as a scene package."""
    from materialist.io.atomic import ensure_writable
    from materialist.io.package import check_room

    # Everything that can be wrong is found before the work starts.
    ensure_writable(output, run.force)
    picture = mt.read_photo(photo, size=options.size, fov=options.fov, layer=options.layer)
    check_room(output, picture)
    # Reading is quick, and wrong files show here; the clock is that of the inversion.
    start = time.monotonic()
    slow = options.preset == "paper" or options.engine == "path"
    with stage_progress(quiet=run.as_json) as progress, FitStop(slow) as stop:
        scene = mt.invert(
            picture, options, progress=progress, on_stage=stop.on_stage, stop=stop.requested
        )
    mt.save_scene(scene, output, force=run.force)
    # --- What is said of the result ---
    warnings = scene.warnings
    seconds = time.monotonic() - start
    quality = scene.report.metrics.get("rerender_psnr_path")
    figure = f", re-rendering {quality:.1f} dB" if quality is not None else ""
    if (whole := scene.report.metrics.get("rerender_psnr_residual")) is not None:
        figure += f" ({whole:.1f} with its shading residual)"
    lines = [
        f"{output}: done in {seconds:.0f} s with predictor {scene.prior.predictor}{figure}.",
        *(f"Note: {warning}" for warning in warnings),
        f"Look at {output / 'overview.png'}",
    ]
    facts: dict[str, Any] = {"predictor": scene.prior.predictor, "sources": scene.prior.sources}
    facts |= {**scene.report.metrics, "seconds": seconds, "warnings": warnings}
    report_success("invert", run.as_json, lines, scene=str(output), **facts)


def render_command(
    scene: SceneArgument,
    output: PictureOutput,
    run: PictureFile,
    spp: Annotated[int, typer.Option(min=1, max=1_000_000, help="Samples per pixel.")] = 64,
    denoise: Annotated[
        bool, typer.Option("--denoise/--no-denoise", help="Remove noise (needs pyoidn).")
    ] = False,
    photo: Annotated[
        bool, typer.Option("--photo", help="With --exr-layers: the photo, not a rendering.")
    ] = False,
) -> None:
    """Path-trace a scene package."""
    from rich.console import Console

    from materialist.cli.picture import check_picture, write_picture
    from materialist.edits.core.notes import PICTURED, is_pictured
    from materialist.render.denoise import require_denoiser

    check_picture(output, run)
    if denoise:
        require_denoiser()
    if photo and not run.exr_layers:
        raise InputError(
            "--photo says nothing without --exr-layers; give that, too, or leave --photo out."
        )
    loaded = mt.load_scene(scene)
    notes = (
        [f"{PICTURED}a rendering does not show it."] if is_pictured(loaded) and not photo else []
    )
    # Layers may be of the photo itself: nothing is rendered then.
    if photo:
        image = loaded.photo.original
    else:
        with Console(stderr=True).status(f"Rendering {spp} samples per pixel"):
            image = mt.render_scene(
                loaded, spp=spp, denoise=denoise, seed=run.seed, device=run.device
            )
    notes += write_picture(output, image, loaded, loaded, run)
    shown = [*(f"Note: {note}" for note in notes), f"Look at {output}"]
    facts = {"image": str(output), "spp": spp, "denoised": denoise, "warnings": notes}
    report_success("render", run.as_json, shown, **facts)


def export_command(
    scene: SceneArgument,
    output: Annotated[
        Path,
        output_option(
            "OUT", "NAME.glb, .blend, .usdz or .html; or a folder (blend, usd, mitsuba)."
        ),
    ],
    options: ExportOptions,
    run: Run,
) -> None:
    """Write a scene for another program: glTF, Blender, USD, Mitsuba, or one self-contained page of HTML.

    Nothing of it is random, and nothing is computed on a GPU.
    """
    from rich.console import Console

    from materialist.exporters.run import check_format

    check_format(output, options.to)
    with Console(stderr=True).status(f"Writing {output}"):
        done = mt.export(mt.load_scene(scene), output, options, force=run.force)
    files = [str(done.path), *map(str, done.beside)]
    report_success(
        "export",
        run.as_json,
        [f"Wrote {', '.join(files)}", *done.notes],
        output=str(done.path),
        beside=files[1:],
        notes=list(done.notes),
    )
