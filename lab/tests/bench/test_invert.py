"""`bench invert`: what it runs, what it reads off; the inversion itself only in the slow test."""

import json
from pathlib import Path

import numpy as np
import pytest

from materialist.errors import MaterialistError
from materialist.io.exr import write_exr
from materialist.io.image import write_png
from materialist.io.photo import read_photo
from materialist_lab.bench import invert
from materialist_lab.bench.benchmark import materialist

STAGES = {
    "geometry": 1.0,
    "engine": 0.75,
    "trace": 1.25,
    "light": 2.5,
    "albedo": 3.0,
    "roughness+metallic": 0.25,
    "rerender": 4.0,
}
REPORT = {
    "rerender_psnr_path": 33.0,
    "rerender_ssim_path": 0.95,
    "prior_l1_albedo": 0.1,
    "prior_l1_roughness": 0.2,
    "prior_l1_metallic": 0.3,
    "peak_rss_mb": 700.0,
    "stages": [{"name": name, "seconds": seconds} for name, seconds in STAGES.items()],
}
"""What an inversion reports."""


@pytest.fixture
def data(tmp_path):
    """A folder with a 48 x 32 photo and maps of one tilted surface."""
    folder = tmp_path / "data"
    (folder / "maps").mkdir(parents=True)
    ramp = np.linspace(0.2, 0.6, 48, dtype=np.float32)
    grid = np.broadcast_to(ramp, (32, 48))
    write_png(folder / "photo.png", np.repeat(grid[..., None], 3, -1))
    write_exr(folder / "maps" / "albedo.exr", np.full((32, 48, 3), 0.5, np.float32))
    write_exr(folder / "maps" / "depth.exr", np.ascontiguousarray(2 + grid))
    return folder


def test_every_size_is_inverted_as_asked_and_larger_ones_enlarge_the_photo(
    data, monkeypatch, measured
):
    seen = []

    def inverted(*command, **_):
        def value(name):
            return command[command.index(name) + 1]

        photo = read_photo(command[1], size=int(value("--size")))
        seen.append((command, photo.camera))
        scene = Path(value("-o"))
        scene.mkdir()
        (scene / "report.json").write_text(json.dumps(REPORT))
        camera = {"width": photo.camera.width, "height": photo.camera.height}
        (scene / "scene.json").write_text(json.dumps({"camera": camera}))

    monkeypatch.setattr(invert, "materialist", inverted)
    report = measured("invert", data=data, sizes="24,96", step_size=0, seed=3, device="cpu")
    commands, cameras = zip(*seen, strict=True)
    assert [(c.width, c.height) for c in cameras] == [(24, 16), (96, 64)]
    assert commands[0][1] == str(data / "photo.png") and commands[1][1] != commands[0][1]
    for command in commands:
        options = " ".join(command)
        assert (
            f"--predictor maps:{data / 'maps'}" in options
            and "--seed 3" in options
            and "--device cpu" in options
        )
    rows = report.rows
    assert [row["method"] for row in rows] == ["24 × 16", "96 × 64"]
    assert rows[1]["peak_mb"] == 700 and rows[1]["psnr"] == 33
    assert rows[1]["seconds_per_mpixel"] == pytest.approx(rows[1]["seconds"] / 96 / 64 * 1e6)


def test_a_failed_command_is_told_in_its_own_words(tmp_path):
    with pytest.raises(
        MaterialistError, match=r"materialist invert .* ended with code 2: .*nothing.jpg"
    ):
        materialist("invert", str(tmp_path / "nothing.jpg"), "-o", str(tmp_path / "a.scene"))


@pytest.mark.slow
def test_an_inversion_for_real(measured):
    first, second, step = measured("invert", sizes="48,64", step_size=48, device="cpu").rows
    assert first["psnr"] > 25 and second["psnr"] > 25 and first["peak_mb"] > 200
    assert 0 < sum(first[f"{name}_s"] for name in invert.STAGES) < first["seconds"]
    assert step["prb_per_cached"] > 10
