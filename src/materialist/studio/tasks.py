"""The long tasks of the studio, each a call of the public API on files; run by `worker` in a process of its own."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from materialist.errors import SetupError
from materialist.io.beside import partial
from materialist.types import Array, Materials, Prediction, Scene

Progress = Any
"""A `worker.Reporter`: progress(stage, done, total), and progress.found(name, file)."""


def do(progress: Progress, kind: str, device: str = "auto", **spec: Any) -> dict[str, Any]:
    """The task of a kind, on a device of `invert`."""
    if device != "auto":
        from materialist.render.variant import setup

        setup(device)  # for the whole process
    return globals()[f"do_{kind}"](progress, **spec)


def do_photo(progress: Progress, photo: str, thumbnail: str) -> dict[str, Any]:
    """Read a photo: its size and field of view, and a small picture of it in the file `thumbnail`."""
    from materialist.io.photo import read_photo

    picture = read_photo(photo, size=512)
    write_jpeg(Path(thumbnail), picture.linear)
    height, width = picture.original.shape[:2]
    return {
        "width": width, "height": height, "fov": picture.camera.fov, "fov_source": picture.fov_source,
        "hdr": picture.hdr, "warnings": list(picture.warnings),
    }  # fmt: skip


def do_invert(
    progress: Progress, photo: str, scene: str, title: str, predictor: str = "auto", size: int = 512,
    fov: float | str = "auto", seed: int = 0,
) -> dict[str, Any]:  # fmt: skip
    """`materialist invert`; maps and light go to `found` as soon as they are there."""
    from dataclasses import replace

    from materialist.io.package import save_scene
    from materialist.io.photo import read_photo
    from materialist.pipeline import invert

    picture = replace(read_photo(photo, size=size, fov=fov), path=title)
    folder = Path(scene).parent
    show = lambda name, value: _show(progress, folder, name, value)  # noqa: E731
    done = invert(picture, predictor=predictor, fov=fov, size=size, seed=seed, progress=progress, found=show)
    progress("save", 0, 1)
    save_scene(done, scene, force=True)
    return {"scene": scene, "psnr": done.report.metrics.get("rerender_psnr_path")}


def _show(progress: Progress, folder: Path, name: str, value: Any) -> None:
    """Pictures of what `invert` has found so far."""
    from materialist.exporters import pictures

    if isinstance(value, Prediction):
        shown = {"first depth": pictures.nearness(value.depth), "first normals": pictures.normals(value.normal)}
        shown |= _materials("first ", value.materials)
    elif isinstance(value, Materials):
        shown = _materials("", value)
    else:
        shown = {name: pictures.light(value) if name == "light" else display(value)}
    for title, pixels in shown.items():
        file = folder / f"found-{title.replace(' ', '-')}.jpg"
        write_pixels(file, pixels)
        progress.found(title, file)


def _materials(before: str, maps: Materials) -> dict[str, Array]:
    from materialist.exporters import pictures

    return {
        f"{before}albedo": display(maps.albedo),
        f"{before}roughness": pictures.grey(maps.roughness),
        f"{before}metallic": pictures.grey(maps.metallic),
    }


def do_final(progress: Progress, scene: str, edits: str, output: str, spp: int = 256, seed: int = 0) -> dict[str, Any]:
    """`materialist apply`: the path-traced composite as OUTPUT.png, OUTPUT.exr and a small OUTPUT.jpg."""
    from materialist.edits.composite.composite import composite
    from materialist.edits.composite.output import write_composite
    from materialist.edits.core.notes import warnings_since

    loaded, edited = _edited(progress, scene, edits)
    picture = composite(loaded, edited, spp=spp, seed=seed, progress=progress)
    out = Path(output)
    for suffix in (".png", ".exr"):
        write_composite(out.with_suffix(suffix), picture, loaded.photo, force=True)
    write_jpeg(out.with_suffix(".jpg"), picture, longest=2048)
    notes = warnings_since(loaded, edited)
    return {"picture": str(out.with_suffix(".png")), "spp": spp, "warnings": notes}


def do_mesh(progress: Progress, scene: str, output: str, triangles: int = 60_000) -> dict[str, Any]:
    """A light GLB of the depth surface for the viewer, without the planes that continue it."""
    from materialist.exporters.glb import write_glb
    from materialist.exporters.parts import scene_parts
    from materialist.exporters.target import whole_files
    from materialist.io.package import load_scene

    progress("export", 0, 1)
    loaded = load_scene(scene)
    with whole_files([Path(output)], True) as (file,):
        write_glb(file, loaded, scene_parts(loaded, triangles)[:1])
    return {"file": output}


def do_take(
    progress: Progress, scene: str, edits: str, output: str, what: str, spp: int = 256, frames: int = 36
) -> dict[str, Any]:
    """One thing to take away, as a single file at `output` (its suffix included)."""
    maker: dict[str, Callable[..., None]] = {"scene": _package, "turn": _turntable}
    loaded, edited = _edited(progress, scene, edits)
    maker.get(what, _exported)(progress, loaded, edited, Path(output), what=what, spp=spp, frames=frames)
    return {"file": output}


def do_fall(
    progress: Progress, scene: str, mesh: str, at: list[float], output: str, scale: str = "1", material: str = "as-is",
    height: str = "1.5", seed: str = "0", frames: int = 36, spp: int = 32,
) -> dict[str, Any]:  # fmt: skip
    """`materialist drop`: a mesh falls onto the photo, as a video."""
    from materialist.edits.composite.composite import pictures
    from materialist.edits.drop.drop import drop
    from materialist.io.package import load_scene
    from materialist.io.video import ensure_video_writable, write_frames

    ensure_video_writable(output, force=True)
    progress("load", 0, 1)
    loaded = load_scene(scene)
    film = drop(
        loaded, [mesh], [(at[0], at[1])], frames=frames, fps=24, scale=float(scale), material=material,
        height=float(height), seed=int(seed),
    )  # fmt: skip
    write_frames(output, pictures(loaded, film, spp=spp, progress=progress), fps=24, force=True)
    return {"file": output}


def _edited(progress: Progress, scene: str, edits: str) -> tuple[Scene, Scene]:
    """The fitted scene, and the same after the list of edits (if there is one)."""
    from materialist.edits.recipe import apply, read_recipe
    from materialist.io.package import load_scene

    progress("load", 0, 1)
    loaded = load_scene(scene)
    return loaded, apply(loaded, read_recipe(edits)) if edits else loaded


def _package(progress: Progress, loaded: Scene, edited: Scene, output: Path, *, spp: int, **_: Any) -> None:
    """The edited scene as a zipped package, its photo the composite."""
    from materialist.edits.composite.composite import composite, developed
    from materialist.io.package import save_scene

    result = loaded
    if edited is not loaded:
        result = developed(loaded, edited, composite(loaded, edited, spp=spp, progress=progress))
    folder = partial(output, "") / output.with_suffix("").name
    folder.parent.mkdir()
    progress("save", 0, 1)
    save_scene(result, folder)
    _zip(folder, output)


def _exported(progress: Progress, loaded: Scene, edited: Scene, output: Path, *, what: str, **_: Any) -> None:
    """Another program's format; several files come as a zip."""
    from materialist.exporters.run import FOLDERS, export

    progress("export", 0, 1)
    if output.suffix != ".zip":
        export(edited, output, to=what, force=True)
        return
    folder = partial(output, "") / output.with_suffix("").name
    folder.mkdir(parents=True)
    export(edited, folder / "scene" if what in FOLDERS else folder / f"scene.{what}", to=what)
    _zip(folder, output)


def _turntable(progress: Progress, loaded: Scene, edited: Scene, output: Path, *, spp: int, frames: int, **_: Any):
    """`materialist relight --rotate 360`: the light once round, over the edits."""
    from materialist.edits.composite.composite import pictures
    from materialist.edits.light.frames import moving_light
    from materialist.io.video import ensure_video_writable, write_frames

    ensure_video_writable(output, force=True)
    scenes = list(moving_light(edited, frames, rotate=360.0))
    write_frames(output, pictures(loaded, scenes, spp=spp, progress=progress), fps=12, force=True)


def _zip(folder: Path, output: Path) -> None:
    """A folder as a zip file, whole; the folder goes."""
    import shutil

    made = shutil.make_archive(str(folder), "zip", folder.parent, folder.name)
    os.replace(made, output)
    shutil.rmtree(folder.parent, ignore_errors=True)


def display(linear: Array) -> Array:
    """[H, W, 3] linear to uint8 sRGB."""
    from materialist.color import srgb_levels

    return srgb_levels(linear)


def write_jpeg(path: Path, linear: Array, longest: int = 1024) -> None:
    """A linear picture [H, W, 3] as a JPEG of at most `longest` pixels a side."""
    import cv2

    scale = min(1.0, longest / max(linear.shape[:2]))
    size = (max(1, round(linear.shape[1] * scale)), max(1, round(linear.shape[0] * scale)))
    small = np.asarray(cv2.resize(linear, size, interpolation=cv2.INTER_AREA)) if scale < 1 else linear
    write_pixels(path, display(small))


def write_pixels(path: Path, pixels: Array) -> None:
    """[H, W, 3] uint8 as JPEG or PNG, whole."""
    import cv2

    made, data = cv2.imencode(path.suffix, np.ascontiguousarray(pixels[..., ::-1]), [cv2.IMWRITE_JPEG_QUALITY, 90])
    if not made:
        raise SetupError(f"The picture {path.name} cannot be encoded.")
    temporary = partial(path, f"-{path.name}")
    temporary.write_bytes(data.tobytes())
    temporary.replace(path)
