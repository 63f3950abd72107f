"""ONNX files: one session each, and what a person reads where a file or the runtime is missing."""

import sys

import pytest

from materialist import forks
from materialist.errors import SetupError, WeightsError
from materialist.predict.onnx import run, session
from materialist.predict.sam.masks import DECODER


def test_a_network_is_loaded_once():
    assert session(DECODER) is session(DECODER)


def test_missing_and_damaged_files_say_what_to_do(tmp_path):
    with pytest.raises(WeightsError, match="is missing; install materialist again"):
        session(tmp_path / "none.onnx")
    damaged = tmp_path / "damaged.onnx"
    damaged.write_bytes(DECODER.read_bytes()[:5000])
    with pytest.raises(WeightsError, match="is damaged"):
        session(damaged)


def test_a_missing_runtime_names_its_command(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(SetupError, match="install onnxruntime"):
        session(tmp_path / "other.onnx")


def test_a_fork_is_refused(monkeypatch):
    monkeypatch.setattr(forks, "_started_in", -1)
    with pytest.raises(SetupError, match="forked"):
        run(DECODER, {})
