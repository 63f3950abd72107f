"""Memory is kept while photos are inverted, and given back."""

import subprocess
import sys

import numpy as np
import psutil
import pytest

from materialist.memory import kept_memory


def resident() -> int:
    return psutil.Process().memory_info().rss


def test_freed_arrays_are_used_again_and_given_back_at_the_end():
    size = 2**27
    with kept_memory():
        values = np.ones(size, np.uint8)
        used = resident()
        del values
        freed = resident()
    after = resident()
    assert freed > used - 0.1 * size
    assert after < used - 0.9 * size


def test_what_it_wraps_may_fail():
    @kept_memory()
    def fails() -> None:
        raise ValueError

    for _ in range(2):
        try:
            fails()
        except ValueError:
            continue
        raise AssertionError


_HEAPS = """
import ctypes, sys, threading
from materialist.memory import limit_heaps
if sys.argv[2] != "all":
    limit_heaps(int(sys.argv[2]))
gate = threading.Barrier(6)
def hold():
    kept = [bytearray(1000) for _ in range(100)]
    gate.wait()
threads = [threading.Thread(target=hold) for _ in range(6)]
for one in threads: one.start()
for one in threads: one.join()
libc = ctypes.CDLL(None)
libc.fopen.restype = ctypes.c_void_p
file = libc.fopen(sys.argv[1].encode(), b"w")
libc.malloc_info(0, ctypes.c_void_p(file))
libc.fclose(ctypes.c_void_p(file))
"""
"""Six threads that allocate at once; glibc's own description of the heaps goes to a file."""


@pytest.mark.skipif(sys.platform != "linux", reason="glibc alone has heaps to limit")
def test_threads_share_heaps(tmp_path):
    def heaps(limit: str) -> int:
        file = tmp_path / limit
        subprocess.run([sys.executable, "-c", _HEAPS, str(file), limit], check=True)
        return file.read_text().count("<heap nr")

    assert heaps("2") == 2 < heaps("all")
