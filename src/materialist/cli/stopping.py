"""A fit that a signal ends and that is written all the same."""

from contextlib import ExitStack
from typing import Any

from materialist.stopping import stop_requests


class FitStop:
    """Ctrl-C or SIGTERM during a fit of minutes or hours ends the fit; what it has found is then written.

    Before the fit, and at the second signal, the command ends at once, as it does with our schedule.
    """

    def __init__(self, slow: bool):
        self.slow = slow
        self.signals: list[int] = []
        self.stack = ExitStack()

    def __enter__(self) -> "FitStop":
        return self

    def __exit__(self, *_: Any) -> None:
        self.stack.close()

    def on_stage(self, name: str, _: Any) -> None:
        """The fit begins when the prior is there."""
        if self.slow and name == "prior":
            self.signals = self.stack.enter_context(stop_requests())

    def requested(self) -> bool:
        return bool(self.signals)
