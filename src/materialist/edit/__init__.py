"""Edits of a scene: pure functions Scene -> Scene, and the composite that brings them back into the photograph.

The package is also the function `materialist.edit(scene, mask, ...)`: the design gives both the same name, and a module
may be called. It stands for `materialist.edit.material.edit`.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any


class _CallablePackage(ModuleType):
    def __call__(self, *args: Any, **options: Any) -> Any:
        """See `materialist.edit.material.edit`."""
        from materialist.edit.material import edit as change

        return change(*args, **options)


edit = sys.modules[__name__]
edit.__class__ = _CallablePackage
