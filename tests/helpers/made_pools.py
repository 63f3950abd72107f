"""Slow work for pools of processes."""

import time

import numpy as np


def slow_arrays(number):
    """One sample, after a minute."""
    time.sleep(60)
    return {"number": np.array(number)}


class SlowNumbers:
    """A data set of four numbers, each after a minute."""

    def __len__(self):
        return 4

    def __getitem__(self, index):
        time.sleep(60)
        return index
