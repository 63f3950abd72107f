"""Videos and folders of frames."""

import subprocess

import numpy as np
import pytest

from materialist.color import srgb_to_linear
from materialist.errors import InputError, OutputError
from materialist.io.video import write_frames


def test_frames_become_a_folder_or_a_video(tmp_path):
    frames = [np.full((21, 31, 3), v, np.float32) for v in (0.1, 0.5, 0.9)]
    assert write_frames(tmp_path / "turn", iter(frames)) == 3
    assert sorted(p.name for p in (tmp_path / "turn").iterdir()) == [
        "0000.png",
        "0001.png",
        "0002.png",
    ]
    with pytest.raises(OutputError, match="force"):
        write_frames(tmp_path / "turn", iter(frames))
    with pytest.raises(InputError, match=r"\.mp4"):
        write_frames(tmp_path / "turn.gif", iter(frames))
    (tmp_path / "link").symlink_to(tmp_path / "turn")
    with pytest.raises(OutputError, match="is a link"):  # before anything is rendered
        write_frames(tmp_path / "link", iter(frames), force=True)
    (tmp_path / "link").unlink()
    video = pytest.importorskip("imageio_ffmpeg", reason="needs the optional extra 'video'")
    assert write_frames(tmp_path / "turn.mp4", iter(frames), fps=10) == 3
    count, seconds = video.count_frames_and_secs(str(tmp_path / "turn.mp4"))
    assert count == 3 and abs(seconds - 0.3) < 0.02
    assert sorted(p.name for p in tmp_path.iterdir()) == ["turn", "turn.mp4"]


def test_films_have_the_colours_that_players_take_them_for(tmp_path):
    """Those of BT.709, which the file says as well."""
    video = pytest.importorskip("imageio_ffmpeg", reason="needs the optional extra 'video'")
    colour = np.array([39, 203, 63])
    frame = np.broadcast_to(srgb_to_linear(colour / 255), (64, 64, 3)).astype(np.float32)
    write_frames(tmp_path / "a.mp4", iter([frame, frame]))
    options = [
        "-vf",
        "scale=in_color_matrix=bt709",
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-frames:v",
        "1",
        "-",
    ]
    command = [video.get_ffmpeg_exe(), "-i", str(tmp_path / "a.mp4"), *options]
    done = subprocess.run(command, capture_output=True, check=True)
    pixel = np.frombuffer(done.stdout, np.uint8).reshape(64, 64, 3)[32, 32]
    assert np.abs(pixel.astype(int) - colour).max() <= 3 and b"bt709" in done.stderr
