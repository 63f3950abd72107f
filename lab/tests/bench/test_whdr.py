"""WHDR on hand-made judgements with known answers."""

import json

import cv2
import numpy as np
import pytest

from materialist.errors import InputError
from materialist_lab import bench
from materialist_lab.bench.whdr import whdr


def _points(*places, opaque=True):
    return [{"id": k, "x": x, "y": y, "opaque": opaque} for k, (x, y) in enumerate(places)]


def _says(point1, point2, darker, score=1.0):
    return {"point1": point1, "point2": point2, "darker": darker, "darker_score": score}


ALBEDO = np.array([0.2, 0.4, 0.42], np.float32)[None, :, None] * np.ones((4, 1, 3), np.float32)
"""Three columns, grey."""
POINTS = _points((0.1, 0.5), (0.5, 0.5), (0.9, 0.5))


@pytest.mark.parametrize(
    ("comparisons", "expected"),
    [
        ([_says(0, 1, "1")], 0.0),  # the first point is the darker one, and the albedo says so
        ([_says(0, 1, "2")], 1.0),
        ([_says(1, 0, "2")], 0.0),
        ([_says(1, 2, "E")], 0.0),  # 5 % apart: less than delta
        ([_says(1, 2, "1")], 1.0),
        ([_says(0, 1, "E")], 1.0),
        ([_says(0, 1, "1", 3.0), _says(0, 2, "2", 1.0)], 0.25),  # weighted
        (
            [_says(0, 1, "1"), _says(0, 1, "2", 0.0), _says(0, 1, "2", None), _says(0, 1, "?")],
            0.0,
        ),  # do not count
    ],
)
def test_known_answers(comparisons, expected):
    judged = {"intrinsic_points": POINTS, "intrinsic_comparisons": comparisons}
    error, count = whdr(ALBEDO, judged)
    assert error == pytest.approx(expected) and count >= 1
    transparent = _points((0.1, 0.5), (0.5, 0.5), (0.9, 0.5), opaque=False)
    error, count = whdr(ALBEDO, {**judged, "intrinsic_points": transparent})
    assert np.isnan(error) and count == 0
    apart = {**judged, "intrinsic_comparisons": [_says(1, 2, "1")]}
    assert [whdr(ALBEDO, apart, delta=delta)[0] for delta in (0.04, 0.06)] == [0, 1], (
        "a relative threshold"
    )


def test_the_benchmark_from_a_folder(tmp_path, measured):
    data = tmp_path / "iiw"
    data.mkdir()
    picture = np.zeros((40, 60, 3), np.uint8)
    picture[:, :30], picture[:, 30:] = 60, 200
    cv2.imwrite(str(data / "17.png"), picture)
    judged = {
        "intrinsic_points": _points((0.25, 0.5), (0.75, 0.5), (0.75, 0.2)),
        "intrinsic_comparisons": [_says(0, 1, "1"), _says(1, 2, "E")],
    }
    (data / "17.json").write_text(json.dumps(judged))
    (data / "18.json").write_text("{}")  # no picture: not part of the set
    means = measured("whdr", data=data, predictor="constant", size=60).means
    assert means["photo"]["whdr"] == 0 and means["constant"]["whdr"] == 0.5


@pytest.mark.parametrize(
    "text",
    [
        "[]",
        "no JSON",
        '{"intrinsic_points": [], "intrinsic_comparisons": [{"point1": 1}]}',
        '{"intrinsic_points": [{"id": 1}], "intrinsic_comparisons": '
        '[{"point1": 1, "point2": 7, "darker": "1", "darker_score": 1}]}',
    ],
)
def test_what_is_no_judgement_is_told(tmp_path, text):
    cv2.imwrite(str(tmp_path / "1.png"), np.arange(4800).reshape(40, 40, 3).astype(np.uint8))
    (tmp_path / "1.json").write_text(text)
    with pytest.raises(InputError, match=r"1.json.*IIW's layout"):
        bench.run("whdr", data=tmp_path, output=tmp_path / "report", predictor="constant")
