"""The built-in predictor: sane maps for any picture, and right ones where the prior holds."""

from pathlib import Path

import numpy as np
import pytest

from materialist.color import srgb_to_linear
from materialist.predict import get_predictor
from materialist.predict.layout import find_sky, guess_depth
from materialist.predict.retinex import separate
from materialist.types import Camera, Photo

PHOTOS = Path(__file__).parents[3] / "shared" / "data" / "photos"


def photo(linear: np.ndarray) -> Photo:
    return Photo(linear, Camera(linear.shape[1], linear.shape[0], 45.0), linear)


def assert_sane(prediction, shape: tuple[int, int]) -> None:
    materials = prediction.materials
    assert materials.albedo.shape == (*shape, 3) and prediction.normal.shape == (*shape, 3)
    assert materials.roughness.shape == materials.metallic.shape == prediction.depth.shape == shape
    assert materials.albedo.min() >= 0.03 and materials.albedo.max() <= 0.95
    assert np.isfinite(prediction.depth).all() and prediction.depth.min() >= 0 and prediction.depth.max() < 100
    assert np.allclose(np.linalg.norm(prediction.normal, axis=-1), 1, atol=1e-4)
    assert (materials.roughness == 0.5).all() and np.allclose(materials.metallic, 0.1)
    assert "classical" in prediction.warnings[0] and prediction.predictor == "classical"


@pytest.mark.parametrize("shape", [(8, 8), (3, 90), (90, 3), (64, 65), (1, 1)])
@pytest.mark.parametrize("content", ["noise", "black", "white"])
def test_any_picture_gets_sane_maps(shape, content):
    linear = np.full((*shape, 3), 1.0 if content == "white" else 0.0, np.float32)
    if content == "noise":
        linear = np.random.default_rng(1).random((*shape, 3)).astype(np.float32)
    assert_sane(get_predictor("classical").predict(photo(linear)), shape)


def test_it_is_deterministic():
    linear = np.random.default_rng(2).random((48, 64, 3)).astype(np.float32) ** 2
    a, b = (get_predictor("classical").predict(photo(linear), seed=seed) for seed in (1, 2))
    assert np.array_equal(a.depth, b.depth) and np.array_equal(a.materials.albedo, b.materials.albedo)


def test_auto_is_the_bundled_network_and_this_one_only_where_there_are_no_weights(monkeypatch, tmp_path):
    linear = np.random.default_rng(2).random((48, 64, 3)).astype(np.float32) ** 2
    assert get_predictor("auto").predict(photo(linear)).predictor.startswith("bundled step")
    monkeypatch.setattr("materialist.predict.bundled.WEIGHTS", tmp_path / "weights.safetensors")
    found = get_predictor("auto").predict(photo(linear))
    assert found.predictor == "classical"
    assert any("no weights of the bundled network" in note for note in found.warnings)


def test_soft_light_on_painted_squares_leaves_the_paint():
    """Mondrian: coloured patches under a smooth lamp; the ratio of patches must be that of the paint."""
    y, x = np.mgrid[0:96, 0:96]
    paint = np.array([[0.7, 0.2, 0.1], [0.1, 0.5, 0.2]])[((x // 24) + (y // 24)) % 2]
    light = 0.15 + 0.85 * np.exp(-(((x - 20) / 60.0) ** 2) - ((y - 30) / 60.0) ** 2)
    picture = (paint * light[..., None]).astype(np.float32)
    albedo, shading = separate(picture)
    assert np.allclose(albedo * shading[..., None], picture, atol=2e-3) or (albedo >= 0.92).any()
    spread = lambda values: np.mean([np.std(np.log(values[paint[..., 0] == p])) for p in (0.7, 0.1)])  # noqa: E731
    assert spread(albedo[..., 1]) < 0.5 * spread(picture[..., 1])
    assert np.corrcoef(np.log(shading.ravel()), np.log(light.ravel()))[0, 1] > 0.9


def standing_object(height: int = 120, width: int = 160) -> tuple[np.ndarray, np.ndarray]:
    """A red post before a grey wall on a brown floor: picture [H, W, 3] and the mask of the post."""
    picture = np.full((height, width, 3), [0.6, 0.6, 0.6], np.float32)
    picture[60:] = [0.35, 0.2, 0.08]
    post = np.zeros((height, width), bool)
    post[35:95, 70:95] = True
    picture[post] = [0.6, 0.05, 0.05]
    return picture, post


def test_a_thing_stands_upright_where_its_foot_is():
    picture, post = standing_object()
    depth = guess_depth(picture, Camera(160, 120, 45.0))
    floor = depth[94, 20]  # the floor beside the foot
    assert np.percentile(depth[post], 95) == pytest.approx(floor, rel=0.08)
    assert (depth[post] < 1.02 * floor).mean() > 0.95
    assert depth[40, 82] < 0.8 * depth[40, 20]  # its top is well before the wall
    assert depth[80, 82] < depth[80, 72]  # its middle comes forward


def test_the_ground_is_a_plane_that_recedes():
    picture, _ = standing_object()
    prediction = get_predictor("classical").predict(photo(picture))
    column = prediction.depth[70:, 10]
    assert (np.diff(column) < 0).all() and column[-1] == pytest.approx(1, rel=1e-3)
    inverse = 1 / column.astype(np.float64)
    assert np.abs(np.diff(inverse, 2)).max() < 1e-4
    assert prediction.normal[110, 20, 1] > 0.9
    assert prediction.normal[20, 20, 2] > 0.99


def test_blue_sky_has_no_surface_but_a_white_ceiling_has():
    picture, _ = standing_object()
    sky = picture.copy()
    sky[:30] = srgb_to_linear(np.array([0.45, 0.65, 0.95]))
    prediction = get_predictor("classical").predict(photo(sky))
    assert (prediction.depth[:28] == 0).all() and (prediction.depth[34:] > 0).all()
    assert any("sky" in w for w in prediction.warnings)
    ceiling = picture.copy()
    ceiling[:30] = 0.95
    assert not find_sky(ceiling).any()
    assert (get_predictor("classical").predict(photo(ceiling)).depth > 0).all()


@pytest.mark.skipif(not PHOTOS.is_dir(), reason="the shared data folder is absent")
def test_every_shared_photo_gets_sane_maps():
    import cv2

    files = [p for p in sorted(PHOTOS.glob("*/*")) if p.suffix in (".png", ".jpg") and "mask" not in p.name]
    assert len(files) > 20
    for path in files:
        pixels = cv2.imread(str(path), cv2.IMREAD_COLOR)[..., ::-1]
        scale = 128 / max(pixels.shape)
        pixels = cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        linear = srgb_to_linear(pixels / np.float32(255))
        assert_sane(get_predictor("classical").predict(photo(linear)), linear.shape[:2])
