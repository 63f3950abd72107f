"""A command run as a user runs it, in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping

from materialist.errors import MaterialistError


def materialist(*arguments: str, environment: Mapping[str, str] | None = None) -> None:
    """Run `materialist` with more in its environment; raises MaterialistError with its last lines when it fails."""
    command = [sys.executable, "-m", "materialist", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **(environment or {})})
    if done.returncode:
        said = f"{done.stdout[-300:]}{done.stderr[-300:]}".strip() or "nothing; it may have run out of memory"
        raise MaterialistError(f"materialist {' '.join(arguments)} ended with code {done.returncode}: {said}")
