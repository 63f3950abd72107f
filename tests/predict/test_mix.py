"""A prior from several predictors."""

import numpy as np
import pytest
from made_matnet import made_photo
from test_moge import write as write_moge

from materialist.errors import InputError
from materialist.io.exr import write_exr
from materialist.predict import get_predictor
from materialist.predict.normals import normals_from_depth
from materialist.predict.protocol import MAPS

H, W = 20, 32


@pytest.fixture
def photo():
    return made_photo(H, W)


@pytest.fixture
def other(tmp_path):
    """maps:DIR with every map, all unlike those of `constant`."""
    folder = tmp_path / "other"
    folder.mkdir()
    rng = np.random.default_rng(8)
    normal = rng.normal(size=(H, W, 3)) * 0.2 + [0, 0, 1]
    maps = {
        "albedo": rng.random((H, W, 3)), "roughness": rng.random((H, W)), "metallic": rng.random((H, W)),
        "normal": normal / np.linalg.norm(normal, axis=-1, keepdims=True), "depth": 2 + rng.random((H, W)),
    }  # fmt: skip
    maps = {name: values.astype(np.float32) for name, values in maps.items()}
    for name, values in maps.items():
        write_exr(folder / f"{name}.exr", values)
    return f"maps:{folder}", maps


def all_maps(prediction):
    return {**vars(prediction.materials), "normal": prediction.normal, "depth": prediction.depth}


@pytest.mark.parametrize("name", ["albedo", "roughness", "metallic", "normal", "depth"])
def test_the_named_map_comes_from_its_source_and_the_rest_from_the_rest(name, photo, other):
    spec, theirs = other
    mixed = get_predictor("constant", **{name: spec}).predict(photo)
    plain = all_maps(get_predictor("constant").predict(photo))
    for key, values in all_maps(mixed).items():
        if key == "normal" and name == "depth":
            continue
        assert np.allclose(values, theirs[key] if key == name else plain[key], atol=1e-6), key
    assert list(mixed.sources) == list(MAPS)
    assert mixed.sources[name] == spec and mixed.sources["roughness" if name != "roughness" else "albedo"] == "constant"
    assert mixed.predictor == f"{name}: {spec}; " + ", ".join(k for k in MAPS if k != name) + ": constant" or (
        name != "albedo" and mixed.predictor.endswith(f"{name}: {spec}")
    )


def test_normals_that_follow_a_depth_follow_the_chosen_one(photo, other):
    spec, theirs = other
    mixed = get_predictor("constant", depth=spec).predict(photo)
    assert np.allclose(mixed.normal, normals_from_depth(theirs["depth"], photo.camera, radius=2), atol=1e-6)
    assert mixed.sources["normal"] == f"derived from the depth of {spec}"
    kept = get_predictor(spec, depth="constant").predict(photo)
    assert np.allclose(kept.normal, theirs["normal"], atol=1e-6) and kept.sources["normal"] == spec


def test_each_source_runs_once_and_unused_ones_never_open(photo, other, monkeypatch):
    from materialist.predict.maps import MapsPredictor

    runs = []
    parts = MapsPredictor.parts
    monkeypatch.setattr(MapsPredictor, "parts", lambda self, *a, **k: runs.append(1) or parts(self, *a, **k))
    spec, theirs = other
    mixed = get_predictor("maps:nowhere", **dict.fromkeys(MAPS, spec)).predict(photo)
    assert runs == [1] and np.array_equal(mixed.depth, theirs["depth"])


def test_moge_gives_depth_normals_and_the_field_of_view(photo, tmp_path):
    depth, _, seen = write_moge(tmp_path / "moge")
    spec = f"moge:{tmp_path / 'moge'}"
    predictor = get_predictor("constant", depth=spec, normal=spec)
    prediction = predictor.predict(photo)
    assert predictor.field_of_view == 61.23
    assert np.array_equal(prediction.depth, np.where(seen, depth, 0))
    assert prediction.sources["depth"] == prediction.sources["normal"] == spec
    assert get_predictor("constant", normal=spec).field_of_view is None


def test_bad_mixtures_are_refused(other, tmp_path):
    write_moge(tmp_path / "moge")
    for parts, word in (
        ({"albedo": f"moge:{tmp_path / 'moge'}"}, "gives only normal, depth, not albedo"),
        ({"depth": "nonsense"}, "no predictor 'nonsense'"),
        ({"colour": "constant"}, "no map 'colour'.*albedo"),
        ({"depth": "maps:nowhere"}, "no folder"),
    ):
        with pytest.raises(InputError, match=word):
            get_predictor("constant", **parts)
    assert get_predictor("constant", albedo=None, depth=None).name == "constant"


def test_a_folder_needs_only_the_maps_that_are_wanted(photo, tmp_path):
    albedo = np.full((H, W, 3), 0.25, np.float32)
    write_exr(tmp_path / "albedo.exr", albedo)
    mixed = get_predictor("constant", albedo=f"maps:{tmp_path}").predict(photo)
    assert np.array_equal(mixed.materials.albedo, albedo) and mixed.sources["depth"] == "constant"
    assert not any("There is no" in note for note in mixed.warnings)
    with pytest.raises(InputError, match="no depth"):
        get_predictor("constant", depth=f"maps:{tmp_path}").predict(photo)


def test_normals_that_will_be_derived_need_no_depth_of_their_own(photo, other, tmp_path):
    spec, theirs = other
    (tmp_path / "alone").mkdir()
    write_exr(tmp_path / "alone" / "albedo.exr", theirs["albedo"])
    mixed = get_predictor(f"maps:{tmp_path / 'alone'}", depth=spec).predict(photo)
    assert np.allclose(mixed.materials.albedo, theirs["albedo"], atol=1e-6)
    assert np.allclose(mixed.normal, normals_from_depth(theirs["depth"], photo.camera, radius=2), atol=1e-6)
    assert mixed.sources["normal"] == f"derived from the depth of {spec}"


def test_normals_that_are_unknown_come_from_the_chosen_depth(photo, other, tmp_path):
    """And need no depth beside them."""
    spec, theirs = other
    (tmp_path / "normals").mkdir()
    normal = theirs["normal"].copy()
    normal[:5] = 0
    write_exr(tmp_path / "normals" / "normal.exr", normal)
    mixed = get_predictor(spec, normal=f"maps:{tmp_path / 'normals'}").predict(photo)
    derived = normals_from_depth(theirs["depth"], photo.camera, radius=2)
    assert np.allclose(mixed.normal[:5], derived[:5], atol=1e-6)
    assert np.allclose(mixed.normal[5:], normal[5:], atol=1e-6)


def test_sky_of_one_source_is_no_surface_normal_of_another(photo, other, monkeypatch):
    """Where the rest saw sky, and the depth is someone else's, its placeholder is no normal, and its note is void."""
    from materialist.predict.bundled.predictor import BundledPredictor
    from materialist.predict.protocol import SKY_NOTE
    from materialist.types import Materials, Prediction

    spec, theirs = other
    depth, up = theirs["depth"].copy(), np.zeros((H, W, 3), np.float32)
    depth[:8], up[..., 1] = 0, 1
    up[:8] = [0, 0, 1]
    maps = Materials(theirs["albedo"], theirs["roughness"], theirs["metallic"])
    seen = Prediction(maps, up, depth, "seen", (f"40% {SKY_NOTE}", "Something else."))
    monkeypatch.setattr(BundledPredictor, "predict", lambda self, photo, seed=0: seen)
    mixed = get_predictor("bundled", depth=spec).predict(photo)
    assert np.allclose(mixed.normal[8:], [0, 1, 0]) and mixed.warnings == ("Something else.",)
    assert np.allclose(mixed.normal[:8], normals_from_depth(theirs["depth"], photo.camera, radius=2)[:8], atol=1e-6)
    assert any(SKY_NOTE in note for note in get_predictor("bundled", albedo=spec).predict(photo).warnings)
