"""What a page needs beside its session: the jobs that it follows, and what the pointer has pointed at."""

import re
import threading
import time
import traceback
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from materialist.edits.core.notes import noise_notes
from materialist.errors import InputError, MaterialistError
from materialist.jobs.queue import QUEUED, RUNNING, STOPPED, Job
from materialist.jobs.worker import DONE, FAILED
from materialist.studio.page import Page
from materialist.studio.selection import Selection
from materialist.studio.session import Session, next_revision
from materialist.studio.stage import failure_message, words
from materialist.studio.studio import Studio
from materialist.studio.workspace import LOST, Project
from materialist.types import Array, Scene

POINTED = 12
"""Objects under the pointer that are remembered: a click on what is outlined takes just that."""
POLL = 0.05
"""Seconds between two looks at a job."""
_PAGE = re.compile(r"[0-9a-f]{32}")


@dataclass(eq=False)
class Followed:
    """A job that a page shows."""

    job: Job
    number: int
    notes: list[str] = field(default_factory=list)
    result: dict[str, Any] | None = None
    """What it made, for the page; a file by the id under which it is handed over."""
    outcome: str = DONE
    """How the page's wait for the job ended."""
    seconds: float = 0.0
    """How long the page waited."""
    finished: bool = False
    """Whether what follows the job was done, too."""
    failed: bool = False
    """Whether that failed; the notes say why."""

    @property
    def state(self) -> str:
        if self.failed:
            return FAILED
        if self.finished:
            return self.outcome
        return RUNNING if self.job.over else self.job.state


class Desk:
    """One page: what it follows. Its methods may be called from any thread."""

    def __init__(self, studio: Studio, page: Page) -> None:
        self.studio = studio
        self.page = page
        self.expected: Project | None = None
        """The photo that is being taken apart, and is opened when that is done."""
        self.followed: list[Followed] = []
        self.channels = 0
        """Its open websockets; counted on the loop that serves them."""
        self.selected: tuple[Selection, Scene | None, str, Any] | None = None
        """A selection, its scene, and what `state` made of them."""
        self._revision = 0
        self._numbers = 0
        self._pointed: OrderedDict[tuple[int, int], Array] = OrderedDict()
        self._scene: object = None
        self._lock = threading.Lock()
        self._pointing = threading.Lock()

    @property
    def session(self) -> Session:
        """What the page shows; another one when it opens another photo."""
        return self.page.session

    @property
    def person(self) -> str:
        return self.page.person

    @property
    def revision(self) -> int:
        """Grows when something that the page shows has changed, by its own requests or without them."""
        return max(self._revision, self.session.revision)

    def changed(self) -> None:
        """Let this page ask for what is shown."""
        self._revision = next_revision()

    # Jobs

    def follow(
        self,
        job: Job,
        then: Callable[[Followed], None],
        is_done: Callable[[], bool] = lambda: False,
    ) -> Followed:
        """Show a job on the page, and call then(it) in another thread when it is over.

        is_done: whether the page has what it waits for, although the job goes on.
        """
        with self._lock:
            self._numbers += 1
            entry = Followed(job, self._numbers)
            # Those that are over were shown.
            self.followed = [*(one for one in self.followed if not one.finished), entry]
        threading.Thread(target=self._wait, args=(entry, then, is_done), daemon=True).start()
        return entry

    def _wait(
        self, entry: Followed, then: Callable[[Followed], None], is_done: Callable[[], bool]
    ) -> None:
        job = entry.job
        while not (job.over or is_done()):
            time.sleep(POLL)
        entry.outcome = DONE if is_done() else job.state
        entry.seconds = job.seconds
        try:
            then(entry)
        except MaterialistError as error:
            entry.failed = True
            entry.notes.append(self.session.without_folders(str(error)))
        except Exception as error:
            traceback.print_exception(error)
            entry.failed = True
            entry.notes.append("Something went wrong inside; the terminal of the studio says what.")
        entry.finished = True
        self.changed()

    def stop(self, number: int) -> None:
        """Stop a job that the page follows. Raises InputError where there is none of that number."""
        for entry in self.followed:
            if entry.number == number:
                return self.studio.jobs.stop(entry.job)
        raise InputError("That work is not there any more.")

    def shown_jobs(self) -> list[dict[str, Any]]:
        """The followed jobs as the page shows them."""
        return [self._shown(entry) for entry in self.followed]

    def _shown(self, entry: Followed) -> dict[str, Any]:
        job = entry.job
        part = min(1.0, job.done / job.total) if job.total and not job.over else None
        map_names = [facts["name"] for facts in job.intermediate]
        return {
            "number": entry.number,
            "kind": job.kind,
            "state": entry.state,
            "text": self._words(entry),
            "part": part,
            "seconds": int(entry.seconds if entry.finished else job.seconds),
            "found": list(dict.fromkeys(map_names)),
            "project": job.folder.name if job.kind == "invert" else None,
            "result": entry.result,
        }

    def _words(self, entry: Followed) -> str:
        job = entry.job
        if entry.state == QUEUED:
            return f"Waiting: {self.studio.jobs.ahead(job)} before yours"
        if entry.state == STOPPED:
            return "Stopped; nothing was changed."
        if entry.outcome == FAILED:
            return self.session.without_folders(failure_message(job))
        if entry.finished:
            notes = noise_notes() if job.kind == "final" else []
            return " ".join([*entry.notes, *notes]) or f"Done in {entry.seconds:.0f} s."
        return words(job.stage or "start")

    # The pointer

    def pointed(self, x: float, y: float) -> Array:
        """[H, W] bool of the object that a click at a pixel takes, but for its sharper border; remembered.

        Raises InputError where a click would.
        """
        scene = self.session.scene
        place = self.session.pixel(x, y)
        with self._pointing:
            if scene is not self._scene:
                self._pointed.clear()
                self._scene = scene
            if place not in self._pointed:
                # While one is being found, the next pointer waits: a page asks for one at a time.
                self._pointed[place] = self.session.preview.select(click=place, sharpen=False)
                while len(self._pointed) > POINTED:
                    self._pointed.popitem(last=False)
            return self._pointed[place]


class Desks:
    """The desks of all pages."""

    def __init__(self, studio: Studio) -> None:
        self.studio = studio
        self._lock = threading.Lock()

    def of(self, name: str | None, person: str) -> Desk:
        """The desk of a page by its name. Raises InputError for no name, and for another person's page."""
        if not name or not _PAGE.fullmatch(name):
            raise InputError(LOST)
        page = self.studio.page(name, person)
        with self._lock:
            # With the page: a table of desks, each of which holds its page, would never forget one.
            if page.desk is None:
                page.desk = Desk(self.studio, page)
            desk: Desk = page.desk
            return desk


def found_file(project: Project, name: str) -> Path:
    """A first picture of an inversion. Raises InputError for another file."""
    file = project.folder / f"found-{name}.jpg"
    if not re.fullmatch(r"[a-z_]{1,30}", name) or not file.is_file():
        raise InputError("That picture is not there.")
    return file
