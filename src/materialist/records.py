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
        for one in fields(self):  # type: ignore[arg-type]
            if one.repr:
                shown.append(f"{one.name}={_short(getattr(self, one.name))}")
        return f"{type(self).__name__}({', '.join(shown)})"


def same(one: Any, other: Any) -> bool:
    """Whether two values are equal, arrays by their numbers; NaN equals NaN, and a list the tuple of its items."""
    if one is other:
        return True
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return _same_arrays(np.asarray(one), np.asarray(other))
    if isinstance(one, Record):
        names = [field.name for field in fields(one)]  # type: ignore[arg-type]
        return type(one) is type(other) and all(
            same(getattr(one, n), getattr(other, n)) for n in names
        )
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(
            same(value, other[key]) for key, value in one.items()
        )
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float) and isinstance(other, float) and one != one:
        return other != other
    return bool(one == other)


def _same_arrays(one: Array, other: Array) -> bool:
    floats = one.dtype.kind == other.dtype.kind == "f"
    return np.array_equal(one, other, equal_nan=floats)


def _short(value: Any) -> str:
    """A value in a few words: an array by type and shape, a long sequence by its length."""
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{list(value.shape)}"
    if isinstance(value, list | tuple | dict) and len(value) > 4:
        return f"<{type(value).__name__} of {len(value)}>"
    return repr(value)
