"""`materialist.batch`: the loop that hands photos to workers and records the results."""

import errno
import os
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Unpack

import psutil

from materialist import __version__, errors
from materialist.batches.edits import check_edits, missing_files
from materialist.batches.ledger import Ledger, open_ledger
from materialist.batches.options import BatchOptions
from materialist.batches.outcome import COLUMNS, Outcome, Row, Status, write_page, write_summary
from materialist.batches.photos import Listed, list_photos
from materialist.batches.plan import check_options, plan
from materialist.batches.remote import require_stores
from materialist.batches.task import SINGLE_THREAD, PhotoTask, process
from materialist.errors import InputError, OutputError
from materialist.jobs.pool import LocalPool, RayPool
from materialist.jobs.process import LOST, Message
from materialist.jobs.worker import DONE, FAILED, PROGRESS
from materialist.keywords import BatchKeywords
from materialist.option_kinds import documented
from materialist.spelling import check_names

Watch = Callable[[Status], None]


@dataclass(frozen=True)
class BatchSettings:
    """How often a batch does things; tuned by eye."""

    tries: int = 3  # how often a photo is begun whose worker dies
    # seconds between two writings of the summary and the page while the batch runs
    refresh: float = 30.0


SETTINGS = BatchSettings()
DISK_PROBLEMS = tuple(
    os.strerror(code).lower() for code in (errno.ENOSPC, errno.EDQUOT, errno.EROFS)
)
"""What the system says of a disk to which nothing more can be written."""


@documented(BatchOptions)
def batch(
    source: str | Path,
    runs: str | Path,
    *,
    progress: Watch | None = None,
    **options: Unpack[BatchKeywords],
) -> Outcome:
    """Invert every photo of SOURCE into RUNS/NAME.scene, and apply a list of edits to each as RUNS/NAME.FORMAT.

    A photo that cannot be inverted is recorded with its reason and stops nothing; a worker that dies loses only its
    photo, which is begun again, `BatchSettings.tries` times in all. The results do not depend on the number of workers.

    `source`: see `list_photos`. `progress` is called with a Status whenever something happens. `options`: fields of
    BatchOptions, and options of `materialist.invert`; `{name}` in a text is the photo's name.

    Raises InputError for options or edits that no photo could be inverted with and for RUNS of another, OutputError
    where RUNS cannot be written, SetupError and WeightsError for what every photo needs and is missing here;
    KeyboardInterrupt as pressed, after the workers are ended and the summary is written.
    """
    # --- Options of the batch, and options of the inversion ---
    start = time.monotonic()
    batch_fields = {entry.name for entry in fields(BatchOptions)}
    values: dict[str, Any] = dict(options)
    check_names(values, tuple(BatchKeywords.__annotations__), "batch")
    batch_options = BatchOptions(
        **{name: value for name, value in values.items() if name in batch_fields}
    )
    asked: dict[str, Any] = {
        "predictor": "auto",
        "size": 512,
        "fov": "auto",
        "seed": 0,
        "device": "auto",
    }
    asked |= {name: value for name, value in values.items() if name not in batch_fields}
    check_options(asked)
    if batch_options.recipe is not None:
        check_edits(batch_options.recipe)  # before anything is written
    # --- What there is to do: photos whose results are not in the ledger ---
    notes: list[str] = []
    photos = list_photos(source, runs=runs, notes=notes)
    require_stores([photo.location for photo in photos])
    folder = Path(runs)
    facts = {**asked, "tool_version": __version__}
    with open_ledger(
        folder, facts, resume=batch_options.resume, force=batch_options.force
    ) as ledger:
        template = PhotoTask("", "", "", folder.resolve(), asked, batch_options)
        tasks = {task.id: task for task in plan(photos, ledger, template)}
        run = _Run(folder, photos, ledger, tasks, asked, progress or (lambda _: None), start, notes)
        try:
            for note in notes:
                run.tell(note)
            if batch_options.recipe is not None and (
                notice := _lacking(batch_options.recipe, [*tasks.values()])
            ):
                run.tell(notice)
            if tasks:
                run.work(_pool(batch_options, len(tasks), asked["device"], asked["size"]))
        finally:
            run.write()
    return run.outcome()


def _pool(batch_options: BatchOptions, tasks: int, device: str, size: int) -> LocalPool | RayPool:
    if batch_options.ray is not None:
        return RayPool(
            batch_options.ray, SINGLE_THREAD, workers=batch_options.workers, gpu=device != "cpu"
        )
    return LocalPool(
        environments(min(batch_options.workers or default_workers(device, size), tasks), device)
    )


def environments(workers: int, device: str) -> list[dict[str, str]]:
    """Environment variables of each worker: one thread, and its GPU where there are any."""
    gpus = visible_gpus(device)
    return [
        SINGLE_THREAD | ({"CUDA_VISIBLE_DEVICES": gpus[k % len(gpus)]} if gpus else {})
        for k in range(workers)
    ]


def default_workers(device: str = "auto", size: int = 512) -> int:
    """One for each GPU that may be used, else one for each processor as far as memory reaches."""
    if gpus := visible_gpus(device):
        return len(gpus)
    processors = (
        len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    )
    # MB to count on for each: measured were 1.5 GB at 512 and 3.7 GB at 1024
    worker = 720 + 2.9e-3 * size**2
    return max(1, min(processors, int(psutil.virtual_memory().available / 1e6 / worker)))


def visible_gpus(device: str = "auto") -> list[str]:
    """Names by which CUDA can be told to use one GPU; none for the device "cpu", or where no driver answers."""
    from materialist.render.variant import usable_gpus

    count = 0 if device == "cpu" else usable_gpus()
    chosen = os.environ.get("CUDA_VISIBLE_DEVICES")
    if count and chosen is not None:
        return [name.strip() for name in chosen.split(",") if name.strip()]
    return [str(k) for k in range(count)]


def _lacking(recipe: Path, tasks: list[PhotoTask]) -> str | None:
    """A sentence on photos whose edits name a file that is missing. Raises InputError where all photos are such."""
    lacking = [
        (task, missing[0]) for task in tasks if (missing := missing_files(recipe, task.name))
    ]
    if not lacking:
        return None
    task, file = lacking[0]
    if len(lacking) == len(tasks):
        raise InputError(
            f"No photo has the files that {recipe} names (there is no {file} for {task.id}); put them "
            "there, and add `resume=True`."
        )
    return (
        f"{len(lacking)} of {len(tasks)} photos lack a file that {recipe} names (there is no {file} for {task.id}); "
        "they get a scene, but no edited photo unless it is there by then."
    )


@dataclass
class _Run:
    runs: Path
    photos: list[Listed]
    ledger: Ledger
    tasks: dict[str, PhotoTask]
    """Photo id -> its task, of the photos that are not finished."""
    options: dict[str, Any]
    watch: Watch
    start: float
    notes: list[str]
    """Sentences on what the source holds beside photos."""
    stages: dict[str, str] = field(default_factory=dict)
    """Photo id -> stage, of the photos at work."""
    tries: Counter[str] = field(default_factory=Counter)
    ended: dict[str, str] = field(default_factory=dict)
    """Photo id -> done or failed, of the photos that ended in this call."""
    failed: int = 0
    """How many of them failed."""

    def work(self, pool: LocalPool | RayPool) -> None:
        """Run until every photo is over, or an error occurs that would fail all of them."""
        waiting = deque(self.tasks.values())
        written = time.monotonic()
        try:
            while waiting or self.stages:
                while waiting and pool.free() > 0:
                    self._begin(pool, waiting.popleft())
                self.tell(None)
                for key, message in pool.wait(1.0) if self.stages else ():
                    if self._hear(self.tasks[key], message):
                        waiting.appendleft(self.tasks[key])
                if time.monotonic() - written > SETTINGS.refresh:
                    self.write()
                    written = time.monotonic()
        finally:
            pool.close()

    def outcome(self) -> Outcome:
        rows = tuple(self._row(photo) for photo in self.photos)
        kept = len(self.photos) - len(self.tasks)
        return Outcome(
            self.runs, rows, kept, time.monotonic() - self.start, self.options, tuple(self.notes)
        )

    def write(self) -> None:
        outcome = self.outcome()
        write_summary(outcome)
        write_page(outcome)

    def _begin(self, pool: LocalPool | RayPool, task: PhotoTask) -> None:
        places = ([] if task.kept else [task.scene]) + (
            [] if task.batch_options.recipe is None else [task.picture]
        )
        for place in places:
            if place.exists() and place.name not in self.ledger.owned:
                reason = f"{place} exists and is not of this batch; move it away."
                self._end(
                    task,
                    FAILED,
                    {"error": "OutputError", "reason": reason, "bug": False, "stage": "begin"},
                )
                return
        self.tries[task.id] += 1
        self.stages[task.id] = "begin"
        self.ledger.append(
            "begin", id=task.id, name=task.name, owned=[place.name for place in places], **task.kept
        )
        pool.begin(task.id, process, {"task": task})

    def _hear(self, task: PhotoTask, message: Message) -> bool:
        """Take note of a message; returns whether the task is to be begun again."""
        if message.kind == PROGRESS:
            self.stages[task.id] = str(message.facts["stage"])
            return False
        facts = message.facts
        stage = self.stages.pop(task.id)
        if message.kind == LOST and self.tries[task.id] < SETTINGS.tries:
            self.tell(f"{task.id}: {facts['reason']} It is begun again.")
            return True
        if message.kind == FAILED:
            _stop_if_for_all(facts)
        if message.kind == LOST:
            facts = {
                **facts,
                "reason": f"{facts['reason']} It was begun {SETTINGS.tries} times.",
                "stage": stage,
            }
        self._end(task, DONE if message.kind == DONE else FAILED, facts)
        return False

    def _end(self, task: PhotoTask, event: str, facts: dict[str, Any]) -> None:
        self.failed += event == FAILED
        self.ended[task.id] = (
            event  # first, as in the ledger: Ctrl-C may come while the entry goes to the disk
        )
        self.ledger.append(
            event,
            id=task.id,
            name=task.name,
            attempts=self.tries[task.id],
            **{**task.kept, **facts},
        )
        if event == FAILED:
            line = f"failed: {facts['reason']}"
        else:
            quality = f", {facts['psnr']:.1f} dB" if facts.get("psnr") is not None else ""
            line = f"done in {facts['seconds']:.1f} s{quality}"
        self.tell(f"{task.id}: {line}")

    def tell(self, news: str | None) -> None:
        over = len(self.photos) - len(self.tasks) + len(self.ended)
        running = {self.tasks[id].name: stage for id, stage in self.stages.items()}
        self.watch(Status(len(self.photos), over - self.failed, self.failed, running, news))

    def _row(self, photo: Listed) -> Row:
        entry = self.ledger.last.get(photo.id, {})
        task = self.tasks.get(photo.id)
        name = task.name if task else entry.get("name", "")
        status = "done" if task is None else self.ended.get(photo.id, "open")
        return {**dict.fromkeys(COLUMNS), **entry, "id": photo.id, "name": name, "status": status}


def _stop_if_for_all(facts: dict[str, Any]) -> None:
    """Raise what would fail every other photo in the same way: options that fit none, or what this machine lacks."""
    machine = facts["error"] in ("SetupError", "WeightsError") and facts["stage"] != "read"
    if machine or (facts["error"] == "InputError" and facts["stage"] == "start"):
        raise getattr(errors, facts["error"])(facts["reason"])
    if facts["error"] == "OutputError" and any(text in facts["reason"] for text in DISK_PROBLEMS):
        raise OutputError(
            f"{facts['reason']} What is finished is kept; make room, and add `resume=True`."
        )
