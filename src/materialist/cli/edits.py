"""`materialist select`, `edit`, `glass`, `remove`, `insert`, `apply`, `relight` and `drop`: pictures and films."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

import materialist as mt
from materialist.cli.options import (
    PictureOutput,
    Place,
    Region,
    Rendering,
    Run,
    SceneArgument,
    output_option,
)
from materialist.cli.outcome import report_success
from materialist.cli.picture import (
    check_before,
    chosen_region,
    opened_region,
    write_film,
    write_result,
)
from materialist.errors import InputError
from materialist.option_kinds import option, parse_numbers
from materialist.options import Drop, Glass, Insertion, MaterialEdit, Relight, Removal

MESH_FILES = "OBJ, PLY, STL, glTF or GLB."
FPS = 24
At = Annotated[
    list[str],
    typer.Option("--at", metavar="X,Y", help="A pixel at working size; several: one each."),
]
FramesPerSecond = Annotated[int, typer.Option(min=1, max=120, help="Frames per second.")]


@dataclass(frozen=True, kw_only=True)
class MovingLight(Relight):
    """Other light, which goes from one sun to the next in a film."""

    sun: tuple[tuple[float, float], ...] = option(  # type: ignore[assignment]
        (),
        "A sun: degrees right of ahead, and above the horizon.",
        kind="numbers",
        count=2,
        many=True,
        metavar="AZ,EL",
    )


def select_command(
    scene: SceneArgument,
    output: Annotated[Path, output_option("MASK", "A .png; white is inside.")],
    region: Region,
    run: Run,
    native: Annotated[
        bool, typer.Option("--native", help="At the photo's native size, with soft edges.")
    ] = False,
) -> None:
    """Find the mask of an object from a click or a box, or check a given one; nothing of it is random."""
    import numpy as np

    from materialist.color import srgb_to_linear
    from materialist.edits.composite.matte import matte
    from materialist.io.image import ensure_image_writable, write_image

    if output.suffix.lower() != ".png":
        raise InputError(f"The mask {output} must end in .png.")
    # The output is checked before the work.
    ensure_image_writable(output, force=run.force)
    loaded = mt.load_scene(scene)
    region_mask = chosen_region(loaded, region, run.device)
    shown = matte(region_mask, loaded.photo.original) if native else region_mask.astype(np.float32)
    # Written as display values: half a pixel inside must be half of white, whatever the curve.
    write_image(output, np.repeat(srgb_to_linear(shown)[..., None], 3, -1), force=run.force)
    share = float(region_mask.mean())
    report_success(
        "select",
        run.as_json,
        [f"{int(region_mask.sum())} pixels, {share:.1%} of the photo.", f"Look at {output}"],
        mask=str(output),
        pixels=int(region_mask.sum()),
        share=share,
    )


def edit_command(
    scene: SceneArgument,
    output: PictureOutput,
    region: Region,
    options: MaterialEdit,
    rendering: Rendering,
) -> None:
    """Change the material of a region, and get the photo back with only that changed."""
    if options == MaterialEdit():
        raise InputError(
            "Nothing to change; give --hue, --saturation, --value, --albedo, --roughness or the like."
        )
    loaded, mask = opened_region(scene, output, region, rendering)
    lines = [f"{int(mask.sum())} pixels edited, {float(mask.mean()):.0%} of the photo."]
    write_result("edit", loaded, mt.edit(loaded, mask, options), output, rendering, lines=lines)


def glass_command(
    scene: SceneArgument,
    output: PictureOutput,
    region: Region,
    options: Glass,
    rendering: Rendering,
) -> None:
    """Turn an object to glass: what is behind it is continued, and seen through it."""
    from materialist.edits.core.notes import PICTURED

    if options.model == "two-interface" and rendering.full_render:
        raise InputError(
            f"{PICTURED}--full-render would not show it; take --model closed, or leave that out."
        )
    loaded, mask = opened_region(scene, output, region, rendering)
    edited = mt.glass(loaded, mask, options)
    source = edited.provenance["edits"][-1]["thickness"]
    lines = [f"{int(mask.sum())} pixels are glass; thickness: {source}."]
    write_result("glass", loaded, edited, output, rendering, lines=lines)


def remove_command(
    scene: SceneArgument,
    output: PictureOutput,
    region: Region,
    options: Removal,
    rendering: Rendering,
) -> None:
    """Take an object out of the photo, with its shadow and its reflections."""
    loaded, mask = opened_region(scene, output, region, rendering)
    lines = [f"{int(mask.sum())} pixels taken away."]
    write_result("remove", loaded, mt.remove(loaded, mask, options), output, rendering, lines=lines)


def insert_command(
    scene: SceneArgument,
    mesh: Annotated[Path, typer.Argument(metavar="MESH", help=MESH_FILES)],
    output: PictureOutput,
    at: At,
    options: Insertion,
    rendering: Rendering,
) -> None:
    """Put a mesh into the photo: it stands on what is there, casts its shadow and is reflected."""
    from materialist.edits.insert.meshes import read_model

    check_before(output, rendering)
    places = [parse_numbers(text, 2, "--at") for text in at]
    model = read_model(mesh, up=options.up)
    loaded = edited = mt.load_scene(scene)
    # One after the other: the last stands on what the first ones are.
    for x, y in places:
        edited = mt.insert(edited, model, (x, y), options)
    longest = edited.provenance["edits"][-1]["size"]
    lines = [f"{model.name}: longest side {longest:.3g} scene units."]
    write_result("insert", loaded, edited, output, rendering, lines=lines)


def apply_command(
    scene: SceneArgument,
    edits: Annotated[Path, typer.Argument(metavar="EDITS", help="A YAML list of edits.")],
    output: PictureOutput,
    rendering: Rendering,
) -> None:
    """Replay a list of edits on a scene: materials and light, in one picture."""
    from materialist.edits.recipe import apply as replay
    from materialist.edits.recipe import read_recipe

    check_before(output, rendering)
    steps = read_recipe(edits)
    loaded = mt.load_scene(scene)
    edited = replay(loaded, steps, seed=rendering.seed, device=rendering.device)
    skipped = sum(step.skipped for step in steps)
    done = len(steps) - skipped
    summary = f"{done} edit{'s' * (done != 1)} applied" + f", {skipped} skipped" * bool(skipped)
    write_result("apply", loaded, edited, output, rendering, lines=[f"{summary}."])


def relight_command(
    scene: SceneArgument,
    output: Annotated[
        Path, output_option("OUT", "A picture as for edit; with --frames .mp4 or a folder.")
    ],
    options: MovingLight,
    lights: Place,
    rendering: Rendering,
    frames: Annotated[
        int | None,
        typer.Option(
            metavar="N", help="A video: the light turns, or goes from --sun or --lamp to the next."
        ),
    ] = None,
    fps: FramesPerSecond = FPS,
) -> None:
    """Show the photo under other light."""
    # In a film several suns are stations; one picture has one.
    suns = options.sun
    if options == MovingLight() and frames is None:
        raise InputError(
            "No light to change; give --envmap, --rotate, --sun, --lamp, --ambient or --dim."
        )
    # --- Options that say nothing, or contradict each other ---
    alone = [("--fps", "--frames")] if fps != FPS and frames is None else []
    alone += [(flag, "--dim") for flag in lights.named if options.dim is None]
    if alone:
        flag, needed = alone[0]
        raise InputError(
            f"{flag} says nothing without {needed}; give that, too, or leave {flag} out."
        )
    if frames is None and output.suffix.lower() == ".mp4":
        raise InputError(
            f"{output} is a video; say of how many frames with --frames, for example --frames 48."
        )
    if frames is None and len(suns) > 1:
        raise InputError(
            "Several --sun are stations of a moving one; give --frames as well, or one --sun."
        )
    if frames is not None and rendering.save is not None:
        raise InputError("--save writes one scene; leave out --frames.")
    # --- One picture, or a film of a moving light ---
    check_before(output, rendering, video=frames is not None)
    loaded = mt.load_scene(scene)
    marked = chosen_region(loaded, lights, rendering.device) if lights.named else None
    changes = Relight(**{**vars(options), "sun": None, "lights": marked})
    if frames is not None:
        from materialist.edits.light.relight import moving_light

        film = moving_light(loaded, frames, changes, suns=suns)
        write_film("relight", loaded, film, output, rendering, frames=frames, fps=fps)
        return
    edited = mt.relight(loaded, changes, sun=suns[0] if suns else None)
    write_result("relight", loaded, edited, output, rendering)


def drop_command(
    scene: SceneArgument,
    meshes: Annotated[list[Path], typer.Argument(metavar="MESH...", help=MESH_FILES)],
    output: Annotated[Path, output_option("OUT", "A .mp4, or a folder of frames.")],
    at: At,
    options: Drop,
    frames: Annotated[int, typer.Option(metavar="N", help="Length of the film.")] = 48,
    fps: FramesPerSecond = FPS,
    rotate: Annotated[
        str | None,
        typer.Option(
            metavar="DEG|A..B", help="Meanwhile the light turns to the right, from A to B."
        ),
    ] = None,
    rendering: Rendering = Rendering(),  # noqa: B008
) -> None:
    """Let meshes fall onto what the photo shows, and film it; --save writes the scene of the last frame."""
    from materialist.edits.insert.meshes import read_model
    from materialist.edits.light.relight import moving_light

    # Read as a list of edits would be, so that the same texts are accepted.
    light = Relight.read({} if rotate is None else {"rotate": rotate})
    check_before(output, rendering, video=True)
    places: Any = [parse_numbers(text, 2, "--at") for text in at]
    models = [read_model(path, up=options.up) for path in meshes]
    loaded = mt.load_scene(scene)
    film: Any = mt.drop(loaded, models, places, options, frames=frames, fps=fps)
    film = film if rotate is None else moving_light(film, frames, light)
    write_film("drop", loaded, film, output, rendering, frames=frames, fps=fps)
