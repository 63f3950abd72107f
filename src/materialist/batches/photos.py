"""Which photos a batch is about (a folder, a list file, one photo, or a URL), and what their results are called."""

import os
import re
import zlib
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from materialist.batches.ledger import LEDGER
from materialist.batches.remote import is_url, list_url, without_secrets
from materialist.errors import InputError
from materialist.io.atomic import FILE_MANAGER_FILES, MARKER
from materialist.io.bitmap import FORMATS
from materialist.io.decode import SUFFIXES
from materialist.io.photo import PREFIX
from materialist.io.text import read_text

NAMED = 5
"""Names in a note."""
LONGEST_NAME = 100
"""Bytes of a name; file systems take 255, and temporaries add to it."""


@dataclass(frozen=True)
class Listed:
    id: str
    """Path below the folder, line of the list, or URL without secrets: the same wherever the folder lies."""
    location: str


def list_photos(
    source: str | Path, *, runs: str | Path, notes: list[str] | None = None
) -> list[Listed]:
    """The photos of SOURCE, sorted by name, each once.

    SOURCE is a folder (searched with its subfolders; hidden files, scene packages and the results of batches are
    passed over), a text file with a photo or URL on each line (relative to the file; # begins a comment, behind a name
    only after a space), a single photo, or a URL of a folder, a pattern or a photo that fsspec can read. RUNS is passed
    over in any case. `notes` get a sentence on files whose names are no photo's, and on repeated lines of a list.

    Raises InputError where there is nothing to do, SetupError where a URL needs a library that is not installed.
    """
    text = str(source)
    notes = [] if notes is None else notes
    if is_url(text):
        photos = [Listed(without_secrets(url), url) for url in list_url(text, SUFFIXES)]
    elif text.startswith(PREFIX) or (
        Path(text).suffix.lower() in SUFFIXES and Path(text).is_file()
    ):
        photos = [_named(text, Path())]
    elif Path(text).is_dir():
        photos = _of_folder(Path(text), Path(runs), notes)
    elif Path(text).is_file():
        photos = _of_list(Path(text), notes)
    else:
        raise InputError(f"There is no folder or list of photos at {text}.")
    if not photos:
        raise InputError(f"{without_secrets(text)} holds no photo; it may hold {FORMATS}.")
    return sorted({photo.id: photo for photo in photos}.values(), key=lambda photo: photo.id)


def _of_folder(folder: Path, runs: Path, notes: list[str]) -> list[Listed]:
    # --- A walk that enters neither packages, nor other runs, nor a folder twice ---
    photos = list[Listed]()
    others = list[str]()
    seen = {os.path.realpath(runs)}
    if os.path.realpath(folder) in seen:
        raise InputError(
            f"RUNS cannot be {runs}, the folder of the photos; name another, such as {runs / 'runs'}."
        )
    try:
        for place, below, files in os.walk(folder, onerror=_raise, followlinks=True):
            real = os.path.realpath(place)
            if MARKER in files or LEDGER in files or real in seen:
                below.clear()
                continue
            seen.add(real)
            below[:] = sorted(name for name in below if not name.startswith("."))
            for name in files:
                if name.startswith(".") or name in FILE_MANAGER_FILES:
                    continue
                path = Path(place) / name
                # Bytes of a path that are no UTF-8 cannot be written into a table; they become escapes.
                id = (
                    path.relative_to(folder)
                    .as_posix()
                    .encode("utf-8", "backslashreplace")
                    .decode("utf-8")
                )
                if path.suffix.lower() in SUFFIXES:
                    photos.append(Listed(id, os.path.abspath(path)))
                else:
                    others.append(id)
    except OSError as error:
        raise InputError(
            f"The folder {error.filename or folder} cannot be read: {error.strerror or error}."
        ) from error
    if others:
        notes.append(f"Passed over, as their names are no photo's: {_some(sorted(others))}.")
    return photos


def _some(names: list[str]) -> str:
    """The first names, and how many more there are."""
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return ", ".join(names[:NAMED]) + more


def _raise(error: OSError) -> None:
    raise error


def _of_list(file: Path, notes: list[str]) -> list[Listed]:
    try:
        lines = read_text(file).splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"{file} is no list of photos ({error}); write one path or URL on each line."
        ) from error
    entries = [re.split(r"(?:^|\s)#", line.strip(), maxsplit=1)[0].rstrip() for line in lines]
    listed = [_named(entry, file.parent) for entry in entries if entry]
    # One file may be named in several ways.
    places: dict[str, Listed] = {}
    repeated: dict[str, None] = {}
    for photo in listed:
        place = photo.location if is_url(photo.location) else os.path.realpath(photo.location)
        if place in places:
            repeated[places[place].id] = None
        places.setdefault(place, photo)
    if repeated:
        notes.append(
            f"More than one line of {file.name} names {_some([*repeated])}; each is done once."
        )
    return [*places.values()]


def _named(entry: str, folder: Path) -> Listed:
    if is_url(entry):
        return Listed(without_secrets(entry), entry)
    if entry.startswith(PREFIX):
        return Listed(entry, entry)
    return Listed(entry, os.path.abspath(folder / entry))


def unique_names(ids: Iterable[str], known: Mapping[str, str] | None = None) -> dict[str, str]:
    """Photo id -> name: its stem, where that is not unique its whole path, else a hash behind its stem.

    Whatever the order, equal sets of ids get equal names; those in `known` keep theirs. Names differ by more than upper
    and lower case, hold no separators, and never begin with a dot.
    """
    known = known or {}
    ids = list(dict.fromkeys(ids))
    names = {photo_id: known[photo_id] for photo_id in ids if photo_id in known}
    used = {name.casefold() for name in known.values()}
    for form in (_stem, lambda photo_id: photo_id.replace("://", "/"), _hashed):
        proposed = {photo_id: _clean(form(photo_id)) for photo_id in ids if photo_id not in names}
        count = Counter(name.casefold() for name in proposed.values())
        chosen = {
            i: n
            for i, n in proposed.items()
            if count[n.casefold()] == 1 and n.casefold() not in used
        }
        names |= chosen
        used |= {name.casefold() for name in chosen.values()}
    return names


def _stem(photo_id: str) -> str:
    last = re.split(r"[/\\]", photo_id.rstrip("/\\"))[-1].removeprefix("example:")
    return last.rsplit(".", 1)[0] or last


def _hashed(photo_id: str) -> str:
    return f"{_stem(photo_id)[:60]}-{zlib.crc32(photo_id.encode('utf-8', 'surrogateescape')):08x}"


def _clean(text: str) -> str:
    """A legal file name on every system, as much like the text as that allows; a long one keeps its end."""
    safe = re.sub(r'[\x00-\x1f\x7f<>:"|?*{}%#]', "_", re.sub(r"[/\\]+", "_", text))
    safe = safe.encode("utf-8", "replace")[-LONGEST_NAME:].decode("utf-8", "ignore")
    return safe.strip(" .").lstrip("._") or "photo"
