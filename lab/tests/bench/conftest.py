"""Benchmarks run into a folder of the test, and their reports."""

import json
from types import SimpleNamespace

import pytest


@pytest.fixture
def measured(mitsuba, tmp_path):
    """Run a benchmark: its folder, and what is in report.json."""
    from materialist_lab import bench

    def run(name, **options):
        folder = bench.run(name, **{"output": tmp_path / "report", "force": True, **options})
        return SimpleNamespace(folder=folder, **json.loads((folder / "report.json").read_text()))

    return run
