"""The examination: it never raises, and every failing line has the command that mends it."""

import json
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

from materialist import doctor
from materialist.cli import app
from materialist.cli.outcome import run_to_exit_code
from materialist.doctor import Finding

ROOT = Path(__file__).resolve().parents[2]


def test_a_wrong_llvm_is_found_in_a_child_and_survived(monkeypatch):
    monkeypatch.setattr(
        doctor.subprocess, "run", lambda *a, **k: subprocess.CompletedProcess(a, -6, "", "Cannot select")
    )
    finding = doctor._renderer("/wrong/libLLVM.so")
    assert finding.state == "broken" and "Cannot select" in finding.detail and "libllvm19" in finding.remedy


def test_a_missing_library_is_named_with_its_package(monkeypatch):
    said = "ImportError: libatomic.so.1: cannot open shared object file: No such file or directory\n\nNameError: name"
    monkeypatch.setattr(doctor.subprocess, "run", lambda *a, **k: subprocess.CompletedProcess(a, 1, "", said))
    finding = doctor._renderer(None)
    assert finding.detail == "libatomic.so.1 is missing" and finding.remedy == "sudo apt-get install -y libatomic1"


def test_a_probe_that_hangs_is_survived(monkeypatch):
    def hang(*_, **__):
        raise subprocess.TimeoutExpired("python", 120)

    monkeypatch.setattr(doctor.subprocess, "run", hang)
    assert doctor._renderer(None).state == "broken"


def test_missing_packages_name_their_command():
    finding = doctor._package("no-such-package-here")
    assert finding.state == "broken" and finding.remedy.endswith("pip install no-such-package-here")


def test_a_missing_extra_names_the_one_that_brings_it(monkeypatch):
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    packages = {
        re.match(r"[\w-]+", entry)[0]: extra
        for extra, entries in extras.items()
        for entry in entries
        if extra not in ("app", "dev")
    }

    def nothing(name):
        raise doctor.PackageNotFoundError(name)

    monkeypatch.setattr(doctor, "version", nothing)
    found = {name: doctor._extra(name, *what) for name, what in doctor._EXTRAS.items()}
    assert set(found) == set(packages), "every package of an extra is looked for, and no other"
    for name, finding in found.items():
        assert finding.state == "missing" and finding.remedy.endswith(
            f" -m pip install 'materialist[{packages[name]}]'"
        )


@pytest.mark.parametrize(("state", "code"), [("ok", 0), ("missing", 0), ("broken", 2)])
def test_exit_code_follows_the_main_job(monkeypatch, capsys, state, code):
    monkeypatch.setattr(doctor, "examine", lambda device: [Finding("LLVM", state, "19", "mend it")])
    assert run_to_exit_code(app, ["doctor"]) == code
    shown = capsys.readouterr().out
    assert "LLVM" in shown and "mend it" in shown
    assert run_to_exit_code(app, ["doctor", "--json"]) == code
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert last["ok"] is (code == 0) and last["findings"][0]["remedy"] == "mend it"


def test_a_gpu_that_is_asked_for_must_be_there(monkeypatch):
    monkeypatch.setattr(doctor.shutil, "which", lambda _: None)
    assert doctor._cuda().state == "missing" and doctor._cuda(needed=True).state == "broken"


def test_this_machine():
    findings = {finding.name: finding for finding in doctor.examine()}
    assert findings["Python"].state == "ok" and findings["torch"].state == "ok"
    for finding in findings.values():
        assert finding.state in ("ok", "missing", "broken")
        assert finding.state != "broken" or finding.remedy
