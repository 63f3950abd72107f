"""The API reference builds from the docstrings, and has every public name."""

import subprocess
from pathlib import Path

import pytest

import materialist as mt

ROOT = Path(__file__).resolve().parents[1]


@pytest.mark.slow
def test_reference_has_every_public_name(tmp_path):
    if not (ROOT / ".venv/bin/python").exists():
        pytest.skip("needs .venv, which scripts/setup makes")
    command = [ROOT / "scripts/api-docs", tmp_path]
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    assert "Couldn't import" not in built.stderr
    page = (tmp_path / "materialist.html").read_text("utf-8")
    absent = [name for name in mt.__all__ if name != "__version__" and f'id="{name}"' not in page]
    assert not absent
    assert (tmp_path / "materialist" / "transport" / "cache.html").is_file()
