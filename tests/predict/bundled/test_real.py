"""The weights that ship, on real photos: a measured depth, and another network's maps."""

import pytest

from materialist.io.photo import read_photo
from materialist.predict.bundled.predictor import BundledPredictor
from materialist.predict.maps import MapsPredictor
from materialist_lab.bench.real.captures import garage_photo, garages
from materialist_lab.bench.real.photos import Reading
from materialist_lab.metrics.maps import depth_figures, mean_angle, ordinal_accuracy


@pytest.mark.slow
def test_a_cluttered_garage_is_mostly_in_the_right_order(real_data):
    """Pairs of pixels against a measured depth; a guess without a network had 0.73."""
    (path,) = garages(real_data("data/photos/indoor"))
    (real,) = garage_photo(path, Reading(size=512, lamps=0))
    found = BundledPredictor(device="cpu").predict(real.photo)
    assert ordinal_accuracy(found.depth, real.depth) >= 0.8
    assert depth_figures(found.depth, real.depth, real.depth > 0)["depth_si_log_rmse"] <= 0.2


@pytest.mark.slow
def test_an_indoor_photo_agrees_with_the_published_network(real_data):
    folder = real_data("data/official_indoor")
    photo = read_photo(folder / "photo.png", size=512)
    true = MapsPredictor(folder / "maps").predict(photo)
    found = BundledPredictor(device="cpu").predict(photo)
    assert ordinal_accuracy(found.depth, true.depth) >= 0.85
    assert mean_angle(found.normal, true.normal, true.depth > 0) <= 30
