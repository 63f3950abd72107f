"""`materialist select`, `edit`, `glass`, `remove`, `insert`, `apply`, `relight` and `drop`: pictures and films."""

from collections.abc import Callable
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
    write_film,
    write_result,
)
from materialist.edits.core.operation import Operation, Placement, Target
from materialist.edits.drop.operation import DROP
from materialist.edits.drop.options import Drop
from materialist.edits.light.operation import RELIGHT
from materialist.edits.light.options import Relight
from materialist.errors import InputError
from materialist.option_kinds import declarations, option, parse_numbers

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


def operation_command(operation: Operation) -> Callable[..., None]:
    """The command of an operation that acts on a region or on places, for `generate.add_command`."""
    make = _place_command if operation.target is Target.PLACE else _region_command
    command = make(operation)
    command.__annotations__["options"] = operation.options
    command.__doc__ = operation.about
    return command


def _region_command(operation: Operation) -> Callable[..., None]:
    def command(
        scene: SceneArgument,
        output: PictureOutput,
        region: Region,
        options: Any,
        rendering: Rendering,
    ) -> None:
        check_needed(operation, options)
        if options.only_in_photo and rendering.full_render:
            from materialist.edits.core.notes import PICTURED

            raise InputError(
                f"{PICTURED}--full-render would not show it; take --model closed, or leave that out."
            )
        check_before(output, rendering)
        loaded = mt.load_scene(scene)
        mask = chosen_region(loaded, region, rendering.device)
        write_operation(operation, loaded, mask, options, output, rendering)

    return command


def _place_command(operation: Operation) -> Callable[..., None]:
    def command(
        scene: SceneArgument,
        mesh: Annotated[Path, typer.Argument(metavar="MESH", help=MESH_FILES)],
        output: PictureOutput,
        at: At,
        options: Any,
        rendering: Rendering,
    ) -> None:
        from materialist.edits.insert.meshes import read_model

        check_before(output, rendering)
        places = tuple(parse_numbers(text, 2, "--at") for text in at)
        placement = Placement((read_model(mesh, up=options.up),), places)
        write_operation(operation, mt.load_scene(scene), placement, options, output, rendering)

    return command


def check_needed(operation: Operation, options: Any) -> None:
    """Raise InputError where the options of a command change nothing."""
    if operation.needed and options == type(options)():
        known = declarations(operation.options)
        flags = [known[name][0].spells(name)[0] for name in operation.needed]
        raise InputError(f"Nothing to change; give {', '.join(flags)}.")


def write_operation(
    operation: Operation,
    scene: Any,
    target: Any,
    options: Any,
    output: Path,
    rendering: Rendering,
) -> None:
    """Apply an operation to a scene, write the picture, and report."""
    edited = operation.apply(scene, target, options, scene)
    lines = [operation.summary(edited)] if operation.summary else []
    write_result(operation.name, scene, edited, output, rendering, lines=lines)


def apply_command(
    scene: SceneArgument,
    edits: Annotated[Path, typer.Argument(metavar="EDITS", help="A YAML list of edits.")],
    output: PictureOutput,
    rendering: Rendering,
) -> None:
    """Replay a list of edits on a scene: materials and light, in one picture."""
    from materialist.edits.recipe import apply as replay
    from materialist.edits.recipe import check_libraries, read_recipe

    check_before(output, rendering)
    steps = read_recipe(edits)
    check_libraries(steps)
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
    if frames is None:
        check_needed(RELIGHT, options)
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
    changes = Relight(**{**vars(options), "sun": suns[0] if len(suns) == 1 else None})
    if frames is None:
        write_operation(RELIGHT, loaded, marked, changes, output, rendering)
        return
    from materialist.edits.light.relight import moving_light

    film = moving_light(loaded, frames, changes, suns=suns, sun=None, lights=marked)
    write_film(RELIGHT.name, loaded, film, output, rendering, frames=frames, fps=fps)


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
    from materialist.edits.drop.physics import check_libraries
    from materialist.edits.insert.meshes import read_model
    from materialist.edits.light.relight import moving_light
    from materialist.io.video import lacks_encoder

    # Read as a list of edits would be, so that the same texts are accepted.
    light = Relight.read({} if rotate is None else {"rotate": rotate})
    # One command installs all that is missing: the film's package, too.
    check_libraries(*(["video"] if lacks_encoder(output) else []))
    check_before(output, rendering, video=True)
    places: Any = [parse_numbers(text, 2, "--at") for text in at]
    models = [read_model(path, up=options.up) for path in meshes]
    loaded = mt.load_scene(scene)
    film: Any = mt.drop(loaded, models, places, options, frames=frames, fps=fps)
    film = film if rotate is None else moving_light(film, frames, light)
    write_film(DROP.name, loaded, film, output, rendering, frames=frames, fps=fps)
