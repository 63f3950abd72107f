"""`bench plate` on the published pair of photos: its mask, and that both lie over each other."""

import pytest

from materialist.io.photo import read_photo
from materialist_lab.bench import plate
from materialist_lab.bench.plate import PHOTO, PlateBench, orange


def test_the_mask_is_the_jug(real_data):
    mask = orange(read_photo(real_data(f"data/{PHOTO}"), size=128).linear)
    assert (
        0.12 < mask.mean() < 0.25
        and mask[75, 70]
        and not mask[40, 70]
        and not mask[75, 20]
        and not mask[68, 106]
    )


@pytest.mark.slow
def test_the_plate_lies_over_the_photo_where_nothing_was_removed(measured, real_data, monkeypatch):
    monkeypatch.setattr(PlateBench, "_removed", lambda self, photo, predictor, mask: photo.original)
    # Two of twenty photos with holes: all take most of a minute.
    two = dict([*plate.outlines().items()][:2])
    monkeypatch.setattr(plate, "outlines", lambda: two)
    rows = {
        row["method"]: row
        for row in measured("plate", data=real_data("data"), size=128, device="cpu").rows
    }
    assert rows["untouched"]["inside"] < 10 < rows["diffused"]["inside"]
    assert rows["untouched"]["around"] > 21.6  # 1.5 pixels of the file aside it is 21.5
    assert rows["remove, bundled"]["inside"] == pytest.approx(rows["untouched"]["inside"], abs=0.3)
    assert rows["holes: filled"]["inside"] > 12
