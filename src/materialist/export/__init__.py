"""Scenes for other programs: glTF, Blender, USD, Mitsuba, and one page of HTML (docs/export.md).

The package may be called: `materialist.export(scene, path)` works whether or not a module of it was imported before,
which puts the package itself in the place of the public function.
"""

import sys
from types import ModuleType
from typing import Any


class _Callable(ModuleType):
    def __call__(self, *args: Any, **options: Any) -> Any:
        from materialist.export.run import export

        return export(*args, **options)


sys.modules[__name__].__class__ = _Callable
