"""Videos and folders of frames, written whole or not at all."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from materialist.color import srgb_levels
from materialist.errors import InputError, OutputError, SetupError
from materialist.io.atomic import partial
from materialist.io.image import probe_beside, write_png_bytes
from materialist.types import Array

BT709 = (
    "-vf", "scale=out_color_matrix=bt709:out_range=tv", "-colorspace", "bt709", "-color_primaries", "bt709",
    "-color_trc", "bt709",
)  # fmt: skip
"""ffmpeg's options for the colours that players expect of a video; its default is standard-definition television."""
MAX_FRAMES = 3600


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
        write_png_bytes(folder / f"{count - 1:04d}.png", srgb_levels(picture))
    return count


def _to_video(path: Path, pictures: Iterable[Array], fps: int) -> int:
    writer, count = None, 0
    try:
        for picture in pictures:
            pixels = srgb_levels(picture)
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
