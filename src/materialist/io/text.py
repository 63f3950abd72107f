"""Texts that people write: lists of edits and lists of photos."""

import codecs
from pathlib import Path


def read_text(path: Path) -> str:
    """The text of a file in UTF-8, or in UTF-16 with a byte order mark, as Windows PowerShell's `>` writes it.

    Raises OSError where the file cannot be read, UnicodeDecodeError for another encoding.
    """
    with path.open("rb") as file:
        start = file.read(2)
    wide = start in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
    return path.read_text("utf-16" if wide else "utf-8-sig")
