"""`bench invert`: what it runs, what it reads off, what it refuses; the inversion itself only in the slow test."""

import json
import sys

import numpy as np
import pytest

from materialist import bench
from materialist.bench import invert
from materialist.errors import InputError
from materialist.io.exr import write_exr
from materialist.io.image import write_png
from materialist.io.photo import read_photo

REPORT = {
    "rerender_psnr_path": 33.0, "rerender_ssim_path": 0.95, "prior_l1_albedo": 0.1, "prior_l1_roughness": 0.2,
    "prior_l1_metallic": 0.3, "warnings": [],
    "stages": [
        {"name": "geometry", "seconds": 1.0}, {"name": "engine", "seconds": 0.75}, {"name": "trace", "seconds": 1.25},
        {"name": "prior light", "seconds": 0.5}, {"name": "light", "seconds": 1.5},
        {"name": "materials", "seconds": 3.0},
        {"name": "light", "seconds": 0.5}, {"name": "roughness+metallic", "seconds": 0.25},
        {"name": "rerender", "seconds": 4.0},
    ],
}  # fmt: skip
"""What an inversion reports: two rounds of light and materials."""


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


@pytest.fixture
def fake_inversion(monkeypatch):
    """Inversions that take no time; the list collects their command lines and the photos they were given."""
    seen = []

    def watched(command):
        value = lambda name: command[command.index(name) + 1]  # noqa: E731
        photo = read_photo(command[4], size=int(value("--size")))
        seen.append((command, photo.camera))
        scene = invert.Path(value("-o"))
        scene.mkdir()
        (scene / "report.json").write_text(json.dumps(REPORT))
        camera = {"width": photo.camera.width, "height": photo.camera.height}
        (scene / "scene.json").write_text(json.dumps({"camera": camera}))
        return 0, '{"ok": true}', 700.0

    monkeypatch.setattr(invert, "watched", watched)
    return seen


def test_every_size_is_inverted_as_asked_and_larger_ones_enlarge_the_photo(data, fake_inversion, tmp_path):
    out = bench.run("invert", data=data, output=tmp_path / "out", sizes="24,96", step_size=0, seed=3, device="cpu")
    commands, cameras = zip(*fake_inversion, strict=True)
    assert [(c.width, c.height) for c in cameras] == [(24, 16), (96, 64)]
    assert commands[0][4] == str(data / "photo.png") and commands[1][4] != commands[0][4]
    for command in commands:
        assert command[:4] == [sys.executable, "-m", "materialist", "invert"]
        options = " ".join(command)
        assert f"--predictor maps:{data / 'maps'}" in options and "--seed 3" in options and "--device cpu" in options
    rows = json.loads((out / "report.json").read_text())["rows"]
    assert [row["method"] for row in rows] == ["24 × 16", "96 × 64"]
    assert rows[1]["pixels"] == 96 * 64 and rows[1]["peak_mb"] == 700 and rows[1]["psnr"] == 33
    assert rows[1]["seconds_per_mpixel"] == pytest.approx(rows[1]["seconds"] / 96 / 64 * 1e6)
    assert (out / "plot.png").read_bytes()[:4] == b"\x89PNG"


def test_stages_are_added_up_and_the_rest_is_told():
    spent = invert._stages(REPORT, seconds=12.0)
    assert spent["light_s"] == 2.5 and spent["materials_s"] == 3.25 and spent["engine_s"] == 2
    assert spent["other_s"] == pytest.approx(12 - 12.75)


def test_a_process_is_watched_to_its_end():
    program = "import sys; block = bytearray(120_000_000); block[::4096] = b'x' * len(block[::4096]); print('end')"
    program += "; import time; time.sleep(0.2); sys.exit(3)"
    code, answer, peak = invert.watched([sys.executable, "-c", program])
    assert code == 3 and answer.strip() == "end"
    if sys.platform == "linux":
        assert 115 < peak < 250


def test_a_failed_inversion_is_told_in_its_own_words(data, tmp_path):
    (data / "maps" / "depth.exr").unlink()
    with pytest.raises(InputError, match=r"size 24 ended with code 2: .*depth"):
        bench.run("invert", data=data, output=tmp_path / "out", sizes=24, step_size=0)


@pytest.mark.parametrize("sizes", ["", "12,x", "8", 99999, "256;512"])
def test_odd_sizes_are_refused(sizes, tmp_path):
    with pytest.raises(InputError, match="with commas"):
        bench.run("invert", output=tmp_path / "out", sizes=sizes)


def test_data_without_a_photo_is_refused(tmp_path):
    (tmp_path / "data").mkdir()
    with pytest.raises(InputError, match="holds neither"):
        bench.run("invert", data=tmp_path / "data", output=tmp_path / "out")


@pytest.mark.slow
def test_an_inversion_for_real(tmp_path):
    out = bench.run("invert", output=tmp_path / "out", sizes="48,64", step_size=48, device="cpu")
    first, second, step = json.loads((out / "report.json").read_text())["rows"]
    assert first["psnr"] > 25 and second["psnr"] > 25 and first["peak_mb"] > 200
    assert 0 < sum(first[f"{name}_s"] for name in invert.STAGES) < first["seconds"]
    assert step["prb_per_cached"] > 10
