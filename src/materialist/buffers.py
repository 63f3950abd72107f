"""Numpy arrays for Dr.Jit, safe to be read by whole vectors of the processor."""

from typing import Any

import numpy as np

from materialist.types import Array

WIDEST = 16
"""Lanes of the widest vector that Dr.Jit compiles for."""


def floats(mi, array: Array) -> Any:
    """`mi.Float` of all values of the array, row-major."""
    return mi.Float(_padded(array, np.float32))


def integers(mi, array: Array) -> Any:
    """`mi.UInt32` of all values of the array, row-major."""
    return mi.UInt32(_padded(array, np.uint32))


def tensor(mi, array: Array) -> Any:
    """`mi.TensorXf` of the array's shape."""
    return mi.TensorXf(floats(mi, array), np.shape(array))


def _padded(array: Array, kind) -> Array:
    """[N] copy whose memory goes on for a vector.

    Dr.Jit borrows numpy's memory on the CPU, and its kernels read the last, partly filled vector in full: beyond the
    end, which ends the process where the next page is not mapped.
    """
    flat = np.ravel(array)
    memory = np.empty(len(flat) + WIDEST, kind)
    memory[: len(flat)] = flat
    return memory[: len(flat)]
