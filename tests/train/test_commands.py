"""`materialist train matnet`, as a user calls it."""

import json

import made_samples
import pytest
from typer.testing import CliRunner

from materialist.cli import app
from materialist.cli.outcome import run_to_exit_code
from materialist.predict.bundled.network import BundledNetwork


def _call(*arguments):
    result = CliRunner().invoke(app, ["train", *map(str, arguments)])
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout.strip().splitlines()[-1])


def test_one_step_and_its_weights(data, tmp_path):
    small = ("--size", 32, "--batch", 1, "--workers", 0, "--score-samples", 0, "--device", "cpu", "--json")
    more = made_samples.write_set(tmp_path / "more", 3)
    made = _call("matnet", "--data", data, "--data", more, "-o", tmp_path / "run", "--steps", 1, *small)
    assert made["step"] == 1
    weights = tmp_path / "run" / "weights.safetensors"
    assert weights.stat().st_size < 40e6, "what the package can hold"
    assert BundledNetwork.load(weights)[1]["data"] == {"samples": 7, "seed": [5, 5]}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["matnet", "-o", "run"], "--data"),
        (["matnet", "--data", "DATA", "-o", "run"], "either --steps or --minutes"),
        (["matnet", "--data", "nowhere", "-o", "run", "--steps", "1"], "no data folder nowhere"),
        (["matnet", "--data", "DATA", "-o", "run", "--steps", "1", "--init", "x.pth"], "x.pth"),
    ],
)
def test_bad_input_is_named(arguments, said, data, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run_to_exit_code(app, ["train", *(str(data) if a == "DATA" else a for a in arguments)]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "run").exists()
