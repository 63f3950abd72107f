"""Moving light: a list of relit scenes, and the video made of their composites."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from materialist.color import srgb_levels
from materialist.edits.light.relight import relight, triple
from materialist.errors import InputError, OutputError, SetupError
from materialist.io.beside import partial
from materialist.io.image import probe_beside, write_png_bytes
from materialist.types import Array, Lamp, Scene

BT709 = (
    "-vf", "scale=out_color_matrix=bt709:out_range=tv", "-colorspace", "bt709", "-color_primaries", "bt709",
    "-color_trc", "bt709",
)  # fmt: skip
"""ffmpeg's options for the colours that players take films for; without them it encodes those of old television."""
MAX_FRAMES = 3600


def moving_light(
    scene: Scene, count: int, *, turn: float = 0.0, suns: tuple[tuple[float, float], ...] = (),
    lamps: tuple[Lamp, ...] = (), dim: float | None = None, lights: Array | None = None, **options,
) -> Iterator[Scene]:  # fmt: skip
    """`count` relit scenes: the light turns by `turn` degrees in all, the sun and one lamp follow their stations.

    Several suns or lamps are stations of one that moves in straight lines at even time between them; a single one
    stands still. With nothing that moves the light makes a full turn. Lights that the photo shows (`lights`, or those
    that are found) stay where they are, all frames with the same `dim` (None: they are part of what turns). `options`
    go to `relight`. Raises InputError for a count outside 2 to 3600.
    """
    if not 2 <= count <= MAX_FRAMES:
        raise InputError(f"The number of frames is {count}; it must lie in 2 to {MAX_FRAMES}.")
    if not turn and len(suns) < 2 and len(lamps) < 2:
        turn = 360.0
    if dim is not None or lights is not None:
        scene = relight(scene, dim=dim, lights=lights)  # once: finding the lights takes a rendering
    closed = turn != 0 and turn % 360 == 0 and len(suns) < 2 and len(lamps) < 2  # the last frame then meets the first
    for k in range(count):
        t = k / (count if closed else count - 1)
        sun = tuple(_between(np.asarray(suns), t)) if suns else None
        lamp = _lamp_between(lamps, t) if lamps else None
        yield relight(scene, rotate=t * turn, sun=sun, lamps=(lamp,) if lamp else (), **options)


def _between(stations: Array, t: float) -> Array:
    """[...] at time t in [0, 1] between stations [n, ...]."""
    place = t * (len(stations) - 1)
    k = min(int(place), max(len(stations) - 2, 0))
    following = stations[min(k + 1, len(stations) - 1)]
    return stations[k] + (following - stations[k]) * (place - k)


def _lamp_between(lamps: tuple[Lamp, ...], t: float) -> Lamp:
    at = lambda name: _between(np.array([getattr(lamp, name) for lamp in lamps], np.float64), t)  # noqa: E731
    return replace(lamps[0], position=triple(at("position")), power=triple(at("power")), radius=float(at("radius")))


def ensure_video_writable(path: str | Path, *, force: bool = False) -> None:
    """Check before the work that `write_frames` will accept PATH. Raises OutputError, InputError or SetupError."""
    path = Path(path)
    if path.suffix.lower() not in (".mp4", ""):
        raise InputError(f"The output {path} must end in .mp4, or have no ending: a folder of PNG frames.")
    if path.exists() and not (force and _replaceable(path)):
        raise OutputError(f"{path} exists; give {'another name' if force else '--force to replace it'}.")
    if path.is_symlink():
        raise OutputError(f"{path} is a link, which --force will not replace; give the file or folder it leads to.")
    if path.suffix:
        _ffmpeg()
    probe_beside(path)


def write_frames(path: str | Path, pictures: Iterable[Array], *, fps: int = 24, force: bool = False) -> int:
    """Write linear pictures [H, W, 3] to PATH.mp4 (H.264), or to a folder as 0000.png, 0001.png, ...; returns how many.

    Whole or not at all. An odd row or column is left out of a video, which needs even sizes.
    """
    path = Path(path)
    ensure_video_writable(path, force=force)
    temporary = partial(path)
    try:
        count = (_to_video if path.suffix else _to_folder)(temporary, pictures, fps)
        if path.is_dir():
            shutil.rmtree(path)
        os.replace(temporary, path)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}.") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True) if temporary.is_dir() else temporary.unlink(missing_ok=True)
    return count


def _to_folder(folder: Path, pictures: Iterable[Array], fps: int) -> int:
    folder.mkdir()
    count = 0
    for count, picture in enumerate(pictures, 1):
        write_png_bytes(folder / f"{count - 1:04d}.png", _display(picture))
    return count


def _to_video(path: Path, pictures: Iterable[Array], fps: int) -> int:
    writer, count = None, 0
    try:
        for picture in pictures:
            pixels = _display(picture)
            height, width = (n - n % 2 for n in pixels.shape[:2])
            if writer is None:
                writer = _ffmpeg().write_frames(
                    str(path), (width, height), fps=fps, codec="libx264", quality=8, macro_block_size=2,
                    output_params=list(BT709),
                )  # fmt: skip
                writer.send(None)
            writer.send(np.ascontiguousarray(pixels[:height, :width]))
            count += 1
    finally:
        if writer is not None:
            writer.close()
    return count


def _display(picture: Array) -> Array:
    return srgb_levels(picture)


def _replaceable(path: Path) -> bool:
    """A file, or a folder that holds nothing but frames."""
    return path.is_file() or all(p.suffix == ".png" and p.stem.isdigit() for p in path.iterdir())


def _ffmpeg():
    """The encoder's module. Raises SetupError with the command that installs it."""
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise SetupError(
            f"Video needs one more package: {sys.executable} -m pip install imageio-ffmpeg; or give -o a name without "
            "an ending to get PNG frames in a folder."
        ) from error
    return imageio_ffmpeg
