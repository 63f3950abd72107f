"""The stream of training batches: which examples are drawn, and in which order."""

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
from materialist.train.task import Batch, Examples
from materialist.types import Array

ATTEMPTS = 4
"""Examples tried in place of one that cannot be read, before the run ends with its error."""
GRACE = 20
"""Seconds for which a loading process goes on after SIGTERM: the trainer may be waiting for its batch."""


class _Drawn(Dataset):
    """Variants of examples; an item is asked for by (example, seed of its randomness)."""

    def __init__(self, examples: Examples, side: int):
        self.examples, self.side = examples, side

    def __getitem__(self, key: tuple[int, tuple[int, ...]]) -> dict[str, Array] | str:
        """A variant, or the message why there is none: an exception of a worker would arrive as its traceback."""
        index, seed = key
        rng = np.random.default_rng(seed)
        message = ""
        for _ in range(ATTEMPTS):
            try:
                return self.examples.draw(index, self.side, rng)
            except InputError as error:
                message = str(error)
                logging.getLogger(__name__).warning("%s Another sample is used.", message)
                index = int(rng.integers(len(self.examples)))
        return message


def epoch(
    examples: Examples, *, number: int, side: int, batch: int, seed: int, skip: int = 0, workers: int = 0,
) -> Generator[Batch, None, None]:  # fmt: skip
    """Batches of one pass over all examples in a random order, without the first `skip` of them.

    Order and variants depend on (seed, number) alone, for any number of workers. A small set is repeated so that a
    pass has at least one batch.
    Raises InputError where ATTEMPTS examples in a row cannot be read.
    """
    examples.refresh()
    if (own := examples.batches(side=side, batch=batch, seed=(seed, number), skip=skip)) is not None:
        yield from own
        return
    order = np.random.default_rng((seed, number)).permutation(len(examples))
    order = np.tile(order, -(-batch // len(order)))
    order = order[: len(order) // batch * batch]
    keys = [(int(index), (seed, number, k)) for k, index in enumerate(order)]
    loader = DataLoader(
        _Drawn(examples, side),
        batch_sampler=[keys[k : k + batch] for k in range(skip * batch, len(keys), batch)],  # type: ignore[arg-type]
        num_workers=workers,
        worker_init_fn=_init_worker,
        prefetch_factor=4 if workers else None,
        collate_fn=_collated,
        pin_memory=torch.cuda.is_available(),
    )
    batches = iter(loader)
    try:
        for found in batches:
            if isinstance(found, str):
                raise InputError(found)
            yield found
    finally:
        del batches  # ends the workers


def _collated(items: list[Any]) -> Any:
    """The items as a batch; the message of one of them where there is one."""
    return next((item for item in items if isinstance(item, str)), None) or default_collate(items)


def _init_worker(_: int) -> None:
    """One thread a worker: the training has the others. The trainer acts on signals to the group, workers follow."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: signal.alarm(GRACE))
    torch.set_num_threads(1)
    cv2.setNumThreads(0)
