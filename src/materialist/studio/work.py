"""The work folder: one folder a photo, which survives reloads, restarts and closed browsers."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import psutil

from materialist.errors import InputError, OutputError

CARD = "project.json"
"""The file that makes a folder a project: title, owner, where the scene is."""
SCENE = "photo.scene"
_NAME = re.compile(r"photo-\d{3,6}")
_PERSON = re.compile(r"[a-z0-9]{2,32}")


@dataclass(frozen=True)
class Project:
    """A photo in work."""

    folder: Path
    title: str
    """What people read; often the name of the uploaded file. Never part of a path."""
    owner: str
    scene: Path
    """The scene package; inside the folder unless the studio was started on a scene elsewhere."""
    photo: Path | None = None
    """The uploaded file, under a name of ours."""

    @property
    def name(self) -> str:
        return self.folder.name

    @property
    def ready(self) -> bool:
        """Whether the inversion has finished."""
        return (self.scene / "scene.json").is_file()

    def desk(self, person: str) -> Path:
        """The folder for the edits and results of one person; made on first use. Raises OutputError."""
        if not _PERSON.fullmatch(person):
            raise InputError(f"{person!r} is not a valid name for a desk.")
        folder = self.folder / f"edits-{person}"
        _make(folder)
        return folder


class WorkFolder:
    """The folder that the user named, and the projects in it."""

    def __init__(self, root: str | Path):
        self.root = Path(root).resolve()
        _make(self.root)
        # A cache a process: it goes when the process ends, and another studio on the same folder keeps its own.
        self.cache = self.root / ".cache" / str(os.getpid())
        _make(self.cache)
        for leftover in self.cache.parent.iterdir():
            if leftover.name.isdigit() and not psutil.pid_exists(int(leftover.name)):
                shutil.rmtree(leftover, ignore_errors=True)
        try:
            with tempfile.TemporaryFile(dir=self.cache):
                pass
        except OSError as error:
            raise OutputError(f"The work folder {root} cannot be written: {error.strerror or error}.") from error

    def projects(self, person: str | None = None) -> list[Project]:
        """All projects, or those of one person; the last used first."""
        found = [_read(folder) for folder in self.root.iterdir() if _NAME.fullmatch(folder.name)]
        mine = [p for p in found if p is not None and person in (None, p.owner)]
        return sorted(mine, key=lambda p: (p.folder / CARD).stat().st_mtime, reverse=True)

    def new(self, title: str, owner: str, *, scene: Path | None = None) -> Project:
        """An empty project; with `scene` one that uses a package elsewhere."""
        taken = [int(p.name[6:]) for p in self.root.iterdir() if _NAME.fullmatch(p.name)]
        number = max(taken, default=0) + 1
        while True:  # two people may ask at once
            folder = self.root / f"photo-{number:03d}"
            try:
                folder.mkdir()
                break
            except FileExistsError:
                number += 1
            except OSError as error:
                raise OutputError(f"{folder} cannot be made: {error.strerror or error}.") from error
        project = Project(folder, _shown(title), owner, scene.resolve() if scene else folder / SCENE)
        write_card(project)
        return project

    def touch(self, project: Project) -> None:
        """Put the project first in the list."""
        os.utime(project.folder / CARD, (time.time(), time.time()))


def write_card(project: Project) -> None:
    """Write project.json, whole."""
    content = {
        "title": project.title, "owner": project.owner,
        "scene": os.path.relpath(project.scene, project.folder) if _inside(project) else str(project.scene),
        "photo": project.photo.name if project.photo else None,
    }  # fmt: skip
    temporary = project.folder / f".{CARD}.part"
    try:
        temporary.write_text(json.dumps(content, indent=1), "utf-8")
        temporary.replace(project.folder / CARD)
    except OSError as error:
        raise OutputError(f"{project.folder} cannot be written: {error.strerror or error}.") from error


def default_root() -> Path:
    """`materialist-studio` in the current directory, or in the temporary folder where that cannot be written."""
    here = Path.cwd()
    base = here if os.access(here, os.W_OK) else Path(tempfile.gettempdir())
    return base / "materialist-studio"


def _read(folder: Path) -> Project | None:
    """The project in a folder, or None where its card is missing or damaged."""
    try:
        card = json.loads((folder / CARD).read_text("utf-8"))
        photo = folder / Path(card["photo"]).name if card.get("photo") else None
        return Project(folder, str(card["title"]), str(card["owner"]), (folder / card["scene"]).resolve(), photo)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _inside(project: Project) -> bool:
    return project.folder in project.scene.parents


def _shown(title: str) -> str:
    """A title fit for a list: one line, not too long."""
    line = " ".join(re.sub(r"[\x00-\x1f\x7f<>]", " ", title).split())
    return line[:60] or "Photo"


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"The folder {folder} cannot be made: {error.strerror or error}.") from error
