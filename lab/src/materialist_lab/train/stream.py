"""The stream of training batches: which examples are drawn, and in which order."""

import logging
import signal
from collections.abc import Generator
from functools import partial
from typing import Any

import cv2
import numpy as np
import torch
from torch.utils.data import DataLoader, default_collate

from materialist.errors import InputError
from materialist.types import Array
from materialist_lab.data.samples import end_with_parent
from materialist_lab.train.task import Batch, Task

ATTEMPTS = 4
"""Examples tried in place of one that cannot be read, before the run ends with its error."""
GRACE = 20
"""Seconds for which a loading process goes on after SIGTERM: the trainer may be waiting for its batch."""

Key = tuple[int, tuple[int, ...]]
"""Number of an example, and the seed of its variant."""


def epoch(
    task: Task,
    *,
    number: int,
    side: int,
    batch: int,
    seed: int,
    skip: int = 0,
    workers: int = 0,
    device: Any = "cpu",
) -> Generator[Batch, None, None]:
    """Batches of one pass over all examples in a random order, on the device, without the first `skip` of them.

    Order and variants depend on (seed, number) alone, for any number of workers. A small set is repeated so that a
    pass has at least one batch.
    Raises InputError where ATTEMPTS examples in a row cannot be read.
    """
    task.refresh()
    # --- The order of this pass, cut to whole batches ---
    order = np.random.default_rng((seed, number)).permutation(task.count())
    order = np.tile(order, -(-batch // len(order)))
    order = order[: len(order) // batch * batch]
    keys = [(int(index), (seed, number, k)) for k, index in enumerate(order)]
    # --- Loading, without the batches that were done before ---
    random = torch.Generator(device)
    rest: Any = keys[skip * batch :]
    loader: DataLoader[Any] = DataLoader(
        rest,
        batch_size=batch,
        num_workers=workers,
        prefetch_factor=2 if workers else None,
        collate_fn=partial(_drawn, task, side),
        worker_init_fn=_init_worker,
        pin_memory=random.device.type == "cuda",
    )
    batches = iter(loader)
    try:
        for k, loaded in enumerate(batches, skip):
            if isinstance(loaded, str):
                raise InputError(loaded)
            # A seed of its own for each batch: resuming in the middle of a pass changes nothing.
            random.manual_seed(int(np.random.SeedSequence((seed, number, k)).generate_state(1)[0]))
            with torch.no_grad():
                varied = task.vary(
                    {n: t.to(device, non_blocking=True) for n, t in loaded.items()}, side, random
                )
            yield varied
    finally:
        del batches  # ends the workers


def _drawn(task: Task, side: int, keys: list[Key]) -> Any:
    """A batch, or the message why there is none: an exception of a worker would arrive as its traceback."""
    try:
        items = [_readable(task, index, side, np.random.default_rng(seed)) for index, seed in keys]
    except InputError as error:
        return str(error)
    # `default_collate` would end with a message about tensors.
    if len({tuple(np.shape(array) for array in item.values()) for item in items}) > 1:
        return "The samples have different numbers of pixels; use sets of one size."
    return default_collate(items)


def _readable(task: Task, index: int, side: int, rng: np.random.Generator) -> dict[str, Array]:
    """A variant of that example, or of others in place of one that cannot be read."""
    for _ in range(ATTEMPTS - 1):
        try:
            return task.draw(index, side, rng)
        except InputError as error:
            logging.getLogger(__name__).warning("%s Another sample is used.", error)
            # Another example, chosen by the same seed.
            index = int(rng.integers(task.count()))
    return task.draw(index, side, rng)


def _init_worker(_: int) -> None:
    """One thread a worker: the training has the others. The trainer acts on signals to the group, workers follow."""
    end_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: signal.alarm(GRACE))
    # Otherwise each worker would start a thread a processor.
    torch.set_num_threads(1)
    cv2.setNumThreads(0)
