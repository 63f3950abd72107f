"""The work folder: one folder a photo, and in it a workspace a person: edits.yaml and its files, under names of ours.

It survives reloads, restarts and closed browsers.
"""

import fcntl
import hashlib
import json
import os
import re
import secrets
import shutil
import tempfile
import threading
import time
import weakref
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from materialist.edits.recipe import Step, read_recipe, with_files
from materialist.errors import InputError
from materialist.io.atomic import make_folder, write_whole, writing
from materialist.io.display import encoded
from materialist.studio import SETTINGS
from materialist.studio.stored import store
from materialist.types import Array

CARD = "project.json"
"""The file that makes a folder a project: title, owner, where the scene is."""
SCENE = "photo.scene"
LAST = "last.json"
"""The file of the work folder that says which project each person had last."""
LOST = "The page has lost its session; reload it."
GONE = "This photo is no longer in the work folder; open it again."
_NAME = re.compile(r"photo-\d{3,6}")
_CACHE = "materialist-cache-"
_DISCARDED = "discarded-"
_CACHE_MARK = "cache-of-a-studio"
"""A file in each cache: what lacks it is somebody's own."""
_COOKIE = re.compile(r"[a-f0-9]{32}")
"""The cookie of a person: a secret."""
_PERSON = re.compile(r"[a-z0-9]{2,32}")


@dataclass(frozen=True)
class Project:
    folder: Path
    title: str
    """For display; often the name of the uploaded file. Part of a path as `stem` only."""
    owner: str
    scene: Path
    """The scene package; inside the folder unless the studio was started on a scene elsewhere."""

    @property
    def name(self) -> str:
        return self.folder.name

    @property
    def stem(self) -> str:
        """The title as the start of a file name: letters, digits, hyphens."""
        bare = re.sub(r"^Example: |\.[A-Za-z]\w{1,3}$", "", self.title)
        return re.sub(r"\W+", "-", bare).strip("-")[:50] or "photo"

    @property
    def ready(self) -> bool:
        with suppress(OSError):  # a name that is too long
            return (self.scene / "scene.json").is_file()
        return False

    def workspace(self, person: str) -> Path:
        """The folder for the edits and results of one person; made on first use. Raises OutputError."""
        if not _PERSON.fullmatch(person):
            raise InputError(f"{person!r} is not a valid name for a workspace.")
        folder = self.folder / f"edits-{person}"
        # Not those above it: a photo that was discarded meanwhile must not come back.
        with writing(folder):
            folder.mkdir(exist_ok=True)
        return folder


def person_of(cookie: str) -> str:
    """The name of the person with a cookie, as it is in folders and commands; nobody finds the cookie from it.

    Raises InputError for a cookie that is not one of ours.
    """
    if not isinstance(cookie, str) or not _COOKIE.fullmatch(cookie):
        raise InputError(LOST)
    return "p" + hashlib.sha256(f"person {cookie}".encode()).hexdigest()[:31]


class WorkFolder:
    def __init__(self, root: str | Path):
        self.root = Path(root).resolve()
        self._lock = threading.Lock()
        self._highest = 0
        """Largest number of a project: none is given twice, as long as somebody may still mean the one before."""
        with writing(root):
            make_folder(self.root)
            tempfile.TemporaryFile(dir=self.root).close()
        self.hide_cookies()
        with _alone_in(self.root):
            self._sweep_caches()
            self.cache = Path(tempfile.mkdtemp(prefix=_CACHE, dir=self.root))
            """Uploads and results that are handed over; they go with this object."""
            (self.cache / _CACHE_MARK).touch()
            lock = _hold(self.cache)
        self._end = weakref.finalize(self, _remove, self.cache, lock)

    def _sweep_caches(self) -> None:
        """Remove the caches of studios that were killed: whoever works holds a lock on theirs."""
        # A lock ends with its process, however that ended.
        for cache in self.root.glob(f"{_CACHE}*"):
            if not (cache / _CACHE_MARK).is_file():
                continue  # not ours
            lock = _hold(cache)
            if lock is not None:
                _remove(cache, lock)

    def hide_cookies(self) -> None:
        """Rename folders and owners that are called after a person's cookie, as earlier versions did."""
        for project in self.projects():
            for edits in project.folder.glob("edits-*"):
                cookie = edits.name.removeprefix("edits-")
                if _COOKIE.fullmatch(cookie):
                    target = edits.with_name(f"edits-{person_of(cookie)}")
                    edits.rename(_free_name(target))
            if _COOKIE.fullmatch(project.owner):
                # The card names its owner, too.
                _change_card(project, owner=person_of(project.owner))

    def projects(self, person: str | None = None) -> list[Project]:
        """All projects, or those of one person; the newest first."""
        projects = [_read(folder) for folder in self.root.iterdir() if _NAME.fullmatch(folder.name)]
        mine = [p for p in projects if p is not None and person in (None, p.owner)]
        return sorted(mine, key=lambda p: int(p.name[6:]), reverse=True)

    def new(self, title: str, owner: str, *, scene: Path | None = None) -> Project:
        """An empty project; with `scene` one that uses a package elsewhere. Old unfinished ones go."""
        self.sweep()
        with self._lock:  # two people may ask at once
            # Numbers are never used again while a folder has them.
            taken = [int(p.name[6:]) for p in self.root.iterdir() if _NAME.fullmatch(p.name)]
            for number in count(max(*taken, self._highest, 0) + 1):
                folder = self.root / f"photo-{number:03d}"
                with writing(folder), suppress(FileExistsError):  # another studio was faster
                    folder.mkdir()
                    self._highest = number
                    break
        project = Project(
            folder, _shown(title), owner, scene.resolve() if scene else folder / SCENE
        )
        # Relative: the work folder may be moved.
        place = os.path.relpath(project.scene, folder) if scene is None else str(project.scene)
        content = {"title": project.title, "owner": project.owner, "scene": place}
        with writing(folder):
            (folder / CARD).write_text(json.dumps(content, indent=1), "utf-8")
        return project

    def rename(self, project: Project, title: str) -> Project:
        """Give a project another title. Raises InputError where it is gone, OutputError where it cannot be written."""
        renamed = replace(project, title=_shown(title))
        _change_card(project, title=renamed.title)
        return renamed

    def write_last(self, last: dict[str, str]) -> None:
        """Keep which project each person had last, for a studio that is started again. Raises OutputError."""
        write_whole(self.root / LAST, json.dumps(last))

    def read_last(self) -> dict[str, str]:
        """What `write_last` kept; nothing where it cannot be read: people then choose a photo."""
        with suppress(OSError, ValueError, AttributeError, RecursionError):
            kept = json.loads((self.root / LAST).read_text("utf-8"))
            return {str(person): str(name) for person, name in kept.items()}
        return {}

    def discard(self, project: Project) -> None:
        """Take a project, its edits included, out of the list; its folder goes a day later (`sweep`)."""
        with writing(project.folder):
            bin_folder = self.root / f"{_DISCARDED}{project.name}-{secrets.token_hex(4)}"
            project.folder.rename(bin_folder)
            os.utime(bin_folder)

    def drop(self, project: Project) -> None:
        """Remove the folder of a photo that was not taken apart to the end, unless it is another photo's by now."""
        if _read(project.folder) == project and not project.ready:
            shutil.rmtree(project.folder, ignore_errors=True)

    def sweep(self) -> None:
        """Remove what lies idle: folders of photos that were not taken apart to the end, uploads, and results."""
        for folder in self.root.glob(f"{_DISCARDED}photo-*"):
            if time.time() - folder.stat().st_mtime > SETTINGS.unfinished_seconds:
                shutil.rmtree(folder, ignore_errors=True)
        for place in {*self.cache.iterdir()} - {self.cache / _CACHE_MARK}:
            with suppress(OSError):  # it goes by itself meanwhile
                if time.time() - place.stat().st_mtime > SETTINGS.unfinished_seconds:
                    shutil.rmtree(place) if place.is_dir() else place.unlink()
        for project in self.projects():
            # Only folders of the studio's own, without edits of anybody.
            idle = time.time() - project.folder.stat().st_mtime > SETTINGS.unfinished_seconds
            ours = project.scene.parent == project.folder and not [*project.folder.glob("edits-*")]
            if idle and ours and not project.ready:
                shutil.rmtree(project.folder, ignore_errors=True)


def _change_card(project: Project, **facts: str) -> None:
    """Write other facts of a project. Raises InputError where it is gone, OutputError."""
    try:
        card = json.loads((project.folder / CARD).read_text("utf-8"))
    except OSError as error:
        raise InputError(GONE) from error
    write_whole(project.folder / CARD, json.dumps({**card, **facts}, indent=1))


def _free_name(folder: Path) -> Path:
    """The folder itself where there is none yet, else one beside it that no person has: `former-1-NAME`."""
    if not folder.exists():
        return folder
    places = (folder.with_name(f"former-{number}-{folder.name}") for number in count(1))
    return next(place for place in places if not place.exists())


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Within it no other process is within it for the same folder, where the file system has locks."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _hold(cache: Path) -> int | None:
    """A lock on a cache, which ends with this process, however it ends; None where another process has it."""
    with suppress(OSError):
        descriptor = os.open(cache, os.O_RDONLY)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(descriptor)
            return None
        return descriptor
    return None


def _remove(cache: Path, lock: int | None) -> None:
    """Remove a cache, and give up the lock on it."""
    shutil.rmtree(cache, ignore_errors=True)
    if lock is not None:
        os.close(lock)


def _read(folder: Path) -> Project | None:
    """The project in a folder, or None where its card is missing or damaged."""
    try:
        card = json.loads((folder / CARD).read_text("utf-8"))
        return Project(
            folder, str(card["title"]), str(card["owner"]), (folder / card["scene"]).resolve()
        )
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _shown(title: str) -> str:
    """A title fit for a list: one line, not too long."""
    line = " ".join(re.sub(r"[\x00-\x1f\x7f<>]", " ", title).split())
    return line[:60] or "Photo"


def write_mask(workspace: Path, mask: Array) -> str:
    """Write a mask [H, W] bool; returns its name: no other photo has one of that name."""
    return store(workspace, "mask", encoded(mask.astype(np.uint8) * 255), ".png")


def read_steps(workspace: Path, file: Path) -> tuple[Step, ...]:
    """The steps of a list of edits. Raises InputError where one names a file that is not in this workspace."""
    return located(workspace, read_recipe(file))


def located(workspace: Path, steps: Iterable[Step]) -> tuple[Step, ...]:
    """The steps with their files in a workspace. Raises InputError for a file that is not there."""

    def here(option: str, name: str) -> str:
        if not (workspace / name).is_file():
            raise InputError(
                f"The {option} {name} of the list of edits is not here; load the zip that has its files."
            )
        return name

    return tuple(replace(with_plain_files(step, here), folder=workspace) for step in steps)


def with_plain_files(step: Step, use: Callable[[str, str], Any]) -> Step:
    """`with_files`, where every file is named without a folder. Raises InputError for other names."""
    if step.options.get("inpaint", "sd") != "sd":
        raise InputError(
            "The studio takes no inpainter but 'sd'; change the inpaint of the list of edits."
        )

    def plain(option: str, value: Any) -> str:
        if not isinstance(value, str) or not re.fullmatch(r"[\w-]{1,60}\.\w{1,5}", value):
            raise InputError(f"The {option} {value!r} must be a plain file name, as in mask-1.png.")
        return use(option, value)

    return with_files(step, plain)


def content_of(file: Path) -> bytes | None:
    """The bytes of a file; None where there is none."""
    try:
        return file.read_bytes()
    except FileNotFoundError:
        return None
