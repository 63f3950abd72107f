"""ONNX files: one session each, and what a person reads where a file or the runtime is missing."""

import shutil
import sys

import pytest

from materialist import forks
from materialist.edits.remove.filling import NETWORK
from materialist.errors import SetupError, WeightsError
from materialist.predict.onnx import run, session
from materialist.predict.sam.masks import DECODER, ENCODER
from materialist.predict.weights import verify_file


def test_a_network_is_loaded_once():
    assert session(DECODER) is session(DECODER)


def test_missing_and_damaged_files_say_what_to_do(tmp_path):
    with pytest.raises(WeightsError, match="is missing; install materialist again"):
        session(tmp_path / "none.onnx")
    damaged = tmp_path / "damaged.onnx"
    damaged.write_bytes(DECODER.read_bytes()[:5000])
    with pytest.raises(WeightsError, match="is damaged"):
        session(damaged)


def test_a_readable_file_with_other_weights_is_refused(tmp_path):
    """ONNX Runtime reads both without a word: one flipped bit, and another network in its place."""
    for name in (DECODER.name, "SHA256SUMS"):
        shutil.copy(DECODER.with_name(name), tmp_path)
    file = tmp_path / DECODER.name
    assert session(file) is not session(DECODER)
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    for changed in (bytes(content), NETWORK.read_bytes()):
        file.write_bytes(changed)
        session.cache_clear()
        with pytest.raises(WeightsError, match=r"decoder.onnx is damaged: .*install materialist"):
            session(file)


def test_every_file_that_ships_has_its_checksum():
    for file in (ENCODER, DECODER, NETWORK):
        assert file.name in file.with_name("SHA256SUMS").read_text()
        assert verify_file(file)


def test_a_missing_runtime_names_its_command(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(SetupError, match="install onnxruntime"):
        session(tmp_path / "other.onnx")


def test_a_fork_is_refused(monkeypatch):
    monkeypatch.setattr(forks, "_started_in", -1)
    with pytest.raises(SetupError, match="forked"):
        run(DECODER, {})
