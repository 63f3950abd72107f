"""What the editing commands share: the way from their flags to a region, and from an edited scene to a file."""

import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import materialist as mt
from materialist.cli.options import PictureFile, Place, Region, Rendering
from materialist.cli.outcome import report_success
from materialist.cli.progress import stage_progress
from materialist.errors import InputError


def chosen_region(scene: Any, region: Place, device: str) -> Any:
    """[H, W] bool from the flags of the command line."""
    click = list(region.click) or None
    chosen = {}
    if isinstance(region, Region):
        names = ("method", "extent", "same_material", "exclude")
        chosen = {name: getattr(region, name) for name in names}
    return mt.select(
        scene,
        click=click,
        box=region.box,
        mask=region.mask,
        device=device,
        **chosen,
    )


def check_before(output: Path, rendering: Rendering, *, video: bool = False) -> None:
    """Everything about the output that can be wrong, before the work starts.

    All renderings of the command are then done on its device, also those that ask for `auto`.
    """
    # --- The scene that --save writes ---
    from materialist.io.atomic import ensure_writable
    from materialist.io.video import ensure_video_writable
    from materialist.render.denoise import require_denoiser

    save = rendering.save
    if save is not None:
        if rendering.full_render:
            raise InputError(
                "--save keeps the photograph with the edit in it, and --full-render writes the rendering alone; leave "
                "one of them out."
            )
        if output.resolve().is_relative_to(save.resolve()):
            raise InputError(
                f"{output} would lie in the scene {save}, which is written whole; put it beside."
            )
        ensure_writable(save, rendering.force)
    # --- The picture or film itself ---
    if video:
        if rendering.quality is not None or rendering.bits is not None or rendering.exr_layers:
            raise InputError(
                "--quality, --bits and --exr-layers are of pictures; leave them out for a film."
            )
        ensure_video_writable(output, force=rendering.force)
    else:
        check_picture(output, rendering)
    # --- What the work needs ---
    if rendering.denoise:
        require_denoiser()
    if rendering.device != "auto":
        from materialist.render.variant import setup

        setup(rendering.device)


def check_picture(output: Path, options: PictureFile) -> None:
    """Raise what the output of a picture is refused for."""
    from materialist.io.out.encode import check_image_output

    check_image_output(output, **options.encoding)
    if options.exr_layers and output.suffix.lower() != ".exr":
        raise InputError(
            f"--exr-layers writes an .exr, not {output}; give another name, or leave it out."
        )


def write_result(
    command: str,
    scene: Any,
    edited: Any,
    output: Path,
    rendering: Rendering,
    *,
    lines: Sequence[str] = (),
) -> None:
    start = time.monotonic()
    with stage_progress(quiet=rendering.as_json) as progress:
        picture = _last_picture(scene, edited, rendering, progress)
    notes = write_picture(output, picture, scene, edited, rendering)
    facts = {"image": str(output), "spp": rendering.spp, "seconds": time.monotonic() - start}
    finish_command(
        command,
        scene,
        edited,
        picture,
        rendering,
        [*lines, f"Look at {output}"],
        facts,
        notes=notes,
    )


def _last_picture(scene: Any, edited: Any, rendering: Rendering, progress: Any) -> Any:
    """The composite of a scene that the command makes no other picture of."""
    from materialist.edits.composite.composite import composite_in_place
    from materialist.edits.core.renderer import RenderOptions

    settings = dict(rendering.compositing)
    names = ("spp", "seed", "denoise", "device")
    chosen = {name: settings.pop(name) for name in names}
    options = RenderOptions(**chosen, progress=progress)
    return composite_in_place(scene, edited, options, **settings)


def write_picture(
    output: Path, picture: Any, scene: Any, shown: Any, options: PictureFile
) -> tuple[str, ...]:
    """Write a picture of the scene `shown`, made of the photo of `scene`; returns notes."""
    if not options.exr_layers:
        return mt.save_image(output, picture, scene, **options.encoding)
    from materialist.edits.layers import save_layers

    return save_layers(output, shown, picture, device=options.device, force=options.force)


def write_film(
    command: str,
    scene: Any,
    film: Iterable[Any],
    output: Path,
    rendering: Rendering,
    *,
    frames: int,
    fps: int,
) -> None:
    """Render and write a film, one scene in memory at a time; report."""
    from materialist.edits.composite.composite import pictures
    from materialist.edits.core.notes import mean_change
    from materialist.io.video import write_frames

    start = time.monotonic()
    last = {"scene": scene}
    change = 0.0

    # The last scene and picture, and the largest change, are what the report is of.
    def kept(name: str, items: Iterable[Any]) -> Iterator[Any]:
        nonlocal change
        for item in items:
            last[name] = item
            if name == "picture" and not rendering.full_render:
                change = max(change, mean_change(scene, item))
            yield item

    with stage_progress(quiet=rendering.as_json) as progress:
        composites = pictures(
            scene,
            kept("scene", film),
            progress=progress,
            count=frames,
            **rendering.compositing,
        )
        write_frames(output, kept("picture", composites), fps=fps, force=rendering.force)
    facts = {
        "video": str(output),
        "frames": frames,
        "fps": fps,
        "seconds": time.monotonic() - start,
    }
    finish_command(
        command,
        scene,
        last["scene"],
        last["picture"],
        rendering,
        [f"Look at {output}"],
        facts,
        change,
    )


def finish_command(
    command: str,
    scene: Any,
    edited: Any,
    picture: Any,
    rendering: Rendering,
    lines: list[str],
    facts: dict[str, Any],
    change: float | None = None,
    notes: Sequence[str] = (),
) -> None:
    """Save the edited scene where that is asked, and report its warnings before the last of the lines."""
    from materialist.edits.composite.composite import developed
    from materialist.edits.core.notes import mean_change, noise_notes, warnings_since
    from materialist.edits.registry import picture_notes

    # --- Warnings: of the edits, of the denoiser, of a light that changes next to nothing ---
    save = rendering.save
    grainy = noise_notes(rendering.denoise is not False)
    warnings = [*warnings_since(scene, edited), *grainy, *notes]
    if not rendering.full_render:
        warnings += picture_notes(
            scene, edited, mean_change(scene, picture) if change is None else change
        )
    # --- The edited scene, whose photo is the picture ---
    if save is not None:
        saved = developed(scene, edited, picture, seed=rendering.seed, device=rendering.device)
        mt.save_scene(saved, save, force=rendering.force)
        warnings += warnings_since(edited, saved)
        lines.append(f"The edited scene is {save}")
    # Notes stand before the lines that say where the results are.
    last = -2 if save is not None else -1
    lines[last:last] = [f"Note: {note}" for note in warnings]
    facts["denoised"] = rendering.denoise is not False and not grainy
    facts |= {
        "scene": str(save) if save else None,
        "edits": edited.provenance.get("edits", []),
        "warnings": warnings,
    }
    report_success(command, rendering.as_json, lines, **facts)
