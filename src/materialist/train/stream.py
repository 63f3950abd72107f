"""Batches without end: which samples are drawn, in which order, and loaded by whom."""

from __future__ import annotations

import logging
import signal
from collections.abc import Generator
from typing import Any

import cv2
import numpy as np
import torch
from torch.utils.data import DataLoader, Dataset, default_collate

from materialist.errors import InputError
from materialist.io.samples import Sample, Source
from materialist.train.tasks import Task, tensors

ATTEMPTS = 4
"""Samples tried in place of one that cannot be read, before the run ends with its error."""
KEPT_ASIDE = 40
"""Every how-manieth sample is never trained on, but looked at."""
GRACE = 20
"""Seconds for which a loading worker goes on that is told to end: the trainer may be waiting for its batch."""


class _Variants(Dataset):
    """Variants of samples; an item is asked for by (sample number, seed of its randomness)."""

    def __init__(self, source: Source, task: Task, size: int):
        self.source, self.task, self.size = source, task, size

    def __getitem__(self, key: tuple[int, tuple[int, ...]]) -> dict[str, torch.Tensor] | str:
        """A variant, or the sentence why there is none: an error of a worker would arrive as its traceback."""
        index, seed = key
        rng = np.random.default_rng(seed)
        try:
            return tensors(self.task.prepare(self._read(index, rng), self.size, rng))
        except InputError as error:
            return str(error)

    def _read(self, index: int, rng: np.random.Generator) -> Sample:
        """Sample number `index`, or another one where it cannot be read: one bad file must not end a night's run."""
        chosen = trained_on(self.source)
        for attempt in range(ATTEMPTS):
            try:
                return self.source.read(index)
            except InputError as error:
                if attempt == ATTEMPTS - 1:
                    raise
                logging.getLogger(__name__).warning("%s Another sample is used.", error)
                index = int(rng.choice(chosen))
        raise AssertionError("the last attempt returns or raises")


def epoch(
    source: Source, task: Task, *, number: int, size: int, batch: int, seed: int, rank: int = 0, world: int = 1,
    workers: int = 1,
) -> Generator[dict[str, torch.Tensor], None, None]:  # fmt: skip
    """Batches of one pass over all samples that are not kept aside, in a random order.

    The order and the variants depend on (seed, number) alone, for any number of workers; of `world` processes each
    gets a share of its own and all get equally many batches. A small set is gone through several times, so that a pass
    has at least one batch. Raises InputError where ATTEMPTS samples in a row cannot be read.
    """
    source.refresh()
    chosen = trained_on(source)
    order = np.random.default_rng((seed, number)).permutation(chosen)
    repeats = -(-batch * world // len(order))
    order = np.tile(order, repeats)
    order = order[: len(order) // (batch * world) * batch * world]
    keys = [(int(order[k]), (seed, number, k)) for k in range(rank, len(order), world)]
    loader = DataLoader(
        _Variants(source, task, size),
        batch_sampler=[keys[k : k + batch] for k in range(0, len(keys), batch)],  # type: ignore[arg-type]
        num_workers=workers,
        worker_init_fn=_quiet_worker,
        prefetch_factor=4 if workers else None,
        collate_fn=_batch,
    )
    batches = iter(loader)
    try:
        for found in batches:
            if isinstance(found, str):
                raise InputError(found)
            yield found
    finally:
        del batches  # ends the workers


def _batch(items: list[Any]) -> Any:
    """The items as a batch; a sentence where one of them is one."""
    return next((item for item in items if isinstance(item, str)), None) or default_collate(items)


def trained_on(source: Source) -> list[int]:
    """Places of the samples to train on; the others are kept aside. All, when there are too few."""
    count = len(source)
    return [k for k in range(count) if count < KEPT_ASIDE or not _is_aside(source, k)]


def _is_aside(source: Source, place: int) -> bool:
    """Whether the sample at that place is never trained on: its own number says, where it has one, so that a sample
    that goes or comes moves no other one."""
    number = getattr(source, "number", lambda k: k)(place)
    return number % KEPT_ASIDE == KEPT_ASIDE - 1


def none_aside(source: Source) -> bool:
    """Whether `kept_aside` has to take samples that are trained on."""
    return len(trained_on(source)) == len(source) and getattr(source, "validation", lambda: None)() is None


def kept_aside(source: Source, most: int) -> list[Sample]:
    """Up to `most` samples that are not trained on, spread over those that there are (the first, of a tiny set).

    They are those of the source's own validation split, where it has one. Those that cannot be read are left out.
    """
    validation = getattr(source, "validation", lambda: None)()
    if validation is not None:
        chosen, source = list(range(len(validation))), validation
    else:
        aside = set(range(len(source))) - set(trained_on(source))
        chosen = sorted(aside) or list(range(min(len(source), most)))
    found = []
    for k in np.unique(np.linspace(0, len(chosen) - 1, most).astype(int)):
        try:
            found.append(source.read(chosen[k]))
        except InputError as error:
            logging.getLogger(__name__).warning("%s It is left out of the figures.", error)
    return found


def _quiet_worker(_: int) -> None:
    """One thread a worker: the training itself has the others. A SIGTERM or Ctrl-C to the whole group is the trainer's
    to act on: workers end with it, or GRACE later."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: signal.alarm(GRACE))
    torch.set_num_threads(1)
    cv2.setNumThreads(0)
