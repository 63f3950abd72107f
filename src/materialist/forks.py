"""A process that was forked from one in which torch or the renderer runs would hang in its first computation."""

import os

from materialist.errors import SetupError

_started_in: int | None = None
"""The process in which computing began; None before it did."""


def check_process() -> None:
    """Note that this process computes. Raises SetupError where it is a fork of one that did before."""
    global _started_in
    if _started_in is None:
        _started_in = os.getpid()
    # A fork has copied this module's state, but not the threads.
    if _started_in != os.getpid():
        raise SetupError(
            "This process was forked from one in which Materialist had computed before, whose threads it lacks: it "
            'would hang. Start processes with multiprocessing.get_context("spawn"), or fork before the first call.'
        )
