"""`bench plate` on the published pair of photos: its mask, and that both lie over each other."""

from pathlib import Path

import pytest

from materialist import bench
from materialist.bench.plate import PHOTO, PlateBench, orange
from materialist.errors import InputError
from materialist.io.photo import read_photo

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
needs_photos = pytest.mark.skipif(not (DATA / PHOTO).is_file(), reason="shared/data/photos is not here")


def test_without_the_photos_it_says_which_are_missing(tmp_path):
    with pytest.raises(InputError, match=r"materialist_indoor1\.png"):
        bench.run("plate", output=tmp_path / "out", data=tmp_path)


@needs_photos
def test_the_mask_is_the_jug():
    mask = orange(read_photo(DATA / PHOTO, size=128).linear)
    assert 0.12 < mask.mean() < 0.25 and mask[75, 70] and not mask[40, 70] and not mask[75, 20] and not mask[68, 106]


@needs_photos
def test_the_plate_lies_over_the_photo_where_nothing_was_removed(measured, monkeypatch):
    monkeypatch.setattr(PlateBench, "_removed", lambda self, photo, predictor, mask: photo.original)
    rows = {row["method"]: row for row in measured("plate", data=DATA, size=128, device="cpu").rows}
    assert rows["untouched"]["inside"] < 10 < rows["diffused"]["inside"]
    assert rows["untouched"]["around"] > 21.6  # 1.5 pixels of the file aside it is 21.5
    assert rows["remove, bundled"]["inside"] == pytest.approx(rows["untouched"]["inside"], abs=0.3)
