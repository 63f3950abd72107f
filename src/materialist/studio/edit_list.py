"""The list of edits in the making. It is the same thing as edits.yaml: steps of `edits.recipe`."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from materialist.edits.core.operation import PreviewMode, Target
from materialist.edits.recipe import Step
from materialist.errors import InputError

_SILENT = (
    "mask",
    "click",
    "box",
    "with",
    "extent",
    "same_material",
    "exclude",
    "skip",
    "thickness",
    "at",
    "seed",
    "gain",
)
"""Options that a summary leaves out: the picture shows them."""
_NAMES = {
    "mesh": "",
    "envmap": "",
    "value": "brightness",
    "albedo": "colour",
    "ior": "refraction",
    "ambient": "brightness",
}
"""Options that are not called so on the page."""
_OURS = re.compile(r"(?:thing|light)-([a-z]+)")
"""The name of a file that the studio computes."""
_UPLOADED = re.compile(r"[a-z]+-[0-9a-f]{12}")
"""The name that `stored.store` gives an uploaded file."""

_SLIDES = re.compile(r"#\w{6}|[-+.,\de]+")
"""Values that sliders and colour pickers set: numbers and colours."""


@dataclass(frozen=True)
class EditList:
    """Steps in the order of their application, and which of them the sliders move."""

    steps: tuple[Step, ...] = ()
    current: int | None = None

    @property
    def follows_selection(self) -> bool:
        """Whether the current edit is one of a region that the preview shows soon enough."""
        step = self.current_step
        if step is None or step.operation.target is not Target.REGION:
            return False
        return step.operation.preview in (PreviewMode.SHADED, PreviewMode.TRACED)

    def add(self, step: Step) -> EditList:
        return EditList((*self.steps, step), len(self.steps))

    def put(self, index: int, step: Step) -> EditList:
        """With another step in the place of one."""
        return EditList((*self.steps[:index], step, *self.steps[index + 1 :]), index)

    def toggled(self, index: int) -> EditList:
        """With a step switched off, which makes none current if it was, or on again; any other current one stays."""
        step = self.steps[index]
        after = self.put(index, with_options(step, skip=None if step.skipped else "true"))
        return after.chosen(
            None if after.steps[index].skipped and self.current == index else self.current
        )

    def moved(self, index: int, by: int) -> EditList:
        """With a step further up (by = -1) or down (+1); the current one stays current, wherever it is then."""
        other = index + by
        if not 0 <= other < len(self.steps):
            return self
        steps = list(self.steps)
        # Swapped with its neighbour.
        steps[index], steps[other] = steps[other], steps[index]
        current = (
            other if self.current == index else index if self.current == other else self.current
        )
        return EditList(tuple(steps), current)

    def without(self, index: int) -> EditList:
        return EditList((*self.steps[:index], *self.steps[index + 1 :]), None)

    def acted(self, action: str, index: int) -> EditList:
        """After one of the buttons of the list: toggle, up, down, remove, choose. Raises InputError."""
        if not 0 <= index < len(self.steps):
            raise InputError("That edit is no longer there.")
        # Lazily: only the pressed button's list is made.
        changed = {
            "toggle": lambda: self.toggled(index),
            "up": lambda: self.moved(index, -1),
            "down": lambda: self.moved(index, 1),
            "remove": lambda: self.without(index),
            "choose": lambda: self.chosen(None if self.current == index else index),
        }
        if action not in changed:
            raise InputError("That button is not known; reload the page.")
        return changed[action]()

    def chosen(self, index: int | None) -> EditList:
        return replace(self, current=index)

    @property
    def current_step(self) -> Step | None:
        """The step that the sliders move."""
        return self.steps[self.current] if self.current is not None else None

    @property
    def light(self) -> int | None:
        """The place of the light that its controls move: the current one, else the last that is switched on."""
        places = [k for k, step in enumerate(self.steps) if step.operation.target is Target.LIGHT]
        if self.current in places:
            return self.current
        return next((k for k in reversed(places) if not self.steps[k].skipped), None)

    @property
    def active(self) -> tuple[Step, ...]:
        return tuple(step for step in self.steps if not step.skipped)


def is_shaded(step: Step) -> bool:
    """Whether the preview shades a step; what the others add is sketched."""
    return step.operation.preview is PreviewMode.SHADED


def with_options(step: Step, **options: Any) -> Step:
    """The step with some options set, or cleared (None)."""
    return replace(
        step, options={k: v for k, v in {**step.options, **options}.items() if v is not None}
    )


def slides(value: Any) -> bool:
    """Whether an option's value is one that sliders and colour pickers set."""
    if isinstance(value, list):
        return all(isinstance(item, str) and slides(item) for item in value)
    return _SLIDES.fullmatch(str(value)) is not None


def key_of(steps: tuple[Step, ...]) -> str:
    """The key of some steps in the store of `kept`."""
    # Device and seed do not change what a step makes.
    entries = [[step.kind, step.options, str(step.folder)] for step in steps]
    return json.dumps(entries, default=str)


def kept(
    store: dict[str, Any], steps: tuple[Step, ...], make: Callable[[], Any], max_items: int
) -> Any:
    """What a store holds for some steps, made where it is missing; it keeps those that were last asked for."""
    key = key_of(steps)
    # Taken out and put back last: a dict keeps its order, so that the oldest come first.
    value = store.pop(key, None)
    store[key] = value = make() if value is None else value
    for old in list(store)[:-max_items]:
        store.pop(old, None)
    return value


def step_summary(step: Step) -> str:
    """A step in a few words."""
    shown = {name: value for name, value in step.options.items() if name not in _SILENT}
    parts = [
        f"{_NAMES.get(name, name.replace('_', ' '))} {_short(value)}".strip()
        for name, value in shown.items()
    ]
    return f"{step.operation.label}: {', '.join(parts) or step.operation.bare}"


def _short(value: Any) -> str:
    if isinstance(value, list | tuple):
        return (
            f"({len(value)})"
            if value and isinstance(value[0], list | tuple)
            else ",".join(_short(v) for v in value)
        )
    # File names say more without their ending; those of the studio by the thing alone.
    file = re.fullmatch(r"(.*[A-Za-z_].*)\.\w+", str(value))
    if file is None:
        return str(value)
    ours = _OURS.fullmatch(file[1])
    return "own" if _UPLOADED.fullmatch(file[1]) else ours[1] if ours else file[1]
