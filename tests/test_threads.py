"""Waiting threads sleep, unless the user wants otherwise."""

import os
import subprocess
import sys

import pytest


@pytest.mark.parametrize(("given", "kept"), [(None, "PASSIVE"), ("ACTIVE", "ACTIVE")])
def test_openmp_threads_sleep_while_they_wait(given, kept):
    environment = {k: v for k, v in os.environ.items() if k != "OMP_WAIT_POLICY"}
    if given:
        environment["OMP_WAIT_POLICY"] = given
    code = "import sys, materialist, os; assert 'torch' not in sys.modules; sys.stdout.write(os.environ[sys.argv[1]])"
    said = subprocess.run(
        [sys.executable, "-c", code, "OMP_WAIT_POLICY"], env=environment, capture_output=True
    )
    assert said.stdout.decode() == kept, said.stderr.decode()
