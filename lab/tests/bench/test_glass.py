"""The benchmark of glass, small."""

import pytest

from materialist_lab.bench import glass_scenes


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


def test_jugs_are_closed_and_have_a_handle_at_one_side():
    for jug in glass_scenes.jugs(2):
        assert glass_scenes.is_closed(jug.solid)
        x, y, _ = jug.solid.vertices.T
        assert x.max() > -1.2 * x.min() and abs(y.min()) < 1e-6
