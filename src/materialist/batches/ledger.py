"""RUNS/batch.jsonl: the events of a batch, one line each, only ever appended.

A line is flushed to the disk before the next photo begins, so a batch that is killed at any moment can be resumed; a
last line that was cut off is skipped. A lock on it that vanishes with its process keeps a second batch out.
"""

import fcntl
import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from materialist.errors import InputError, OutputError
from materialist.io.atomic import make_folder, require_parent, writing

LEDGER = "batch.jsonl"
FORMAT = 1


class Ledger:
    """The events of a batch. Open it with `open_ledger`."""

    def __init__(
        self, file: BinaryIO, events: list[dict[str, Any]], options: dict[str, Any]
    ) -> None:
        self._file = file
        self.key = hashlib.sha256(json.dumps(options, sort_keys=True).encode()).hexdigest()[:16]
        """Stands for the options of this batch; results of other options do not count as done."""
        self.last: dict[str, dict[str, Any]] = {}
        """Photo id -> its last event (begin, done or failed), of all photos that were ever begun here."""
        self.owned: set[str] = set()
        """File names of results that this batch may replace: their places were free when their photos were begun."""
        for event in events:
            self._note(event)

    def append(self, event: str, **facts: Any) -> None:
        """Write one event. Raises OutputError when the disk is full or read-only."""
        entry = {"event": event, "key": self.key, **facts}
        line = (json.dumps(entry, ensure_ascii=True) + "\n").encode()
        self._note(
            entry
        )  # first, so that a Ctrl-C during the write finds the summary no older than the file
        with writing(LEDGER):
            if self._file.write(line) < len(line):
                raise OSError("the disk is full")
            os.fsync(self._file.fileno())

    def _note(self, entry: dict[str, Any]) -> None:
        if entry.get("anew"):  # all photos are to be done again
            self.last = {id: {**last, "key": None} for id, last in self.last.items()}
        if "id" in entry:
            self.last[entry["id"]] = entry
            self.owned.update(entry.get("owned", ()))


@contextmanager
def open_ledger(
    runs: str | Path, options: dict[str, Any], *, resume: bool = False, force: bool = False
) -> Iterator[Ledger]:
    """The ledger of RUNS, which is made where it is missing; it is closed, and unlocked, when the block ends.

    Without `resume`, RUNS must be empty or, with `force`, hold an earlier batch, which is begun anew. With `resume` it
    must be empty or hold a batch with the same `options`; `force` goes on with others. Nothing but a batch is touched.

    Raises InputError in the other cases, OutputError where RUNS cannot be written or another batch is at work in it.
    """
    folder = Path(runs)
    path = folder / LEDGER
    options = json.loads(json.dumps(options))  # as they will be read again: tuples are lists
    require_parent(folder)
    with writing(folder):
        make_folder(folder)
        held = path.is_file()
        if not held and any(folder.iterdir()):
            raise InputError(f"{folder} is not empty and holds no batch; name another folder.")
        if held and not (resume or force):
            raise InputError(
                f"{folder} holds a batch; add `resume=True` to go on with it, `force=True` to begin anew, or name "
                "another folder."
            )
        file = path.open("ab", buffering=0)
    with file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)  # it ends with the process
        except BlockingIOError as error:
            raise OutputError(
                f"Another batch is at work in {folder}; wait for it, or name another folder."
            ) from error
        events = read_events(path)
        if resume and not force:
            _require_same(events, options, folder)
        ledger = Ledger(file, events, options)
        if held:
            file.write(b"\n")  # ends a line that was cut off; the reader skips an empty one
        ledger.append("start", format=FORMAT, options=options, anew=not resume)
        yield ledger


def read_events(path: str | Path) -> list[dict[str, Any]]:
    """The events of a ledger, oldest first; lines that were cut off are skipped. Raises InputError."""
    events = []
    for line in Path(path).read_bytes().splitlines():
        try:
            entry = json.loads(line)
        except ValueError:
            continue
        if isinstance(entry, dict) and "event" in entry:
            events.append(entry)
    if any(entry["event"] == "start" and entry.get("format") != FORMAT for entry in events):
        raise InputError(f"{path} is a ledger of another version; name another folder.")
    return events


def _require_same(events: list[dict[str, Any]], options: dict[str, Any], folder: Path) -> None:
    starts = [entry["options"] for entry in events if entry["event"] == "start"]
    before = starts[-1] if starts else options
    for name in sorted({*before, *options}):
        if before.get(name) != options.get(name):
            raise InputError(
                f"{folder} was begun with {name} {before.get(name)}, not {options.get(name)}; resume with that, "
                "name another folder, or add `force=True` to redo what differs."
            )
