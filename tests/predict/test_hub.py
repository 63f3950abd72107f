"""Marigold and Depth Anything, with small random models: what goes in, what comes out, and what is refused."""

import os

import numpy as np
import pytest
from made_matnet import check_conventions, made_photo

from materialist.color import linear_to_srgb
from materialist.errors import WeightsError
from materialist.predict import get_predictor
from materialist.predict.protocol import MAPS
from materialist.predict.weights import sha256

pytestmark = [pytest.mark.filterwarnings("ignore"), pytest.mark.usefixtures("one_thread", "models")]
os.environ.setdefault("HF_HUB_OFFLINE", "1")


@pytest.fixture
def hub():
    """The module that makes small models; skips where the extra 'hub' is not installed."""
    for name in ("diffusers", "transformers"):
        pytest.importorskip(name, reason="needs the optional extra 'hub'")
    import made_hub

    return made_hub


@pytest.fixture
def marigold(hub, models):
    """All three Marigold models where a download would put them."""
    for repo, kind, settings in (
        (
            "iid-appearance",
            "MarigoldIntrinsicsPipeline",
            {"prediction_type": "intrinsics", "target_properties": hub.APPEARANCE},
        ),
        ("normals", "MarigoldNormalsPipeline", {"prediction_type": "normals"}),
        (
            "depth",
            "MarigoldDepthPipeline",
            {"prediction_type": "depth", "scale_invariant": True, "shift_invariant": True},
        ),
    ):
        list_files(
            hub.save_marigold(
                models / f"prs-eth--marigold-{repo}-v1-1", kind, half=repo == "depth", **settings
            )
        )
    return models


def list_files(folder):
    """The list of checksums that ends a download."""
    files = sorted(
        path for path in folder.rglob("*") if path.is_file() and path.name != "SHA256SUMS"
    )
    lines = [f"{sha256(path)}  {path.relative_to(folder).as_posix()}\n" for path in files]
    (folder / "SHA256SUMS").write_text("".join(lines))


def test_marigold_gives_all_maps_with_their_sources(marigold):
    photo = made_photo()
    prediction = get_predictor("marigold", device="cpu").predict(photo, seed=4)
    check_conventions(prediction, (20, 31))
    assert (
        all(np.ptp(values) > 0 for values in vars(prediction.materials).values())
        and prediction.depth.min() > 0
    )
    assert list(prediction.sources) == list(MAPS)
    assert all(
        "prs-eth/marigold" in text and "sha256:" in text for text in prediction.sources.values()
    )
    assert "far / near" in prediction.sources["depth"] and "fitted" in prediction.warnings[0]
    again = get_predictor("marigold", device="cpu").predict(photo, seed=4)
    assert np.array_equal(again.materials.albedo, prediction.materials.albedo)


def test_marigold_sees_srgb_and_only_the_wanted_model_runs(marigold, monkeypatch):
    from diffusers import MarigoldIntrinsicsPipeline as Appearance

    seen = []
    call = Appearance.__call__
    monkeypatch.setattr(
        Appearance,
        "__call__",
        lambda self, image, **k: seen.append(image) or call(self, image, **k),
    )
    photo = made_photo()
    prediction = get_predictor("constant", albedo="marigold", device="cpu").predict(photo)
    assert len(seen) == 1 and np.allclose(seen[0][0], linear_to_srgb(photo.linear))
    assert prediction.sources["depth"] == prediction.sources["metallic"] == "constant"


def test_a_damaged_or_incomplete_marigold_is_refused(marigold):
    from safetensors.torch import load_file, save_file

    folder = marigold / "prs-eth--marigold-normals-v1-1"
    weights = folder / "unet" / "diffusion_pytorch_model.safetensors"
    state = load_file(weights)
    del state["conv_in.bias"]
    save_file(state, weights)

    def ask():
        return get_predictor("constant", normal="marigold", device="cpu").predict(made_photo())

    with pytest.raises(WeightsError, match=r"unet.*is damaged.*expected"):
        ask()
    list_files(folder)
    with pytest.raises(WeightsError, match=r"unet.*lacks conv_in\.bias"):
        ask()
    weights.write_bytes(b"short")
    list_files(folder)
    with pytest.raises(WeightsError, match="UNet2DConditionModel"):
        ask()
    (folder / "model_index.json").write_text('{"_class_name": "StableDiffusionPipeline"}')
    with pytest.raises(WeightsError, match="StableDiffusionPipeline"):
        get_predictor("constant", normal=f"marigold:{folder}")


def test_depth_anything_relative_and_metric(hub, models, tmp_path):
    list_files(hub.save_depth_anything(models / "depth-anything--Depth-Anything-V2-Small-hf"))
    photo = made_photo(30, 40)
    prediction = get_predictor("constant", depth="depth-anything", device="cpu").predict(photo)
    assert (
        prediction.depth.shape == (30, 40)
        and prediction.depth.min() > 0
        and np.ptp(prediction.depth) > 0
    )
    assert (
        "Depth-Anything" in prediction.sources["depth"] or "V2 Small" in prediction.sources["depth"]
    )
    assert any("far / near = 4.0 was assumed" in note for note in prediction.warnings)
    metric = hub.save_depth_anything(
        tmp_path / "metric", depth_estimation_type="metric", max_depth=20
    )
    part = get_predictor("constant", depth=f"depth-anything:{metric}", device="cpu").predict(photo)
    assert (
        part.depth.min() > 0 and part.depth.max() < 20 and part.sources["depth"].endswith("metric")
    )


@pytest.mark.parametrize(
    ("spec", "part", "words"),
    [
        ("marigold", "albedo", "models download marigold-appearance.*maps:DIR"),
        ("marigold", "depth", "models download marigold-depth.*maps:DIR"),
        ("marigold:someone/theirs", "normal", "models download someone/theirs.*maps:DIR"),
        ("depth-anything", "depth", "models download depth-anything.*maps:DIR"),
        ("depth-anything:nowhere", "depth", "no folder"),
        ("matnet", "albedo", "matnet_weights.pth.*Lez/MatNet.*models download matnet.*maps:DIR"),
        ("matnet:someone/theirs", "albedo", "models download someone/theirs"),
        ("matnet:none.pth", "albedo", "no file none.pth.*models download matnet.*maps:DIR"),
    ],
)
def test_absent_models_say_how_to_get_them(spec, part, words, monkeypatch):
    monkeypatch.setattr("materialist.predict.hub.import_library", lambda name: None)
    with pytest.raises(WeightsError, match=words):
        get_predictor("constant", **{part: spec})
