"""Every pool of processes ends with the process that started it, however that ended."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from made_tasks import until

ROOT = Path(__file__).resolve().parents[1]
SOURCES = (ROOT / "src", ROOT / "lab" / "src")

POOLS = {
    "materialist_lab/data/samples.py": """
import sys, pathlib
from made_pools import slow_arrays
from materialist_lab.data.samples import make_missing
folder = pathlib.Path(sys.argv[1]) / "samples"
make_missing([folder / f"{k}.npz" for k in range(8)], slow_arrays, "samples", lambda *_: None, 2)
""",
    "materialist/jobs/process.py": """
import time
from made_tasks import answer
from materialist.jobs.pool import LocalPool
pool = LocalPool([{}, {}])
for key in "ab":
    pool.begin(key, answer, {"how": "wait"})
time.sleep(60)
""",
    "materialist_lab/train/stream.py": """
from made_pools import SlowNumbers
from torch.utils.data import DataLoader
from materialist_lab.train.stream import _init_worker
list(DataLoader(SlowNumbers(), num_workers=2, worker_init_fn=_init_worker))
""",
}
"""Module that starts processes -> a program that uses its pool, and stays in it."""
STARTS_PROCESSES = re.compile(
    r"ProcessPoolExecutor|multiprocessing\.Pool|Process\(|Popen\(|DataLoader\("
)
OTHERS = {"materialist_lab/bench/studio.py", "materialist/render/variant.py"}
"""Modules that start one process and end it themselves."""


def test_every_module_that_starts_processes_is_known():
    starting = {
        str(file.relative_to(folder))
        for folder in SOURCES
        for file in folder.rglob("*.py")
        if STARTS_PROCESSES.search(file.read_text("utf-8"))
    }
    assert starting - OTHERS == {*POOLS}


@pytest.mark.parametrize(
    "how_it_ends",
    [signal.SIGKILL, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)],
    ids=["SIGKILL", "SIGTERM"],
)
@pytest.mark.parametrize(
    "module",
    [
        pytest.param(module, marks=[] if module.startswith("materialist/") else pytest.mark.slow)
        for module in POOLS
    ],
)
def test_workers_end_with_their_parent(module, how_it_ends, tmp_path):
    (tmp_path / "samples").mkdir()
    program = [sys.executable, "-c", POOLS[module], str(tmp_path)]
    parent = subprocess.Popen(program, start_new_session=True)
    try:
        workers = until(lambda: _workers(parent.pid, at_least=2), 60)
        os.kill(parent.pid, how_it_ends)
        parent.wait(10)
        _, alive = psutil.wait_procs(workers, timeout=20)
        assert not alive
    finally:
        parent.kill()
        for worker in psutil.process_iter():
            if worker.pid != os.getpid() and _in_session(worker.pid, parent.pid):
                worker.kill()


def _workers(pid: int, at_least: int) -> list[psutil.Process]:
    """The children of a process, once so many are there and have had time to begin their work."""
    children = psutil.Process(pid).children(recursive=True)
    if len(children) < at_least:
        return []
    time.sleep(1.0)
    return psutil.Process(pid).children(recursive=True)


def _in_session(pid: int, session: int) -> bool:
    try:
        return os.getsid(pid) == session
    except ProcessLookupError:
        return False
