"""The weights that ship, on a real photo, against another network's maps."""

from pathlib import Path

import numpy as np
import pytest

from materialist.io.photo import read_photo
from materialist.metrics.maps import ordinal_accuracy
from materialist.predict import get_predictor

INDOOR = Path(__file__).resolve().parents[4] / "shared" / "data" / "official_indoor"


@pytest.mark.skipif(not INDOOR.exists(), reason="shared/data/official_indoor is not here")
def test_an_indoor_photo_agrees_with_the_published_network():
    photo = read_photo(str(INDOOR / "photo.png"), size=512)
    true, found = (get_predictor(spec, device="cpu").predict(photo) for spec in (f"maps:{INDOOR / 'maps'}", "bundled"))
    assert ordinal_accuracy(found.depth, true.depth) >= 0.85
    angle = np.degrees(np.arccos(np.clip((found.normal * true.normal).sum(-1), -1, 1)))
    assert angle[true.depth > 0].mean() <= 30
