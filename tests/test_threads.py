"""Waiting threads sleep, unless the user wants otherwise; their number changes no result."""

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


CODE = """
import hashlib, os, sys
import numpy as np, torch
import materialist as mt
torch.set_num_threads(int(sys.argv[1]))
photo = np.random.default_rng(0).random((48, 64, 3)).astype(np.float32)
scene = mt.invert(photo, size=64, spp=4, device="cpu")
assert torch.get_num_threads() == int(sys.argv[1])
digest = hashlib.sha256()
for values in (scene.depth, scene.materials.albedo, scene.envmap, scene.rerender):
    digest.update(np.ascontiguousarray(values).tobytes())
sys.stdout.write(digest.hexdigest())
"""


@pytest.mark.slow
def test_threads_do_not_change_the_bits():
    digests = set()
    for threads, environment in (
        ("1", {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}),
        ("3", {}),
    ):
        run = subprocess.run(
            [sys.executable, "-c", CODE, threads], env=os.environ | environment, capture_output=True
        )
        assert run.returncode == 0, run.stderr.decode()
        digests.add(run.stdout.decode())
    assert len(digests) == 1
