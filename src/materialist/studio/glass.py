"""Glass on the page: what is asked of the tracing process of a session, and the last panes that it made."""

from __future__ import annotations

import base64
import json
import subprocess
import threading
import time
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from materialist.edits.glass.glass import check_glass
from materialist.edits.recipe import Step, glass_arguments
from materialist.errors import InputError
from materialist.studio import child
from materialist.studio.glass_worker import body_key
from materialist.types import Array, Scene

WORKER = "materialist.studio.glass_worker"
LEAST_FREE = 2.0e9
"""Bytes of memory that must be free before the process starts."""
Tint = tuple[float, float, float]
_REGION = ("mask", "click", "box", "with")
_NUMBERS = count(1)
"""Of requests: two scenes opened on one page have no number in common."""
_WORDS = {"load": "Getting the glass ready", "build": "Building the glass body", "trace": "Tracing the glass"}


@dataclass(frozen=True)
class Pane:
    """A traced piece of glass, and the ground around it that the object had hidden."""

    shows: str
    """The request that it answers."""
    box: tuple[int, int, int, int]
    """Rows and columns (top, bottom, left, right) of the working picture, the ends excluded."""
    picture: Array
    """[h, w, 3] float32 linear."""
    share: Array
    """[h, w] float32 in [0, 1] of the glass."""
    filled: Array
    """[h, w] bool where the photo is filled in."""


@dataclass(frozen=True)
class State:
    """What a tracer is doing."""

    asked: int
    """Number of the last request; 0 for none."""
    waiting: bool
    """Whether it is not answered yet."""
    words: str
    """What to say of it."""
    bad: bool = False
    """Whether that is an error."""


def traced(step: Step) -> bool:
    """Whether a step is glass that the tracer can show: the paper's two-interface model is shown by other means."""
    return step.kind == "glass" and str(step.options.get("model", "closed")) == "closed"


def checked(scene: Scene, step: Step) -> tuple[Array, Tint]:
    """Region [H, W] bool and tint of a glass step, in no time.

    Raises InputError for values out of range, and for a region without a surface.
    """
    region, options = glass_arguments(scene, step)
    tint = options.get("tint", (1.0, 1.0, 1.0))
    check_glass(options.get("ior", 1.5), options.get("transmission", 1.0), tint, options.get("roughness", 0.0))
    if not (region & (scene.depth > 0)).any():
        raise InputError("The selection covers only sky; select a surface.")
    return region, tint


class Tracer:
    """Glass of one open scene, traced in a process that starts with the first request and keeps what it built.

    Only the newest request counts; pictures of those before it are dropped. Methods may be called from any thread,
    and none of them waits for the process.
    """

    def __init__(self, scene: Path):
        self.changed = threading.Condition(threading.RLock())
        self._scene = str(scene)
        self._process: subprocess.Popen[str] | None = None
        self._number, self._answered, self._since = 0, 0, 0.0
        self._key, self._body, self._stage, self._message = "", "", "", ""
        self._next: dict[str, Any] | None = None
        self._panes: dict[str, Pane] = {}

    def ask(self, others: tuple[Step, ...], step: Step) -> None:
        """Want the picture of a glass step, the other steps of the list being these; the same wish twice is one."""
        request = self._request(others, step)
        key, body = json.dumps(request, default=str), body_key(self._scene, request["others"], request["glass"])
        with self.changed:
            if key == self._key:
                return
            known = self._panes.get(_place(step))
            self._key, self._message = key, ""
            self._number = next(_NUMBERS)
            if known is not None and known.shows == key:
                self._answered = self._number
            else:
                self._send(request, body)
            self.changed.notify_all()

    def pane(self, step: Step) -> Pane | None:
        """The last picture of a glass step: of these values, or of values that it had before."""
        with self.changed:
            return self._panes.get(_place(step))

    def fresh(self, others: tuple[Step, ...], step: Step) -> bool:
        """Whether `pane` shows exactly this step among these others."""
        pane = self.pane(step)
        return pane is not None and pane.shows == json.dumps(self._request(others, step), default=str)

    @property
    def state(self) -> State:
        with self.changed:
            if self._number == self._answered:
                return State(self._number, False, self._message, bool(self._message))
            words = f"{_WORDS.get(self._stage, _WORDS['load'])} … {time.monotonic() - self._since:.0f} s"
            return State(self._number, True, words)

    def keep(self, steps: tuple[Step, ...]) -> None:
        """Forget panes of what is no longer among the steps, and end the process when there is no glass any more."""
        places = {_place(step) for step in steps if traced(step)}
        with self.changed:
            self._panes = {place: pane for place, pane in self._panes.items() if place in places}
        if not places:
            self.rest()

    def rest(self) -> None:
        """End the process and forget the panes; a later request starts anew."""
        with self.changed:
            process, self._process = self._process, None
            self._panes.clear()
            self._key, self._body, self._message, self._answered = "", "", "", self._number
            self.changed.notify_all()
        if process is not None:
            child.kill(process)

    def _request(self, others: tuple[Step, ...], step: Step) -> dict[str, Any]:
        return {
            "scene": self._scene, "folder": str(step.folder.resolve()),
            "others": [[one.kind, one.options] for one in others],
            "glass": {name: step.options[name] for name in sorted(step.options) if name != "skip"},
        }  # fmt: skip

    def _send(self, request: dict[str, Any], body: str) -> None:
        """To the process: a new one where none runs, or where it is building another body."""
        if self._process is not None and self._body != body and self._stage == "build":
            child.kill(self._process)
            self._process = None
        try:
            if self._process is None:
                self._start()
        except (OSError, InputError) as error:
            self._message, self._answered = str(error), self._number
            return
        assert self._process is not None
        if body != self._body or self._stage == "trace":
            self._since = time.monotonic()
        if body != self._body:
            self._body, self._stage = body, "load"
        self._next = {"ask": self._number, **request}

    def _start(self) -> None:
        import psutil

        if psutil.virtual_memory().available < LEAST_FREE:
            raise InputError(
                "This machine has too little memory free to trace glass while sliders move; press Quick look instead."
            )
        self._process, self._stage = child.start(WORKER), "load"
        for work in (self._speak, self._listen):
            threading.Thread(target=work, args=(self._process,), name="glass", daemon=True).start()

    def _speak(self, process: subprocess.Popen[str]) -> None:
        """Hand a process the newest request, however long it takes to read it."""
        while True:
            with self.changed:
                self.changed.wait_for(lambda: process is not self._process or self._next is not None)
                if process is not self._process or self._next is None:
                    return
                request, self._next = self._next, None
            child.ask(process, request)

    def _listen(self, process: subprocess.Popen[str]) -> None:
        """Take what a process says until it ends."""
        try:
            for entry in child.lines(process):
                with self.changed:
                    if process is self._process:
                        self._take(entry)
        finally:
            child.close(process)
            with self.changed:
                if process is self._process:
                    self._process = None
                    if self._answered != self._number:
                        self._message = "The tracing of glass ended by itself; move a slider to start it again."
                        self._answered, self._key = self._number, ""
                self.changed.notify_all()

    def _take(self, entry: dict[str, Any]) -> None:
        if "stage" in entry:
            self._stage = entry["stage"]
        elif entry.get("ask") == self._number:  # else a newer one is under way
            self._answered = self._number
            if "pane" in entry:
                request = json.loads(self._key)
                self._panes[_place(Step("glass", request["glass"]))] = _pane(entry["pane"], self._key)
            else:
                self._message = entry["error"]
        self.changed.notify_all()


def _place(step: Step) -> str:
    """Which object a glass step is about."""
    return json.dumps({name: step.options.get(name) for name in _REGION}, default=str)


def _pane(told: dict[str, Any], shows: str) -> Pane:
    """A pane as the process tells it; see `glass_worker.pane`."""
    top, bottom, left, right = told["box"]
    size = (bottom - top, right - left)
    array = lambda name, kind: np.frombuffer(base64.b64decode(told[name]), kind)  # noqa: E731
    return Pane(
        shows, (top, bottom, left, right), array("picture", "<f2").reshape(*size, 3).astype(np.float32),
        array("share", np.uint8).reshape(size).astype(np.float32) / 255, array("filled", np.uint8).reshape(size) > 0,
    )  # fmt: skip
