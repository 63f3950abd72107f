"""Glass that follows its sliders: the client in the studio, and the task that a worker process does for it.

The worker keeps the last few bodies, and makes picture after picture; only the newest request counts.
"""

from __future__ import annotations

import json
import threading
import time
from collections import OrderedDict
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from materialist.edits.recipe import REGION, Step, apply, glass_arguments
from materialist.errors import InputError
from materialist.jobs.process import LOST, Message, Worker, sentence
from materialist.jobs.worker import DONE, FAILED, PROGRESS, Reporter
from materialist.studio import SETTINGS
from materialist.types import Array, Scene

VALUES = ("ior", "transmission", "tint", "roughness")
"""Options of a glass step that its body does not depend on."""
Tint = tuple[float, float, float]
Request = dict[str, Any]
_NUMBERS = count(1)
"""Of requests: two scenes opened on one page have no number in common."""
_WORDS = {"load": "Getting the glass ready", "build": "Building the glass body", "trace": "Tracing the glass"}


@dataclass(frozen=True)
class Pane:
    """A traced piece of glass, and the ground around it that the object had hidden."""

    box: tuple[int, int, int, int]
    """Rows and columns (top, bottom, left, right) of the working picture, the ends excluded."""
    picture: Array
    """[h, w, 3] float32 linear."""
    share: Array
    """[h, w] float32 in [0, 1] of the glass."""
    filled: Array
    """[h, w] bool where the photo is filled in."""


@dataclass(frozen=True)
class GlassState:
    """The state of a client's last request."""

    asked: int
    """Number of the last request; 0 for none."""
    waiting: bool
    """Whether it is not answered yet."""
    words: str
    """A sentence about it."""
    bad: bool = False
    """Whether that is an error."""


def is_traced(step: Step) -> bool:
    """Whether a step is glass that the worker traces: the paper's two-interface model is shown by other means."""
    return step.kind == "glass" and str(step.options.get("model", "closed")) == "closed"


def checked(scene: Scene, step: Step) -> tuple[Array, Tint]:
    """Region [H, W] bool and tint of a glass step, without building anything.

    Raises InputError for values out of range, and for a region without a surface.
    """
    region, options = glass_arguments(scene, step)
    if not (region & (scene.depth > 0)).any():
        raise InputError("The selection covers only sky; select a surface.")
    return region, options.tint


class GlassClient:
    """Glass of one open scene, traced in a process that starts with the first request and keeps its bodies.

    Only the newest request counts; pictures of those before it are dropped. Methods may be called from any thread,
    and none of them waits for the process.
    """

    def __init__(self, scene: Path):
        self.changed = threading.Condition(threading.RLock())
        self._scene = str(scene)
        self._worker: Worker | None = None
        self._number, self._answered, self._since = 0, 0, 0.0
        self._sent = 0
        self._key, self._body, self._stage, self._message = "", "", "", ""
        self._panes: dict[str, tuple[str, Pane]] = {}

    def ask(self, others: tuple[Step, ...], step: Step) -> None:
        """Request the picture of a glass step, the other steps of the list being these; once for equal requests."""
        request = self._request(others, step)
        key = json.dumps(request, default=str)
        with self.changed:
            if key == self._key:
                return
            self._key, self._message, self._number = key, "", next(_NUMBERS)
            if self._panes.get(_place(step), ("",))[0] == key:
                self._answered, self._sent = self._number, 0
            else:
                self._send(request)
            self.changed.notify_all()

    def pane(self, step: Step) -> Pane | None:
        """The last picture of a glass step, perhaps with earlier values."""
        with self.changed:
            found = self._panes.get(_place(step))
        return found[1] if found else None

    def fresh(self, others: tuple[Step, ...], step: Step) -> bool:
        """Whether `pane` shows exactly this step among these others."""
        with self.changed:
            return self._panes.get(_place(step), ("",))[0] == json.dumps(self._request(others, step), default=str)

    @property
    def state(self) -> GlassState:
        """The state of the last request."""
        with self.changed:
            if self._number == self._answered:
                return GlassState(self._number, False, self._message, bool(self._message))
            words = f"{_WORDS.get(self._stage, _WORDS['load'])} … {time.monotonic() - self._since:.0f} s"
            return GlassState(self._number, True, words)

    def keep(self, steps: tuple[Step, ...]) -> None:
        """Forget panes of other steps than these, and end the process when there is no glass any more."""
        places = {_place(step) for step in steps if is_traced(step)}
        with self.changed:
            self._panes = {place: pane for place, pane in self._panes.items() if place in places}
        if not places:
            self.stop()

    def stop(self) -> None:
        """End the process and forget the panes; a later request starts anew."""
        with self.changed:
            worker, self._worker = self._worker, None
            self._panes.clear()
            self._key, self._body, self._message, self._answered = "", "", "", self._number
            self.changed.notify_all()
        if worker is not None:
            worker.kill()

    def _request(self, others: tuple[Step, ...], step: Step) -> Request:
        return {
            "scene": self._scene, "folder": str(step.folder.resolve()),
            "others": [[one.kind, one.options] for one in others],
            "glass": {name: step.options[name] for name in sorted(step.options) if name != "skip"},
        }  # fmt: skip

    def _send(self, request: Request) -> None:
        """To the process: a new one where none runs, or where it is building another body."""
        body = body_key(request)
        if self._worker is not None and self._body != body and self._stage == "build":
            self._worker.kill()
            self._worker = None
        try:
            if self._worker is None:
                self._start()
        except (OSError, InputError) as error:
            self._message, self._answered = str(error), self._number
            return
        assert self._worker is not None
        if body != self._body or self._stage == "trace":
            self._since = time.monotonic()
        if body != self._body:
            self._body, self._stage = body, "load"
        self._sent = self._worker.begin(trace, {"request": request})

    def _start(self) -> None:
        import psutil

        if psutil.virtual_memory().available < SETTINGS.free_for_glass:
            raise InputError(
                "This machine has too little memory free to trace glass while sliders move; press Quick look instead."
            )
        self._worker, self._stage = Worker(niceness=SETTINGS.glass_niceness, idle=SETTINGS.glass_idle), "load"
        threading.Thread(target=self._listen, args=(self._worker,), name="glass", daemon=True).start()

    def _listen(self, worker: Worker) -> None:
        """Take what a process says until it ends."""
        for message in worker.messages():
            with self.changed:
                if worker is self._worker:
                    self._take(message)
                self.changed.notify_all()

    def _take(self, message: Message) -> None:
        if message.kind == PROGRESS:
            self._stage = message.facts["stage"]
        elif message.kind == LOST:
            self._worker = None
            if self._answered != self._number:
                self._message = "The tracing of glass ended by itself; move a slider to start it again."
                self._answered, self._key = self._number, ""
        elif message.number == self._sent:  # else a newer one is under way
            self._answered = self._number
            if message.kind == DONE and message.facts is not None:
                request = json.loads(self._key)
                self._panes[_place(Step("glass", request["glass"]))] = (self._key, message.facts)
            elif message.kind == FAILED:
                self._message = sentence(message.facts)


def _place(step: Step) -> str:
    """Which object a glass step is about."""
    return json.dumps({name: step.options.get(name) for name in REGION}, default=str)


def body_key(request: Request) -> str:
    """Key of a body and its background: requests with the same key differ only in VALUES."""
    fixed = {name: value for name, value in request["glass"].items() if name not in VALUES}
    return json.dumps([request["scene"], request["others"], fixed], default=str)


class GlassBodies:
    """The scene, and the last few glass bodies in it."""

    def __init__(self) -> None:
        self._scene: tuple[str, Any] | None = None
        self._built: OrderedDict[str, Any] = OrderedDict()

    def preview(self, report: Reporter, request: Request) -> tuple[Any, dict[str, Any]]:
        """(the `GlassPreview` of a request, values for its picture). Raises InputError."""
        folder, key = Path(request["folder"]), body_key(request)
        report("load", 0, 1)
        scene = self._loaded(request["scene"])
        region, options = glass_arguments(scene, Step("glass", request["glass"], folder))
        if key not in self._built:
            from materialist.edits.glass.preview import GlassPreview

            report("build", 0, 1)
            edited = apply(scene, [Step(kind, given, folder) for kind, given in request["others"]])
            self._built[key] = GlassPreview(edited, region, options)
        self._built.move_to_end(key)
        while len(self._built) > SETTINGS.glass_bodies:
            self._built.popitem(last=False)
        return self._built[key], {name: getattr(options, name) for name in VALUES}

    def _loaded(self, path: str) -> Any:
        if self._scene is None or self._scene[0] != path:
            from materialist.io.package import load_scene

            self._built.clear()
            self._scene = (path, load_scene(path))
        return self._scene[1]


_BODIES = GlassBodies()
"""Of this process."""


def trace(report: Reporter, request: Request) -> Pane | None:
    """The pane of one request; None where a newer one came meanwhile. Raises InputError."""
    preview, values = _BODIES.preview(report, request)
    if report.outdated:
        return None
    report("trace", 0, 1)
    picture = preview.picture(**values)
    shown = (preview.share > 0) | preview.filled
    rows, columns = np.flatnonzero(shown.any(1)), np.flatnonzero(shown.any(0))
    top, bottom, left, right = int(rows[0]), int(rows[-1]) + 1, int(columns[0]), int(columns[-1]) + 1
    cut = (slice(top, bottom), slice(left, right))
    share = np.ascontiguousarray(preview.share[cut], np.float32)
    return Pane((top, bottom, left, right), np.ascontiguousarray(picture[cut]), share, preview.filled[cut].copy())
