"""Fixtures of the tests of reading and writing."""

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"


@pytest.fixture
def shared() -> Path:
    """The folder of real captures beside the project."""
    if not SHARED.is_dir():
        pytest.skip("needs the captures in ../shared/data")
    return SHARED
