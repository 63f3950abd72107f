"""A command run as a user runs it: what it answers, and how much memory it takes."""

from __future__ import annotations

import json
import subprocess
import tempfile
import time
from pathlib import Path


def watched(command: list[str]) -> tuple[int, str, float | None]:
    """Run a command: exit code, standard output and error, and the peak of its resident memory in MB."""
    with tempfile.TemporaryFile() as out:
        process = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT)
        peak_kb = 0
        try:
            while process.poll() is None:
                # The kernel keeps the high-water mark itself: only growth in the last moment can be missed. The usage
                # that it reports after the end is no substitute, since it begins with the memory of this process.
                peak_kb = max(peak_kb, _high_water_kb(process.pid))
                time.sleep(0.02)
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        out.seek(0)
        return process.returncode, out.read().decode(errors="replace"), peak_kb / 1024 if peak_kb else None


def _high_water_kb(pid: int) -> int:
    """VmHWM of a process in KiB; 0 where the system does not tell."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0
    return next((int(line.split()[1]) for line in status.splitlines() if line.startswith("VmHWM:")), 0)


def message(answer: str) -> str:
    """The sentence in the last line of --json, or the last line itself."""
    last = answer.strip().splitlines()[-1] if answer.strip() else "it said nothing; it may have run out of memory."
    try:
        return json.loads(last)["message"]
    except (ValueError, KeyError, TypeError):
        return last
