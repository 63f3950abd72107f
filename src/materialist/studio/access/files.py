"""The files that requests may name: each by an id of ours, each for one person. No path from a request is opened."""

import secrets
import threading
from pathlib import Path
from typing import Any

from materialist.errors import InputError

_LOOKED_AFTER = 500
"""Files after which those that were cleared away are looked for."""
_GONE = "That file is not here any more; give it again."


class HandedFiles:
    """Files by id, and whose they are. Its methods may be called from any thread."""

    def __init__(self) -> None:
        self._files: dict[str, tuple[str, Path]] = {}
        self._lock = threading.Lock()

    def add(self, person: str, path: Path) -> str:
        """A new id for a file that this person sent. Now and then those of cleared files are forgotten."""
        if len(self._files) % _LOOKED_AFTER == _LOOKED_AFTER - 1:
            self.forget_missing()
        return self.hand_out(person, path, f"upload-{secrets.token_hex(16)}")

    def hand_out(self, person: str, path: Path, name: str) -> str:
        """Let this person name a file by `name`, which nobody else can guess; returns the name."""
        with self._lock:
            self._files[name] = (person, path)
        return name

    def path(self, person: str, name: Any) -> Path:
        """The file of a name that came from this person's page. Raises InputError for all others alike."""
        with self._lock:
            owner, path = self._files.get(name, ("", None)) if isinstance(name, str) else ("", None)
        # One message for all: whether a file exists is nobody else's business.
        if path is None or owner != person or not path.is_file():
            raise InputError(_GONE)
        return path

    def forget_missing(self) -> None:
        """Forget the files that were cleared away."""
        with self._lock:
            self._files = {name: entry for name, entry in self._files.items() if entry[1].is_file()}
