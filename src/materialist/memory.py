"""How the C library asks the system for memory."""

import ctypes
import gc
from collections.abc import Iterator
from contextlib import contextmanager, suppress

_M_TRIM_THRESHOLD = -1
_M_MMAP_THRESHOLD = -3
_M_MMAP_MAX = -4
_M_ARENA_MAX = -8
_MEGABYTE = 2**20


@contextmanager
def kept_memory() -> Iterator[None]:
    """Let freed arrays stay with the process until the end, for the next ones; also a decorator.

    glibc maps every array above 32 MB anew, and the system clears its pages: with the maps of a large photo that took a
    third of all processor time. Afterwards the C library does as it would by itself. Elsewhere nothing happens.
    """
    with suppress(OSError, AttributeError):
        _limits(mapped=0, trimmed=2**31 - 1)
    try:
        yield
    finally:
        with suppress(OSError, AttributeError):
            _limits(mapped=65536, trimmed=64 * _MEGABYTE)
            ctypes.CDLL(None).malloc_trim(0)


def give_back() -> None:
    """Give the memory of what is not used any more back to the system; the C library would keep it."""
    # Scenes are in cycles: only the collector frees them.
    gc.collect()
    with suppress(OSError, AttributeError):  # glibc has it
        ctypes.CDLL(None).malloc_trim(0)


def limit_heaps(count: int) -> None:
    """Let all threads to come share so many heaps; glibc gives each its own, with what it freed, up to 8 a core."""
    with suppress(OSError, AttributeError):  # glibc has it
        ctypes.CDLL(None).mallopt(_M_ARENA_MAX, count)


def _limits(mapped: int, trimmed: int) -> None:
    """Set the number of arrays that are mapped by themselves, and the bytes that are kept at the end of the heap."""
    setting = ctypes.CDLL(None).mallopt
    setting(_M_MMAP_MAX, mapped)
    # To set either threshold ends their growth with use: both get what they would grow to.
    setting(_M_MMAP_THRESHOLD, 32 * _MEGABYTE)
    setting(_M_TRIM_THRESHOLD, trimmed)
