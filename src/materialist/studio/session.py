"""One page and what is open on it: a scene, a selection, a stack of edits, and the way back."""

from __future__ import annotations

import hashlib
import os
import secrets
import threading
from pathlib import Path
from typing import Any

from materialist.edits.recipe import REGION, Step, region_of, write_recipe
from materialist.errors import InputError
from materialist.studio import things, views
from materialist.studio.desk import keep, new_name, read_steps, write_mask
from materialist.studio.glass import Tracer
from materialist.studio.jobs import Job, Jobs
from materialist.studio.live import Live
from materialist.studio.pack import unpack
from materialist.studio.selection import ADD, REMOVE, Selection
from materialist.studio.showing import Final, stage
from materialist.studio.stack import Stack, told
from materialist.studio.work import Project
from materialist.types import Scene

EDITS = "edits.yaml"
ENDING = ("final", "take", "fall")
"""Kinds of jobs that end with the page that asked for them."""
_UNDO = 60
"""How many steps back there are."""
DRAGGED = (
    "hue", "saturation", "value", "albedo", "roughness", "metallic", "texture_scale", "ior", "transmission", "tint",
)  # fmt: skip
"""Options of materials and glass that sliders and colour pickers move: a whole drag is one change."""
LIGHT_DRAGGED = ("rotate", "ambient", "sun", "sun_power")
"""The same of light; `sun` is where it stands."""


class Session:
    """What one page has open. Its methods may be called from any thread."""

    def __init__(self, person: str):
        self.person = person
        self.lock = threading.RLock()
        self.project: Project | None = None
        self.live: Live | None = None
        self.glass: Tracer | None = None
        self.selection = Selection()
        self.thing: dict[str, str] = {}
        """Options of the next object."""
        self.failed_fall: tuple[Step | None, int] = (None, 0)
        """The thing that fell last in vain, and how often."""
        self.lamp = (2700.0, 1.0, 0.75)
        """Kelvin, power, and the share of the way to the surface, of the next lamp."""
        self.stack = Stack()
        self._past: list[tuple[str, Stack, Selection]] = []
        self.mask_urls = views.mask_urls(None)
        self.running: dict[str, Job] = {}
        """The last job of each kind (invert, final, take, fall) that this page asked for."""
        self._ending: list[Job] = []
        self._mark = f"{os.getpid()}-{secrets.token_hex(4)}"
        self._kept: bytes | None = None
        """The list of edits as this page last read or wrote it."""
        self.final: Final | None = None

    @property
    def scene(self) -> Scene:
        """The open scene. Raises InputError where there is none."""
        if self.live is None:
            raise InputError("Open a photo first.")
        return self.live.scene

    @property
    def desk(self) -> Path:
        """Where this person's edits of the open photo lie."""
        if self.project is None:
            raise InputError("Open a photo first.")
        return self.project.desk(self.person)

    @property
    def final_file(self) -> Path:
        """Where this page's path-traced pictures lie, without the ending: two pages may show one photo."""
        return self.desk / f"final-{self._mark}"

    def asked(self, kind: str, job: Job) -> None:
        """Note a job that this page asked for, to stop it, and to take it along where it ends with the page."""
        self.running[kind] = job
        if kind in ENDING:
            self._ending = [*(one for one in self._ending if not one.over), job]

    def end(self, jobs: Jobs) -> None:
        """Stop the jobs that nobody can see any more when the page is gone; an inversion runs on."""
        for job in self._ending:
            jobs.stop(job)

    def stop(self, jobs: Jobs, kind: str) -> None:
        """Stop the last job of a kind that this page asked for."""
        if kind in self.running:
            jobs.stop(self.running[kind])

    @property
    def in_hand(self) -> str | None:
        """The kind of the step that sliders move, if there is one."""
        k = self.stack.current
        return self.stack.steps[k].kind if k is not None else None

    def open(self, project: Project) -> None:
        """Open a project where it was left."""
        from materialist.io.package import load_scene

        loaded = load_scene(project.scene)
        desk = project.desk(self.person)
        kept = _content(desk / EDITS)
        try:
            steps = read_steps(desk, desk / EDITS) if kept is not None else ()
        except InputError as error:
            raise InputError(f"The edits of this photo cannot be read, and were left as they are: {error} Repair or "
                             f"rename {desk / EDITS}.") from error  # fmt: skip
        with self.lock:
            self.close()
            self.project, self.live, self.glass = project, Live(loaded), Tracer(project.scene)
            self.stack, self._kept = Stack(steps), kept

    def close(self) -> None:
        """Give the memory back; what was done stays in the work folder."""
        with self.lock:
            if self.live is not None:
                self.live.close()
            if self.glass is not None:
                self.glass.rest()
            if self.project is not None:
                for suffix in (".png", ".exr", ".jpg"):
                    self.final_file.with_suffix(suffix).unlink(missing_ok=True)
            self.project = self.live = self.glass = self.final = None
            self.stack, self._past = Stack(), []
            self._select(Selection())

    # Selecting

    def pick(self, pick: dict[str, Any], method: str = "network") -> None:
        """A click, a box or a brush stroke, as `selection.read_pick` gives it. Raises InputError."""
        with self.lock:
            scene, mode, before = self.scene, pick["mode"], self.selection
            if pick["tool"] == "click":
                x, y = pick["at"]
                after = before.click(scene, x, y, mode, method)
            elif pick["tool"] == "box":
                after = before.box(scene, pick["at"], mode, method)
            else:
                after = before.brush(scene, pick["points"], pick["radius"], mode)
            step, stack = self._current("edit") or self._current("glass"), self.stack
            if after.mask is None or mode not in (ADD, REMOVE) or step is None or stack.current is None:
                self.remember("select")
                self.stack = stack.chosen(None)
            else:  # the edit in hand grows or shrinks with its region, whatever that was given as
                region = {**dict.fromkeys(REGION), "mask": write_mask(self.desk, after.mask)}
                self.change("select", stack.put(stack.current, told(step, **region)))
            self._select(after)

    def deselect(self) -> None:
        with self.lock:
            self.remember("select")
            self._select(Selection())
            self.stack = self.stack.chosen(None)

    # The stack of edits

    def material(self, name: str, value: str | None, kind: str = "edit") -> None:
        """Set or clear (None) an option of the edit (or glass) in hand; see `materials`."""
        self.materials({name: value}, kind)

    def materials(self, options: dict[str, str | None], kind: str = "edit") -> None:
        """Set or clear (None) options of the edit (or glass) in hand at once; a new one begins where there is none."""
        with self.lock:
            scene = self.scene
            mask = self.selection.mask
            step = self._current(kind)
            if step is None:
                if mask is None:
                    raise InputError("Click the object that you want to change first.")
                if not (mask & (scene.depth > 0)).any():
                    raise InputError("The selection covers only sky; select a surface.")
                self.remember("begin")
                self.stack = self.stack.add(Step(kind, {"mask": write_mask(self.desk, mask)}, self.desk))
                step = self.stack.steps[-1]
            elif told(step, **options) == step:
                return
            else:
                others = [value for name, value in options.items() if name not in DRAGGED]
                moving = len(others) < len(options) and not any(others)
                self.remember(f"{', '.join(options)} of {self.stack.current}", moving=moving)
            self._put(step, **options)

    def region_step(self, kind: str, **options: str | None) -> None:
        """Lay a step such as `glass` or `remove` over the selection, or change the one in hand; checked at once."""
        with self.lock:
            step, mask = self._current(kind), self.selection.mask
            if step is None and mask is None:
                _ = self.scene
                raise InputError("Click the object that you want to change first.")
            stack = self.stack
            if step is None:
                step = Step(kind, {"mask": write_mask(self.desk, mask)}, self.desk)  # type: ignore[arg-type]
                stack = stack.add(step)
            elif told(step, **options) == step:
                return
            assert stack.current is not None
            self.change(kind, stack.put(stack.current, told(step, **options)))

    def light(self, **options: Any) -> None:
        """Set or clear (None) options of the light (`Stack.light`); it is made when the first is set."""
        with self.lock:
            _ = self.scene
            place = self.stack.light
            known = self.stack.steps[place].options if place is not None else {}
            changed = [name for name in options if options[name] != known.get(name)]
            if not changed:
                return
            switched = "sun" in changed and None in (known.get("sun"), options["sun"])
            after = self.stack.add(Step("relight", {}, self.desk)) if place is None else self.stack.chosen(place)
            what = f"{', '.join(changed)} of light {after.current}"
            self.remember(what, moving=set(changed) <= {*LIGHT_DRAGGED} and not switched)
            self.stack = after
            self._put(after.steps[after.current or 0], **options)
            if not {*self.stack.steps[self.stack.current or 0].options} - {"skip"}:
                self.stack = self.stack.without(self.stack.current or 0)
                self.save()

    def place(self, x: float, y: float) -> None:
        """See `things.place`."""
        things.place(self, x, y)

    def thing_option(self, name: str, value: str | None) -> None:
        """See `things.option`."""
        things.option(self, name, value)

    def act(self, what: str, index: int) -> None:
        """One of the buttons of the list: toggle, up, down, remove, choose."""
        with self.lock:
            if not 0 <= index < len(self.stack.steps):
                raise InputError("That edit is no longer there.")
            stack = self.stack
            changed = {
                "toggle": lambda: stack.toggled(index), "up": lambda: stack.moved(index, -1),
                "down": lambda: stack.moved(index, 1), "remove": lambda: stack.without(index),
                "choose": lambda: stack.chosen(None if stack.current == index else index),
            }  # fmt: skip
            if what not in changed:
                raise InputError("That button is not known; reload the page.")
            after = changed[what]()
            region = self._region_of(after) if what == "choose" else None
            self.remember(what)
            self.stack = after
            if region is not None:
                self._select(region)
                things.take_up(self)
            self.save()

    def undo(self) -> bool:
        """Take back the last change; False where there is none."""
        with self.lock:
            if not self._past:
                return False
            self._mine()
            _, self.stack, selection = self._past.pop()
            if self._past:  # a slider that moves on now begins anew
                self._past[-1] = ("", *self._past[-1][1:])
            self._select(selection)
            self.save()
            return True

    def read_edits(self, file: Path) -> None:
        """Put the steps of an uploaded edits.yaml, or of a zip of it and its files, in place of the stack.

        Raises InputError, and changes nothing then.
        """
        with self.lock:
            _ = self.scene
            read = unpack if file.suffix.lower() == ".zip" else read_steps
            self.change("load", Stack(read(self.desk, file)))

    # Showing

    def stage(self, *, edits: bool = True) -> dict[str, Any]:
        """See `showing.stage`."""
        return stage(self, edits=edits)

    def write_edits(self) -> str:
        """The recipe as a file for other commands; an empty text where no step is on."""
        with self.lock:
            self.save()
            return str(self.desk / EDITS) if self.stack.active else ""

    def edits_now(self) -> str:
        """A copy of the recipe for a job, which runs later: what is changed meanwhile is not in it. "" as above."""
        with self.lock:
            if not self.write_edits():
                return ""
            content = (self.desk / EDITS).read_bytes()
            copy = self.desk / f"job-{os.getpid()}-{hashlib.sha256(content).hexdigest()[:12]}.yaml"
            copy.write_bytes(content)
            return str(copy)

    def keep(self, file: Path, stem: str, suffix: str) -> str:
        """See `desk.keep`."""
        return keep(self.desk, file, stem, suffix)

    def new_name(self, stem: str, suffix: str) -> Path:
        """See `desk.new_name`."""
        return new_name(self.desk, stem, suffix)

    # Within

    def change(self, what: str, after: Stack, *, moving: bool = False) -> None:
        """Another list of edits, and a way back. Where it cannot be applied nothing changes, and the error goes on."""
        assert self.live is not None
        self.live.edited(after.active)
        self.remember(what, moving=moving)
        self.stack = after
        self.save()

    def _current(self, kind: str) -> Step | None:
        k = self.stack.current
        return self.stack.steps[k] if k is not None and self.stack.steps[k].kind == kind else None

    def _put(self, step: Step, **options: Any) -> None:
        assert self.stack.current is not None
        self.stack = self.stack.put(self.stack.current, told(step, **options))
        self.save()

    def remember(self, what: str, *, moving: bool = False) -> None:
        """Keep the state for undo; a slider (or colour) that is moving on adds no further entry."""
        if what != "select":
            self._mine()
        if not (moving and self._past and self._past[-1][0] == what):
            self._past = [*self._past[-_UNDO:], (what, self.stack, self.selection)]

    def _select(self, selection: Selection) -> None:
        self.selection = selection
        self.mask_urls = views.mask_urls(selection.mask)

    def _region_of(self, stack: Stack) -> Selection:
        """The selection that the step in hand was made with."""
        step = stack.steps[stack.current] if stack.current is not None else None
        if step is None or not {*REGION} & {*step.options}:
            return Selection()
        try:
            return Selection((region_of(self.scene, step),))
        except InputError as error:
            raise InputError(str(error).replace(f"{step.folder}/", "")) from error

    def _mine(self) -> None:
        """Raises InputError where somebody else has written the edits since: another page, or a person."""
        if self.project is not None and _content(self.desk / EDITS) != self._kept:
            raise InputError("These edits were changed in another place; reload the page to go on with those.")

    def save(self) -> None:
        """Write edits.yaml, and let go of the glass that is no longer in it.

        Raises InputError where somebody else has written it since: another page, or a person.
        """
        if self.project is None:
            return
        self._mine()
        file = self.desk / EDITS
        if self.glass is not None:
            self.glass.keep(self.stack.steps)
        if self.stack.steps:
            write_recipe(file, list(self.stack.steps))
        else:
            file.unlink(missing_ok=True)
        self._kept = _content(file)


def _content(file: Path) -> bytes | None:
    """The bytes of a file; None where there is none."""
    try:
        return file.read_bytes()
    except FileNotFoundError:
        return None
