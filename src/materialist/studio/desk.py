"""The desk: the folder of one person's edits of one photo, and the files on it, all under names of ours."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from materialist.edits.recipe import Step, read_recipe
from materialist.errors import InputError
from materialist.io.beside import partial
from materialist.types import Array

FILES = ("mask", "texture", "envmap", "mesh", "background")
"""Options that name a file."""
WORDS = ("thickness", "inpaint")
"""Options that name a method, or a file."""
_LEFT = re.compile(r"(?:final|job)-(?:(\d+)-)?[0-9a-f]+\.(?:png|exr|jpg|yaml)")
"""What `session.Session` writes for a while: which process, and a mark of the page or the content."""


def new_name(desk: Path, stem: str, suffix: str) -> Path:
    """A free place on the desk: STEM-1SUFFIX, STEM-2SUFFIX, ..."""
    pattern = re.compile(rf"{re.escape(stem)}-(\d+)\.")
    taken = [int(m[1]) for p in desk.iterdir() if (m := pattern.match(p.name))]
    return desk / f"{stem}-{max(taken, default=0) + 1}{suffix}"


def keep(desk: Path, file: Path, stem: str, suffix: str) -> str:
    """Copy an uploaded file (checked before) to the desk; returns its name there, which tells its content."""
    return _whole(desk / _name(stem, file.read_bytes(), suffix), lambda place: shutil.copyfile(file, place))


def write_mask(desk: Path, mask: Array) -> str:
    """Write a mask [H, W] bool; returns its name, which tells its content: no other photo has one of that name."""
    from materialist.io.image import write_png_bytes

    file = desk / _name("mask", f"{mask.shape}".encode() + np.packbits(mask).tobytes(), ".png")
    return _whole(file, lambda place: write_png_bytes(place, mask.astype(np.uint8) * 255))


def _whole(file: Path, write: Callable[[Path], Any]) -> str:
    """The name of a file that is there whole, or is written so."""
    if not file.is_file():
        temporary = partial(file)
        try:
            write(temporary)
            os.replace(temporary, file)
        finally:
            temporary.unlink(missing_ok=True)
    return file.name


def _name(stem: str, content: bytes, suffix: str) -> str:
    return f"{stem}-{hashlib.sha256(content).hexdigest()[:12]}{suffix}"


def tidy(desk: Path) -> None:
    """Remove path-traced pictures and lists of jobs that pages have left; those of another studio that runs stay."""
    for file in desk.iterdir():
        left = _LEFT.fullmatch(file.name)
        if left and (left[1] is None or int(left[1]) == os.getpid() or not psutil.pid_exists(int(left[1]))):
            file.unlink(missing_ok=True)


def read_steps(desk: Path, file: Path) -> tuple[Step, ...]:
    """The steps of a list of edits, which may name files of this desk only. Raises InputError."""
    return tuple(confined(step, desk) for step in read_list(file))


def read_list(file: Path) -> list[Step]:
    """`read_recipe`, with messages that do not say where the file lies."""
    try:
        return read_recipe(file)
    except InputError as error:
        raise InputError(str(error).replace(str(file), "the file")) from error


def confined(step: Step, desk: Path) -> Step:
    """The step with its files on the desk. Raises InputError where it names a file elsewhere or one that is missing."""

    def here(option: str, name: str) -> str:
        if not (desk / name).is_file():
            raise InputError(f"The {option} {name} of the list of edits is not here; load the zip that has its files.")
        return name

    return replace(with_files(step, here), folder=desk)


def with_files(step: Step, use: Callable[[str, str], str]) -> Step:
    """The step with `use(option, name)` in the place of each file that it names. Raises InputError for odd names."""

    def used(option: str, value: Any) -> Any:
        if option in WORDS and isinstance(value, str) and re.fullmatch(r"[\w-]{1,60}", value):
            return value
        if not isinstance(value, str) or not re.fullmatch(r"[\w-]{1,60}\.\w{1,5}", value):
            raise InputError(f"The {option} {value!r} must be a plain file name, as in mask-1.png.")
        return use(option, value)

    options = dict(step.options)
    for option in {*FILES, *WORDS} & {*options}:
        given = options[option]
        options[option] = [used(option, value) for value in given] if isinstance(given, list) else used(option, given)
    return replace(step, options=options)
