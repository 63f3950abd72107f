"""What one person does with one photo: scene, selection, list of edits and undo history, for all pages that show it."""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

from materialist.edits.core.operation import REGION, Target
from materialist.edits.light.operation import RELIGHT
from materialist.edits.recipe import Step, options_of, write_recipe
from materialist.errors import InputError, OutputError
from materialist.jobs.process import Worker
from materialist.jobs.queue import Job, JobQueue
from materialist.studio import SETTINGS, uploads
from materialist.studio.access.quota import Allowance
from materialist.studio.archives import read_list, unpack
from materialist.studio.edit_list import EditList, slides, with_options
from materialist.studio.finals import FinalPicture, kept_final, sweep_finals
from materialist.studio.history import History, read_history, write_history
from materialist.studio.live import views
from materialist.studio.live.glass import GlassClient
from materialist.studio.live.process import Live
from materialist.studio.selection import ADD, REMOVE, Selection
from materialist.studio.workspace import Project, content_of, located, read_steps, write_mask
from materialist.types import Scene

EDITS = "edits.yaml"
ENDING = ("take", "removal")
"""Kinds of jobs that end with the last page of a session; inversions and final pictures run on."""
_REVISIONS = count(1)
"""Of all sessions: a page that goes from one to another must not take an older state for a newer one."""


def next_revision() -> int:
    return next(_REVISIONS)


class Session:
    """The state that pages show. Its methods may be called from any thread."""

    def __init__(
        self,
        person: str,
        without_folders: Callable[[str], str] = str,
        local: bool = True,
        allowance: Allowance | None = None,
        device: str = "auto",
    ):
        self.person = person
        self.without_folders = without_folders
        self.local = local
        """`without_folders` is the studio's; `local`: the person has the command line of this machine, too."""
        self.allowance = allowance or Allowance()
        self._device = device
        self.lock = threading.RLock()
        self.project: Project | None = None
        self.expected: Project | None = None
        """The photo that is being opened here, or was."""
        self.live: Live | None = None
        self.glass: GlassClient | None = None
        self.selection = Selection()
        self.next_object: dict[str, str] = {}
        self.falls = 0
        """How many falls were begun here: each tumbles in its own way."""
        self.edits = EditList()
        self._past: list[tuple[str, EditList, Selection]] = []
        self._future: list[tuple[str, EditList, Selection]] = []
        self.running: list[Job] = []
        self.revision = next_revision()
        """Grows with every change."""
        self._history_changed = False
        self._kept: bytes | None = None
        """The list of edits as this session last read or wrote it."""
        self.final: FinalPicture | None = None

    @property
    def scene(self) -> Scene:
        """The open scene. Raises InputError where there is none."""
        return self.preview.scene

    @property
    def preview(self) -> Live:
        """Its live preview. Raises InputError where no photo is open."""
        live = self.live
        if live is None:
            raise InputError("Open a photo first.")
        return live

    def shows(self, project: Project) -> bool:
        """Whether it is the session of a photo."""
        return self.expected is not None and self.expected.folder == project.folder

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
        """Note a job that a page asked for, to stop it when the last page is closed."""
        self.running = [*(earlier for earlier in self.running if not earlier.over), job]

    def stop(self, jobs: JobQueue, *kinds: str) -> None:
        """Stop the jobs of some kinds, or all, that pages asked for here."""
        for job in self.running:
            if not kinds or job.kind in kinds:
                jobs.stop(job)

    @property
    def current_kind(self) -> str | None:
        step = self.edits.current_step
        return step.kind if step else None

    def changed(self) -> None:
        """Let every page that shows this session ask for its state."""
        self.revision = next_revision()

    def open(self, project: Project, worker: Worker | None = None) -> None:
        """Open a photo with its edits, history and last final picture as they were left. Raises InputError.

        worker: a process for its preview that is running already.
        """
        workspace = project.workspace(self.person)
        # --- Everything that can fail, before the page changes ---
        kept = content_of(workspace / EDITS)
        try:
            steps = read_steps(workspace, workspace / EDITS) if kept is not None else ()
        except InputError as error:
            place = f"{EDITS} in {project.name}/{workspace.name} of the work folder"
            raise InputError(
                f"The edits of this photo cannot be read, and were left as they are: {error} Repair or rename {place}."
            ) from error
        tables = project.folder / "preview.npz"
        live = Live(project.scene, tables, self.allowance, worker, self._device)
        with self.lock:
            self.close()
            self.project = self.expected = project
            self.glass = GlassClient(project.scene)
            self.live = live
            # --- As it was left ---
            history = read_history(workspace, live.scene.depth.shape)
            current = history.current
            self._past = history.past
            self._future = history.future
            self.selection = history.selection
            self.edits = EditList(steps, current if current in range(len(steps)) else None)
            self._kept = kept
            self._take_up_object()
            sweep_finals(workspace)
            self.final = kept_final(workspace)
            self.changed()

    def close(self) -> None:
        """Give the memory back; the edits stay in the work folder."""
        with self.lock:
            if self.live is not None:
                self.live.close()
            if self.glass is not None:
                self.glass.stop()
            self.project = self.expected = self.live = self.glass = self.final = None
            self.edits = EditList()
            self._past = []
            self._future = []
            self.selection = Selection()
            self.next_object = {}
            self.changed()

    # Selecting

    @property
    def can_undo(self) -> tuple[bool, bool]:
        """Whether there is a change to take back, and one to do again."""
        return bool(self._past), bool(self._future)

    def pick(
        self,
        tool: str,
        *,
        mode: str = "new",
        at: Sequence[float] = (),
        points: Sequence[Sequence[float]] = (),
        radius: float = 1.0,
    ) -> None:
        """A click or a box at two or four numbers, or a brush stroke through points. Raises InputError."""
        with self.lock:
            scene = self.scene
            choose = self.preview.select
            before = self.selection
            if tool == "click":
                x, y = self.pixel(*at)
                after = before.click(scene, x, y, mode, choose)
            elif tool == "box":
                after = before.box(scene, at, mode, choose)
            else:
                after = before.brush(scene, points, radius, mode, choose)
            self._select(after, follows=mode in (ADD, REMOVE))

    def reselect(self, change: Callable[[Selection], Selection]) -> None:
        """Put what `change` makes of the selection in its place; the current edit follows it."""
        with self.lock:
            self._select(change(self.selection), follows=True)

    def _select(self, after: Selection, follows: bool) -> None:
        """Change the selection; the current edit `follows` it, or is put aside."""
        if after.mask is None or not follows or not self.edits.follows_selection:
            self.remember("select")
            self.edits = self.edits.chosen(None)
        else:  # the current edit grows or shrinks with its region, whatever that was given as
            self.put(
                self.edits,
                **{**dict.fromkeys(REGION), "mask": write_mask(self.workspace, after.mask)},
            )
        self.selection = after
        # The edit was written beside the selection of before.
        self._history_changed = True
        self._note_history()
        if after.mask is not None and self.glass is not None:
            self.glass.get_ready()

    def deselect(self) -> None:
        with self.lock:
            self.remember("select")
            self.selection = Selection()
            self.edits = self.edits.chosen(None)
            self._note_history()

    # The list of edits

    def set(self, kind: str, **options: Any) -> None:
        """Set or clear (None) options of the current step; a new one over the selection where it is of another kind.

        Raises InputError, and changes nothing, for values that are not valid.
        """
        with self.lock:
            self.put(self.planned(kind), **options)

    def planned(self, kind: str) -> EditList:
        """The edits, whose current step is of a kind: a new one over the selection, if need be. Raises InputError."""
        _ = self.scene
        if self.current_kind == kind:
            return self.edits
        mask = self.selection.mask
        if mask is None:
            raise InputError("Click the object that you want to change first.")
        step = Step(kind, {"mask": write_mask(self.workspace, mask)}, self.workspace)
        return self.edits.add(step)

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
        options_of(new)  # of a step that is switched off, too, which `change` does not apply
        # A light without options would be a step that does nothing.
        empty = new.operation.target is Target.LIGHT and not {*new.options} - {"skip"}
        # --- One entry of the history while the same values slide on ---
        after = edits.without(index) if empty else edits.put(index, new)
        if after.steps != self.edits.steps:
            changed = [name for name in options if new.options.get(name) != step.options.get(name)]
            moving = all(
                slides(state.options.get(name)) for state in (step, new) for name in changed
            )
            self.change(f"{', '.join(options)} of {index}", after, moving=moving)

    def act(self, action: str, index: int) -> None:
        """One of the buttons of the list: toggle, up, down, remove, choose."""
        with self.lock:
            after = self.edits.acted(action, index)
            # First everything that can fail, then the changes.
            region = self._region_of(after) if action == "choose" else None
            with self._or_as_before():
                self.remember(action)
                self.edits = after
                if region is not None:
                    self.selection = region
                    self._take_up_object()
                self.save()

    def undone(self, *, again: bool = False) -> EditList:
        """The list of edits after `undo`; the present one where there is nothing to take back."""
        entries = self._future if again else self._past
        return entries[-1][1] if entries else self.edits

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
            with self._or_as_before():
                target.append(("", self.edits, self.selection))
                _, self.edits, self.selection = source.pop()
                if self._past:  # a slider that moves on now begins anew
                    self._past[-1] = ("", *self._past[-1][1:])
                self._history_changed = True
                self.save()

    def read_edits(self, file: Path) -> None:
        """Put the steps of an uploaded edits.yaml, or of a zip of it and its files, in place of the edits.

        Raises InputError, and changes nothing then.
        """
        # Opened before the lock: a large file takes seconds, and other requests go on meanwhile.
        workspace = self.workspace
        if file.suffix.lower() == ".zip":
            steps = unpack(workspace, file, self.allowance)
        else:
            steps = located(workspace, uploads.opened_upload(read_list, file, self.allowance))
        with self.lock:
            self.change("load", EditList(steps))

    def change(self, action: str, after: EditList, *, moving: bool = False) -> None:
        """Set another list of edits, with a way back. Raises InputError, and changes nothing, where it is not valid."""
        if len(after.steps) > SETTINGS.edits:
            raise InputError(
                f"That would be {len(after.steps)} edits; a photo takes up to {SETTINGS.edits}. Take some away first."
            )
        # Applied once before it counts: an edit that cannot be applied is refused.
        self.preview.call(views.check, steps=after.active)
        with self._or_as_before():
            self.remember(action, moving=moving)
            self.edits = after
            self.save()

    @contextmanager
    def _or_as_before(self) -> Iterator[None]:
        """Within it a change that cannot be written, as on a full disk, is no change."""
        state = (self.edits, self.selection, [*self._past], [*self._future], self._kept)
        try:
            yield
        except OutputError:
            self.edits, self.selection, self._past, self._future, self._kept = state
            raise

    def _take_up_object(self) -> None:
        """The next object is like the current one, as the controls show it."""
        step = self.edits.current_step
        if (
            step is not None
            and step.operation.target is Target.PLACE
            and isinstance(step.options.get("mesh"), str)
        ):
            names = ("mesh", "scale", "turn", "material")
            self.next_object = {k: step.options[k] for k in names if k in step.options}

    def remember(self, action: str, moving: bool = False) -> None:
        """Keep the state for undo; a slider (or colour) that moves on adds no further entry."""
        if action != "select":
            self._check_unchanged()
        self._history_changed = self._history_changed or bool(self._future)
        self._future = []
        if not (moving and self._past and self._past[-1][0] == action):
            self._past = [*self._past, (action, self.edits, self.selection)][-SETTINGS.undo_steps :]
            self._history_changed = True

    def _region_of(self, edits: EditList) -> Selection:
        """The selection that the current step was made with."""
        step = edits.current_step
        if step is None or not {*REGION} & {*step.options}:
            return Selection()
        return Selection((self.preview.call(views.region, step=step),))

    def _check_unchanged(self) -> None:
        """Take over what another studio, or a person, has written meanwhile. Raises InputError where they did."""
        if self.take_over():
            raise InputError(
                "These edits were changed in another place meanwhile; here they are. Do it again."
            )

    def take_over(self) -> bool:
        """Read the list of edits again where its file is not as this session left it; undo goes back to its own.

        Returns whether it was another. Raises InputError where it cannot be read.
        """
        with self.lock:
            if self.project is None:
                return False
            file = self.workspace / EDITS
            content = content_of(file)
            if content == self._kept:
                return False
            steps = () if content is None else read_steps(self.workspace, file)
            self._past = [*self._past, ("", self.edits, self.selection)][-SETTINGS.undo_steps :]
            self._future = []
            self.edits = EditList(steps)
            self._kept = content
            self._history_changed = True
            self._note_history()
            return True

    def _note_history(self) -> None:
        """Keep what undo goes back to, and tell the pages of the change. Raises OutputError."""
        self.changed()
        if self._history_changed and self.project is not None:
            kept = History(self._past, self._future, self.edits.current, self.selection)
            write_history(self.workspace, kept)
            self._history_changed = False

    def save(self) -> None:
        """Write edits.yaml and the history, and forget the glass that is no longer in the list.

        Raises InputError where another studio, or a person, has written it since; OutputError on a full disk.
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
        self._kept = content_of(file)
        self._note_history()
