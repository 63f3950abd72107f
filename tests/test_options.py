"""Options of the operations: values, texts, ranges, and what is said of a wrong one."""

from dataclasses import fields

import numpy as np
import pytest

from materialist import Drop, Glass, Insertion, InvertOptions, MaterialEdit, Relight, Removal
from materialist.cli.options import Rendering
from materialist.color import srgb_to_linear
from materialist.errors import InputError
from materialist.options import ExportOptions

ALL = (MaterialEdit, Removal, Glass, Relight, Insertion, Drop, InvertOptions, ExportOptions)


@pytest.mark.parametrize("kind", ALL)
def test_defaults_pass_their_own_checks_and_every_field_is_declared(kind):
    assert kind.merged() == kind() and all("option" in field.metadata for field in fields(kind))
    with pytest.raises(
        InputError, match=rf"^{kind.operation} has no option 'colour'; it takes \w+, "
    ):
        kind.merged(colour="red")


def test_given_values_replace_those_of_the_options():
    base = Glass(ior=1.3, tint="#ff8000")
    got = Glass.merged(base, transmission=0.9)
    assert (got.ior, got.transmission, got.seed) == (1.3, 0.9, 0)
    assert (
        got.tint == base.tint == pytest.approx(tuple(srgb_to_linear(np.float32([1, 128 / 255, 0]))))
    )


def test_texts_mean_what_the_values_do(tmp_path):
    got = Glass.read(
        {"ior": "1.2", "hollow": "yes", "tint": ["1", "0.5", "0"], "background": "b.png"},
        folder=tmp_path,
    )
    assert got == Glass(ior=1.2, hollow=True, tint=(1, 0.5, 0), background=tmp_path / "b.png")
    assert Glass.read({"thickness": "symmetry", "shadow": "auto"}) == Glass(thickness="symmetry")
    assert Removal.read({"shadow": "0.5"}, seed=3) == Removal(shadow=0.5, seed=3)
    assert MaterialEdit.read({"roughness": "+0.25", "metallic": "1"}) == MaterialEdit(
        roughness="+0.25", metallic=1
    )
    assert Insertion.read({"material": ["0.1", "0.2", "0.3"]}).material == "0.1,0.2,0.3"
    assert InvertOptions.read({"envmap_size": "64x32", "fov": "auto"}).envmap_size == (64, 32)
    for lamps in (
        "1,2,3,4,5",
        ["1", "2", "3", "4", "5"],
        [["1", "2", "3", "4", "5"]],
        ["1,2,3,4,5"],
    ):
        assert Relight.read({"lamps": lamps}).lamps == ((1, 2, 3, 4, 5),)
    assert len(Relight.read({"lamps": ["1,2,3,4,5", "5,4,3,2,1"]}).lamps) == 2


@pytest.mark.parametrize(
    ("kind", "values", "words"),
    [
        (MaterialEdit, {"hue": "blue"}, "The hue must be a number, not 'blue'."),
        (MaterialEdit, {"roughness": 3}, "The roughness is 3; it must lie in [0, 1]."),
        (MaterialEdit, {"roughness": "rough"}, "a shift such as +0.5, not 'rough'"),
        (MaterialEdit, {"texture_scale": 0}, "The texture scale is 0; it must lie in (0, 100]."),
        (MaterialEdit, {"albedo": (0.1, 2, 0)}, "must be R,G,B with three numbers in [0, 1]"),
        (Glass, {"ior": 0.9}, "The index of refraction is 0.9; it must lie in [1, 3] (water 1.33"),
        (Glass, {"tint": "#88ccf"}, "The tint '#88ccf' must look like"),
        (Glass, {"hollow": "maybe"}, "The hollow must be true or false, or open, not 'maybe'."),
        (Removal, {"seed": -2}, "The seed is -2; it must lie in [0, 2147483647]."),
        (Removal, {"seed": 1.5}, "The seed is 1.5; give a whole number."),
        (Removal, {"shadow": "yes"}, "The shadow must be a number, or auto, not 'yes'."),
        (Relight, {"rotate": float("nan")}, "The rotation is nan; give a finite number."),
        (Relight, {"rotate": "1..b"}, "The rotation must be a number, or A..B, not 'b'."),
        (
            Rendering,
            {"upscale": "none.py:twice"},
            "The upscale is none.py:twice; give FILE.py:FUNCTION",
        ),
        (Rendering, {"upscale": f"{__file__}:twice"}, "has no function 'twice'"),
        (Glass, {"back": "same"}, "which only the two-interface model knows"),
        (MaterialEdit, {"hue": 10**400}, "The hue must be a number, not 1000"),
        (Relight, {"sun": (float("nan"), 2)}, "The sun must be 2 numbers"),
        (Relight, {"lamps": [[0, 1e400, 2, 3, 4]]}, "The lamp must be 5 numbers"),
        (
            InvertOptions,
            {"envmap_size": (512.7, 256.9)},
            "The envmap size is 512.7; give a whole number.",
        ),
        (
            InvertOptions,
            {"envmap_size": (float("inf"), 1)},
            "The envmap size is inf; give a finite number.",
        ),
        (Relight, {"sun": (1, 2, 3)}, "The sun must be 2 numbers"),
        (Relight, {"lamps": [[1, 2, 3]]}, "The lamp must be 5 numbers"),
        (
            Insertion,
            {"material": "wood"},
            "The material is 'wood'; give as-is, glass, mirror, R,G,B",
        ),
        (
            InvertOptions,
            {"envmap_size": (64, 64)},
            "The envmap size is 64x64; it must be twice as wide",
        ),
        (InvertOptions, {"envmap_size": "512"}, "must look like 512x256, not '512'"),
        (
            ExportOptions,
            {"max_triangles": 99},
            "The number of triangles is 99; it must lie in [100, ",
        ),
        (InvertOptions, {"tau": 90}, "The tau is 90; it must lie in (0, 90) degrees."),
    ],
)
def test_wrong_values_are_named_with_what_may_be_given(kind, values, words):
    with pytest.raises(InputError) as error:
        kind(**values)
    assert words in str(error.value)


def test_an_option_that_says_nothing_alone():
    with pytest.raises(
        InputError, match="gain says nothing without envmap; give that, too, or leave gain out"
    ):
        Relight.read({"gain": "3"})
    with pytest.raises(InputError, match="--texture-scale says nothing without --texture"):
        MaterialEdit.read({"texture_scale": 2.0}, flags=True)
    assert MaterialEdit.read({"texture_scale": 1.0}) == MaterialEdit()
