"""Memory is kept while photos are inverted, and given back."""

import numpy as np
import psutil

from materialist.memory import kept_memory


def resident() -> int:
    return psutil.Process().memory_info().rss


def test_freed_arrays_are_used_again_and_given_back_at_the_end():
    size = 2**27
    with kept_memory():
        values = np.ones(size, np.uint8)
        used = resident()
        del values
        freed = resident()
    after = resident()
    assert freed > used - 0.1 * size
    assert after < used - 0.9 * size


def test_what_it_wraps_may_fail():
    @kept_memory()
    def fails() -> None:
        raise ValueError

    for _ in range(2):
        try:
            fails()
        except ValueError:
            continue
        raise AssertionError
