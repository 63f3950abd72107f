"""What the editing commands share: the way from their options to a region, and from an edited scene to a file."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from materialist.cli.options import Method
from materialist.cli.outcome import report_success
from materialist.cli.progress import StageProgress
from materialist.errors import InputError


def numbers(text: str, count: int, option: str) -> tuple[float, ...]:
    """`count` numbers from a text such as 310,220. Raises InputError."""
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count:
        raise InputError(f"{option} takes {count} numbers with commas between them, not {text!r}.")
    return values


def chosen_region(
    scene: Any, clicks: list[str] | None, box: str | None, mask: Path | None, method: Method, device: str = "auto"
) -> Any:
    """[H, W] bool from the options of the command line."""
    from materialist.edits.select.select import select

    return select(
        scene,
        click=[numbers(click, 2, "--click") for click in clicks] if clicks else None,
        box=numbers(box, 4, "--box") if box else None,
        mask=mask,
        method=method.value,
        device=device,
    )


def chosen_inpainter(text: str | None, seed: int, device: str) -> Any:
    """What --inpaint names, or None for patches."""
    if text is None:
        return None
    from materialist.edits.remove.inpaint import inpainter

    return inpainter(text, seed=seed, device=device)


def check_paths(spp: int) -> None:
    """Raises InputError unless two renderings of `spp` paths a pixel can be compared."""
    if not 2 <= spp <= 1_000_000:
        raise InputError(f"--spp is a number of paths from 2 to 1000000, not {spp}.")


def check_video(output: Path, fps: int, force: bool, device: str) -> None:
    """Everything about a video that can be wrong, before the work starts; renderings are done on `device`."""
    from materialist.io.video import ensure_video_writable

    if not 1 <= fps <= 120:
        raise InputError(f"--fps is a number from 1 to 120, not {fps}.")
    ensure_video_writable(output, force=force)
    _choose(device)


def check_before(
    output: Path, save: Path | None, spp: int, force: bool, *, device: str, full_render: bool = False
) -> None:  # fmt: skip
    """Everything about the output that can be wrong, before the work starts; renderings are done on `device`."""
    from materialist.io.image import ensure_image_writable

    check_paths(spp)
    check_saved(output, save, force, full_render)
    ensure_image_writable(output, force=force)
    _choose(device)


def check_saved(output: Path, save: Path | None, force: bool, full_render: bool) -> None:
    """Everything about --save that can be wrong, before the work starts."""
    from materialist.io.atomic import ensure_writable

    if save is None:
        return
    if full_render:
        raise InputError(
            "--save keeps the photograph with the edit in it, and --full-render writes the rendering alone; leave one "
            "of them out."
        )
    if output.resolve().is_relative_to(save.resolve()):
        raise InputError(f"{output} would lie in the scene {save}, which is written whole; put it beside.")
    ensure_writable(save, force)


def _choose(device: str) -> None:
    """Let everything of this command render on the device, also what asks for `auto`."""
    if device != "auto":
        from materialist.render.variant import setup

        setup(device)


def write_result(
    command: str, scene: Any, edited: Any, output: Path, *, save: Path | None, spp: int, seed: int, denoise: bool,
    full_render: bool, device: str, as_json: bool, force: bool, lines: Sequence[str] = (), unseen: str = "",
    **facts: Any,
) -> None:  # fmt: skip
    """Render, composite, write, report; `unseen` says what may be done where nothing of the edit is to be seen."""
    from materialist.edits.composite.composite import composite, developed
    from materialist.edits.composite.output import write_composite
    from materialist.edits.core.notes import warnings_since
    from materialist.edits.core.renderer import is_relit
    from materialist.io.package import save_scene

    start = time.monotonic()
    with StageProgress(quiet=as_json) as progress:
        picture = composite(
            scene, edited, spp=spp, seed=seed, full_render=full_render, denoise=denoise, device=device,
            progress=progress,
        )  # fmt: skip
    write_composite(output, picture, scene.photo, force=force)
    if save is not None:
        save_scene(developed(scene, edited, picture, seed=seed, device=device), save, force=force)
    warnings = warnings_since(scene, edited)
    if not full_render and is_unseen(picture, scene.photo.original, relit=is_relit(scene, edited)):
        warnings.append(f"The picture looks like the photo: nothing of the edit is to be seen. {unseen}".rstrip())
    shown = [*lines, *(f"Note: {note}" for note in warnings), f"Look at {output}"]
    if save is not None:
        shown.append(f"The edited scene is {save}")
    report_success(
        command, as_json, shown, image=str(output), scene=str(save) if save else None, spp=spp,
        seconds=time.monotonic() - start, edits=edited.provenance.get("edits", []), warnings=warnings, **facts,
    )  # fmt: skip


def is_unseen(picture: Any, photo: Any, *, relit: bool = False) -> bool:
    """Whether two pictures [H, W, 3] linear look the same: encoded, fewer than one pixel in 10 000 differ by 1/255.

    Another light reaches every pixel, and its noise, too: there fewer than one in 100 by 4/255.
    """
    import numpy as np

    from materialist.color import linear_to_srgb
    from materialist.edits.composite.upsample import strips

    if np.array_equal(picture, photo):
        return True
    step, share = (4 / 255, 1e-2) if relit else (1 / 255, 1e-4)
    most = share * picture.shape[0] * picture.shape[1]
    for rows in strips(picture.shape[0]):
        away = np.abs(linear_to_srgb(picture[rows]) - linear_to_srgb(photo[rows])).max(-1)
        most -= int((away > step).sum())
        if most <= 0:
            return False
    return True
