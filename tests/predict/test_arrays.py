"""Priors of arrays: any of the five maps, checked and brought to size, the others from the predictor."""

import numpy as np
import pytest
import torch
from made_maps import good_maps
from made_matnet import made_photo

import materialist as mt
from materialist.errors import InputError
from materialist.predict import get_predictor
from materialist.predict.protocol import MAPS

H = 20
W = 32


@pytest.fixture
def photo():
    return made_photo(H, W)


def maps_of(prediction):
    return {**vars(prediction.materials), "normal": prediction.normal, "depth": prediction.depth}


@pytest.mark.parametrize("names", [("depth",), ("albedo", "normal"), MAPS])
def test_known_maps_are_kept_and_the_others_predicted(names, photo):
    known = {name: values for name, values in good_maps(H, W).items() if name in names}
    prediction = get_predictor("constant", prior=mt.Prior(**known)).predict(photo)
    found = maps_of(prediction)
    plain = maps_of(get_predictor("constant").predict(photo))
    for name in MAPS:
        if name in names:
            assert (
                np.allclose(found[name], known[name], atol=1e-6)
                and prediction.sources[name] == "arrays"
            )
        elif (name, "depth" in names) != ("normal", True):  # unknown normals follow the depth
            assert np.array_equal(found[name], plain[name])
    assert ("constant" in prediction.predictor) == (set(names) != set(MAPS))


def test_no_network_is_opened_where_all_is_known(photo, monkeypatch):
    monkeypatch.setattr(
        "materialist.predict.registry._open", lambda *_: pytest.fail("a predictor was opened")
    )
    prediction = get_predictor(prior=mt.Prior(**good_maps(H, W))).predict(photo)
    assert prediction.predictor == "arrays" and prediction.warnings == ()


def test_other_sizes_are_resampled_and_other_types_converted(photo):
    large = good_maps(2 * H, 2 * W)["depth"].astype(np.float64)
    prediction = get_predictor("constant", prior=mt.Prior(depth=large)).predict(photo)
    assert prediction.depth.shape == (H, W) and prediction.depth.dtype == np.float32
    assert any(
        "The prior's depth is 64x40 and was resampled to 32x20" in note
        for note in prediction.warnings
    )


@pytest.mark.parametrize(
    ("name", "values", "words"),
    [
        (
            "depth",
            np.ones((H, W, 3)),
            r"The prior's depth is float64\[20, 32, 3\]; give numbers of the shape \[H, W\]",
        ),
        ("normal", np.ones((H, W)), r"shape \[H, W, 3\]"),
        ("depth", np.full((H, W), np.nan), "The prior's depth has 640 NaN"),
        ("depth", np.zeros((H, W)), "is 0 everywhere"),
        ("albedo", np.full((H, W, 3), 200), "must be in"),
        ("normal", np.full((H, W, 3), 0.5), "no unit vectors|does not hold unit vectors"),
        ("roughness", np.full((H, H), 0.5), "aspect ratio"),
        ("metallic", np.full((H, W), "a"), "give numbers"),
        ("depth", 3.0, "shape"),
    ],
)
def test_maps_that_cannot_be_meant(name, values, words, photo):
    with pytest.raises(InputError, match=words):
        get_predictor("constant", prior=mt.Prior(**{name: values})).predict(photo)


def test_shapes_are_checked_at_once():
    with pytest.raises(InputError, match=r"The prior's normal is float64\[2, 3\]"):
        mt.Prior(normal=np.ones((2, 3)))
    with pytest.raises(InputError, match=r"The prior's depth is float64\[0, 3\]"):
        mt.Prior(depth=np.ones((0, 3)))
    for depth in ([[1, 2], [3]], torch.ones(2, 3, requires_grad=True)):
        with pytest.raises(InputError, match="The prior's depth is no array: "):
            mt.Prior(depth=depth)


def test_what_is_masked_is_not_taken_for_a_value():
    depth = np.ma.masked_greater(np.ones((H, W)) * 3, 2)
    with pytest.raises(InputError, match=r"The prior's depth is a masked array; .*filled"):
        mt.Prior(depth=depth)
    mt.Prior(depth=depth.filled(0))


def test_a_map_has_one_source():
    with pytest.raises(
        InputError, match="The depth is in the prior and has a predictor of its own"
    ):
        get_predictor("constant", depth="moge:there", prior=mt.Prior(depth=np.ones((H, W))))
