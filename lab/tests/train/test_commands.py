"""`materialist train matnet`, as a user calls it."""

import made_samples
import pytest

from materialist.predict.bundled.network import BundledNetwork


def test_one_step_and_its_weights(done, data, tmp_path):
    small = ("--size", 32, "--batch", 1, "--workers", 0, "--score-samples", 0, "--device", "cpu")
    more = made_samples.write_set(tmp_path / "more", 3)
    report = done(
        "train",
        "matnet",
        "--data",
        data,
        "--data",
        more,
        "-o",
        tmp_path / "run",
        "--steps",
        1,
        *small,
    )
    assert report["step"] == 1
    weights = tmp_path / "run" / "weights.safetensors"
    assert weights.stat().st_size < 40e6, "what the package can hold"
    assert BundledNetwork.load(weights)[1]["data"] == {"samples": 7, "seed": [5, 5]}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["matnet", "-o", "run"], "--data"),
        (["matnet", "--data", "nowhere", "-o", "run", "--steps", "1"], "no data folder nowhere"),
        (["matnet", "--data", "DATA", "-o", "run", "--steps", "1", "--init", "x.pth"], "x.pth"),
    ],
)
def test_bad_input_is_named(arguments, said, refused, data, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert said in refused("train", *(data if a == "DATA" else a for a in arguments))
    assert not (tmp_path / "run").exists()
