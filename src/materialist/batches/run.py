"""`materialist.batch`: the loop that hands photos to workers and records the results."""

from __future__ import annotations

import os
import sys
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from materialist import __version__, errors
from materialist.batches.edits import missing_files
from materialist.batches.ledger import Ledger, open_ledger
from materialist.batches.outcome import Outcome, Row, Status, write_summary
from materialist.batches.page import write_pages
from materialist.batches.photos import Listed, list_photos
from materialist.batches.plan import check_options, fingerprint, plan
from materialist.batches.remote import is_url
from materialist.batches.task import INVERSION, SINGLE_THREAD, PhotoTask, process
from materialist.edits.recipe import read_recipe
from materialist.errors import InputError
from materialist.jobs.pool import LocalPool, Pool
from materialist.jobs.process import LOST, Message
from materialist.jobs.worker import DONE, FAILED, FOUND, PROGRESS

Watch = Callable[[Status], None]


@dataclass(frozen=True)
class Pace:
    """How often a batch does things; tuned by eye."""

    tries: int = 3  # how often a photo is begun whose worker dies
    refresh: float = 30.0  # least seconds between two writings of the summary and the page while the batch runs,
    share: float = 50  # and least ratio of other work to the time of a writing


PACE = Pace()


@dataclass(frozen=True, kw_only=True)
class BatchOptions:
    """How a batch runs, beside the options of its inversions."""

    apply: str | Path | None = None
    """A list of edits (docs/editing.md); `{name}` in its file names stands for the photo's name."""
    spp: int = 256
    """Paths per pixel of the edit's renderings."""
    workers: int | None = None
    """Worker processes; None: one a GPU, else one a processor as far as memory reaches."""
    ray: str | None = None
    """Address of a Ray cluster instead, or `local`."""
    resume: bool = False
    """Go on with the batch in RUNS: finished photos are kept, all others redone."""
    force: bool = False
    """Replace an earlier batch in RUNS, or with `resume` go on although the options are others."""
    function: str = INVERSION
    """The inversion, as module:function."""

    def __post_init__(self) -> None:
        """Raises InputError."""
        if self.apply is not None and not 2 <= self.spp <= 1_000_000:
            raise InputError(f"spp is a number of paths from 2 to 1000000, not {self.spp}.")
        if self.workers is not None and self.workers < 1:
            raise InputError(f"The number of workers is {self.workers}; give at least 1.")

    @property
    def recipe(self) -> Path | None:
        """The list of edits as a path."""
        return None if self.apply is None else Path(self.apply).resolve()


def batch(source: str | Path, runs: str | Path, *, progress: Watch | None = None, **options: Any) -> Outcome:
    """Invert every photo of SOURCE into RUNS/NAME.scene, and apply a list of edits to each as RUNS/NAME.png.

    A photo that cannot be inverted is recorded with its reason and stops nothing; a worker that dies loses only its
    photo, which is begun again, `Pace.tries` times in all. The results do not depend on the number of workers.

    Args:
        source: a folder, a list file, a photo, or a URL; see `list_photos`.
        runs: folder of the results, on this machine or one that the cluster shares.
        progress: called with a Status whenever something happens.
        options: fields of BatchOptions, and options of `materialist.invert`; `{name}` in a text is the photo's name.

    Raises:
        InputError: options or edits that no photo could be inverted with; RUNS is another's.
        OutputError: RUNS cannot be written. SetupError, WeightsError: what every photo needs is missing here.
        KeyboardInterrupt: as pressed, after the workers are ended and the summary is written.
    """
    start = time.monotonic()
    own = {one.name for one in fields(BatchOptions)}
    how = BatchOptions(**{name: value for name, value in options.items() if name in own})
    asked: dict[str, Any] = {"predictor": "auto", "size": 512, "fov": "auto", "seed": 0, "device": "auto"}
    asked |= {name: value for name, value in options.items() if name not in own}
    check_options(asked)
    if how.recipe is not None:
        _check_files(how.recipe)
    photos, folder = list_photos(source, runs=runs), Path(runs)
    ledger = open_ledger(folder, {**asked, "tool_version": __version__}, resume=how.resume, force=how.force)
    run = None
    try:
        template = PhotoTask("", "", "", folder.resolve(), asked, how.recipe, how.spp, function=how.function)
        tasks, finished = plan(photos, ledger, template)
        run = _Run(folder, photos, ledger, tasks, len(finished), asked, progress or (lambda _: None))
        run.start = start
        if how.recipe is not None and (notice := _lacking(how.recipe, tasks, none_done=not finished)):
            run.tell(notice, urgent=True)
        if tasks:
            run.work(_pool(how, len(tasks), asked["device"], asked["size"]))
        return run.outcome()
    finally:
        if run is not None:
            run.write()
        ledger.close()


def _pool(how: BatchOptions, tasks: int, device: str, size: int) -> Pool:
    if how.ray is not None:
        from materialist.jobs.ray_pool import RayPool

        return RayPool(how.ray, SINGLE_THREAD, workers=how.workers, gpu=device != "cpu")
    return LocalPool(environments(min(how.workers or default_workers(device, size), tasks), device))


def environments(workers: int, device: str) -> list[dict[str, str]]:
    """Environment variables of each worker: one thread, and its GPU where there are any."""
    gpus = visible_gpus() if device != "cpu" else []
    return [SINGLE_THREAD | ({"CUDA_VISIBLE_DEVICES": gpus[k % len(gpus)]} if gpus else {}) for k in range(workers)]


def default_workers(device: str = "auto", size: int = 512) -> int:
    """One for each GPU that may be used, else one for each processor as far as memory reaches."""
    gpus = visible_gpus() if device != "cpu" else []
    if gpus:
        return len(gpus)
    import psutil

    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(processors, int(psutil.virtual_memory().available / 1e6 / worker_mb(size))))


def worker_mb(size: int) -> float:
    """Memory to count on for a worker at a working size, MB: measured were 1.5 GB at 512 and 3.7 GB at 1024."""
    return 720 + 2.9e-3 * size**2


def visible_gpus() -> list[str]:
    """Names by which CUDA can be told to use one GPU; none where no driver answers."""
    from materialist.render.variant import cuda_usable

    if not cuda_usable():
        return []
    chosen = os.environ.get("CUDA_VISIBLE_DEVICES")
    if chosen is not None:
        return [name.strip() for name in chosen.split(",") if name.strip()]
    import ctypes

    count = ctypes.c_int()
    ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1").cuDeviceGetCount(ctypes.byref(count))
    return [str(k) for k in range(count.value)]


def _check_files(recipe: Path) -> None:
    """Refuse edits whose files every photo lacks. Raises InputError."""
    missing = [file for file in missing_files(read_recipe(recipe), "{name}") if "{name}" not in file]
    if missing:
        raise InputError(f"There is no file {missing[0]}, which {recipe} names; put it there, or change the edits.")


def _lacking(recipe: Path, tasks: list[PhotoTask], *, none_done: bool) -> str | None:
    """A sentence on photos whose edits name a file that is missing. Raises InputError where all photos are such."""
    steps = read_recipe(recipe)
    found = [(task, missing[0]) for task in tasks if (missing := missing_files(steps, task.name))]
    if not found:
        return None
    task, file = found[0]
    if none_done and len(found) == len(tasks):
        raise InputError(f"No photo has the files that {recipe} names (there is no {file} for {task.id}); put them "
                         "there, and add --resume.")  # fmt: skip
    return (f"{len(found)} of {len(tasks)} photos lack a file that {recipe} names (there is no {file} for {task.id}); "
            "they get a scene, but no edited photo unless it is there by then.")  # fmt: skip


class _Run:
    """The state of a batch at work."""

    def __init__(
        self, runs: Path, photos: list[Listed], ledger: Ledger, tasks: list[PhotoTask], kept: int,
        options: dict[str, Any], watch: Watch,
    ) -> None:  # fmt: skip
        self._runs, self._photos, self._ledger, self._watch = runs, photos, ledger, watch
        self._options, self._kept = options, kept
        self._waiting = deque(tasks)
        self._tasks = {task.id: task for task in tasks}
        self._stages: dict[str, str] = {}
        self._tries: dict[str, int] = {}
        self._through = self._failed = 0
        self._before = {task.id: ledger.last.get(task.id) for task in tasks}
        self.start = self._worked = time.monotonic()
        self._written, self._writing = self._worked, 0.0

    def work(self, pool: Pool) -> None:
        """Run until every photo is over, or an error occurs that would fail all of them."""
        try:
            while self._waiting or self._stages:
                while self._waiting and pool.free() > 0:
                    self._begin(pool, self._waiting.popleft())
                self.tell(None)
                for key, message in pool.wait(1.0):
                    self._hear(self._tasks[key], message)
                if time.monotonic() - self._written > max(PACE.refresh, PACE.share * self._writing):
                    self.write()
        finally:
            pool.close()

    def outcome(self) -> Outcome:
        """The state of all photos."""
        rows = tuple(self._row(photo) for photo in self._photos)
        return Outcome(self._runs, rows, self._kept, time.monotonic() - self.start, self._options)

    def write(self) -> None:
        """Write the summary and the page."""
        begun = time.monotonic()
        outcome = self.outcome()
        write_summary(outcome)
        write_pages(outcome)
        self._written = time.monotonic()
        self._writing = self._written - begun

    def _begin(self, pool: Pool, task: PhotoTask) -> None:
        self._tries[task.id] = self._tries.get(task.id, 0) + 1
        self._stages[task.id] = "begin"
        before = self._ledger.last.get(task.id, {})
        # What lies there and is of nobody else is this batch's from now on, however this try ends.
        own = {"own_scene": _own(before, "own_scene", "scene_bytes") or not task.scene.exists(),
               "own_picture": _own(before, "own_picture", "picture_hash")
               or (task.edits is not None and not task.picture.exists())}  # fmt: skip
        # The facts of a scene that is kept stay in the ledger's last entry until there is another.
        known = {key: before[key] for key in _OF_THE_SCENE if key in before} if task.inverted else {}
        self._ledger.append("begin", id=task.id, name=task.name, **known, **own)
        task = replace(task, replace_scene=own["own_scene"], replace_picture=own["own_picture"])
        pool.begin(task.id, process, {"task": task})

    def _hear(self, task: PhotoTask, message: Message) -> None:
        if message.kind in (PROGRESS, FOUND):
            self._stages[task.id] = str(message.facts.get("stage", self._stages[task.id]))
            return
        facts, stage = message.facts, self._stages.pop(task.id, None)
        if message.kind == LOST and self._tries[task.id] < PACE.tries:
            self._waiting.appendleft(task)
            self.tell(f"{task.id}: {facts['reason']} It is begun again.")
            return
        if message.kind == FAILED:
            _stop_if_for_all(facts)
        if message.kind == LOST:
            facts = {**facts, "reason": f"{facts['reason']} It was begun {PACE.tries} times.", "stage": stage}
        if "photo_hash" in facts and is_url(task.location):
            facts = {**facts, "photo_version": fingerprint(task.location)}
        before = self._ledger.last.get(task.id, {})
        kind = DONE if message.kind == DONE else FAILED
        known = {key: before[key] for key in (*_OF_THE_SCENE, *_OWN) if key in before}
        if kind == FAILED:  # where it left nothing, what is there next time is somebody else's
            known |= {key: known[key] and place.exists() for key, place in zip(_OWN, (task.scene, task.picture))
                      if key in known}  # fmt: skip
        self._ledger.append(kind, id=task.id, name=task.name, attempts=self._tries[task.id], **{**known, **facts})
        self._through += 1
        self._failed += kind == FAILED
        self.tell(_line(task, kind, facts), urgent=kind == FAILED)

    def tell(self, news: str | None, urgent: bool = False) -> None:
        """Reporter the state, and what has happened."""
        total, over = len(self._photos), self._kept + self._through
        rate = self._through / max(time.monotonic() - self._worked, 1e-9)
        left = (total - over) / rate if rate else None
        running = {self._tasks[id].name: stage for id, stage in self._stages.items()}
        self._watch(Status(total, over - self._failed, self._failed, rate, left, running, news, urgent))

    def _row(self, photo: Listed) -> Row:
        entry = self._ledger.last.get(photo.id, {})
        task = self._tasks.get(photo.id)
        name = task.name if task else entry.get("name", "")
        stale = entry.get("event") not in (DONE, FAILED) or self._before.get(photo.id) is entry
        status = "open" if stale else entry["event"]
        return Row({**entry, "id": photo.id, "name": name, "status": status})


_OF_THE_SCENE = ("invert_seconds", "photo_version", "scene_bytes", "photo_hash")
"""Facts of a scene that was kept while its edit was redone."""
_OWN = ("own_scene", "own_picture")
"""Whether what lies at a place is of this batch."""


def _own(entry: dict[str, Any], key: str, written: str) -> bool:
    """Whether the last entry on a photo says that this batch made what lies there; old ledgers have only `written`."""
    return bool(entry.get(key, written in entry))


def _line(task: PhotoTask, kind: str, facts: dict[str, Any]) -> str:
    """A line of the log."""
    if kind == FAILED:
        return f"{task.id}: failed: {facts['reason']}"
    quality = f", {facts['psnr']:.1f} dB" if facts.get("psnr") is not None else ""
    return f"{task.id}: done in {facts['seconds']:.1f} s{quality}"


def _stop_if_for_all(facts: dict[str, Any]) -> None:
    """Raise what would fail every other photo in the same way: options that fit none, or what this machine lacks."""
    machine = facts["error"] in ("SetupError", "WeightsError") and facts["stage"] != "read"
    if machine or (facts["error"] == "InputError" and facts["stage"] == "start"):
        raise getattr(errors, facts["error"])(facts["reason"])
