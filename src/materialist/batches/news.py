"""What workers tell the batch."""

from __future__ import annotations

import traceback
from dataclasses import dataclass, field
from typing import Any, Protocol

from materialist.batches.job import Job
from materialist.errors import MaterialistError

PROGRESS, DONE, FAILED, LOST = "progress", "done", "failed", "lost"


@dataclass(frozen=True)
class News:
    """One message about one job."""

    kind: str
    """`progress`, `done`, `failed` (the photo's own fault, or ours: `error` says), `lost` (the worker died)."""
    job: Job
    facts: dict[str, Any] = field(default_factory=dict)
    """progress: stage, done, total. done: what `process` returned. failed, lost: error, reason, stage, trace."""


class Pool(Protocol):
    """Workers, of whatever kind."""

    def free(self) -> int:
        """How many jobs may be begun now."""
        ...

    def begin(self, job: Job) -> None:
        """Hand a job to a worker."""
        ...

    def wait(self, seconds: float) -> list[News]:
        """What has happened; returns at once when there is something, and empty after `seconds`."""
        ...

    def close(self) -> None:
        """End all workers, also those at work."""
        ...


def describe(error: BaseException, stage: str) -> dict[str, Any]:
    """An exception of a job as JSON's own types; the trace only where it is a bug of ours."""
    ours = not isinstance(error, MaterialistError | MemoryError | OSError)
    reason = " ".join(str(error).split()) or type(error).__name__
    if isinstance(error, MemoryError):
        reason = "There is not enough memory for this photo; give a smaller --size or fewer --workers."
    return {
        **getattr(error, "facts", {}),
        "error": type(error).__name__, "reason": reason, "stage": stage, "bug": ours,
        "trace": "".join(traceback.format_exception(error))[-4000:] if ours else None,
    }  # fmt: skip
