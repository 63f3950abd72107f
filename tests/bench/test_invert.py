"""`bench invert`: what a command says that fails; the inversions themselves only in the slow test."""

import json

import pytest

from materialist import bench
from materialist.bench import invert
from materialist.bench.benchmark import materialist
from materialist.errors import MaterialistError


def test_a_failed_command_is_told_in_its_own_words(tmp_path):
    with pytest.raises(MaterialistError, match=r"materialist invert .* ended with code 2: .*nothing.jpg"):
        materialist("invert", str(tmp_path / "nothing.jpg"), "-o", str(tmp_path / "a.scene"))


@pytest.mark.slow
def test_an_inversion_for_real(tmp_path):
    out = bench.run("invert", output=tmp_path / "out", sizes="48,64", step_size=48, device="cpu")
    first, second, step = json.loads((out / "report.json").read_text())["rows"]
    assert first["psnr"] > 25 and second["psnr"] > 25 and first["peak_mb"] > 200
    assert 0 < sum(first[f"{name}_s"] for name in invert.STAGES) < first["seconds"]
    assert step["prb_per_cached"] > 10
