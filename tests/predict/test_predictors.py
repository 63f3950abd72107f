"""Predictors by name, the constant one, and a prior from several predictors."""

import json

import cv2
import numpy as np
import pytest
from made_maps import good_maps, write
from made_matnet import made_photo

from materialist.errors import InputError, WeightsError
from materialist.io.exr import write_exr
from materialist.predict import get_predictor
from materialist.predict.bundled import predictor
from materialist.predict.normals import normals_from_depth
from materialist.predict.protocol import MAPS
from materialist.types import Materials, Prediction

H = 20
W = 32


@pytest.fixture
def photo():
    return made_photo(H, W)


@pytest.fixture
def other(tmp_path):
    """maps:DIR with every map, all unlike those of `constant`."""
    folder = tmp_path / "other"
    maps = good_maps(H, W)
    folder.mkdir()
    return write(folder, **maps), maps


def write_moge(folder):
    """MoGe's own layout; returns depth [H, W], normals [H, W, 3] in our frame, and the mask [H, W]."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(2)
    depth = (2 + rng.random((H, W))).astype(np.float32)
    normals = rng.normal(size=(H, W, 3)) * [0.5, 0.5, 0.1] + [0, 0, 1]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    seen = np.ones((H, W), bool)
    seen[:4, 10:] = False
    write_exr(folder / "depth.exr", np.where(seen, depth, np.inf).astype(np.float32))
    # MoGe: +Y down, +Z into the picture; colour = n * (0.5, -0.5, -0.5) + 0.5
    theirs = np.where(seen[..., None], normals * [1, -1, -1], 0)
    colour = ((theirs * [0.5, -0.5, -0.5] + 0.5).clip(0, 1) * 255).astype(np.uint8)
    cv2.imwrite(str(folder / "normal.png"), cv2.cvtColor(colour, cv2.COLOR_RGB2BGR))
    cv2.imwrite(str(folder / "mask.png"), (seen * 255).astype(np.uint8))
    (folder / "fov.json").write_text(json.dumps({"fov_x": 61.23, "fov_y": 40.0}))
    return depth, normals, seen


def all_maps(prediction):
    return {**vars(prediction.materials), "normal": prediction.normal, "depth": prediction.depth}


def test_the_constant_predictor_is_neutral_and_says_so(photo):
    prediction = get_predictor("constant").predict(photo)
    materials = prediction.materials
    assert materials.albedo.shape == (20, 32, 3) and (materials.albedo == 0.5).all()
    assert (materials.roughness == 0.5).all() and np.allclose(materials.metallic, 0.1)
    assert np.ptp(prediction.depth) == 0 and prediction.depth.min() > 0
    assert np.allclose(prediction.normal, [0, 0, 1], atol=1e-4)
    assert prediction.predictor == "constant" and "neutral" in prediction.warnings[0]


def test_auto_is_the_bundled_network():
    assert get_predictor("auto").name == get_predictor("bundled").name
    with pytest.raises(WeightsError, match="no weights of BundledNetwork"):
        get_predictor("bundled:nowhere.safetensors")


@pytest.mark.parametrize("name", MAPS)
def test_the_named_map_comes_from_its_source_and_the_rest_from_the_rest(name, photo, other):
    spec, theirs = other
    mixed = get_predictor("constant", **{name: spec}).predict(photo)
    plain = all_maps(get_predictor("constant").predict(photo))
    if name == "depth":  # normals that nobody knows follow the depth
        plain["normal"] = normals_from_depth(theirs["depth"], photo.camera, radius=2)
    for key, values in all_maps(mixed).items():
        assert np.allclose(values, theirs[key] if key == name else plain[key], atol=1e-6), key
    assert list(mixed.sources) == list(MAPS) and mixed.sources[name] == spec
    assert mixed.sources["roughness" if name != "roughness" else "albedo"] == "constant"
    assert f"{name}: {spec}" in mixed.predictor
    assert mixed.sources["normal"] == (
        spec if name == "normal" else f"derived from the depth of {mixed.sources['depth']}"
    )


def test_a_folder_needs_only_the_maps_that_are_wanted(photo, other, tmp_path):
    spec, theirs = other
    albedo = np.full((H, W, 3), 0.25, np.float32)
    write_exr(tmp_path / "albedo.exr", albedo)
    mixed = get_predictor("constant", albedo=f"maps:{tmp_path}").predict(photo)
    assert np.array_equal(mixed.materials.albedo, albedo) and mixed.sources["depth"] == "constant"
    assert not any("There is no" in note for note in mixed.warnings)
    derived = normals_from_depth(theirs["depth"], photo.camera, radius=2)
    assert np.allclose(
        get_predictor(f"maps:{tmp_path}", depth=spec).predict(photo).normal, derived, atol=1e-6
    )
    with pytest.raises(InputError, match="no depth"):
        get_predictor("constant", depth=f"maps:{tmp_path}").predict(photo)


def test_sky_of_one_source_is_no_surface_normal_of_another(photo, other, monkeypatch):
    """Where the network saw sky, and the depth is someone else's, it knows no normal, and its note is void."""
    spec, theirs = other
    depth = theirs["depth"].copy()
    up = np.zeros((H, W, 3), np.float32)
    depth[:8], up[..., 1] = 0, 1
    up[:8] = [0, 0, 1]
    materials = Materials(theirs["albedo"], theirs["roughness"], theirs["metallic"])
    seen = Prediction(materials, up, depth, warnings=("40% of the picture was taken for sky.",))
    monkeypatch.setattr(predictor, "infer_bundled", lambda *_, **__: seen)
    mixed = get_predictor("bundled", depth=spec).predict(photo)
    assert np.allclose(mixed.normal[8:], [0, 1, 0]) and mixed.warnings == ()
    assert np.allclose(
        mixed.normal[:8], normals_from_depth(theirs["depth"], photo.camera, radius=2)[:8], atol=1e-6
    )
    assert "40% of the picture" in get_predictor("bundled", albedo=spec).predict(photo).warnings[0]


def test_moge_gives_depth_normals_and_the_field_of_view(photo, tmp_path):
    depth, normals, seen = write_moge(tmp_path / "moge" / "kitchen")
    spec = f"moge:{tmp_path / 'moge'}"  # the outer folder is enough when it holds one result
    predictor = get_predictor("constant", depth=spec, normal=spec)
    prediction = predictor.predict(photo)
    assert predictor.field_of_view == 61.23
    assert np.array_equal(prediction.depth, np.where(seen, depth, 0))
    assert (prediction.normal * normals).sum(-1)[seen].min() > 0.999
    assert prediction.sources["depth"] == prediction.sources["normal"] == f"{spec}/kitchen"
    assert get_predictor("constant", normal=spec).field_of_view is None
    small = predictor.predict(made_photo(H // 2, W // 2))
    assert small.depth.shape == (10, 16) and small.normal.shape == (10, 16, 3)
    with pytest.raises(InputError, match="aspect ratio"):
        predictor.predict(made_photo(20, 20))


@pytest.mark.parametrize(
    ("spec", "parts", "message"),
    [
        ("nonsense", {}, "no predictor 'nonsense'.*bundled"),
        ("constant:x", {}, "no predictor 'constant:x'"),
        ("maps:", {}, "needs a folder"),
        ("maps:nowhere", {}, "no folder"),
        ("moge:", {}, "needs a folder"),
        ("moge:EMPTY", {}, "no depth.exr"),
        ("moge:MOGE", {}, "gives only normal, depth, not albedo.*`depth=.moge:"),
        ("moge:TWO", {}, "several results .garden, kitchen"),
        ("depth-anything", {}, "gives only depth.*`depth="),
        ("constant", {"albedo": "moge:MOGE"}, "gives only normal, depth, not albedo"),
        ("constant", {"colour": "constant"}, "no map 'colour'.*albedo"),
    ],
)
def test_bad_names_are_refused(spec, parts, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "EMPTY").mkdir()
    for folder in ("MOGE", "TWO/kitchen", "TWO/garden"):
        write_moge(tmp_path / folder)
    with pytest.raises(InputError, match=message):
        get_predictor(spec, **parts)
