"""The benchmark of glass, small."""

import pytest


@pytest.mark.slow
@pytest.mark.parametrize("background", ["envmap", "room"])
def test_the_whole_benchmark_runs(measured, background):
    small = {
        "shapes": 1,
        "envmaps": 1,
        "iors": "1.2",
        "size": 32,
        "spp": 4,
        "reference": 4,
        "draws": 1,
        "pictures": 1,
    }
    report = measured("glass", background=background, **small)
    assert (report.folder / "sheet.png").is_file()
    assert {"closed, true d", "two_interface, true d"} <= report.means.keys()
