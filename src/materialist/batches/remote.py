"""Photos behind URLs (s3://, gs://, https://, ...), through fsspec."""

import re
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any

from materialist.batches.results import file_hash
from materialist.errors import InputError, MaterialistError, SetupError
from materialist.install import extra_command, install_command
from materialist.io.photo import PREFIX, example_path

LARGEST = 2 << 30
"""Bytes of a photo that is fetched: no photo within the pixel limit is larger."""
STORES = {"s3": "s3fs", "gs": "gcsfs", "gcs": "gcsfs", "az": "adlfs", "abfs": "adlfs"}
"""Protocol -> the package that fsspec needs for it."""


def is_url(text: str) -> bool:
    """Whether the text is a URL rather than a path."""
    return re.match(r"[A-Za-z][A-Za-z0-9+.-]*(::[A-Za-z0-9+.-]+)*://", text) is not None


def without_secrets(url: str) -> str:
    """The URL without its secrets: user, password and signed query."""
    return re.sub(r"://[^/]*@", "://", url).split("?")[0] if is_url(url) else url


def list_url(url: str, suffixes: frozenset[str]) -> list[str]:
    """URLs of the photos at a URL: a folder with its subfolders, a pattern with *, or one photo."""
    with _opened(url) as (system, path):
        system.invalidate_cache()  # an earlier listing in this process may be out of date
        pattern = any(mark in path for mark in "*[")
        if not pattern and _path(url).suffix.lower() in suffixes:
            return [url]
        paths = system.glob(path) if pattern else system.find(path)
        if not paths and not pattern:
            system.ls(path)  # says why: a search passes over what cannot be reached
        urls = [str(listed) for listed in map(system.unstrip_protocol, paths)]
    return [
        listed
        for listed in urls
        if _path(listed).suffix.lower() in suffixes and not _path(listed).name.startswith(".")
    ]


def fingerprint(location: str) -> str | None:
    """The hash of a photo's bytes, or the version that a remote store gives it; None where it cannot be read."""
    try:
        if not is_url(location):
            return file_hash(example_path(location) if location.startswith(PREFIX) else location)
        with _opened(location) as (system, path):
            return f"url:{system.ukey(path)}"
    except (OSError, MaterialistError):
        return None


@contextmanager
def local_copy(location: str) -> Iterator[Path]:
    """The photo as a local file; one behind a URL is fetched, and its copy removed afterwards."""
    if not is_url(location):
        yield Path(location)
        return
    with tempfile.TemporaryDirectory(prefix="materialist-") as folder:
        file = Path(folder) / f"photo{_path(location).suffix.lower()}"
        with _opened(location) as (system, path):
            size = system.info(path).get("size")
            if size is not None and size > LARGEST:
                raise InputError(
                    f"{without_secrets(location)} has {size / 1e9:.1f} GB; the limit is {LARGEST / 1e9:.1f}."
                )
            system.get_file(path, str(file))
        yield file


@contextmanager
def _opened(url: str) -> Iterator[tuple[Any, str]]:
    """The file system of a URL and the path in it; errors of the store become a sentence without the URL's secrets."""
    import fsspec

    try:
        yield fsspec.core.url_to_fs(url)
    except (InputError, SetupError):
        raise
    except ImportError as error:
        raise _lacking(url, error) from error
    except FileNotFoundError as error:
        raise InputError(f"There is nothing at {without_secrets(url)}.") from error
    except Exception as error:
        reason = str(error).replace(url, without_secrets(url)) or type(error).__name__
        raise InputError(f"{without_secrets(url)} cannot be read: {reason}.") from error


def require_stores(locations: Iterable[str]) -> None:
    """Raise SetupError where a library that one of the URLs needs is not installed; nothing is opened."""
    import fsspec

    # One URL of each kind tells: `simplecache::https` is that of simplecache::https://...
    kinds = {url.split("://")[0]: url for url in locations if is_url(url)}
    for kind, url in kinds.items():
        for protocol in kind.split("::"):
            try:
                fsspec.get_filesystem_class(protocol)
            except ImportError as error:
                raise _lacking(url, error) from error
            except ValueError:  # a protocol that nobody knows shows when it is opened
                continue


def _lacking(url: str, error: ImportError) -> SetupError:
    """The error of a library that is not there; where we do not know its name, fsspec's own words."""
    kind = re.findall(r"(\w+)://", url)[-1]  # the store at the end of zip://*.jpg::https://...
    if kind in ("http", "https"):
        command = extra_command("http")
    elif kind in STORES:
        command = install_command(STORES[kind])
    else:
        return SetupError(f"{without_secrets(url)} cannot be opened: {str(error).rstrip('.')}.")
    return SetupError(f"{without_secrets(url)} needs one more package: {command}")


def _path(url: str) -> PurePosixPath:
    return PurePosixPath(without_secrets(url))
