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
    method = region.method if isinstance(region, Region) else "network"
    click = list(region.click) or None
    return mt.select(
        scene, click=click, box=region.box, mask=region.mask, method=method, device=device
    )


def opened(scene: Path, output: Path, region: Place, how: Rendering) -> tuple[Any, Any]:
    """(the scene, [H, W] bool region that is edited), once the output is known to be writable."""
    check_before(output, how)
    loaded = mt.load_scene(scene)
    return loaded, chosen_region(loaded, region, how.device)


def check_before(output: Path, how: Rendering, *, video: bool = False) -> None:
    """Everything about the output that can be wrong, before the work starts.

    All renderings of the command are then done on its device, also those that ask for `auto`.
    """
    from materialist.io.atomic import ensure_writable
    from materialist.io.video import ensure_video_writable
    from materialist.render.denoise import require_denoiser

    save = how.save
    if save is not None:
        if how.full_render:
            raise InputError(
                "--save keeps the photograph with the edit in it, and --full-render writes the rendering alone; leave "
                "one of them out."
            )
        if output.resolve().is_relative_to(save.resolve()):
            raise InputError(
                f"{output} would lie in the scene {save}, which is written whole; put it beside."
            )
        ensure_writable(save, how.force)
    if video:
        if how.quality is not None or how.bits is not None or how.exr_layers:
            raise InputError(
                "--quality, --bits and --exr-layers are of pictures; leave them out for a film."
            )
        ensure_video_writable(output, force=how.force)
    else:
        check_picture(output, how)
    if how.denoise:
        require_denoiser()
    if how.device != "auto":
        from materialist.render.variant import setup

        setup(how.device)


def check_picture(output: Path, how: PictureFile) -> None:
    """Raise what the output of a picture is refused for."""
    from materialist.io.out.encode import check_image_output

    check_image_output(output, **how.encoding)
    if how.exr_layers and output.suffix.lower() != ".exr":
        raise InputError(
            f"--exr-layers writes an .exr, not {output}; give another name, or leave it out."
        )


def write_result(
    command: str,
    scene: Any,
    edited: Any,
    output: Path,
    how: Rendering,
    *,
    lines: Sequence[str] = (),
) -> None:
    start = time.monotonic()
    with stage_progress(quiet=how.as_json) as progress:
        picture = mt.composite(
            scene,
            edited,
            spp=how.spp,
            seed=how.seed,
            full_render=how.full_render,
            upscale=how.upscale,
            denoise=how.denoise is not False,
            device=how.device,
            progress=progress,
        )
    notes = write_picture(output, picture, scene, edited, how)
    told = {"image": str(output), "spp": how.spp, "seconds": time.monotonic() - start}
    finish(command, scene, edited, picture, how, [*lines, f"Look at {output}"], told, notes=notes)


def write_picture(
    output: Path, picture: Any, scene: Any, shown: Any, how: PictureFile
) -> tuple[str, ...]:
    """Write a picture of the scene `shown`, made of the photo of `scene`; returns notes."""
    if not how.exr_layers:
        return mt.save_image(output, picture, scene, **how.encoding)
    from materialist.edits.layers import save_layers

    return save_layers(output, shown, picture, device=how.device, force=how.force)


def write_film(
    command: str,
    scene: Any,
    film: Iterable[Any],
    output: Path,
    how: Rendering,
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

    def kept(name: str, items: Iterable[Any]) -> Iterator[Any]:
        nonlocal change
        for item in items:
            last[name] = item
            if name == "picture" and not how.full_render:
                change = max(change, mean_change(scene, item))
            yield item

    with stage_progress(quiet=how.as_json) as progress:
        made = pictures(
            scene,
            kept("scene", film),
            spp=how.spp,
            seed=how.seed,
            denoise=how.denoise is not False,
            device=how.device,
            full_render=how.full_render,
            upscale=how.upscale,
            progress=progress,
            count=frames,
        )
        write_frames(output, kept("picture", made), fps=fps, force=how.force)
    told = {"video": str(output), "frames": frames, "fps": fps, "seconds": time.monotonic() - start}
    finish(command, scene, last["scene"], last["picture"], how, [f"Look at {output}"], told, change)


def finish(
    command: str,
    scene: Any,
    edited: Any,
    picture: Any,
    how: Rendering,
    lines: list[str],
    told: dict[str, Any],
    change: float | None = None,
    notes: Sequence[str] = (),
) -> None:
    """Save the edited scene where that is asked, and report its warnings before the last of the lines."""
    from materialist.edits.composite.composite import developed
    from materialist.edits.core.notes import effect_notes, mean_change, noise_notes, warnings_since

    save = how.save
    grainy = noise_notes(how.denoise is not False)
    warnings = [*warnings_since(scene, edited), *grainy, *notes]
    if not how.full_render:
        warnings += effect_notes(
            scene, edited, mean_change(scene, picture) if change is None else change
        )
    if save is not None:
        saved = developed(scene, edited, picture, seed=how.seed, device=how.device)
        mt.save_scene(saved, save, force=how.force)
        warnings += warnings_since(edited, saved)
        lines.append(f"The edited scene is {save}")
    last = -2 if save is not None else -1
    lines[last:last] = [f"Note: {note}" for note in warnings]
    told["denoised"] = how.denoise is not False and not grainy
    told |= {
        "scene": str(save) if save else None,
        "edits": edited.provenance.get("edits", []),
        "warnings": warnings,
    }
    report_success(command, how.as_json, lines, **told)
