"""The last path-traced picture of a photo, kept beside its edits: it outlives pages, and the studio itself."""

import json
import secrets
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from materialist.edits.recipe import Step
from materialist.io.atomic import write_whole
from materialist.studio import SETTINGS

CARD = "final.json"
"""The file that says which picture is kept, and which steps it shows."""


@dataclass(frozen=True)
class FinalPicture:
    steps: tuple[Step, ...]
    path: Path
    """Its files (.png, .exr, .jpg), without the ending."""

    def of(self, steps: tuple[Step, ...]) -> bool:
        return bool(steps) and self.steps == steps

    def remove(self) -> None:
        for file in self.path.parent.glob(f"{self.path.name}*"):
            file.unlink(missing_ok=True)


def new_final(workspace: Path, steps: tuple[Step, ...]) -> FinalPicture:
    """A picture of some steps whose files are still to be made."""
    return FinalPicture(steps, workspace / f"final-{secrets.token_hex(8)}")


def keep_final(workspace: Path, picture: FinalPicture) -> None:
    """Note a picture in place of the one that was kept before, whose files go. Raises OutputError."""
    before = kept_final(workspace)
    steps = [[step.kind, step.options] for step in picture.steps]
    write_whole(workspace / CARD, json.dumps({"name": picture.path.name, "steps": steps}))
    if before is not None and before.path != picture.path:
        before.remove()


def kept_final(workspace: Path) -> FinalPicture | None:
    """The picture that is kept; None where there is none, or its files are gone."""
    with suppress(OSError, ValueError, KeyError, TypeError):
        card = json.loads((workspace / CARD).read_text("utf-8"))
        steps = tuple(Step(str(kind), dict(options), workspace) for kind, options in card["steps"])
        picture = FinalPicture(steps, workspace / Path(str(card["name"])).name)
        if picture.path.with_suffix(".jpg").is_file():
            return picture
    return None


def sweep_finals(workspace: Path) -> None:
    """Remove what renderings that did not end well have left, once none of them can still be at work."""
    kept = kept_final(workspace)
    name = "" if kept is None else kept.path.name
    for file in workspace.glob("final-*"):
        old = time.time() - file.stat().st_mtime > SETTINGS.job_seconds
        if old and not (name and file.name.startswith(name)):
            file.unlink(missing_ok=True)
