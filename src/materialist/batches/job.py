"""One photo's worth of work, as it travels to a worker process or another machine."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

INVERSION = "materialist.pipeline:invert"
"""What a worker calls on a photo, as module:function."""


@dataclass(frozen=True)
class Job:
    """A photo, and what is to become of it. Only JSON's own types: it crosses process borders as a line of text."""

    id: str
    """What the ledger knows the photo by: its path below the folder, its line in the list, or its URL."""
    name: str
    """Its results are NAME.scene, NAME.png and thumbs/NAME.jpg."""
    location: str
    """Where the photo is read from: an absolute path, `example:NAME` or a URL."""
    runs: str
    """Folder of the results."""
    options: dict[str, Any] = field(default_factory=dict)
    """Keywords of the inversion; `{name}` in a text stands for the name."""
    edits: str | None = None
    """A list of edits to apply."""
    spp: int = 256
    """Paths per pixel of each rendering of the edit."""
    inverted: bool = False
    """The package is there, whole and of this photo and these options: only the edit is missing."""
    replace: bool = False
    """A scene that lies there is of this batch, and may be replaced."""
    replace_picture: bool = False
    """So is an edited photo."""
    function: str = INVERSION

    @property
    def scene(self) -> Path:
        """The scene package."""
        return scene_path(self.runs, self.name)

    @property
    def picture(self) -> Path:
        """The edited photo."""
        return picture_path(self.runs, self.name)

    def named_options(self) -> dict[str, Any]:
        """The options of the inversion, for this photo."""
        return {
            key: value.replace("{name}", self.name) if isinstance(value, str) else value
            for key, value in self.options.items()
        }

    def to_text(self) -> str:
        """One line of JSON."""
        return json.dumps(asdict(self))

    @staticmethod
    def from_text(text: str | bytes) -> Job:
        """The job of a line that `to_text` made."""
        return Job(**json.loads(text))


def scene_path(runs: str | Path, name: str) -> Path:
    """Where the scene package of a name lies."""
    return Path(runs) / f"{name}.scene"


def picture_path(runs: str | Path, name: str) -> Path:
    """Where the edited photo of a name lies."""
    return Path(runs) / f"{name}.png"


def thumbnail_path(runs: str | Path, name: str) -> Path:
    """Where the strip of small pictures of a name lies."""
    return Path(runs) / "thumbs" / f"{name}.jpg"
