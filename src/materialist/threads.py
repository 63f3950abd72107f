"""How many threads torch computes with."""

from collections.abc import Iterator
from contextlib import contextmanager

TORCH_THREADS = 2
"""Sums are split by threads, and how they are split decides their last bits: results need one number everywhere."""


@contextmanager
def fixed_threads() -> Iterator[None]:
    """Let torch compute with TORCH_THREADS threads, so that a seed gives the same bits on any number of processors.

    Also a decorator. Afterwards the number is what it was.
    """
    import torch

    before = torch.get_num_threads()
    torch.set_num_threads(TORCH_THREADS)
    try:
        yield
    finally:
        torch.set_num_threads(before)
