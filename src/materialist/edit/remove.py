"""An object taken out of the photo."""

from __future__ import annotations

from materialist.edit.background import without as remove

__all__ = ["remove"]
