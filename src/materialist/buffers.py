"""Numpy arrays for Dr.Jit, safe to be read by whole vectors of the processor, and for torch beside it."""

import sys
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


def torch_device() -> str:
    """Where torch computes beside the renderer: `cuda` where Mitsuba renders there and torch can, else `cpu`."""
    mi = sys.modules.get("mitsuba")  # to import it here would be to choose its LLVM
    if mi is None or not (mi.variant() or "").startswith("cuda"):
        return "cpu"
    import torch

    return "cuda" if torch.cuda.is_available() else "cpu"


def placed(values: Any) -> Any:
    """The array or torch tensor as a torch tensor on `torch_device()`."""
    import torch

    return torch.as_tensor(values).to(torch_device())


def _padded(array: Array, kind) -> Array:
    """[N] copy whose memory begins at a whole vector and goes on for another.

    Dr.Jit borrows numpy's memory on the CPU. Its kernels read the last, partly filled vector in full: beyond the end,
    which ends the process where the next page is not mapped. And it compiles them anew for memory aligned otherwise.
    """
    # One vector more than needed on either side: room to shift the start to a whole vector.
    flat = np.ravel(array)
    memory = np.empty(len(flat) + 2 * WIDEST, kind)
    start = -(memory.ctypes.data // memory.itemsize) % WIDEST
    memory[start : start + len(flat)] = flat
    return memory[start : start + len(flat)]
