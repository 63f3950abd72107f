"""What undo goes back to, kept beside the edits, so that it survives reloads and restarts."""

import json
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2

from materialist.edits.recipe import Step
from materialist.errors import InputError
from materialist.io.atomic import write_whole
from materialist.studio.edit_list import EditList
from materialist.studio.selection import Selection
from materialist.studio.workspace import located, write_mask
from materialist.types import Array

FILE = "history.json"
Entry = tuple[str, EditList, Selection]
"""The change that came after it, the edits, and the selection."""


@dataclass
class History:
    past: list[Entry] = field(default_factory=list)
    future: list[Entry] = field(default_factory=list)
    current: int | None = None
    """Of the present list of edits."""
    selection: Selection = field(default_factory=Selection)


def write_history(workspace: Path, history: History) -> None:
    """Write what undo and redo need. Steps that several lists share are written once. Raises OutputError."""
    steps: list[Step] = []
    places: dict[int, int] = {}  # id of a step -> its place among those
    masks: dict[int, list[str]] = {}

    def place(step: Step) -> int:
        if id(step) not in places:
            places[id(step)] = len(steps)
            steps.append(step)
        return places[id(step)]

    def region(selection: Selection) -> list[str]:
        if id(selection) not in masks:
            masks[id(selection)] = selection.stored(lambda part: write_mask(workspace, part))
        return masks[id(selection)]

    def entry(one: Entry) -> list[Any]:
        action, edits, selection = one
        return [action, [place(step) for step in edits.steps], edits.current, region(selection)]

    # Lists by numbers of steps, selections by names of mask files.
    content = {
        "past": [entry(one) for one in history.past],
        "future": [entry(one) for one in history.future],
        "current": history.current,
        "selection": region(history.selection),
        "steps": [[step.kind, step.options] for step in steps],
    }
    write_whole(workspace / FILE, json.dumps(content))


def read_history(workspace: Path, shape: tuple[int, ...]) -> History:
    """What was written of a photo of a shape (H, W); empty where none can be read: undo then begins anew."""
    with suppress(OSError, ValueError, KeyError, TypeError, IndexError, InputError):
        content = json.loads((workspace / FILE).read_text("utf-8"))
        stored = [Step(kind, dict(options), workspace) for kind, options in content["steps"]]
        steps = located(workspace, stored)
        masks: dict[str, Array] = {}

        def region(names: list[str]) -> Selection:
            for name in names:
                if name not in masks:
                    masks[name] = _mask(workspace, name, shape)
            return Selection.read(tuple(masks[name] for name in names), names)

        def entry(kept: list[Any]) -> Entry:
            action, numbers, current, names = kept
            edits = EditList(tuple(steps[number] for number in numbers), current)
            _ = edits.current_step  # one that is not there makes the history unreadable
            return str(action), edits, region(names)

        return History(
            [entry(one) for one in content["past"]],
            [entry(one) for one in content["future"]],
            content["current"],
            region(content["selection"]),
        )
    return History()


def _mask(workspace: Path, name: str, shape: tuple[int, ...]) -> Array:
    """[H, W] bool of a file. Raises ValueError where it is none of this photo's."""
    picture = cv2.imread(str(workspace / Path(name).name), cv2.IMREAD_GRAYSCALE)
    if picture is None or picture.shape != shape:
        raise ValueError(name)
    return picture > 127
