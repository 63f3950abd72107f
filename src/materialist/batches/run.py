"""`materialist.batch`: the loop that hands photos to workers and records the results."""

import os
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from materialist import __version__, errors
from materialist.batches.edits import missing_files
from materialist.batches.ledger import Ledger, open_ledger
from materialist.batches.options import BatchOptions
from materialist.batches.outcome import Outcome, Row, Status, write_page, write_summary
from materialist.batches.photos import Listed, list_photos
from materialist.batches.plan import check_options, plan
from materialist.batches.task import SINGLE_THREAD, PhotoTask, process
from materialist.edits.recipe import read_recipe
from materialist.errors import InputError
from materialist.jobs.pool import LocalPool, RayPool
from materialist.jobs.process import LOST, Message
from materialist.jobs.worker import DONE, FAILED, FOUND, PROGRESS

Watch = Callable[[Status], None]


@dataclass(frozen=True)
class BatchSettings:
    """How often a batch does things; tuned by eye."""

    tries: int = 3  # how often a photo is begun whose worker dies
    refresh: float = 30.0  # seconds between two writings of the summary and the page while the batch runs


SETTINGS = BatchSettings()


def batch(source: str | Path, runs: str | Path, *, progress: Watch | None = None, **options: Any) -> Outcome:
    """Invert every photo of SOURCE into RUNS/NAME.scene, and apply a list of edits to each as RUNS/NAME.png.

    A photo that cannot be inverted is recorded with its reason and stops nothing; a worker that dies loses only its
    photo, which is begun again, `BatchSettings.tries` times in all. The results do not depend on the number of workers.

    `source`: see `list_photos`. `progress` is called with a Status whenever something happens. `options`: fields of
    BatchOptions, and options of `materialist.invert`; `{name}` in a text is the photo's name.

    Raises InputError for options or edits that no photo could be inverted with and for RUNS of another, OutputError
    where RUNS cannot be written, SetupError and WeightsError for what every photo needs and is missing here;
    KeyboardInterrupt as pressed, after the workers are ended and the summary is written.
    """
    start = time.monotonic()
    own = {one.name for one in fields(BatchOptions)}
    how = BatchOptions(**{name: value for name, value in options.items() if name in own})
    asked: dict[str, Any] = {"predictor": "auto", "size": 512, "fov": "auto", "seed": 0, "device": "auto"}
    asked |= {name: value for name, value in options.items() if name not in own}
    check_options(asked)
    if how.recipe is not None:
        read_recipe(how.recipe)
    photos, folder = list_photos(source, runs=runs), Path(runs)
    ledger = open_ledger(folder, {**asked, "tool_version": __version__}, resume=how.resume, force=how.force)
    run = None
    try:
        template = PhotoTask("", "", "", folder.resolve(), asked, how.recipe, how.spp, function=how.function)
        tasks, finished = plan(photos, ledger, template)
        run = _Run(folder, photos, ledger, tasks, len(finished), asked, progress or (lambda _: None))
        run.start = start
        if how.recipe is not None and (notice := _lacking(how.recipe, tasks)):
            run.tell(notice)
        if tasks:
            run.work(_pool(how, len(tasks), asked["device"], asked["size"]))
        return run.outcome()
    finally:
        if run is not None:
            run.write()
        ledger.close()


def _pool(how: BatchOptions, tasks: int, device: str, size: int) -> LocalPool | RayPool:
    if how.ray is not None:
        return RayPool(how.ray, SINGLE_THREAD, workers=how.workers, gpu=device != "cpu")
    return LocalPool(environments(min(how.workers or default_workers(device, size), tasks), device))


def environments(workers: int, device: str) -> list[dict[str, str]]:
    """Environment variables of each worker: one thread, and its GPU where there are any."""
    gpus = visible_gpus(device)
    return [SINGLE_THREAD | ({"CUDA_VISIBLE_DEVICES": gpus[k % len(gpus)]} if gpus else {}) for k in range(workers)]


def default_workers(device: str = "auto", size: int = 512) -> int:
    """One for each GPU that may be used, else one for each processor as far as memory reaches."""
    if gpus := visible_gpus(device):
        return len(gpus)
    import psutil

    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    worker = 720 + 2.9e-3 * size**2  # MB to count on for each: measured were 1.5 GB at 512 and 3.7 GB at 1024
    return max(1, min(processors, int(psutil.virtual_memory().available / 1e6 / worker)))


def visible_gpus(device: str = "auto") -> list[str]:
    """Names by which CUDA can be told to use one GPU; none for the device "cpu", or where no driver answers."""
    from materialist.render.variant import cuda_usable

    if device == "cpu" or not cuda_usable():
        return []
    chosen = os.environ.get("CUDA_VISIBLE_DEVICES")
    if chosen is not None:
        return [name.strip() for name in chosen.split(",") if name.strip()]
    import ctypes

    count = ctypes.c_int()
    ctypes.CDLL("libcuda.so.1").cuDeviceGetCount(ctypes.byref(count))
    return [str(k) for k in range(count.value)]


def _lacking(recipe: Path, tasks: list[PhotoTask]) -> str | None:
    """A sentence on photos whose edits name a file that is missing. Raises InputError where all photos are such."""
    found = [(task, missing[0]) for task in tasks if (missing := missing_files(recipe, task.name))]
    if not found:
        return None
    task, file = found[0]
    if len(found) == len(tasks):
        raise InputError(f"No photo has the files that {recipe} names (there is no {file} for {task.id}); put them "
                         "there, and add --resume.")  # fmt: skip
    return (f"{len(found)} of {len(tasks)} photos lack a file that {recipe} names (there is no {file} for {task.id}); "
            "they get a scene, but no edited photo unless it is there by then.")  # fmt: skip


class _Run:
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
        self._ended: dict[str, str] = {}
        self.start = self._written = time.monotonic()

    def work(self, pool: LocalPool | RayPool) -> None:
        """Run until every photo is over, or an error occurs that would fail all of them."""
        try:
            while self._waiting or self._stages:
                while self._waiting and pool.free() > 0:
                    self._begin(pool, self._waiting.popleft())
                self.tell(None)
                for key, message in pool.wait(1.0) if self._stages else ():
                    self._hear(self._tasks[key], message)
                if time.monotonic() - self._written > SETTINGS.refresh:
                    self.write()
        finally:
            pool.close()

    def outcome(self) -> Outcome:
        rows = tuple(self._row(photo) for photo in self._photos)
        return Outcome(self._runs, rows, self._kept, time.monotonic() - self.start, self._options)

    def write(self) -> None:
        outcome = self.outcome()
        write_summary(outcome)
        write_page(outcome)
        self._written = time.monotonic()

    def _begin(self, pool: LocalPool | RayPool, task: PhotoTask) -> None:
        places = ([] if task.inverted else [task.scene]) + ([] if task.edits is None else [task.picture])
        for place in places:
            if place.exists() and place.name not in self._ledger.owned:
                reason = f"{place} exists and is not of this batch; move it away."
                self._end(task, FAILED, {"error": "OutputError", "reason": reason, "bug": False, "stage": "begin"})
                return
        self._tries[task.id] = self._tries.get(task.id, 0) + 1
        self._stages[task.id] = "begin"
        self._ledger.append(
            "begin", id=task.id, name=task.name, owned=[place.name for place in places], **self._known(task)
        )
        pool.begin(task.id, process, {"task": task})

    def _hear(self, task: PhotoTask, message: Message) -> None:
        if message.kind in (PROGRESS, FOUND):
            self._stages[task.id] = str(message.facts.get("stage", self._stages[task.id]))
            return
        facts, stage = message.facts, self._stages.pop(task.id)
        if message.kind == LOST and self._tries[task.id] < SETTINGS.tries:
            self._waiting.appendleft(task)
            self.tell(f"{task.id}: {facts['reason']} It is begun again.")
            return
        if message.kind == FAILED:
            _stop_if_for_all(facts)
        if message.kind == LOST:
            facts = {**facts, "reason": f"{facts['reason']} It was begun {SETTINGS.tries} times.", "stage": stage}
        self._end(task, DONE if message.kind == DONE else FAILED, facts)

    def _end(self, task: PhotoTask, event: str, facts: dict[str, Any]) -> None:
        tries = self._tries.get(task.id, 0)
        self._ended[task.id] = event  # first, as in the ledger: Ctrl-C may come while the entry goes to the disk
        self._ledger.append(event, id=task.id, name=task.name, attempts=tries, **{**self._known(task), **facts})
        if event == FAILED:
            line = f"failed: {facts['reason']}"
        else:
            quality = f", {facts['psnr']:.1f} dB" if facts.get("psnr") is not None else ""
            line = f"done in {facts['seconds']:.1f} s{quality}"
        self.tell(f"{task.id}: {line}")

    def _known(self, task: PhotoTask) -> dict[str, Any]:
        """Facts of a scene that is kept while its edit is made again; the ledger's last entry has them always."""
        before = self._ledger.last.get(task.id, {}) if task.inverted else {}
        return {key: before[key] for key in _OF_THE_SCENE if key in before}

    def tell(self, news: str | None) -> None:
        total, failed = len(self._photos), list(self._ended.values()).count(FAILED)
        over = self._kept + len(self._ended)
        running = {self._tasks[id].name: stage for id, stage in self._stages.items()}
        self._watch(Status(total, over - failed, failed, running, news))

    def _row(self, photo: Listed) -> Row:
        entry, task = self._ledger.last.get(photo.id, {}), self._tasks.get(photo.id)
        name = task.name if task else entry.get("name", "")
        status = "done" if task is None else self._ended.get(photo.id, "open")
        return Row({**entry, "id": photo.id, "name": name, "status": status})


_OF_THE_SCENE = ("invert_seconds", "photo_version", "scene_bytes", "photo_hash")


def _stop_if_for_all(facts: dict[str, Any]) -> None:
    """Raise what would fail every other photo in the same way: options that fit none, or what this machine lacks."""
    machine = facts["error"] in ("SetupError", "WeightsError") and facts["stage"] != "read"
    if machine or (facts["error"] == "InputError" and facts["stage"] == "start"):
        raise getattr(errors, facts["error"])(facts["reason"])
