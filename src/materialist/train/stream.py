"""The stream of training batches: which examples are drawn, and in which order."""

import logging
import signal
from collections.abc import Callable, Generator
from functools import partial
from typing import Any, TypeVar

import cv2
import numpy as np
import torch
from torch.utils.data import DataLoader, default_collate

from materialist.errors import InputError
from materialist.train.task import Batch, Examples

ATTEMPTS = 4
"""Examples tried in place of one that cannot be read, before the run ends with its error."""
GRACE = 20
"""Seconds for which a loading process goes on after SIGTERM: the trainer may be waiting for its batch."""


T = TypeVar("T")
Key = tuple[int, tuple[int, ...]]
"""Number of an example, and the seed of its variant."""


def readable(read: Callable[[int], T], index: int, another: Callable[[], Any]) -> T:
    """What `read` makes of a number, or of `another()` in place of one that cannot be read.

    Raises InputError after ATTEMPTS.
    """
    for _ in range(ATTEMPTS - 1):
        try:
            return read(index)
        except InputError as error:
            logging.getLogger(__name__).warning("%s Another sample is used.", error)
            index = another()
    return read(index)


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
    loader: DataLoader[Any] = DataLoader(
        keys[skip * batch :],  # type: ignore[arg-type]
        batch_size=batch,
        num_workers=workers,
        worker_init_fn=_init_worker,
        prefetch_factor=4 if workers else None,
        collate_fn=partial(_drawn, examples, side),
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


def _drawn(examples: Examples, side: int, keys: list[Key]) -> Any:
    """A batch, or the message why there is none: an exception of a worker would arrive as its traceback."""
    items = []
    for index, seed in keys:
        rng = np.random.default_rng(seed)
        draw, another = partial(examples.draw, side=side, rng=rng), partial(rng.integers, len(examples))
        try:
            items.append(readable(draw, index, another))
        except InputError as error:
            return str(error)
    return default_collate(items)


def _init_worker(_: int) -> None:
    """One thread a worker: the training has the others. The trainer acts on signals to the group, workers follow."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: signal.alarm(GRACE))
    torch.set_num_threads(1)
    cv2.setNumThreads(0)
