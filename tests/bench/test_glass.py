"""The benchmark of glass, small."""

import json

import pytest

from materialist import bench


@pytest.mark.parametrize("background", ["envmap", pytest.param("room", marks=pytest.mark.slow)])
def test_the_whole_benchmark_runs(tmp_path, background):
    small = {"shapes": 1, "envmaps": 1, "iors": "1.2", "size": 32, "spp": 4, "reference": 4, "draws": 1, "pictures": 1}
    folder = bench.run("glass", output=tmp_path / "report", background=background, **small)
    assert (folder / "sheet.png").is_file()
    report = json.loads((folder / "report.json").read_text())
    assert {"closed, true d", "two_interface, true d"} <= report["means"].keys()
