"""Field of view from EXIF, against numbers worked out by hand."""

import math

import pytest

from materialist.io.exif import horizontal_fov
from materialist.io.photo import read_photo


def test_35_mm_film_landscape_and_portrait():
    # 18 mm half width over 50 mm; in portrait the short side is 24 mm wide.
    assert horizontal_fov({"FocalLengthIn35mmFilm": 50}, 6000, 4000) == pytest.approx(
        39.5978, abs=1e-3
    )
    assert horizontal_fov({"FocalLengthIn35mmFilm": 50}, 4000, 6000) == pytest.approx(
        26.9915, abs=1e-3
    )


def test_focal_plane_resolution_in_every_unit():
    # 4000 pixels on a 23.6 mm sensor, 35 mm lens.
    expected = math.degrees(2 * math.atan(11.8 / 35))
    for unit, per_mm in ((2, 25.4), (3, 10.0), (4, 1.0), (5, 0.001)):
        tags = {
            "FocalLength": 35.0,
            "FocalPlaneXResolution": 4000 / 23.6 * per_mm,
            "FocalPlaneResolutionUnit": unit,
        }
        assert horizontal_fov(tags, 4000, 2667) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    "tags",
    [
        {},
        *({"FocalLengthIn35mmFilm": value} for value in (0, "fifty", float("nan"), 100000)),
        {"FocalLength": 35.0},
        {"FocalLength": 35.0, "FocalPlaneXResolution": 72.0, "FocalPlaneResolutionUnit": 2},
    ],
)
def test_tags_that_cannot_be_believed(tags):
    assert horizontal_fov(tags, 4000, 3000) is None


@pytest.mark.parametrize(
    ("name", "fov"),
    [
        ("photos/outdoor/autumn_road_exif.jpg", 65.470),  # 28 mm equivalent
        (
            "odd_inputs/orientation6_streetlamp_exif.jpg",
            4.646,
        ),  # 57.019 mm, 8427.98 pixels an inch, portrait
        ("odd_inputs/flower.heic", 56.40),  # 26 mm equivalent, portrait
    ],
)
def test_real_cameras(real_data, name, fov):
    photo = read_photo(real_data(f"data/{name}"), size=64)
    assert photo.fov_source == "exif" and photo.camera.fov == pytest.approx(fov, abs=0.01)
