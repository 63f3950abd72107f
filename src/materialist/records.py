"""Dataclasses that hold arrays: compared by value, and shown by shape instead of by number."""

from dataclasses import fields
from typing import Any

import numpy as np

Array = np.ndarray


class Record:
    """Base of dataclasses with arrays, which are declared with `eq=False, repr=False`."""

    def __eq__(self, other: object) -> bool:
        return same(self, other) if type(other) is type(self) else NotImplemented

    def __repr__(self) -> str:
        shown = []
        for field in fields(self):  # type: ignore[arg-type]
            if field.repr:
                shown.append(f"{field.name}={_short(getattr(self, field.name))}")
        return f"{type(self).__name__}({', '.join(shown)})"


def same(first: Any, second: Any) -> bool:
    """Whether two values are equal, arrays by their numbers; NaN equals NaN, and a list the tuple of its items."""
    if first is second:
        return True
    # Arrays by their numbers: `==` would give an array of truth values.
    if isinstance(first, np.ndarray) or isinstance(second, np.ndarray):
        return _same_arrays(np.asarray(first), np.asarray(second))
    if isinstance(first, Record):
        names = [field.name for field in fields(first)]  # type: ignore[arg-type]
        return type(first) is type(second) and all(
            same(getattr(first, n), getattr(second, n)) for n in names
        )
    if isinstance(first, dict) and isinstance(second, dict):
        return first.keys() == second.keys() and all(
            same(value, second[key]) for key, value in first.items()
        )
    if isinstance(first, list | tuple) and isinstance(second, list | tuple):
        return len(first) == len(second) and all(map(same, first, second))
    # NaN differs from itself: two of them count as equal.
    if isinstance(first, float) and isinstance(second, float) and first != first:
        return second != second
    return bool(first == second)


def _same_arrays(first: Array, second: Array) -> bool:
    # numpy compares NaN with NaN in floats alone.
    floats = first.dtype.kind == second.dtype.kind == "f"
    return np.array_equal(first, second, equal_nan=floats)


def _short(value: Any) -> str:
    """A value in a few words: an array by type and shape, a long sequence by its length."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{list(value.shape)}"
    if isinstance(value, list | tuple | dict) and len(value) > 4:
        return f"<{type(value).__name__} of {len(value)}>"
    return repr(value)
