"""Records of arrays: equality by value, short texts, and pictures in notebooks."""

import io
import re
from base64 import b64decode
from dataclasses import fields, replace

import numpy as np
import pytest
from made_scene import make_body, make_scene
from PIL import Image

import materialist as mt
from materialist.records import Record, same
from materialist.types import FitReport, Materials


def test_equal_scenes_are_equal_and_one_number_makes_them_differ():
    assert make_scene() == make_scene() and make_scene() != make_scene(25)
    scene = make_scene()
    other = make_scene()
    other.materials.roughness[3, 4] += 1e-3
    assert scene != other and scene.materials != other.materials and scene.prior == other.prior
    for changed in (
        {"lamps": (mt.Lamp((0, 0, -1), (1, 1, 1), 0.1),)},
        {"bodies": (make_body(),)},
        {"provenance": {}},
    ):
        assert replace(scene, **changed) != scene
    assert scene != "kitchen" and make_body() == make_body()


def test_a_scene_is_equal_after_it_was_saved_and_read(tmp_path):
    scene = replace(make_scene(), bodies=(make_body(),))
    scene = replace(scene, provenance={**scene.provenance, "tool_version": mt.__version__})
    mt.save_scene(scene, tmp_path / "a.scene")
    assert mt.load_scene(tmp_path / "a.scene") == scene


@pytest.mark.parametrize(
    ("one", "other", "equal"),
    [
        (float("nan"), float("nan"), True),
        (float("nan"), 1.0, False),
        ([1, (2.0, float("nan"))], (1, [2.0, float("nan")]), True),
        ({"a": np.array([1, np.nan])}, {"a": np.array([1, np.nan])}, True),
        ({"a": 1}, {"b": 1}, False),
        (np.zeros((2, 3)), np.zeros((3, 2)), False),
        (np.zeros(2), 0.0, False),
        (FitReport(), FitReport(metrics={"a": 1.0}), False),
    ],
)
def test_values_of_every_kind(one, other, equal):
    assert same(one, other) is equal and same(other, one) is equal


def test_records_hold_no_hash_because_arrays_have_none():
    with pytest.raises(TypeError, match="unhashable"):
        hash(make_scene())


def test_the_text_of_a_scene_says_what_it_is_in_one_line():
    prior = replace(make_scene().prior, predictor="maps sha256:7f841f20b236bfc9")
    edited = replace(
        make_scene(), prior=prior, provenance={"edits": [{}, {}]}, bodies=(make_body(),)
    )
    assert repr(edited) == (
        "<Scene kitchen.PNG: 33 x 24 pixels, field of view 41.5 degrees, predictor maps, re-rendering 31.2 dB, "
        "2 edits, 1 body>"
    )


def test_the_text_of_a_record_names_shapes_and_no_numbers():
    map_ = np.zeros((4, 5), np.float32)
    text = repr(Materials(np.zeros((4, 5, 3), np.float32), map_, map_))
    assert (
        text
        == "Materials(albedo=float32[4, 5, 3], roughness=float32[4, 5], metallic=float32[4, 5])"
    )
    assert ", source=" not in repr(make_scene().photo)
    scene = make_scene()
    records = [getattr(scene, one.name) for one in fields(scene)]
    assert all(len(repr(record)) < 700 for record in records if isinstance(record, Record))


def test_notebooks_show_the_photo_beside_its_rerendering():
    scene = make_scene()
    shown = np.asarray(Image.open(io.BytesIO(scene._repr_png_())))
    assert shown.shape == (24, 66, 3)
    assert np.array_equal(shown[:, :33], np.asarray(Image.open(io.BytesIO(scene.photo.source))))
    page = replace(scene, photo=replace(scene.photo, path="<b>.png"))._repr_html_()
    picture = re.search(r'base64,([^"]+)"', page)
    assert "<b>" not in page and "&lt;b&gt;.png" in page
    assert b64decode(picture[1]) == scene._repr_png_()


def test_the_picture_of_a_large_scene_is_small():
    assert Image.open(io.BytesIO(make_scene(300, 1200)._repr_png_())).size == (960, 120)
