"""Names of results: a photo's stem where it is the only one, more of its path where it is not."""

from __future__ import annotations

import re
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping

LONGEST = 100
"""Bytes of a name; file systems take 255, and temporaries add to it."""


def unique_names(ids: Iterable[str], known: Mapping[str, str] | None = None) -> dict[str, str]:
    """Photo id -> name. Whatever the order, equal sets of ids get equal names; those in `known` keep theirs.

    Names differ by more than upper and lower case, hold no separators, and never begin with a dot.
    """
    known = known or {}
    ids = list(dict.fromkeys(ids))
    names = {one: known[one] for one in ids if one in known}
    used = {name.casefold() for name in known.values()}
    forms: tuple[Callable[[str], str], ...] = (_stem, _path, _with_suffix, _hashed)
    for form in forms:
        proposed = {one: _clean(form(one)) for one in ids if one not in names}
        count = Counter(name.casefold() for name in proposed.values())
        chosen = {i: n for i, n in proposed.items() if count[n.casefold()] == 1 and n.casefold() not in used}
        names |= chosen
        used |= {name.casefold() for name in chosen.values()}
    return names


def _stem(one: str) -> str:
    last = re.split(r"[/\\]", one.rstrip("/\\"))[-1].removeprefix("example:")
    return last.rsplit(".", 1)[0] or last


def _path(one: str) -> str:
    return one.rsplit(".", 1)[0].replace("://", "/")


def _with_suffix(one: str) -> str:
    return one.replace("://", "/")


def _hashed(one: str) -> str:
    return f"{_stem(one)[:60]}-{zlib.crc32(one.encode('utf-8', 'surrogateescape')):08x}"


def _clean(text: str) -> str:
    """A legal file name on every system, as much like the text as that allows; a long one keeps its end."""
    safe = re.sub(r'[\x00-\x1f\x7f<>:"|?*{}%#]', "_", re.sub(r"[/\\]+", "_", text))
    safe = safe.encode("utf-8", "replace")[-LONGEST:].decode("utf-8", "ignore")
    return safe.strip(" .").lstrip("._") or "photo"
