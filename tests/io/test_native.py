"""Names that OpenEXR takes, and damaged files about which libraries print nothing."""

import os
import subprocess
import sys

import numpy as np
import pytest

from materialist.errors import InputError, OutputError
from materialist.io.atomic import ensure_writable
from materialist.io.exr import read_exr, write_exr
from materialist.io.native import name_problem, unprinted
from materialist.io.photo import read_photo


def test_names_in_utf8_are_no_problem():
    assert name_problem("a.scene") is None
    assert name_problem("ü.scene") is None


def test_names_that_are_not_utf8(monkeypatch, tmp_path):
    assert "not UTF-8" in name_problem("\udcfc.scene")
    monkeypatch.setattr(sys, "getfilesystemencoding", lambda: "iso-8859-1")
    assert "PYTHONUTF8=1" in name_problem("ü.scene")
    assert name_problem("plain.scene") is None
    for path in (tmp_path / "ü.scene", tmp_path / "ü" / "a.scene"):
        with pytest.raises(OutputError, match="iso-8859-1"):
            ensure_writable(path)
    ensure_writable(tmp_path / "ü.png", kind=None)
    with pytest.raises(InputError, match="iso-8859-1"):
        (tmp_path / "ü.exr").touch()
        read_exr(tmp_path / "ü.exr")


def test_another_locale_is_refused_before_the_work(tmp_path):
    environment = os.environ | {"PYTHONUTF8": "0", "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0"}
    command = [sys.executable, "-m", "materialist", "invert", "example:cat", "-o", "ü.scene"]
    run = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, check=False)
    assert run.returncode == 2
    assert run.stderr.startswith(b"Error: The name ")
    assert not list(tmp_path.iterdir())


def damaged(content: bytes) -> bytes:
    """The content with its second half overwritten here and there."""
    changed = bytearray(content)
    for place in range(len(content) // 2, len(content), 97):
        changed[place] ^= 0x55
    return bytes(changed)


def test_damaged_files_are_one_sentence(tmp_path, capfd):
    import tifffile

    noise = np.random.default_rng(0).random((64, 64, 3))
    write_exr(tmp_path / "a.exr", noise.astype(np.float32))
    tifffile.imwrite(
        tmp_path / "a.tif", (noise * 65535).astype(np.uint16), compression="zlib", photometric="rgb"
    )
    for name in ("a.exr", "a.tif"):
        whole = (tmp_path / name).read_bytes()
        for kind, content in {"cut": whole[: len(whole) // 2], "bad": damaged(whole)}.items():
            file = tmp_path / f"{kind}_{name}"
            file.write_bytes(content)
            with pytest.raises(InputError):
                read_photo(file)
    printed = capfd.readouterr()
    assert printed.out == ""
    assert printed.err == ""


def test_what_is_printed_before_and_after_stays(capfd):
    os.write(2, b"before\n")
    with unprinted():
        os.write(2, b"inside\n")
        os.write(1, b"inside\n")
    os.write(2, b"after\n")
    printed = capfd.readouterr()
    assert printed.err == "before\nafter\n"
    assert printed.out == ""
