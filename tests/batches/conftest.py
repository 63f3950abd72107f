"""What the tests of batches share."""

import made_batch
import pytest


@pytest.fixture(autouse=True)
def workers_find_the_stand_ins(monkeypatch, tmp_path_factory):
    marks = tmp_path_factory.mktemp("marks")
    monkeypatch.setenv("PYTHONPATH", made_batch.HELPERS)
    monkeypatch.setenv("MADE_MARKS", str(marks))
