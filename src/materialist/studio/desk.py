"""The desk: the folder of one person's edits of one photo, and the files on it, all under names of ours."""

from __future__ import annotations

import os
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import psutil

from materialist.edit.recipe import Step, read_recipe
from materialist.errors import InputError
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
    """Copy an uploaded file (checked before) to the desk; returns its name there."""
    place = new_name(desk, stem, suffix)
    shutil.copyfile(file, place)
    return place.name


def write_mask(desk: Path, mask: Array) -> str:
    """Write a mask [H, W] bool; returns its name."""
    from materialist.io.image import write_png_bytes

    file = new_name(desk, "mask", ".png")
    write_png_bytes(file, mask.astype(np.uint8) * 255)
    return file.name


def tidy(desk: Path) -> None:
    """Remove path-traced pictures and lists of jobs that pages have left; those of another studio that runs stay."""
    for file in desk.iterdir():
        left = _LEFT.fullmatch(file.name)
        if left and (left[1] is None or int(left[1]) == os.getpid() or not psutil.pid_exists(int(left[1]))):
            file.unlink(missing_ok=True)


def read_steps(desk: Path, file: Path) -> tuple[Step, ...]:
    """The steps of a list of edits, which may name files of this desk only. Raises InputError."""
    try:
        steps = read_recipe(file)
    except InputError as error:
        raise InputError(str(error).replace(str(file), "the file")) from error
    return tuple(confined(step, desk) for step in steps)


def confined(step: Step, desk: Path) -> Step:
    """The step with its files on the desk. Raises InputError where it names a file elsewhere or one that is missing."""
    for name in (*FILES, *WORDS):
        given = step.options.get(name)
        for value in given if isinstance(given, list) else [] if given is None else [given]:
            if name in WORDS and isinstance(value, str) and re.fullmatch(r"[\w-]{1,60}", value):
                continue
            if not isinstance(value, str) or not re.fullmatch(r"[\w-]{1,60}\.\w{1,5}", value):
                raise InputError(f"The {name} {value!r} must be a plain file name; upload the file as well.")
            if not (desk / value).is_file():
                raise InputError(f"The {name} {value} of the list of edits is not here; make that edit again by hand.")
    return replace(step, folder=desk)
