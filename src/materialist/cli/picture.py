"""What the editing commands share: options, and the way from an edited scene to a file."""

from __future__ import annotations

import time
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from materialist.cli.outcome import report_success
from materialist.cli.progress import StageProgress
from materialist.errors import InputError


class Method(StrEnum):
    """How a region is found."""

    grabcut = "grabcut"
    sam2 = "sam2"


SceneArgument = Annotated[Path, typer.Argument(metavar="SCENE", help="A scene package.")]
PictureOutput = Annotated[
    Path, typer.Option("-o", "--output", metavar="OUT", help="A .png (as deep as the photo) or .exr (linear, HDR).")
]
Clicks = Annotated[
    list[str] | None,
    typer.Option("--click", metavar="X,Y", help="A pixel of the object, at working size; more than one helps."),
]
Box = Annotated[str | None, typer.Option("--box", metavar="X0,Y0,X1,Y1", help="A box around the object.")]
MaskFile = Annotated[Path | None, typer.Option("--mask", metavar="PNG", help="The region: white inside.")]
With = Annotated[Method, typer.Option("--with", help="grabcut needs nothing; sam2 needs its weights.")]
Spp = Annotated[int, typer.Option(help="Paths per pixel, of each of the two renderings.")]
Denoise = Annotated[bool, typer.Option("--denoise/--no-denoise", help="Clean the renderings (with pyoidn).")]
FullRender = Annotated[bool, typer.Option("--full-render", help="The plain rendering, without the photo.")]
Save = Annotated[Path | None, typer.Option("--save", metavar="SCENE2", help="Write the edited scene as well.")]

Background = Annotated[
    Path | None, typer.Option(metavar="PNG", help="The same view without the object, in place of inpainting.")
]
Inpainter = Annotated[
    str | None, typer.Option("--inpaint", metavar="sd:MODEL", help="A diffusion model: a folder, or owner/name.")
]
Shadow = Annotated[
    float, typer.Option(help="Repaint the ground around it by this share of its size: shadows that stayed there.")
]


def numbers(text: str, count: int, option: str) -> tuple[float, ...]:
    """`count` numbers from a text such as 310,220. Raises InputError."""
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count:
        raise InputError(f"{option} takes {count} numbers with commas between them, not {text!r}.")
    return values


def chosen_region(scene: Any, clicks: list[str] | None, box: str | None, mask: Path | None, method: Method) -> Any:
    """[H, W] bool from the options of the command line."""
    from materialist.edit.select import select

    return select(
        scene,
        click=[numbers(click, 2, "--click") for click in clicks] if clicks else None,
        box=numbers(box, 4, "--box") if box else None,
        mask=mask,
        method=method.value,
    )


def chosen_inpainter(text: str | None, seed: int, device: str) -> Any:
    """What --inpaint names, or None for patches."""
    if text is None:
        return None
    from materialist.edit.inpaint import inpainter

    return inpainter(text, seed=seed, device=device)


def check_before(output: Path, save: Path | None, spp: int, force: bool) -> None:
    """Everything about the output that can be wrong, before the work starts."""
    from materialist.io.image import ensure_image_writable
    from materialist.io.target import ensure_writable

    if not 2 <= spp <= 1_000_000:
        raise InputError(f"--spp is a number of paths from 2 to 1000000, not {spp}.")
    ensure_image_writable(output, force=force)
    if save is not None:
        ensure_writable(save, force)


def write_result(
    command: str, scene: Any, edited: Any, output: Path, *, save: Path | None, spp: int, seed: int, denoise: bool,
    full_render: bool, device: str, as_json: bool, force: bool, lines: Sequence[str] = (), **facts: Any,
) -> None:  # fmt: skip
    """Render, composite, write, report."""
    from materialist.edit.composite import composite, developed
    from materialist.edit.output import write_composite
    from materialist.io.package import save_scene

    start = time.monotonic()
    with StageProgress(quiet=as_json) as progress:
        picture = composite(
            scene, edited, spp=spp, seed=seed, full_render=full_render, denoise=denoise, device=device,
            progress=progress,
        )  # fmt: skip
    write_composite(output, picture, scene.photo, force=force)
    if save is not None:
        save_scene(developed(scene, edited, picture), save, force=force)
    warnings = [note for note in edited.report.warnings if note not in scene.report.warnings]
    shown = [*lines, *(f"Note: {note}" for note in warnings), f"Look at {output}"]
    if save is not None:
        shown.append(f"The edited scene is {save}")
    report_success(
        command, as_json, shown, image=str(output), scene=str(save) if save else None, spp=spp,
        seconds=time.monotonic() - start, edits=edited.provenance.get("edits", []), warnings=warnings, **facts,
    )  # fmt: skip
