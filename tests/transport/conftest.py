"""The variant is chosen before any test module imports Dr.Jit."""

import pytest

from materialist.render.variant import setup

setup("cpu")


@pytest.fixture(scope="module", autouse=True)
def threads(one_thread):
    """Every test here runs on one thread."""
