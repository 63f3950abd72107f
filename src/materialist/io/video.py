"""Videos and folders of frames, written whole or not at all."""

from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from imageio.v2 import get_writer

from materialist.color import srgb_levels
from materialist.errors import InputError, SetupError
from materialist.install import extra_command
from materialist.io.atomic import FRAMES, ensure_writable, whole_file, whole_folder
from materialist.io.image import write_png
from materialist.types import Array

BT709 = (
    "-vf",
    "scale=out_color_matrix=bt709:out_range=tv",
    "-colorspace",
    "bt709",
    "-color_primaries",
    "bt709",
    "-color_trc",
    "bt709",
)
"""ffmpeg's options for the colours that players expect of a video; its default is standard-definition television."""
MAX_FRAMES = 3600


def lacks_encoder(path: Path) -> bool:
    """Whether PATH is a video, and the package that encodes it is not installed."""
    return bool(path.suffix) and find_spec("imageio_ffmpeg") is None


def ensure_video_writable(path: str | Path, *, force: bool = False) -> None:
    """Check before the work that `write_frames` will accept PATH. Raises OutputError, InputError or SetupError."""
    path = Path(path)
    if path.suffix.lower() not in (".mp4", ""):
        raise InputError(
            f"The output {path} must end in .mp4, or have no ending: a folder of PNG frames."
        )
    # Found before the work: writing fails only at the end.
    if lacks_encoder(path):
        raise SetupError(
            f"Video needs one more package: {extra_command('video')}; or give -o a name without "
            "an ending to get PNG frames in a folder."
        )
    ensure_writable(path, force, None if path.suffix else FRAMES)


def write_frames(
    path: str | Path, pictures: Iterable[Array], *, fps: int = 24, force: bool = False
) -> int:
    """Write linear pictures [H, W, 3] to PATH.mp4 (H.264), or to a folder as 0000.png, 0001.png, ...; returns how many.

    Whole or not at all. An odd row or column is left out of a video, which needs even sizes.
    """
    path = Path(path)
    ensure_video_writable(path, force=force)
    if path.suffix:
        with whole_file(path, force) as file:
            return _to_video(file, pictures, fps)
    with whole_folder(path, force, FRAMES) as folder:
        count = 0
        for count, picture in enumerate(pictures, 1):
            write_png(folder / f"{count - 1:04d}.png", picture)
        return count


def _to_video(path: Path, pictures: Iterable[Array], fps: int) -> int:
    count = 0
    writer: Any = get_writer(
        path,
        "FFMPEG",
        fps=fps,
        codec="libx264",
        quality=8,
        macro_block_size=2,
        output_params=list(BT709),
    )
    with writer:
        for picture in pictures:
            # H.264 stores colour at half resolution.
            height, width = (n - n % 2 for n in picture.shape[:2])
            writer.append_data(srgb_levels(picture[:height, :width]))
            count += 1
    return count
