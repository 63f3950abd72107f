"""`doctor` never raises, and every failing line has the command that mends it; `models`, and what mixes predictors."""

import hashlib
import json
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from materialist import doctor
from materialist.doctor import Finding

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(autouse=True)
def nothing_there(models, monkeypatch):
    """No model on this machine, and no hub."""
    monkeypatch.setenv("HF_ENDPOINT", "http://127.0.0.1:9")  # nothing listens there


@pytest.mark.parametrize(
    ("code", "said", "detail", "remedy"),
    [
        (-6, "Cannot select", "exit -6: Cannot select", "sudo apt-get install -y libllvm19"),
        (
            1,
            "ImportError: libatomic.so.1: cannot open shared object file: No such file or directory\n\nNameError: name",
            "libatomic.so.1 is missing",
            "sudo apt-get install -y libatomic1",
        ),
        (None, "", "the probe did not finish", "materialist doctor"),
    ],
)
def test_a_renderer_that_fails_in_its_child_is_survived(monkeypatch, code, said, detail, remedy):
    def probe(command, **_):
        if code is None:
            raise subprocess.TimeoutExpired("python", 120)
        return subprocess.CompletedProcess(command, code, "", said)

    monkeypatch.setattr(doctor.subprocess, "run", probe)
    finding = doctor._renderer("/wrong/libLLVM.so")
    assert (
        finding.state == "broken" and finding.detail.startswith(detail) and finding.remedy == remedy
    )


def test_a_missing_extra_names_the_one_that_brings_it(monkeypatch):
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"][
        "optional-dependencies"
    ]
    packages = {
        re.match(r"[\w-]+", entry)[0]: extra
        for extra, entries in extras.items()
        for entry in entries
        if extra not in ("app", "dev")
    }

    def nothing(name):
        raise doctor.PackageNotFoundError(name)

    monkeypatch.setattr(doctor, "version", nothing)
    findings = {name: doctor._package(name, *what) for name, what in doctor._EXTRAS.items()}
    assert set(findings) == set(packages), "every package of an extra is looked for, and no other"
    for name, finding in findings.items():
        assert finding.state == "missing"
        assert name in finding.remedy


def test_a_driver_without_optix_is_no_gpu(monkeypatch):
    class Answer:
        stdout = "NVIDIA H100, 550.1\n"

    monkeypatch.setattr(doctor.shutil, "which", lambda name: name)
    monkeypatch.setattr(doctor.subprocess, "run", lambda *_, **__: Answer())
    for gpus, state in ((0, "broken"), (1, "ok")):
        monkeypatch.setattr(doctor, "usable_gpus", lambda gpus=gpus: gpus)
        assert doctor._cuda(needed=True).state == state and "H100" in doctor._cuda().detail


@pytest.mark.parametrize(("state", "code"), [("ok", 0), ("missing", 0), ("broken", 2)])
def test_exit_code_follows_the_main_job(run, monkeypatch, state, code):
    monkeypatch.setattr(doctor, "examine", lambda device: [Finding("LLVM", state, "19", "mend it")])
    got, shown, _ = run("doctor")
    assert got == code and "LLVM" in shown and "mend it" in shown
    got, shown, _ = run("doctor", "--json")
    last = json.loads(shown.splitlines()[-1])
    assert got == code and last["ok"] is (code == 0) and last["findings"][0]["remedy"] == "mend it"


def test_this_machine():
    findings = {finding.name: finding for finding in doctor.examine()}
    assert findings["Python"].state == "ok" and findings["torch"].state == "ok"
    for finding in findings.values():
        assert finding.state in ("ok", "missing", "broken")
        assert finding.state != "broken" or finding.remedy


def put(tmp_path, content=b"weights"):
    """A finished download of the published MatNet."""
    folder = tmp_path / "models" / "Lez--MatNet"
    folder.mkdir(parents=True)
    (folder / "matnet_weights.pth").write_bytes(content)
    (folder / "SHA256SUMS").write_text(
        f"{hashlib.sha256(b'weights').hexdigest()}  matnet_weights.pth\n"
    )


def test_list_says_what_is_here(run, done, tmp_path):
    models = {m["name"]: m for m in done("models", "list")["models"]}
    assert not models["matnet"]["here"] and models["matnet"]["repo"] == "Lez/MatNet"
    put(tmp_path)
    out = run("models", "list")[1]
    assert next(line for line in out.splitlines() if " matnet" in line).startswith("here")
    assert next(line for line in out.splitlines() if "depth-anything" in line).startswith("-")


def test_verify(run, done, refused, tmp_path):
    for name, words in ((), "models download"), (("matnet",), "models download matnet"):
        assert words in refused("models", "verify", *name)
    put(tmp_path)
    assert list(done("models", "verify")["digests"]) == ["matnet"]
    weights = tmp_path / "models/Lez--MatNet/matnet_weights.pth"
    for spoil, words in (
        (lambda: weights.write_bytes(b"weightx"), "is damaged"),
        (weights.unlink, "lacks matnet_weights.pth"),
        (lambda: weights.with_name("SHA256SUMS").write_text(""), "no list of checksums"),
    ):
        spoil()
        code, out, err = run("models", "verify", "matnet", "--json")
        assert (
            code == 2
            and words in err
            and json.loads(out.splitlines()[-1])["error"] == "WeightsError"
        )


def test_files_that_were_fetched_elsewhere_are_taken(run, done, refused, tmp_path):
    source = tmp_path / "fetched"
    source.mkdir()
    assert "lacks config.json" in refused("models", "download", "depth-anything", "--from", source)
    for name, content in (
        ("config.json", b"{}"),
        ("model.safetensors", b"weights"),
        ("notes.md", b"no"),
    ):
        (source / name).write_bytes(content)
    done("models", "download", "depth-anything", "--from", source)
    folder = tmp_path / "models" / "depth-anything--Depth-Anything-V2-Small-hf"
    assert sorted(p.name for p in folder.iterdir()) == [
        "SHA256SUMS",
        "config.json",
        "model.safetensors",
    ]
    out = run("models", "list")[1]
    assert next(line for line in out.splitlines() if "depth-anything" in line).startswith("here")


def test_download_without_a_hub_and_of_nothing(refused):
    err = refused("models", "download", "matnet")
    assert "cannot be fetched" in err and "matnet --from FOLDER" in err and "maps:DIR" in err
    assert "nonsense" in refused("models", "download", "nonsense")


def test_train_on_without_a_folder_says_what_it_needs():
    done = subprocess.run([str(ROOT / "scripts" / "train-on")], capture_output=True, text=True)
    assert done.returncode == 2 and "RUN/data" in done.stderr


def test_quickstart_takes_paths_of_the_caller_and_forces_its_own_place_only(tmp_path):
    for name in ("scripts/quickstart", "scripts/setup", ".venv/bin/materialist"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        text = (
            (ROOT / name).read_text() if name == "scripts/quickstart" else '#!/bin/sh\necho "$@"\n'
        )
        (tmp_path / name).write_text(text)
        (tmp_path / name).chmod(0o755)
    here = tmp_path / "else where"
    here.mkdir()
    for given, said in (
        ([], "invert example:coffee -o out/coffee.scene --force"),
        (["a.png"], f"invert {here}/a.png -o out/a.scene --force"),
        (["/b/a.png", "yes"], f"invert /b/a.png -o {here}/yes"),
    ):
        told = subprocess.run(
            ["../scripts/quickstart", *given], cwd=here, capture_output=True, text=True, check=True
        )
        assert told.stdout.splitlines()[-1] == said
