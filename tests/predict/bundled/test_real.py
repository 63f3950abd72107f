"""The weights that ship, on real photos: a measured depth, and another network's maps."""

import numpy as np

from materialist.io.photo import read_photo
from materialist.metrics.maps import depth_figures, ordinal_accuracy
from materialist.predict import resample
from materialist.predict.bundled.predictor import BundledPredictor
from materialist.predict.maps import MapsPredictor

FOCAL, BASELINE, OFFSET = 994.978, 0.193, 31.086
"""Pixels, metres and pixels of the stereo pair (Middlebury 2014): depth = focal * baseline / (disparity + offset)."""


def test_a_cluttered_garage_is_mostly_in_the_right_order(real_data):
    """Pairs of pixels against a measured depth; a guess without a network had 0.73."""
    folder = real_data("data/photos/indoor")
    disparity = np.load(folder / "motorcycle_garage_disp.npz")["arr_0"]
    known = np.isfinite(disparity) & (disparity > 0)
    true = np.where(known, FOCAL * BASELINE / (np.where(known, disparity, 1) + OFFSET), 0).astype(np.float32)
    photo = read_photo(folder / "motorcycle_garage.png", size=512)
    found, true = BundledPredictor(device="cpu").predict(photo), resample.depth(true, photo.linear.shape[:2])
    assert ordinal_accuracy(found.depth, true) >= 0.8
    assert depth_figures(found.depth, true, true > 0)["depth_si_log_rmse"] <= 0.2


def test_an_indoor_photo_agrees_with_the_published_network(real_data):
    folder = real_data("data/official_indoor")
    photo = read_photo(folder / "photo.png", size=512)
    true, found = MapsPredictor(folder / "maps").predict(photo), BundledPredictor(device="cpu").predict(photo)
    assert ordinal_accuracy(found.depth, true.depth) >= 0.85
    angle = np.degrees(np.arccos(np.clip((found.normal * true.normal).sum(-1), -1, 1)))
    assert angle[true.depth > 0].mean() <= 30
