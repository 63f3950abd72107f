"""An object taken out of the photo."""

from __future__ import annotations

from materialist.edits.remove.background import without as remove

__all__ = ["remove"]
