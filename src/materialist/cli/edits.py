"""`materialist edit`, `glass`, `remove`, `insert` and `apply`: an edited scene as a picture."""

from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.options import PictureOutput, Region, Rendering, Run, SceneArgument, output_option
from materialist.cli.outcome import report_success
from materialist.cli.picture import check_before, chosen_region, flag_numbers, opened, write_result
from materialist.errors import InputError
from materialist.options import Glass, Insertion, MaterialEdit, Removal

MESH_FILES = "OBJ, PLY, STL, glTF or GLB."


def select(
    scene: SceneArgument,
    output: Annotated[Path, output_option("MASK", "A .png; white is inside.")],
    region: Region,
    run: Run,
    native: Annotated[bool, typer.Option("--native", help="At the photo's native size, with soft edges.")] = False,
) -> None:
    """Find the mask of an object from a click, a box or a rough mask; nothing of it is random."""
    import numpy as np

    from materialist.color import srgb_to_linear
    from materialist.edits.composite.upsample import matte
    from materialist.io.image import ensure_image_writable, write_image
    from materialist.io.package import load_scene

    if output.suffix.lower() != ".png":
        raise InputError(f"The mask {output} must end in .png.")
    ensure_image_writable(output, force=run.force)
    loaded = load_scene(scene)
    found = chosen_region(loaded, region, run)
    shown = matte(found, loaded.photo.original) if native else found.astype(np.float32)
    # Written as display values: half a pixel inside must be half of white, whatever the curve.
    write_image(output, np.repeat(srgb_to_linear(shown)[..., None], 3, -1), force=run.force)
    share = float(found.mean())
    report_success(
        "select", run.as_json, [f"{int(found.sum())} pixels, {share:.1%} of the photo.", f"Look at {output}"],
        mask=str(output), pixels=int(found.sum()), share=share,
    )  # fmt: skip


def edit(
    scene: SceneArgument, output: PictureOutput, region: Region, options: MaterialEdit, rendering: Rendering, run: Run
) -> None:
    """Change the material of a region, and get the photo back with only that changed."""
    from materialist.edits.material.material import edit as change

    if options == MaterialEdit():
        raise InputError("Nothing to change; give --hue, --saturation, --value, --albedo, --roughness or the like.")
    loaded, found = opened(scene, output, region, rendering, run)
    lines = [f"{int(found.sum())} pixels edited, {float(found.mean()):.0%} of the photo."]
    write_result("edit", loaded, change(loaded, found, options), output, rendering, run, lines=lines)


def glass(
    scene: SceneArgument, output: PictureOutput, region: Region, options: Glass, rendering: Rendering, run: Run
) -> None:
    """Turn an object to glass: what is behind it is continued, and seen through it."""
    from materialist.edits.core.notes import PICTURED
    from materialist.edits.glass.glass import glass as change

    if options.model == "two-interface" and rendering.full_render:
        raise InputError(f"{PICTURED}--full-render would not show it; take --model closed, or leave that out.")
    loaded, found = opened(scene, output, region, rendering, run)
    edited = change(loaded, found, options)
    source = edited.provenance["edits"][-1]["thickness"]
    lines = [f"{int(found.sum())} pixels are glass; thickness: {source}."]
    write_result("glass", loaded, edited, output, rendering, run, lines=lines)


def remove(
    scene: SceneArgument, output: PictureOutput, region: Region, options: Removal, rendering: Rendering, run: Run
) -> None:
    """Take an object out of the photo, with its shadow and its reflections."""
    from materialist.edits.remove.remove import remove as change

    loaded, found = opened(scene, output, region, rendering, run)
    lines = [f"{int(found.sum())} pixels taken away."]
    write_result("remove", loaded, change(loaded, found, options), output, rendering, run, lines=lines)


def insert(
    scene: SceneArgument,
    mesh: Annotated[Path, typer.Argument(metavar="MESH", help=MESH_FILES)],
    output: PictureOutput,
    at: Annotated[
        list[str], typer.Option("--at", metavar="X,Y", help="Where it stands, at working size; several: one each.")
    ],
    options: Insertion,
    rendering: Rendering,
    run: Run,
) -> None:
    """Put a mesh into the photo: it stands on what is there, casts its shadow and is reflected."""
    from materialist.edits.insert.insert import insert as put
    from materialist.edits.insert.meshes import read_model
    from materialist.io.package import load_scene

    check_before(output, rendering, run)
    places = [flag_numbers(text, 2, "--at") for text in at]
    model = read_model(mesh, up=options.up)
    loaded = edited = load_scene(scene)
    for x, y in places:
        edited = put(edited, model, (x, y), options)
    longest = edited.provenance["edits"][-1]["size"]
    lines = [f"{model.name}: longest side {longest:.3g} scene units."]
    write_result("insert", loaded, edited, output, rendering, run, lines=lines)


def apply(
    scene: SceneArgument,
    edits: Annotated[Path, typer.Argument(metavar="EDITS", help="A YAML list of edits.")],
    output: PictureOutput,
    rendering: Rendering,
    run: Run,
) -> None:
    """Replay a list of edits on a scene: materials and light, in one picture."""
    from materialist.edits.recipe import apply as replay
    from materialist.edits.recipe import read_recipe
    from materialist.io.package import load_scene

    check_before(output, rendering, run)
    steps = read_recipe(edits)
    loaded = load_scene(scene)
    edited = replay(loaded, steps, seed=run.seed, device=run.device)
    skipped = sum(step.skipped for step in steps)
    done = len(steps) - skipped
    told = f"{done} edit{'s' * (done != 1)} applied" + f", {skipped} skipped" * bool(skipped)
    write_result("apply", loaded, edited, output, rendering, run, lines=[f"{told}."])
