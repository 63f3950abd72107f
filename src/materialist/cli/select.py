"""`materialist select SCENE (--click X,Y ... | --box X0,Y0,X1,Y1 | --mask PNG) -o MASK.png`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.options import (
    Box,
    Clicks,
    Device,
    DeviceOption,
    Force,
    Json,
    MaskFile,
    Method,
    SceneArgument,
    Seed,
    With,
    output_option,
)
from materialist.cli.outcome import report_success
from materialist.cli.picture import chosen_region
from materialist.errors import InputError


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("select")(select)


def select(
    scene: SceneArgument,
    output: Annotated[Path, output_option("MASK", "A .png; white is inside.")],
    click: Clicks = None,
    box: Box = None,
    mask: MaskFile = None,
    method: With = Method.network,
    native: Annotated[bool, typer.Option("--native", help="At the photo's native size, with soft edges.")] = False,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Find the mask of an object from a click, a box or a rough mask; nothing of it is random."""
    import numpy as np

    from materialist.edits.composite.upsample import matte
    from materialist.io.image import ensure_image_writable, write_image
    from materialist.io.package import load_scene

    if output.suffix.lower() != ".png":
        raise InputError(f"The mask {output} must end in .png.")
    ensure_image_writable(output, force=force)
    loaded = load_scene(scene)
    region = chosen_region(loaded, click, box, mask, method, device.value)
    shown = matte(region, loaded.photo.original) if native else region.astype(np.float32)
    # Written as display values: half a pixel inside must be half of white, whatever the curve.
    from materialist.color import srgb_to_linear

    write_image(output, np.repeat(srgb_to_linear(shown)[..., None], 3, -1), force=force)
    share = float(region.mean())
    report_success(
        "select", as_json, [f"{int(region.sum())} pixels, {share:.1%} of the photo.", f"Look at {output}"],
        mask=str(output), pixels=int(region.sum()), share=share,
    )  # fmt: skip
