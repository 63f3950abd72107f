"""Which photos the benchmark of batches takes."""

import numpy as np
import pytest

from materialist.bench import batch
from materialist.errors import InputError
from materialist.io.image import write_png


@pytest.mark.parametrize("below", ["", "photos"])
def test_photos_are_spread_over_those_of_a_folder(tmp_path, below):
    folder = tmp_path / "data" / below
    folder.mkdir(parents=True)
    for k in range(5):
        write_png(folder / f"{k}.png", np.zeros((8, 8, 3), np.float32))
    chosen = batch._chosen(tmp_path / "data", 2, tmp_path / "report")
    assert [name.rsplit("/", 1)[-1] for name in chosen] == ["0.png", "2.png"]
    report = folder / "report"
    report.mkdir()
    write_png(report / "plot.png", np.zeros((8, 8, 3), np.float32))
    assert len(batch._chosen(tmp_path / "data", 9, report)) == 5  # the report is none of them


def test_bad_counts_are_refused(tmp_path):
    with pytest.raises(InputError, match="photos is 0"):
        batch.BatchBench(photos=0)
    with pytest.raises(InputError, match="workers is 0"):
        batch._counts("0")
