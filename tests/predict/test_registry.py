"""Predictors by name, and the constant one."""

import numpy as np
import pytest
from made_matnet import made_photo

from materialist.errors import InputError, WeightsError
from materialist.predict import get_predictor


def test_the_constant_predictor_is_neutral_and_says_so():
    prediction = get_predictor("constant").predict(made_photo(20, 32))
    materials = prediction.materials
    assert materials.albedo.shape == (20, 32, 3) and (materials.albedo == 0.5).all()
    assert (materials.roughness == 0.5).all() and np.allclose(materials.metallic, 0.1)
    assert np.ptp(prediction.depth) == 0 and prediction.depth.min() > 0
    assert (prediction.normal == [0, 0, 1]).all()
    assert prediction.predictor == "constant" and "neutral" in prediction.warnings[0]


@pytest.mark.parametrize(
    ("spec", "message"),
    [
        ("nonsense", "no predictor 'nonsense'.*bundled"),
        ("classical", "no predictor 'classical'"),
        ("constant:x", "no predictor 'constant:x'"),
        ("auto:x", "no predictor 'auto:x'"),
        ("maps:", "needs a folder"),
        ("maps:nowhere", "no folder"),
        ("depth-anything", "gives only depth"),
    ],
)
def test_bad_names_are_refused(spec, message):
    with pytest.raises(InputError, match=message):
        get_predictor(spec)


def test_auto_is_the_bundled_network():
    assert get_predictor("auto").name == get_predictor("bundled").name
    with pytest.raises(WeightsError, match="no weights of the bundled network"):
        get_predictor("bundled:nowhere.safetensors")
