"""materialist models, and the options that mix predictors."""

import hashlib
import json

import numpy as np
import pytest
from made_pipeline import install
from PIL import Image

from materialist.cli import app
from materialist.cli.outcome import run_to_exit_code


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    monkeypatch.setenv("MATERIALIST_MODELS", str(tmp_path / "models"))
    monkeypatch.setenv("HF_ENDPOINT", "http://127.0.0.1:9")  # nothing listens there

    def call(*arguments):
        code = run_to_exit_code(app, [str(argument) for argument in arguments])
        shown = capsys.readouterr()
        return code, shown.out, shown.err

    return call


def put(tmp_path, content=b"weights"):
    """A finished download of the published MatNet."""
    folder = tmp_path / "models" / "Lez--MatNet"
    folder.mkdir(parents=True)
    (folder / "matnet_weights.pth").write_bytes(content)
    (folder / "SHA256SUMS").write_text(f"{hashlib.sha256(b'weights').hexdigest()}  matnet_weights.pth\n")


def test_list_says_what_is_here(run, tmp_path):
    code, out, _ = run("models", "list", "--json")
    models = {m["name"]: m for m in json.loads(out.splitlines()[-1])["models"]}
    assert code == 0 and not models["matnet"]["here"] and models["matnet"]["repo"] == "Lez/MatNet"
    put(tmp_path)
    code, out, _ = run("models", "list")
    assert next(line for line in out.splitlines() if " matnet" in line).startswith("here")
    assert next(line for line in out.splitlines() if "depth-anything" in line).startswith("-")


def test_verify(run, tmp_path):
    code, _, err = run("models", "verify")
    assert code == 2 and "models download" in err
    code, _, err = run("models", "verify", "matnet")
    assert code == 2 and "models download matnet" in err
    put(tmp_path)
    code, out, _ = run("models", "verify", "--json")
    assert code == 0 and list(json.loads(out.splitlines()[-1])["digests"]) == ["matnet"]
    (tmp_path / "models/Lez--MatNet/matnet_weights.pth").write_bytes(b"weightx")
    code, out, err = run("models", "verify", "--json")
    assert code == 2 and "damaged" in err and json.loads(out.splitlines()[-1])["error"] == "WeightsError"


def test_files_that_were_fetched_elsewhere_are_taken(run, tmp_path):
    source = tmp_path / "fetched"
    source.mkdir()
    code, _, err = run("models", "download", "depth-anything", "--from", source)
    assert code == 2 and "lacks config.json" in err
    for name, content in (("config.json", b"{}"), ("model.safetensors", b"weights"), ("notes.md", b"no")):
        (source / name).write_bytes(content)
    code, _, _ = run("models", "download", "depth-anything", "--from", source)
    folder = tmp_path / "models" / "depth-anything--Depth-Anything-V2-Small-hf"
    assert code == 0 and sorted(p.name for p in folder.iterdir()) == ["SHA256SUMS", "config.json", "model.safetensors"]
    code, out, _ = run("models", "list")
    assert next(line for line in out.splitlines() if "depth-anything" in line).startswith("here")


def test_models_by_hub_id_are_verified_too(run, tmp_path):
    put(tmp_path)
    (tmp_path / "models" / "Lez--MatNet").rename(tmp_path / "models" / "me--mine")
    code, out, _ = run("models", "verify", "--json")
    assert code == 0 and list(json.loads(out.splitlines()[-1])["digests"]) == ["me/mine"]


def test_download_without_a_hub_and_of_nothing(run):
    code, _, err = run("models", "download", "matnet")
    assert code == 2 and "cannot be reached" in err and "maps:DIR" in err
    assert run("models", "download", "nonsense")[0] == 2


def test_invert_with_absent_weights_names_both_ways_out(run, tmp_path):
    Image.fromarray(np.random.default_rng(0).integers(0, 256, (16, 16, 3)).astype(np.uint8)).save(tmp_path / "a.png")
    code, _, err = run("invert", tmp_path / "a.png", "-o", tmp_path / "a.scene", "--predictor", "matnet")
    assert code == 2 and "models download matnet" in err and "maps:DIR" in err and "Traceback" not in err
    assert not (tmp_path / "a.scene").exists()


def test_sources_of_single_maps_are_passed_on(run, tmp_path, monkeypatch):
    Image.fromarray(np.random.default_rng(0).integers(0, 256, (16, 16, 3)).astype(np.uint8)).save(tmp_path / "a.png")
    calls = install(monkeypatch)
    options = ("--albedo", "marigold", "--depth", "depth-anything", "--rest", "bundled")
    assert run("invert", tmp_path / "a.png", "-o", tmp_path / "a.scene", *options)[0] == 0
    named = {key: calls[0].get(key) for key in ("predictor", "albedo", "depth", "normal")}
    assert named == {"predictor": "bundled", "albedo": "marigold", "depth": "depth-anything", "normal": None}
