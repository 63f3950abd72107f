"""Libraries in C++ that read and write pictures: names of files that they take, and what they print."""

import ctypes
import io
import logging
import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from pathlib import Path

import cv2

from materialist.plain import is_utf8

_lock = threading.RLock()
_STANDARD_STREAMS = (1, 2)
_OPENCV_SILENT = 0


def name_problem(path: str | Path) -> str | None:
    """Why OpenEXR cannot open a file or write below a folder of this name, as a sentence; None where it can.

    It takes names in UTF-8 alone, whatever the locale.
    """
    text = str(path)
    if not is_utf8(text):
        return f"The name {text!r} is not UTF-8, and OpenEXR knows no others; give another."
    encoding = sys.getfilesystemencoding()
    if text.encode("utf-8") == _encoded(text, encoding):
        return None
    return (
        f"The name {text!r} is written in {encoding} here, and OpenEXR knows UTF-8 alone; "
        "set PYTHONUTF8=1 or LC_ALL=C.UTF-8, or give a name of plain ASCII letters."
    )


def _encoded(text: str, encoding: str) -> bytes | None:
    """The bytes of a name on the disk, None where it has none."""
    try:
        return text.encode(encoding, "surrogateescape")
    except UnicodeEncodeError:
        return None


@contextmanager
def unprinted() -> Iterator[None]:
    """Keep what libraries print about a damaged file off the terminal: the error that follows says it once.

    They write to the process's standard output and error, through Python and past it. What other threads write there
    meanwhile is lost, too, so the block should be short.
    """
    with _lock, _silent_opencv(), _silent_tifffile(), _silent_python():
        _flush()
        # C libraries write to the descriptors 1 and 2: these lead nowhere for a while.
        kept = {number: _duplicate(number) for number in _STANDARD_STREAMS}
        try:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            try:
                for number, copy in kept.items():
                    if copy is not None:
                        os.dup2(nowhere, number)
            finally:
                os.close(nowhere)
            yield
        finally:
            _flush()
            for number, copy in kept.items():
                if copy is not None:
                    os.dup2(copy, number)
                    os.close(copy)


def _flush() -> None:
    """Write what the C library holds back for the standard streams."""
    with suppress(OSError, AttributeError):  # systems whose C library is not in the process
        ctypes.CDLL(None).fflush(None)


def _duplicate(number: int) -> int | None:
    """A copy of a file descriptor, None where it is closed."""
    try:
        return os.dup(number)
    except OSError:
        return None


@contextmanager
def _silent_python() -> Iterator[None]:
    nowhere = io.StringIO()
    with redirect_stdout(nowhere), redirect_stderr(nowhere):
        yield


@contextmanager
def _silent_opencv() -> Iterator[None]:
    log = getattr(cv2.utils, "logging", cv2)  # where OpenCV 5 and 4 have it
    level = log.getLogLevel()
    log.setLogLevel(_OPENCV_SILENT)
    try:
        yield
    finally:
        log.setLogLevel(level)


@contextmanager
def _silent_tifffile() -> Iterator[None]:
    logger = logging.getLogger("tifffile")
    disabled = logger.disabled
    logger.disabled = True
    try:
        yield
    finally:
        logger.disabled = disabled
