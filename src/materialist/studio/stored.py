"""Files of a workspace under names that hold their content's hash.

It imports little: every upload is opened in a process that begins by importing it.
"""

import hashlib
from pathlib import Path

from materialist.io.atomic import write_whole


def store(workspace: Path, stem: str, content: bytes, suffix: str) -> str:
    """Write a file whole unless it exists; returns its name, which holds its hash."""
    file = workspace / f"{stem}-{hashlib.sha256(content).hexdigest()[:12]}{suffix}"
    if not file.is_file():
        write_whole(file, content)
    return file.name
