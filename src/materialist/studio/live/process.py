"""The live preview of an open photo, in a process of its own: torch, the renderer and all tables end with it.

The studio's own process imports neither. It asks by `Live.call`, with functions that get the process's `LivePreview`.
"""

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from materialist import errors
from materialist.edits.core.operation import PreviewMode
from materialist.edits.recipe import Step
from materialist.errors import InputError, MaterialistError
from materialist.io.package import load_scene, with_rerender
from materialist.jobs.process import LOST, Message, Worker, sentence
from materialist.jobs.worker import DONE, FAILED, INTERMEDIATE, Reporter
from materialist.memory import give_back
from materialist.studio import SETTINGS
from materialist.studio.access.quota import Allowance
from materialist.studio.edit_list import key_of
from materialist.studio.live import views
from materialist.types import Array, Scene

Steps = tuple[Step, ...]
CLOSED = "This photo was closed; open it again."


class PreviewLost(InputError):
    """The process of a preview has ended while it was asked."""


class Live:
    """An open scene, and the process of its preview. Methods may be called from any thread."""

    def __init__(
        self,
        package: Path,
        file: Path,
        allowance: Allowance | None = None,
        worker: Worker | None = None,
        device: str = "auto",
    ):
        """package: where the scene lies. file: where the preview keeps its tables. worker: one that `warmed` gave.

        device: on which the preview is computed, as of `invert`. Raises SceneError as `load_scene`.
        """
        self._package = str(package)
        self._device = device
        self._file = str(file)
        self._allowance = allowance or Allowance()
        self._lock = threading.Lock()
        self._worker: Worker | None = None
        self._calls: dict[int, Future[Any]] = {}
        """What is asked at present, by its number."""
        self._opening = 0
        """The number of the task that opens the scene there."""
        self._built: Future[None] = Future()
        self._fine = False
        self._closed = False
        self._asked = time.monotonic()
        self._fallen: set[str] = set()
        """Lists of edits that end with a fall, which was simulated."""
        self.photos: dict[tuple[int, int], bytes] = {}
        """The photo as a JPEG, by the most pixels a side and the quality."""
        with self._lock:
            self._start(worker)
        try:
            # Read here, too, while the process does.
            self.scene: Scene = load_scene(package)
        except BaseException:
            self.close()
            raise

    @property
    def ready(self) -> bool:
        """Whether there are live pictures, or an error in their place; an idle process is started when it is asked."""
        return self._built.done()

    @property
    def fine(self) -> bool:
        """Whether pictures have all their rays by now."""
        return self._fine

    @property
    def process(self) -> int | None:
        """The process's id; None where it is idle, closed, or was lost."""
        worker = self._worker
        return None if worker is None else worker.pid

    def wait(self) -> None:
        """Wait for the preview. Raises the error of its building, if there was one."""
        self._built.result()

    def call(self, function: Callable[..., Any], **arguments: Any) -> Any:
        """What function(preview, **arguments), importable, returns in the process; `steps` are edits that it applies.

        Where the process is lost meanwhile, another one is asked, once. Raises its errors, if they are ours; InputError
        where the photo is closed, PreviewLost where the second process is lost, too.
        """
        with self._allowed(arguments.get("steps", ())):
            try:
                return self._begin(function, arguments).result()
            except PreviewLost:
                # Whatever ended it need not be what was asked: a process of its own answers.
                return self._begin(function, arguments).result()

    def select(self, **where: Any) -> Array:
        """[H, W] bool: what `edits.select.select.select` chooses by these keywords. Raises InputError."""
        return np.asarray(self.call(views.selected, where=where))

    def take_rerender(self) -> None:
        """Take the re-rendering that an inversion has added to the package since it was opened. Raises as `call`."""
        self.call(views.take_rerender)
        self.scene = with_rerender(self.scene, self._package)

    def _begin(self, function: Callable[..., Any], arguments: dict[str, Any]) -> Future[Any]:
        with self._lock:
            if self._closed:
                raise InputError(CLOSED)
            if self._worker is None:
                self._start(None)
            assert self._worker is not None
            self._asked = time.monotonic()
            task = {"function": function, "arguments": arguments}
            future: Future[Any] = Future()
            self._calls[self._worker.begin(answer, task)] = future
            return future

    @contextmanager
    def _allowed(self, steps: Steps) -> Iterator[None]:
        """Count a fall that is simulated anew: what falls, and for how long, is a stranger's."""
        slow = [k for k, step in enumerate(steps, 1) if _is_slow(step)]
        key = key_of(steps[: slow[-1]]) if slow else None
        if key is None or key in self._fallen:
            yield
            return
        with self._allowance.opening():
            yield
        self._fallen.add(key)

    def rest(self, seconds: float) -> None:
        """End the process where it has been asked nothing for so long; the next question starts another one."""
        with self._lock:
            idle = not self._calls and self.ready and time.monotonic() - self._asked > seconds
            worker = self._worker if idle else None
            if worker is not None:
                self._worker = None
        if worker is not None:
            worker.kill()

    def close(self) -> None:
        """End the process; whoever waits for it gets an InputError."""
        with self._lock:
            self._closed = True
            worker = self._worker
            self._worker = None
            waiting = [*self._calls.values()]
            self._calls.clear()
        if worker is not None:
            worker.kill()
            # It holds the scene, whose memory is given back next.
            self._listener.join(2)
        for future in (*waiting, self._built):
            _fail(future, InputError(CLOSED))

    # The process

    def _start(self, worker: Worker | None) -> None:
        """Let a process, a new one where none is given, open the scene; the lock is held. Raises InputError."""
        try:
            self._worker = worker = worker or _new_worker()
        except OSError as error:
            raise InputError(f"The live preview cannot be started: {error}; try again.") from error
        task = {"package": self._package, "file": self._file, "device": self._device}
        self._opening = worker.begin(open_preview, task)
        self._listener = threading.Thread(
            target=self._listen, args=(worker,), name="live", daemon=True
        )
        self._listener.start()

    def _listen(self, worker: Worker) -> None:
        """Take the messages of a process until it ends."""
        for message in worker.messages():
            with self._lock:
                if worker is not self._worker:
                    continue  # closed, or idle
                lost = message.kind == LOST
                future = (
                    self._calls.pop(message.number, None)
                    if message.kind in (DONE, FAILED)
                    else None
                )
                failed = [*self._calls.values()] if lost else []
                if lost:
                    self._worker = None
                    self._calls.clear()
            if lost:
                words = f"The live preview has ended: {message.facts['reason']} Do it again."
                for waiting in (*failed, self._built):
                    _fail(waiting, PreviewLost(words))
            elif future is not None:
                _settle(future, message)
            elif message.number == self._opening:
                self._take(message)

    def _take(self, message: Message) -> None:
        """A message about the opening: there are pictures, then fine ones, or an error."""
        if message.kind == INTERMEDIATE:
            self._fine = message.facts["fine"]
            if not self._built.done():
                self._built.set_result(None)
        elif message.kind == FAILED:
            _fail(self._built, _error_of(message))


def warmed(device: str) -> Worker | None:
    """A process that loads what previews need, before there is a scene; None where none can be started."""
    try:
        worker = _new_worker()
    except OSError:
        return None
    worker.begin(load, {"device": device})
    return worker


def _new_worker() -> Worker:
    # What it opens may be a stranger's: it does not see the password.
    return Worker(
        # Of its many threads each would keep freed memory of its own: a tenth of all.
        environment={"MATERIALIST_PASSWORD": "", "MALLOC_ARENA_MAX": "1"},
        memory=SETTINGS.job_memory,
        threads=SETTINGS.requests,
    )


def _is_slow(step: Step) -> bool:
    return step.operation.preview is PreviewMode.SIMULATED and not step.skipped


def _settle(future: Future[Any], message: Message) -> None:
    if message.kind == DONE:
        future.set_result(message.facts)
    else:
        _fail(future, _error_of(message))


def _fail(future: Future[Any], error: Exception) -> None:
    if not future.done():
        future.set_exception(error)


def _error_of(message: Message) -> Exception:
    """The exception that a failed task raised, where it is one of ours; else one that says what it was."""
    known = getattr(errors, message.facts["error"], MaterialistError)
    return known(sentence(message.facts))


# --- In the process ---

_OPENED: Future[Any] = Future()
"""The `LivePreview` of this process."""


def load(report: Reporter, device: str) -> None:
    """Load what previews need."""
    from materialist.studio.live.preview import load_renderer

    load_renderer(device)


def open_preview(report: Reporter, package: str, file: str, device: str) -> None:
    """Open a scene, once in a process; reports `fine` when there are pictures, and again when those are fine."""
    from materialist.studio.live.preview import LivePreview, load_renderer

    try:
        if device != "auto":
            load_renderer(device)
        preview = LivePreview(load_scene(package), Path(file), Path(package))
    except BaseException as error:
        _OPENED.set_exception(error)
        raise
    _OPENED.set_result(preview)
    preview.wait()
    report.intermediate(fine=preview.fine)
    # While the page is looked at: a pointer that moves would wait for it.
    views.look_ahead(preview)
    give_back()
    preview.prepared.wait()
    report.intermediate(fine=preview.fine)


def answer(report: Reporter, function: Callable[..., Any], arguments: dict[str, Any]) -> Any:
    """What a function of the preview returns."""
    return function(_OPENED.result(), **arguments)
