"""What the tests of batches share."""

import pytest


@pytest.fixture(autouse=True)
def marks_of_the_stand_ins(monkeypatch, tmp_path_factory):
    monkeypatch.setenv("MADE_MARKS", str(tmp_path_factory.mktemp("marks")))
