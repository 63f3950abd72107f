"""`materialist studio` in a process of its own, for tests."""

import os
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from contextlib import contextmanager
from pathlib import Path


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def start(folder: Path, *arguments: str) -> tuple[subprocess.Popen, str]:
    """`materialist studio` in a process of its own, and its address once it answers."""
    port = free_port()
    command = [sys.executable, "-m", "materialist", "studio", *arguments, "--port", str(port), "--work", str(folder)]
    log = (folder.parent / "studio.log").open("w")
    process = subprocess.Popen(command, stdout=log, stderr=log, env={**os.environ, "OMP_NUM_THREADS": "1"})
    address = f"http://127.0.0.1:{port}"
    end = time.monotonic() + 120  # as `bench studio` waits
    while True:
        try:
            urllib.request.urlopen(address, timeout=5).close()
            return process, address
        except urllib.error.HTTPError:
            return process, address
        except OSError:
            assert process.poll() is None, (folder.parent / "studio.log").read_text()
            if time.monotonic() > end:
                process.kill()
                raise AssertionError("the studio did not start") from None
            time.sleep(0.2)


@contextmanager
def studio(folder: Path, *arguments: str):
    """(process, address) of a studio that runs as long."""
    process, address = start(folder / "work", *arguments)
    try:
        yield process, address
    finally:
        process.terminate()
        process.wait(20)
