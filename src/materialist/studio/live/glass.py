"""Glass that follows its sliders: the client in the studio, and the task that a worker process does for it.

The worker keeps the last few bodies and makes one picture after the other; only the newest request counts.
"""

import json
import threading
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any

import psutil

import materialist as mt
from materialist.edits.core.operation import REGION, PreviewMode
from materialist.edits.recipe import Step, apply, options_of, region_of
from materialist.edits.remove.filling import remembered
from materialist.errors import InputError
from materialist.jobs.process import LOST, Message, Worker, sentence
from materialist.jobs.worker import DONE, FAILED, PROGRESS, Reporter
from materialist.studio import SETTINGS
from materialist.studio.edit_list import kept, with_options
from materialist.types import Array, Scene

VALUES = ("ior", "transmission", "tint", "roughness")
"""Options of a glass step that its body does not depend on."""
Request = tuple[tuple[Step, ...], Step]
"""The other steps of a list, and the glass whose picture is wanted."""
_BODIES: dict[str, Any] = {}
"""The last `GlassPreview`s of this process."""
_WORDS = {"build": "Building the glass body …", "trace": "Tracing the glass …"}


@dataclass(frozen=True)
class Pane:
    """A traced piece of glass, and the ground around it that the object had hidden; at working size."""

    picture: Array
    """[H, W, 3] float32 linear."""
    share: Array
    """[H, W] float32 in [0, 1] of the glass."""
    filled: Array
    """[H, W] bool where the photo is filled in."""


@dataclass(frozen=True)
class GlassState:
    """The state of a client's last request."""

    waiting: bool = False
    """Whether it is not answered yet."""
    words: str = ""
    bad: bool = False


Panes = dict[str, Pane]
"""`place` of a glass step -> its last picture."""


def is_traced(step: Step) -> bool:
    """Whether a step is glass that the worker traces: the paper's two-interface model is shown by other means."""
    is_closed = str(step.options.get("model", "closed")) == "closed"
    return step.operation.preview is PreviewMode.TRACED and is_closed


class GlassClient:
    """Glass of one open scene, traced in a process that starts with the first request and keeps its bodies.

    Only the newest request counts; pictures of those before it are dropped. Methods may be called from any thread,
    and none of them waits for the process.
    """

    def __init__(self, scene: Path):
        self.changed = threading.Condition(threading.RLock())
        self._scene = str(scene)
        self._worker: Worker | None = None
        self._asked: Request | None = None
        """The last request."""
        self._number = 0
        """Its number at the worker."""
        self.state = GlassState()
        self._panes: dict[str, tuple[Request, Pane]] = {}
        """Object -> (request, its answer)."""

    def ask(self, steps: tuple[Step, ...], step: Step) -> None:
        """Request the picture of a glass step of this list; once for equal requests."""
        request = _request(steps, step)
        with self.changed:
            # A slider sends the same value more than once.
            if request == self._asked:
                return
            self._asked = request
            self.state = GlassState()
            if not self.fresh(steps, step):
                self._send(*request)
            self.changed.notify_all()

    def get_ready(self) -> None:
        """Let the process load what glass needs, while somebody looks at what they have selected."""
        with self.changed:
            # Without it the first picture starts it, or says why it cannot.
            if self._worker is None:
                with suppress(OSError, InputError):
                    self._start().begin(load, {"scene": self._scene})

    def pane(self, step: Step) -> Pane | None:
        """The last picture of a glass step, perhaps with earlier values."""
        return self._panes.get(place(step), (None, None))[1]

    def panes(self, steps: tuple[Step, ...]) -> Panes:
        """The last pictures of the glass in a list, where there are any."""
        shown = {place(step): self.pane(step) for step in steps if is_traced(step)}
        return {name: pane for name, pane in shown.items() if pane is not None}

    def fresh(self, steps: tuple[Step, ...], step: Step) -> bool:
        """Whether `pane` shows exactly this step of this list."""
        return self._panes.get(place(step), (None, None))[0] == _request(steps, step)

    def keep(self, steps: tuple[Step, ...]) -> None:
        """Forget panes of other steps than these, and end the process when there is no glass any more."""
        places = {place(step) for step in steps if is_traced(step)}
        with self.changed:
            self._panes = {name: pane for name, pane in self._panes.items() if name in places}
            had_glass = self._asked is not None
        if had_glass and not places:
            self.stop()

    def stop(self) -> None:
        """End the process and forget the panes; a later request starts anew."""
        with self.changed:
            worker = self._worker
            self._worker = None
            self._panes.clear()
            self._asked = None
            self.state = GlassState()
            self.changed.notify_all()
        if worker is not None:
            worker.kill()

    def _send(self, others: tuple[Step, ...], step: Step) -> None:
        """Send a request to the process; start one where none runs."""
        try:
            worker = self._worker or self._start()
        except (OSError, InputError) as error:
            self.state = GlassState(False, str(error), True)
            return
        self.state = GlassState(True, "Getting the glass ready …")
        self._number = worker.begin(trace, {"scene": self._scene, "others": others, "step": step})

    def _start(self) -> Worker:
        """Start the process. Raises OSError, and InputError where memory is short."""
        # Tracing needs a scene of its own in memory.
        if psutil.virtual_memory().available < SETTINGS.free_for_glass:
            raise InputError(
                "This machine has too little memory free to trace glass while sliders move; press Final picture "
                "instead."
            )
        self._worker = worker = Worker(
            niceness=SETTINGS.glass_niceness, idle=SETTINGS.glass_idle, memory=SETTINGS.job_memory
        )
        threading.Thread(target=self._listen, args=(worker,), name="glass", daemon=True).start()
        return worker

    def _listen(self, worker: Worker) -> None:
        """Take the messages of a process until it ends."""
        for message in worker.messages():
            with self.changed:
                if worker is self._worker:
                    self._take(message)
                self.changed.notify_all()

    def _take(self, message: Message) -> None:
        if message.kind == LOST:
            self._worker = None
            if self.state.waiting:
                self._asked = None
                # A process that ends without a request at work was idle.
                words = "The tracing of glass ended by itself; move a slider to start it again."
                self.state = GlassState(False, words, True)
        elif not self.state.waiting or message.number != self._number:
            return  # a newer request is under way
        elif message.kind == PROGRESS:
            self.state = GlassState(True, _WORDS.get(message.facts["stage"], self.state.words))
        elif message.kind == DONE and message.facts is not None and self._asked is not None:
            self._panes[place(self._asked[1])] = (self._asked, message.facts)
            self.state = GlassState()
        elif message.kind == FAILED:
            self.state = GlassState(False, sentence(message.facts), True)


def _request(steps: tuple[Step, ...], step: Step) -> Request:
    return tuple(other for other in steps if other is not step), with_options(step, skip=None)


def place(step: Step) -> str:
    """Which object a glass step is about."""
    return json.dumps({name: step.options.get(name) for name in REGION}, default=str)


@lru_cache(1)
def _loaded(path: str) -> Scene:
    return mt.load_scene(path)


def load(report: Reporter, scene: str) -> None:
    """Load what glass needs, but PyTorch, half of the memory: `trace` loads it while it does other things."""
    import onnxruntime  # noqa: F401

    import materialist.edits.glass.glass_preview
    import materialist.render.pixels  # noqa: F401
    from materialist.render.denoise import require_denoiser
    from materialist.render.variant import setup

    setup()
    require_denoiser()
    _loaded(scene)


def trace(report: Reporter, scene: str, others: tuple[Step, ...], step: Step) -> Pane | None:
    """The pane of a glass step after other steps; None where a newer request came meanwhile. Raises InputError."""
    options = options_of(step)
    report("build", 0, 1)
    # The body is the same for all values of these options.
    fixed = with_options(step, **dict.fromkeys(VALUES))

    def build() -> Any:
        from materialist.edits.glass.glass_preview import GlassPreview

        threading.Thread(target=import_module, args=("torch",), daemon=True).start()
        loaded = _loaded(scene)
        edited = apply(loaded, list(others)) if others else loaded
        return GlassPreview(edited, region_of(loaded, fixed), options_of(fixed))

    # Building takes seconds: meanwhile a newer request may have come.
    with remembered(step.folder):
        preview = kept(_BODIES, (*others, fixed), build, SETTINGS.glass_bodies)
    if report.outdated:
        return None
    report("trace", 0, 1)
    picture = preview.picture(**{name: getattr(options, name) for name in VALUES})
    return Pane(picture, preview.share, preview.filled)
