"""Photos behind URLs (s3://, gs://, https://, ...), through fsspec."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any

from materialist.errors import InputError, SetupError

LARGEST = 2 << 30
"""Bytes of a photo that is fetched: no photo within the pixel limit is larger."""


def is_url(text: str) -> bool:
    """Whether the text is a URL rather than a path."""
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]*(::[A-Za-z0-9+.-]+)*://", text) is not None


def shown(url: str) -> str:
    """The URL without its secrets: user, password and signed query."""
    return re.sub(r"://[^/@]*@", "://", url).split("?")[0] if is_url(url) else url


def list_url(url: str, suffixes: frozenset[str]) -> list[str]:
    """URLs of the photos at a URL: a folder with its subfolders, a pattern with *, or one photo."""
    with _told(url):
        system, path = _system(url)
        system.invalidate_cache()  # what was listed earlier in this process may have changed
        if not any(mark in path for mark in "*[") and _suffix(url) in suffixes:
            return [url]
        paths = system.glob(path) if any(mark in path for mark in "*[") else system.find(path)
        found = [str(system.unstrip_protocol(one)) for one in paths]
    return [one for one in found if _suffix(one) in suffixes and not PurePosixPath(shown(one)).name.startswith(".")]


def version(url: str) -> str:
    """A text that changes with the file behind the URL; the store gives it without a download where it can."""
    with _told(url):
        system, path = _system(url)
        return f"url:{system.ukey(path)}"


@contextmanager
def local_copy(location: str) -> Iterator[Path]:
    """The photo as a local file; one behind a URL is fetched, and its copy removed afterwards."""
    if not is_url(location):
        yield Path(location)
        return
    with tempfile.TemporaryDirectory(prefix="materialist-") as folder:
        file = Path(folder) / f"photo{_suffix(location)}"
        with _told(location):
            system, path = _system(location)
            size = system.info(path).get("size")
            if size is not None and size > LARGEST:
                raise InputError(f"{shown(location)} has {size / 1e9:.1f} GB; the limit is {LARGEST / 1e9:.1f}.")
            system.get_file(path, str(file))
        yield file


def _system(url: str) -> tuple[Any, str]:
    try:
        import fsspec
    except ModuleNotFoundError as error:
        raise SetupError("Photos behind URLs need fsspec; install it with: pip install 'materialist[batch]'") from error
    system, path = fsspec.core.url_to_fs(url)
    return system, path


def _suffix(url: str) -> str:
    return PurePosixPath(shown(url)).suffix.lower()


@contextmanager
def _told(url: str) -> Iterator[None]:
    """Turn the errors of a store into one sentence without the URL's secrets."""
    try:
        yield
    except (InputError, SetupError):
        raise
    except ImportError as error:  # fsspec names the package that the protocol needs
        raise SetupError(f"{shown(url)} cannot be opened: {error}.") from error
    except FileNotFoundError as error:
        raise InputError(f"There is nothing at {shown(url)}.") from error
    except Exception as error:
        reason = str(error).replace(url, shown(url)) or type(error).__name__
        raise InputError(f"{shown(url)} cannot be read: {reason}.") from error
