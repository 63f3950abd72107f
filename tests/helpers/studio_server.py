"""`materialist studio` in a process of its own, for tests."""

import os
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from contextlib import contextmanager
from pathlib import Path

from made_tasks import until


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@contextmanager
def studio(folder: Path, *arguments: str):
    """(process, address) of a studio that runs as long, once it answers."""
    port = free_port()
    work = str(folder / "work")
    log = folder / "studio.log"
    command = [
        sys.executable,
        "-m",
        "materialist",
        "studio",
        *arguments,
        "--port",
        str(port),
        "--work",
        work,
    ]
    with log.open("w") as out:
        process = subprocess.Popen(
            command, stdout=out, stderr=out, env={**os.environ, "OMP_NUM_THREADS": "1"}
        )
    address = f"http://127.0.0.1:{port}"

    def answers():
        assert process.poll() is None, log.read_text()
        try:
            urllib.request.urlopen(address, timeout=5).close()
        except OSError as error:
            return isinstance(error, urllib.error.HTTPError)  # asks for a password
        return True

    try:
        until(answers, 120)  # as `bench studio` waits
        yield process, address
    finally:
        process.terminate()
        process.wait(20)
