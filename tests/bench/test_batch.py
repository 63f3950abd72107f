"""Which photos the benchmark of batches takes."""

import numpy as np
import pytest

from materialist.bench import batch
from materialist.io.image import write_png


@pytest.mark.parametrize("below", ["", "photos"])
def test_photos_are_spread_over_those_of_a_folder(tmp_path, below):
    folder = tmp_path / "data" / below
    folder.mkdir(parents=True)
    for k in range(5):
        write_png(folder / f"{k}.png", np.zeros((8, 8, 3), np.float32))
    chosen = batch.chosen(tmp_path / "data", 2, tmp_path / "runs")
    assert [name.rsplit("/", 1)[-1] for name in chosen] == ["0.png", "2.png"]
