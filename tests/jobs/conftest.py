"""What the tests of jobs share."""

import os
from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def workers_find_the_tasks(monkeypatch):
    path = [str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, path)))
