"""The files that requests may name: each by an id of ours, each for one person.

Gradio takes a path of the server in place of an uploaded file. No path from a request reaches it: ids of files that
the studio took from this person, or handed to them, are replaced by the paths, and everything else is refused.
"""

import json
import secrets
import threading
from pathlib import Path
from typing import Any

from materialist.errors import InputError

_FILE_KEYS = frozenset({"path", "url", "meta", "_type", "is_stream"})
"""Keys that make Gradio take an object for a file, or for a part of one."""
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


def with_known_files(body: bytes, person: str, files: HandedFiles) -> bytes:
    """The JSON body of an event, with the path of each file that the person may name in place of its id.

    What an event tells of itself (`event_data`) keeps no file. Raises InputError for a body that is no JSON object,
    or names another file.
    """
    try:
        content = json.loads(body)
        if not isinstance(content, dict):
            raise ValueError("no object")
        content["data"] = _located(content.get("data"), person, files)
        content["event_data"] = _without_files(content.get("event_data"))
        return json.dumps(content).encode()
    except (ValueError, RecursionError) as error:
        raise InputError("The request cannot be read; reload the page.") from error


def _located(value: Any, person: str, files: HandedFiles) -> Any:
    if isinstance(value, list):
        return [_located(item, person, files) for item in value]
    if not isinstance(value, dict):
        return value
    # Any such key makes Gradio treat the object as a file.
    if not _FILE_KEYS & value.keys():
        return {key: _located(item, person, files) for key, item in value.items()}
    # Only what is known of the file itself; nothing of what the request says of it.
    path = files.path(person, value.get("path"))
    shown = str(value.get("orig_name") or path.name)
    kind = {"_type": "gradio.FileData"}
    return {"path": str(path), "orig_name": shown, "size": path.stat().st_size, "meta": kind}


def _without_files(value: Any) -> Any:
    if isinstance(value, list):
        return [_without_files(item) for item in value]
    if not isinstance(value, dict):
        return value
    if _FILE_KEYS & value.keys():
        return None
    return {key: _without_files(item) for key, item in value.items()}
