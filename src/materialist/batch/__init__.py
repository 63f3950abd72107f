"""Many photos at once: a scene package each, on worker processes or a Ray cluster, resumable at any moment.

The package is also the function `materialist.batch(source, runs, ...)`: the design gives both the same name, and a
module may be called. It stands for `materialist.batch.run.batch`.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any


class _CallablePackage(ModuleType):
    def __call__(self, *args: Any, **options: Any) -> Any:
        """See `materialist.batch.run.batch`."""
        from materialist.batch.run import batch as run

        return run(*args, **options)


batch = sys.modules[__name__]
batch.__class__ = _CallablePackage
