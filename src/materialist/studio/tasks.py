"""The long tasks of the studio, each a call of the public API on files, run in a process of its own."""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import materialist as mt
from materialist.color import srgb_levels
from materialist.edits.core.operation import PreviewMode, new_edits
from materialist.edits.recipe import Step
from materialist.io import display
from materialist.io.atomic import partial, write_whole
from materialist.io.package import replace_rerender
from materialist.jobs.worker import Reporter
from materialist.studio import SETTINGS
from materialist.types import Array, Materials, Prediction, Scene

Steps = tuple[Step, ...]
Task = Callable[..., None]
"""task(report, **arguments)."""
PHOTO = "photo"
"""The name under which an inversion shows its photo, before anything is found."""
WARM_SIDE = 64
"""Pixels a side of the picture with which a process gets ready."""
PICTURES = {"jpg": "-full.jpg", "png": ".png", "tif": ".tif", "exr": ".exr"}
"""Kind of a path-traced picture -> what its file is called after the name of the picture."""
KINDS = {
    "jpg": ("Picture, JPEG", ".jpg"),
    "png": ("Picture, PNG", ".png"),
    "tif": ("Picture, TIFF", ".tif"),
    "exr": ("Picture, EXR: linear, for further work", ".exr"),
    "edits": ("edits.yaml with its masks (zip)", ".zip"),
    "scene": ("The edited scene, a package (zip)", ".zip"),
    "glb": ("glTF with its light (zip)", ".zip"),
    "blend": ("Blender: script and files (zip)", ".zip"),
    "usd": ("USD (usdz)", ".usdz"),
    "mitsuba": ("Mitsuba (zip)", ".zip"),
    "html": ("A page that opens without a server", ".html"),
    "turn": ("A video: the light goes round", ".mp4"),
}
"""Kind of result -> its title, and the suffix of the file."""
_NEEDED = {"usd": "pxr", "turn": "imageio_ffmpeg"}
"""Kind -> the module that it does not work without."""
_JPEG_SIDE = 2048
"""Longest side of the small picture beside a result, pixels."""


@cache
def kinds_here() -> dict[str, tuple[str, str]]:
    """The kinds of results that this machine can make."""
    return {kind: facts for kind, facts in KINDS.items() if _works(kind)}


def _works(kind: str) -> bool:
    return kind not in _NEEDED or find_spec(_NEEDED[kind]) is not None


def on_device(device: str, task: Task, report: Reporter, **arguments: Any) -> None:
    """Do a task on a device of `invert`, which is set for the whole process."""
    if device != "auto":
        from materialist.render.variant import setup

        setup(device)
    task(report, **arguments)


class _Awaited(Exception):
    """A job waits for the process that gets ready."""


def warm(report: Reporter) -> None:
    """Load all that `invert` needs, by an inversion of a few pixels, which a waiting job ends at its next step."""

    def look(*_: Any) -> None:
        if report.outdated:
            raise _Awaited

    grey = np.full((WARM_SIDE, WARM_SIDE, 3), 0.5, np.float32)
    grey[: WARM_SIDE // 2] = 0.3
    with suppress(_Awaited):
        mt.invert(grey, encoded=False, size=WARM_SIDE, progress=look, on_stage=look)


def invert(
    report: Reporter,
    photo: str,
    scene: str,
    title: str,
    predictor: str,
    size: int,
    fov: float | str,
    seed: int,
) -> None:
    """`materialist invert`; maps and light are sent as intermediate results as soon as they are there.

    The scene is there as soon as it is fitted, so that it can be opened; its re-rendering follows.
    """
    from dataclasses import replace

    picture = replace(mt.read_photo(photo, size=size, fov=fov), path=title)
    folder = Path(scene).parent

    def show(name, value):
        if isinstance(value, Scene):
            report("save", 0, 1)
            mt.save_scene(value, scene)
        else:
            _show(report, folder, name, value)

    # The photo first: the page shows it while the rest is computed.
    show(PHOTO, picture.linear)
    done = mt.invert(
        picture, predictor=predictor, fov=fov, size=size, seed=seed, progress=report, on_stage=show
    )
    report("save", 0, 1)
    if Path(scene).exists():
        replace_rerender(done, scene)
    else:
        mt.save_scene(done, scene)


def _show(report: Reporter, folder: Path, name: str, value: Any) -> None:
    # Each stage brings other maps: all of the prediction, then materials, then light.
    if isinstance(value, Prediction):
        shown = display.maps(value)
    elif isinstance(value, Materials):
        shown = {"albedo": srgb_levels(value.albedo)}
        shown |= {
            "roughness": display.grey(value.roughness),
            "metallic": display.grey(value.metallic),
        }
    else:
        shown = {name: display.light(value) if name == "light" else srgb_levels(value)}
    for title, pixels in shown.items():
        file = folder / f"found-{title}.jpg"
        write_pixels(file, pixels)
        report.intermediate(name=title, file=file.name)


def final(report: Reporter, scene: str, steps: Steps, output: str) -> None:
    """`materialist apply`: the path-traced composite as OUTPUT.png, OUTPUT.exr and a small OUTPUT.jpg; the photo so."""
    loaded, edited = _edited(report, scene, steps)
    picture = mt.composite(loaded, edited, progress=report)
    out = Path(output)
    for suffix in (".png", ".exr"):
        mt.save_image(out.with_suffix(suffix), picture, loaded.photo, force=True)
    for file, shown in (
        (out.with_suffix(".jpg"), picture),
        (before_of(out), loaded.photo.original),
    ):
        write_pixels(file, srgb_levels(display.shrunk(shown, _JPEG_SIDE)))


def converted(report: Reporter, scene: str, source: str, output: str) -> None:
    """A path-traced picture, SOURCE.exr of `final`, in another format, as the photo's own file would be."""
    from materialist.io.exr import read_exr

    report("export", 0, 1)
    photo = mt.load_scene(scene).photo
    # An EXR is in the unit of the photo's file.
    picture = read_exr(source) * np.float32(2.0**photo.stops)
    mt.save_image(output, picture, photo, force=True)


def removal(report: Reporter, scene: str, steps: Steps, fillings: str) -> None:
    """Fill what the last of the steps hides, and keep that in the folder `fillings`: `apply` takes it from there.

    Steps before it that neither move a surface nor change the photo are left out: they change nothing of the hole.
    """
    from materialist.edits.recipe import apply, options_of, region_of
    from materialist.edits.remove.filling import remembered
    from materialist.edits.remove.remove import disocclusion

    report("load", 0, 1)
    loaded = mt.load_scene(scene)
    with remembered(Path(fillings)):
        before = apply(loaded, _surface_steps(steps[:-1]))
        report("removal", 0, 1)
        step = steps[-1]
        disocclusion(before, region_of(loaded, step), options_of(step), loaded)


def _surface_steps(steps: Steps) -> list[Step]:
    """The steps that move a surface or change the photo."""
    return [step for step in steps if step.operation.preview is not PreviewMode.SHADED]


def before_of(output: Path) -> Path:
    """The photo beside a path-traced picture, of its size."""
    return output.with_name(f"{output.name}-before.jpg")


def fallen(report: Reporter, scene: str, steps: Steps) -> dict[str, Any]:
    """What a fall, the last of the steps, adds to a scene: `bodies`, `warnings`, and `edits` of its provenance.

    Steps before it that move no surface are left out: they change nothing of the fall.
    """
    from materialist.edits.core.notes import warnings_since
    from materialist.edits.recipe import apply

    loaded = mt.load_scene(scene)
    # A fall meets surfaces alone: colours and light are left out.
    before = apply(loaded, _surface_steps(steps[:-1]))
    after = apply(loaded, [steps[-1]], onto=before)
    return {
        "bodies": after.bodies[len(before.bodies) :],
        "warnings": warnings_since(before, after),
        "edits": new_edits(before, after),
    }


def mesh(report: Reporter, scene: str, output: str) -> None:
    """A light GLB of the depth surface for the viewer, without the planes that continue it."""
    from materialist.exporters.glb import glb_bytes
    from materialist.exporters.parts import scene_parts
    from materialist.exporters.run import PAGE_TRIANGLES

    report("export", 0, 1)
    loaded = mt.load_scene(scene)
    write_whole(output, glb_bytes(loaded, scene_parts(loaded, PAGE_TRIANGLES)[:1]))


def take(report: Reporter, scene: str, steps: Steps, output: str, kind: str) -> None:
    """One thing to take away, as a single file at `output` (its suffix included); several files come as a zip."""
    from materialist.exporters.run import FOLDERS

    loaded, edited = _edited(report, scene, steps)
    file = Path(output)
    if kind == "turn":
        _turntable(report, loaded, edited, file)
    elif kind == "scene":
        with _zipped(file) as folder:
            report("save", 0, 1)
            mt.save_scene(_developed(report, loaded, edited), folder, force=True)
    elif kind == "html":
        _page(_developed(report, loaded, edited), edited, loaded, file)
    else:
        report("export", 0, 1)
        if file.suffix != ".zip":
            mt.export(edited, file, to=kind, force=True)
            return
        with _zipped(file) as folder:
            name = "scene" if kind in FOLDERS else f"scene.{kind}"
            mt.export(edited, folder / name, to=kind)


def _edited(report: Reporter, scene: str, steps: Steps) -> tuple[Scene, Scene]:
    from materialist.edits.recipe import apply
    from materialist.edits.remove.filling import remembered

    report("load", 0, 1)
    loaded = mt.load_scene(scene)
    if not steps:
        return loaded, loaded
    # What the pages have filled lies beside the masks.
    with remembered(steps[0].folder):
        return loaded, apply(loaded, list(steps))


def _developed(report: Reporter, loaded: Scene, edited: Scene) -> Scene:
    """The edited scene with the composite as its photo."""
    from materialist.edits.composite.composite import developed

    if edited is loaded:
        return loaded
    return developed(loaded, edited, mt.composite(loaded, edited, progress=report))


def _page(shown: Scene, edited: Scene, loaded: Scene, output: Path) -> None:
    """A page of the edited picture, with the photo before it, and the edited scene."""
    from materialist.exporters.page import page
    from materialist.exporters.parts import body_parts, scene_parts
    from materialist.exporters.run import PAGE_TRIANGLES

    parts = [*scene_parts(edited, PAGE_TRIANGLES), *body_parts(edited)]
    before = None if edited is loaded else loaded.photo.linear
    write_whole(output, page(shown, parts, before))


def _turntable(report: Reporter, loaded: Scene, edited: Scene, output: Path) -> None:
    """`materialist relight --rotate 360`: the light once round, over the edits."""
    from materialist.edits.composite.composite import pictures
    from materialist.edits.light.relight import moving_light
    from materialist.io.video import ensure_video_writable, write_frames

    ensure_video_writable(output, force=True)
    # The same light function as of the command, so that both films are equal.
    scenes = list(moving_light(edited, SETTINGS.video_frames, rotate=360.0))
    film = pictures(loaded, scenes, progress=report)
    write_frames(output, film, fps=12, force=True)


@contextmanager
def _zipped(output: Path) -> Iterator[Path]:
    """Yield an empty folder that becomes the zip file OUTPUT, whole, when the block ends well."""
    place = partial(output, "")
    folder = place / output.stem
    folder.mkdir(parents=True)
    try:
        yield folder
        # Zipped beside, then renamed: a half zip is never seen.
        os.replace(shutil.make_archive(str(folder), "zip", place, folder.name), output)
    finally:
        shutil.rmtree(place, ignore_errors=True)


def write_pixels(path: Path, pixels: Array) -> None:
    write_whole(path, display.encoded(pixels, "JPEG", quality=SETTINGS.jpeg_quality))
