"""The state of one page: its scene, selection, list of edits and undo history."""

import re
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import materialist as mt
from materialist.edits.core.operation import REGION, PreviewMode, Target
from materialist.edits.light.operation import RELIGHT
from materialist.edits.recipe import Step, region_of, write_recipe
from materialist.errors import InputError
from materialist.jobs.queue import Job, JobQueue
from materialist.studio import SETTINGS, uploads
from materialist.studio.access.quota import Allowance
from materialist.studio.archives import read_list, unpack
from materialist.studio.edit_list import EditList, with_options
from materialist.studio.glass import GlassClient
from materialist.studio.live_preview import LivePreview
from materialist.studio.selection import ADD, REMOVE, Selection
from materialist.studio.workspace import Project, located, read_steps, write_mask
from materialist.types import Array, Scene

EDITS = "edits.yaml"
ENDING = ("final", "take")
"""Kinds of jobs that end with the page that asked for them; an inversion runs on."""
_SLIDES = re.compile(r"#\w{6}|[-+.,\de]+")
"""Values that sliders and colour pickers set: numbers and colours."""


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


class Session:
    """The state of one page. Its methods may be called from any thread."""

    def __init__(
        self,
        person: str,
        without_folders: Callable[[str], str] = str,
        local: bool = True,
        allowance: Allowance | None = None,
    ):
        self.person = person
        self.without_folders = without_folders
        self.local = local
        """`without_folders` is the studio's; `local`: the person has the command line of this machine, too."""
        self.allowance = allowance or Allowance()
        self.lock = threading.RLock()
        self.project: Project | None = None
        self.live: LivePreview | None = None
        self.glass: GlassClient | None = None
        self.selection = Selection()
        self.next_object: dict[str, str] = {}
        self.falls = 0
        """How many falls were begun here: each tumbles in its own way."""
        self.edits = EditList()
        self._past: list[tuple[str, EditList, Selection]] = []
        self._future: list[tuple[str, EditList, Selection]] = []
        self.running: list[Job] = []
        self.left = False
        """Whether the page was closed."""
        self.followers: dict[int, object] = {}
        """Job (by its id) -> who follows it for this page: of several the last."""
        self.seen = 0.0
        self.beats = False
        """When this page last asked for something, by the monotonic clock, and whether it shows that it is open."""
        self._kept: bytes | None = None
        """The list of edits as this page last read or wrote it."""
        self.final: FinalPicture | None = None

    @property
    def scene(self) -> Scene:
        """The open scene. Raises InputError where there is none."""
        if self.live is None:
            raise InputError("Open a photo first.")
        return self.live.scene

    @property
    def opened(self) -> Project:
        """The open photo. Raises InputError where there is none."""
        if self.project is None:
            raise InputError("Open a photo first.")
        return self.project

    @property
    def workspace(self) -> Path:
        """Where this person's edits of the open photo lie."""
        return self.opened.workspace(self.person)

    def pixel(self, x: float, y: float) -> tuple[int, int]:
        """(column, row) of the pixel at a place of the photo, its right and bottom edge included. Raises InputError."""
        camera = self.scene.camera
        if not (0 <= x <= camera.width and 0 <= y <= camera.height):
            raise InputError(f"The place {x:g}, {y:g} is outside of the photo; click in it.")
        return min(int(x), camera.width - 1), min(int(y), camera.height - 1)

    def note_job(self, job: Job) -> None:
        """Note a job that this page asked for, to stop it by a button, or when the page is closed."""
        self.running = [*(earlier for earlier in self.running if not earlier.over), job]

    def stop(self, jobs: JobQueue, *kinds: str) -> None:
        """Stop the jobs of some kinds, or all, that this page asked for."""
        for job in self.running:
            if not kinds or job.kind in kinds:
                jobs.stop(job)

    @property
    def current_kind(self) -> str | None:
        step = self.edits.current_step
        return step.kind if step else None

    def open(self, project: Project) -> None:
        loaded = mt.load_scene(project.scene)
        workspace = project.workspace(self.person)
        # --- Everything that can fail, before the page changes ---
        kept = _content(workspace / EDITS)
        try:
            steps = read_steps(workspace, workspace / EDITS) if kept is not None else ()
        except InputError as error:
            place = f"{EDITS} in {project.name}/{workspace.name} of the work folder"
            raise InputError(
                f"The edits of this photo cannot be read, and were left as they are: {error} Repair or rename {place}."
            ) from error
        with self.lock:
            self.close()
            self.project = project
            self.glass = GlassClient(project.scene)
            self.live = LivePreview(
                loaded, project.folder / "preview.npz", project.scene, self.allowance
            )
            self.edits = EditList(steps)
            self._kept = kept

    def close(self) -> None:
        """Give the memory back; the edits stay in the work folder."""
        with self.lock:
            if self.live is not None:
                self.live.close()
            if self.glass is not None:
                self.glass.stop()
            if self.final is not None:
                self.final.remove()
            self.project = self.live = self.glass = self.final = None
            self.edits = EditList()
            self._past = []
            self._future = []
            self.selection = Selection()

    # Selecting

    @property
    def can_undo(self) -> tuple[bool, bool]:
        """Whether there is a change to take back, and one to do again."""
        return bool(self._past), bool(self._future)

    def pick(
        self, pick: dict[str, Any], method: str = "network", region: Array | None = None
    ) -> None:
        """A click, a box or a brush stroke, as `selection.read_pick` gives it. Raises InputError.

        region: [H, W] bool of the object at a click, where it is known already.
        """
        with self.lock:
            scene = self.scene
            mode = pick["mode"]
            before = self.selection
            if pick["tool"] == "click":
                x, y = self.pixel(*pick["at"])
                after = before.click(scene, x, y, mode, method, region)
            elif pick["tool"] == "box":
                after = before.box(scene, pick["at"], mode, method)
            else:
                after = before.brush(scene, pick["points"], pick["radius"], mode)
            if after.mask is None or mode not in (ADD, REMOVE) or not self._follows_selection():
                self.remember("select")
                self.edits = self.edits.chosen(None)
            else:  # the current edit grows or shrinks with its region, whatever that was given as
                self.put(
                    self.edits,
                    **{**dict.fromkeys(REGION), "mask": write_mask(self.workspace, after.mask)},
                )
            self.selection = after

    def _follows_selection(self) -> bool:
        """Whether the current edit is one of a region that the preview shows soon enough."""
        step = self.edits.current_step
        if step is None or step.operation.target is not Target.REGION:
            return False
        return step.operation.preview in (PreviewMode.SHADED, PreviewMode.TRACED)

    def deselect(self) -> None:
        with self.lock:
            self.remember("select")
            self.selection = Selection()
            self.edits = self.edits.chosen(None)

    # The list of edits

    def set(self, kind: str, **options: Any) -> None:
        """Set or clear (None) options of the current step; a new one over the selection where it is of another kind.

        Raises InputError, and changes nothing, for values that are not valid.
        """
        with self.lock:
            _ = self.scene
            # --- A new step over the selection, unless one of its kind is current ---
            mask = self.selection.mask
            edits = self.edits
            if self.current_kind != kind:
                if mask is None:
                    raise InputError("Click the object that you want to change first.")
                edits = edits.add(
                    Step(kind, {"mask": write_mask(self.workspace, mask)}, self.workspace)
                )
            self.put(edits, **options)

    def light(self, **options: Any) -> None:
        """Set or clear (None) options of the light (`EditList.light`); it is made when the first is set."""
        with self.lock:
            _ = self.scene
            place = self.edits.light
            new = Step(RELIGHT.name, {}, self.workspace)
            self.put(self.edits.add(new) if place is None else self.edits.chosen(place), **options)

    def put(self, edits: EditList, **options: Any) -> None:
        """Take over a list of edits, with options of the current step set or cleared (None). Raises InputError.

        A slider (or colour) that moves on is one change in the undo history. A light without options goes.
        """
        index = edits.current
        step = edits.current_step
        assert index is not None and step is not None
        new = with_options(step, **options)
        # A light without options would be a step that does nothing.
        empty = new.operation.target is Target.LIGHT and not {*new.options} - {"skip"}
        after = edits.without(index) if empty else edits.put(index, new)
        if after.steps != self.edits.steps:
            changed = [name for name in options if new.options.get(name) != step.options.get(name)]
            moving = all(
                _slides(state.options.get(name)) for state in (step, new) for name in changed
            )
            self.change(f"{', '.join(options)} of {index}", after, moving=moving)

    def act(self, action: str, index: int) -> None:
        """One of the buttons of the list: toggle, up, down, remove, choose."""
        with self.lock:
            if not 0 <= index < len(self.edits.steps):
                raise InputError("That edit is no longer there.")
            edits = self.edits
            # Lazily: only the pressed button's list is made.
            changed = {
                "toggle": lambda: edits.toggled(index),
                "up": lambda: edits.moved(index, -1),
                "down": lambda: edits.moved(index, 1),
                "remove": lambda: edits.without(index),
                "choose": lambda: edits.chosen(None if edits.current == index else index),
            }
            if action not in changed:
                raise InputError("That button is not known; reload the page.")
            after = changed[action]()
            # First everything that can fail, then the changes.
            region = self._region_of(after) if action == "choose" else None
            self.remember(action)
            self.edits = after
            if region is not None:
                self.selection = region
                self._take_up_object()
            self.save()

    def undo(self, *, again: bool = False) -> None:
        """Take back the last change, or do it again. Raises InputError where there is none."""
        with self.lock:
            # Undo and redo are the same move between two stacks.
            source, target = (self._future, self._past) if again else (self._past, self._future)
            if not source:
                raise InputError(
                    "There is nothing to do again." if again else "There is nothing to take back."
                )
            # Two pages may edit one photo: whoever comes second must not overwrite.
            self._check_unchanged()
            target.append(("", self.edits, self.selection))
            _, self.edits, self.selection = source.pop()
            if self._past:  # a slider that moves on now begins anew
                self._past[-1] = ("", *self._past[-1][1:])
            self.save()

    def read_edits(self, file: Path) -> None:
        """Put the steps of an uploaded edits.yaml, or of a zip of it and its files, in place of the edits.

        Raises InputError, and changes nothing then.
        """
        with self.lock:
            _ = self.scene
            if file.suffix.lower() == ".zip":
                steps = unpack(self.workspace, file, self.allowance)
            else:
                steps = located(
                    self.workspace, uploads.opened_upload(read_list, file, self.allowance)
                )
            self.change("load", EditList(steps))

    # Within

    def change(self, action: str, after: EditList, *, moving: bool = False) -> None:
        """Set another list of edits, with a way back. Raises InputError, and changes nothing, where it is not valid."""
        assert self.live is not None
        if len(after.steps) > SETTINGS.edits:
            raise InputError(
                f"That would be {len(after.steps)} edits; a photo takes up to {SETTINGS.edits}. Take some away first."
            )
        # Applied once before it counts: an edit that cannot be applied is refused.
        self.live.edited(after.active)
        self.remember(action, moving=moving)
        self.edits = after
        self.save()

    def _take_up_object(self) -> None:
        """The next object is like the current one, as the controls show it."""
        step = self.edits.current_step
        if (
            step is not None
            and step.operation.target is Target.PLACE
            and isinstance(step.options.get("mesh"), str)
        ):
            self.next_object = {
                k: step.options[k]
                for k in ("mesh", "scale", "turn", "material")
                if k in step.options
            }

    def remember(self, action: str, moving: bool = False) -> None:
        """Keep the state for undo; a slider (or colour) that moves on adds no further entry."""
        if action != "select":
            self._check_unchanged()
        self._future = []
        if not (moving and self._past and self._past[-1][0] == action):
            self._past = [*self._past, (action, self.edits, self.selection)][-SETTINGS.undo_steps :]

    def _region_of(self, edits: EditList) -> Selection:
        """The selection that the current step was made with."""
        step = edits.current_step
        if step is None or not {*REGION} & {*step.options}:
            return Selection()
        return Selection((region_of(self.scene, step),))

    def _check_unchanged(self) -> None:
        """Raises InputError where another page, or a person, has written the edits since this page did."""
        if self.project is not None and _content(self.workspace / EDITS) != self._kept:
            raise InputError(
                "These edits were changed in another place; reload the page to go on with those."
            )

    def save(self) -> None:
        """Write edits.yaml, and forget the glass that is no longer in it.

        Raises InputError where another page, or a person, has written it since.
        """
        if self.project is None:
            return
        self._check_unchanged()
        file = self.workspace / EDITS
        if self.glass is not None:
            self.glass.keep(self.edits.steps)
        if self.edits.steps:
            write_recipe(file, list(self.edits.steps))
        else:
            file.unlink(missing_ok=True)
        self._kept = _content(file)


def _slides(value: Any) -> bool:
    """Whether an option's value is one that sliders and colour pickers set."""
    if isinstance(value, list):
        return all(isinstance(item, str) and _slides(item) for item in value)
    return _SLIDES.fullmatch(str(value)) is not None


def _content(file: Path) -> bytes | None:
    try:
        return file.read_bytes()
    except FileNotFoundError:
        return None
