"""The predictor maps:DIR: what it reads, what it mends, and what it refuses."""

import cv2
import numpy as np
import pytest
from made_maps import H, W, good_maps, write
from made_matnet import made_photo

from materialist.color import linear_to_srgb
from materialist.errors import InputError
from materialist.predict import get_predictor


def test_exr_maps_come_back_bit_for_bit(tmp_path):
    maps = good_maps()
    prediction = get_predictor(write(tmp_path, **maps)).predict(made_photo(H, W))
    assert prediction.warnings == () and prediction.predictor.startswith("maps:")
    for name in ("albedo", "roughness", "metallic"):
        assert np.array_equal(getattr(prediction.materials, name), maps[name])
    assert np.array_equal(prediction.depth, maps["depth"])
    assert np.allclose(prediction.normal, maps["normal"], atol=1e-6)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_png_maps_are_decoded_by_their_meaning(tmp_path, dtype):
    maps = good_maps()
    top = np.iinfo(dtype).max
    maps["depth"] /= maps["depth"].max()
    encoded = maps | {
        "albedo": linear_to_srgb(maps["albedo"]),
        "normal": maps["normal"] * 0.5 + 0.5,
    }
    for name, values in encoded.items():
        pixels = np.round(values * top).astype(dtype)
        cv2.imwrite(
            str(tmp_path / f"{name}.png"), pixels[..., ::-1] if pixels.ndim == 3 else pixels
        )
    prediction = get_predictor(f"maps:{tmp_path}").predict(made_photo(H, W))
    close = 1.5 / top
    assert np.allclose(linear_to_srgb(prediction.materials.albedo), encoded["albedo"], atol=close)
    assert np.allclose(prediction.materials.roughness, maps["roughness"], atol=close)
    assert np.allclose(prediction.materials.metallic, maps["metallic"], atol=close)
    assert np.allclose(prediction.depth, maps["depth"], atol=close)
    assert np.allclose(prediction.normal, maps["normal"], atol=4 * close)
    assert any("depth steps" in w for w in prediction.warnings) == (dtype == np.uint8)


def test_missing_maps_are_neutral_and_told(tmp_path):
    maps = good_maps()
    spec = write(tmp_path, albedo=maps["albedo"], depth=np.full((H, W), 2.0, np.float32))
    prediction = get_predictor(spec).predict(made_photo(H, W))
    assert (prediction.materials.roughness == 0.5).all()
    assert np.allclose(prediction.materials.metallic, 0.1)
    assert np.allclose(prediction.normal, [0, 0, 1], atol=1e-4)
    assert [w for w in prediction.warnings if "roughness" in w] and [
        w for w in prediction.warnings if "metallic" in w
    ]
    assert [w for w in prediction.warnings if "normal" in w]


def test_maps_of_other_sizes_are_resampled_and_told(tmp_path):
    maps = good_maps(2 * H, 2 * W)
    prediction = get_predictor(write(tmp_path, **maps)).predict(made_photo(H, W))
    assert prediction.materials.albedo.shape == (H, W, 3)
    assert prediction.depth.shape == prediction.materials.roughness.shape == (H, W)
    assert np.allclose(np.linalg.norm(prediction.normal, axis=-1), 1, atol=1e-5)
    assert sum("resampled" in w for w in prediction.warnings) == 5
    mean = maps["albedo"].reshape(H, 2, W, 2, 3).mean((1, 3))
    assert np.allclose(prediction.materials.albedo, mean, atol=1e-5)

    # No surface is made between near and far.
    depth = np.full((2 * H, 2 * W), 10.0, np.float32)
    depth[7:23, 9:31] = 2.0
    depth[:5] = 0
    prediction = get_predictor(write(tmp_path, **(maps | {"depth": depth}))).predict(
        made_photo(H, W)
    )
    assert set(np.unique(prediction.depth.round(4))) == {0.0, 2.0, 10.0}
    prediction = get_predictor(f"maps:{tmp_path}").predict(made_photo(3 * H, 3 * W))
    assert set(np.unique(prediction.depth.round(4))) == {0.0, 2.0, 10.0}


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("albedo", None, "no albedo.exr"),
        ("depth", None, "no depth.exr"),
        ("metallic", lambda v: np.zeros((W, W)), "32x32 and the photo is 32x20"),
        ("albedo", lambda v: v * 255, "divide by 255"),
        ("roughness", lambda v: v + np.nan, "NaN"),
        ("metallic", lambda v: v - 1, r"in \[0, 1\]"),
        ("depth", lambda v: -v, "negative depths"),
        ("depth", lambda v: v * 0, "0 everywhere"),
        ("normal", lambda v: v * 0.5 + 0.5, "encoded normals"),
        ("normal", lambda v: v * 3, "unit vectors"),
        ("normal", lambda v: v * [1, 1, -1], "points away"),
        ("normal", lambda v: v[..., 0], "one channel"),
        ("depth", lambda v: np.stack([v, 2 * v, v], -1), "one value a pixel"),
    ],
)
def test_maps_that_cannot_be_meant_are_refused(tmp_path, name, change, message):
    maps = good_maps()
    values = maps.pop(name)
    if change is not None:
        maps[name] = change(values)
    with pytest.raises(InputError, match=message):
        get_predictor(write(tmp_path, **maps)).predict(made_photo(H, W))


def test_slight_excess_is_clipped_and_told(tmp_path):
    maps = good_maps()
    maps["albedo"] = maps["albedo"] * 1.05
    maps["depth"][0, 0] = np.inf
    prediction = get_predictor(write(tmp_path, **maps)).predict(made_photo(H, W))
    assert prediction.materials.albedo.max() == 1
    assert prediction.depth[0, 0] == 0
    assert len(prediction.warnings) == 2


@pytest.mark.parametrize("far", [1e10, 3.4e38])
def test_depths_that_no_scene_has_are_sky(tmp_path, far):
    """Renderers write such numbers for rays that meet nothing; most of the picture may be such."""
    depth = np.full((H, W), far, np.float32)
    depth[H // 2 :] = 3
    depth[-1] = 4000
    found = get_predictor(write(tmp_path, **{**good_maps(), "depth": depth})).predict(
        made_photo(H, W)
    )
    assert (found.depth[: H // 2] == 0).all() and (found.depth[H // 2 :] == depth[H // 2 :]).all()
    assert any("taken as sky" in note for note in found.warnings)
