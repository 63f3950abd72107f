"""`materialist.batch`: the loop that hands photos to workers and writes down what becomes of them."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from materialist import __version__, errors
from materialist.batches.edits import missing_files
from materialist.batches.job import INVERSION, Job
from materialist.batches.ledger import Ledger, open_ledger
from materialist.batches.listing import Listed, list_photos
from materialist.batches.news import DONE, FAILED, LOST, PROGRESS, News, Pool
from materialist.batches.outcome import Outcome, Row, Status
from materialist.batches.page import write_pages
from materialist.batches.plan import check_options, fingerprint, plan
from materialist.batches.remote import is_url
from materialist.batches.summary import write_summary
from materialist.edits.recipe import read_recipe
from materialist.errors import InputError

TRIES = 3
"""How often a photo is begun whose worker dies."""
REFRESH = 30.0
"""Seconds between two writings of the summary and the page while the batch runs."""
SHARE = 50
"""The batch does this many times as much other work before it writes them again."""
Watch = Callable[[Status], None]


def batch(
    source: str | Path,
    runs: str | Path,
    *,
    apply: str | Path | None = None,
    workers: int | None = None,
    ray: str | None = None,
    resume: bool = False,
    force: bool = False,
    predictor: str = "auto",
    size: int = 512,
    fov: float | str | None = "auto",
    seed: int = 0,
    device: str = "auto",
    spp: int = 256,
    progress: Watch | None = None,
    function: str = INVERSION,
    **options: Any,
) -> Outcome:
    """Invert every photo of SOURCE into RUNS/NAME.scene, and apply a list of edits to each as RUNS/NAME.png.

    A photo that cannot be inverted is recorded with its reason and stops nothing; a worker that dies loses only its
    photo, which is begun again, `TRIES` times in all. The results do not depend on the number of workers.

    Args:
        source: a folder, a list file, a photo, or a URL; see `list_photos`.
        runs: folder of the results, on this machine or one that the cluster shares.
        apply: a list of edits (docs/editing.md); `{name}` in its file names stands for the photo's name.
        workers: worker processes; None: one a GPU, else one a processor as far as memory reaches.
        ray: address of a Ray cluster instead, or `local`.
        resume: go on with the batch in RUNS: finished photos are kept, all others redone.
        force: replace an earlier batch in RUNS, or with `resume` go on although the options are others.
        predictor, size, fov, seed, device, options: as for `materialist.invert`; `{name}` in a text is the photo's.
        spp: paths per pixel of the edit's renderings.
        progress: called with a Status whenever something happens.
        function: the inversion, as module:function.

    Raises:
        InputError: options or edits that no photo could be inverted with; RUNS is another's.
        OutputError: RUNS cannot be written. SetupError, WeightsError: what every photo needs is missing here.
        KeyboardInterrupt: as pressed, after the workers are ended and the summary is written.
    """
    start = time.monotonic()
    asked = {"predictor": predictor, "size": size, "fov": fov, "seed": seed, "device": device, **options}
    check_options(asked)
    recipe = None if apply is None else Path(apply)
    if recipe is not None:
        _check_edits(recipe, spp)
    if workers is not None and workers < 1:
        raise InputError(f"The number of workers is {workers}; give at least 1.")
    photos = list_photos(source, runs=runs)
    ledger = open_ledger(runs, {**asked, "tool_version": __version__}, resume=resume, force=force)
    run = None
    try:
        jobs, finished = plan(photos, ledger, Path(runs), asked, edits=recipe, spp=spp, function=function)
        run = _Run(Path(runs), photos, ledger, jobs, finished, progress or (lambda _: None), start, asked)
        if recipe is not None and (notice := _lacking(recipe, jobs, none_done=not finished)):
            run.tell(notice, urgent=True)
        if jobs:
            run.work(_pool(ray, workers, len(jobs), device, size))
        return run.outcome()
    finally:
        if run is not None:
            run.write()
        ledger.close()


def _pool(ray: str | None, workers: int | None, jobs: int, device: str, size: int) -> Pool:
    if ray is not None:
        from materialist.batches.ray_pool import RayPool

        return RayPool(ray, workers=workers, device=device)
    from materialist.batches.local import LocalPool, default_workers

    return LocalPool(min(workers or default_workers(device, size), jobs), device=device)


def _check_edits(recipe: Path, spp: int) -> None:
    """Refuse, before any photo is touched, what would fail every photo. Raises InputError."""
    if not 2 <= spp <= 1_000_000:
        raise InputError(f"spp is a number of paths from 2 to 1000000, not {spp}.")
    missing = [file for file in missing_files(read_recipe(recipe), "{name}") if "{name}" not in file]
    if missing:
        raise InputError(f"There is no file {missing[0]}, which {recipe} names; put it there, or change the edits.")


def _lacking(recipe: Path, jobs: list[Job], *, none_done: bool) -> str | None:
    """What to say of photos whose edits name a file that is missing. Raises InputError where all photos are such."""
    steps = read_recipe(recipe)
    found = [(job, missing[0]) for job in jobs if (missing := missing_files(steps, job.name))]
    if not found:
        return None
    job, file = found[0]
    if none_done and len(found) == len(jobs):
        raise InputError(f"No photo has the files that {recipe} names (there is no {file} for {job.id}); put them "
                         "there, and add --resume.")  # fmt: skip
    return (f"{len(found)} of {len(jobs)} photos lack a file that {recipe} names (there is no {file} for {job.id}); "
            "they get a scene, but no edited photo unless it is there by then.")  # fmt: skip


class _Run:
    """The state of a batch at work."""

    def __init__(
        self, runs: Path, photos: list[Listed], ledger: Ledger, jobs: list[Job], finished: list[str], watch: Watch,
        start: float, options: dict[str, Any],
    ) -> None:  # fmt: skip
        self._runs, self._photos, self._ledger, self._watch = runs, photos, ledger, watch
        self._options, self._start, self._kept = options, start, set(finished)
        self._waiting = deque(jobs)
        self._names = {job.id: job.name for job in jobs}
        self._stages: dict[str, str] = {}
        self._tries: dict[str, int] = {}
        self._through = self._failed = 0
        self._before = {job.id: ledger.last.get(job.id) for job in jobs}
        self._worked = time.monotonic()
        self._written, self._writing = self._worked, 0.0

    def work(self, pool: Pool) -> None:
        """Until every job is over, or something that would stop all of them."""
        try:
            while self._waiting or self._stages:
                while self._waiting and pool.free() > 0:
                    self._begin(pool, self._waiting.popleft())
                self.tell(None)
                for news in pool.wait(1.0):
                    self._hear(news)
                if time.monotonic() - self._written > max(REFRESH, SHARE * self._writing):
                    self.write()
        finally:
            pool.close()

    def outcome(self) -> Outcome:
        """How it stands."""
        rows = tuple(self._row(photo) for photo in self._photos)
        return Outcome(self._runs, rows, len(self._kept), time.monotonic() - self._start, self._options)

    def write(self) -> None:
        """Summary and page, of how it stands."""
        begun = time.monotonic()
        outcome = self.outcome()
        write_summary(outcome)
        write_pages(outcome)
        self._written = time.monotonic()
        self._writing = self._written - begun

    def _begin(self, pool: Pool, job: Job) -> None:
        self._tries[job.id] = self._tries.get(job.id, 0) + 1
        self._stages[job.id] = "begin"
        before = self._ledger.last.get(job.id, {})
        # What lies there and is of nobody else is this batch's from now on, however this try ends.
        own = {"own_scene": _own(before, "own_scene", "scene_bytes") or not job.scene.exists(),
               "own_picture": _own(before, "own_picture", "picture_hash")
               or (job.edits is not None and not job.picture.exists())}  # fmt: skip
        # What the ledger says of a scene that is kept stays its last word until there is another.
        known = {key: before[key] for key in _OF_THE_SCENE if key in before} if job.inverted else {}
        self._ledger.append("begin", id=job.id, name=job.name, **known, **own)
        pool.begin(replace(job, replace=own["own_scene"], replace_picture=own["own_picture"]))

    def _hear(self, news: News) -> None:
        job, facts = news.job, news.facts
        if news.kind == PROGRESS:
            self._stages[job.id] = str(facts["stage"])
            return
        stage = self._stages.pop(job.id, None)
        if news.kind == LOST and self._tries[job.id] < TRIES:
            self._waiting.appendleft(job)
            self.tell(f"{job.id}: {facts['reason']} It is begun again.")
            return
        if news.kind == FAILED:
            _stop_if_for_all(facts)
        if news.kind == LOST:
            facts = {**facts, "reason": f"{facts['reason']} It was begun {TRIES} times.", "stage": stage}
        if "photo_hash" in facts and is_url(job.location):
            facts = {**facts, "photo_version": fingerprint(job.location)}
        before = self._ledger.last.get(job.id, {})
        kind = DONE if news.kind == DONE else FAILED
        known = {key: before[key] for key in (*_OF_THE_SCENE, *_OWN) if key in before}
        if kind == FAILED:  # where it left nothing, what is there next time is somebody else's
            known |= {key: known[key] and place.exists() for key, place in zip(_OWN, (job.scene, job.picture))
                      if key in known}  # fmt: skip
        self._ledger.append(kind, id=job.id, name=job.name, attempts=self._tries[job.id], **{**known, **facts})
        self._through += 1
        self._failed += kind == FAILED
        self.tell(_line(job, kind, facts), urgent=kind == FAILED)

    def tell(self, news: str | None, urgent: bool = False) -> None:
        """Say how it stands, and what has happened."""
        total, over = len(self._photos), len(self._kept) + self._through
        rate = self._through / max(time.monotonic() - self._worked, 1e-9)
        left = (total - over) / rate if rate else None
        running = {self._names[id]: stage for id, stage in self._stages.items()}
        self._watch(Status(total, over - self._failed, self._failed, rate, left, running, news, urgent))

    def _row(self, photo: Listed) -> Row:
        entry = self._ledger.last.get(photo.id, {})
        name = self._names.get(photo.id) or entry.get("name", "")
        stale = entry.get("event") not in (DONE, FAILED) or self._before.get(photo.id) is entry
        status = "open" if stale else entry["event"]
        return Row({**entry, "id": photo.id, "name": name, "status": status})


_OF_THE_SCENE = ("invert_seconds", "photo_version", "scene_bytes", "photo_hash")
"""Facts of a scene that was kept while its edit was redone."""
_OWN = ("own_scene", "own_picture")
"""Whether what lies at a place is of this batch."""


def _own(entry: dict[str, Any], key: str, written: str) -> bool:
    """Whether this batch has made what lies there, says its last word on a photo; `written` is what older ones told."""
    return bool(entry.get(key, written in entry))


def _line(job: Job, kind: str, facts: dict[str, Any]) -> str:
    """What a log says of a photo."""
    if kind == FAILED:
        return f"{job.id}: failed: {facts['reason']}"
    quality = f", {facts['psnr']:.1f} dB" if facts.get("psnr") is not None else ""
    return f"{job.id}: done in {facts['seconds']:.1f} s{quality}"


def _stop_if_for_all(facts: dict[str, Any]) -> None:
    """Raise what would fail every other photo in the same way: options that fit none, or what this machine lacks."""
    machine = facts["error"] in ("SetupError", "WeightsError") and facts["stage"] != "read"
    if machine or (facts["error"] == "InputError" and facts["stage"] == "start"):
        raise getattr(errors, facts["error"])(facts["reason"])
