"""Shared by the tabs of the page: components, events that change the session, and the values of the controls."""

import functools
import inspect
import time
import traceback
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from functools import partial
from html import escape
from pathlib import Path
from shlex import quote
from typing import Any

import gradio as gr

from materialist.errors import MaterialistError
from materialist.jobs.queue import QUEUED, STOPPED, Job
from materialist.jobs.worker import DONE, FAILED
from materialist.studio import SETTINGS, tasks
from materialist.studio.controls import CONTROLS, control_values, set_option
from materialist.studio.edit_list import summary
from materialist.studio.session import EDITS, FinalPicture, Session
from materialist.studio.stage import stage
from materialist.studio.studio import PERSON, Studio

LIVE: dict[str, Any] = {
    "queue": False, "trigger_mode": "always_last", "show_progress": "hidden", "api_visibility": "private",
}  # fmt: skip
"""Events that skip the queue; while one request is under way only the newest value waits."""
LONG: dict[str, Any] = {"show_progress": "hidden", "concurrency_limit": None, "api_visibility": "private"}
"""Events that take long, and send updates meanwhile."""
_WORDS = {
    "start": "Starting", "read": "Reading the photo", "predict": "Guessing colours, shapes and depth",
    "geometry": "Building the surface", "trace": "Tracing light paths", "light": "Finding the light",
    "albedo": "Finding the materials", "materials": "Finding the materials", "rerender": "Rendering the result",
    "save": "Saving", "load": "Loading",
    "render": "Path tracing", "frames": "Path tracing the frames", "export": "Writing the file",
}  # fmt: skip
PREDICTORS = (("Automatic", "auto"), ("MatNet", "matnet"), ("Marigold", "marigold"))


@dataclass
class PageContext:
    """The studio, and the components of one page that more than one tab changes."""

    studio: Studio
    parts: dict[str, Any] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Any:
        return self.parts[name]

    def session(self, request: Any) -> Session:
        return self.studio.session(request.session_hash, self.studio.person(dict(request.cookies).get(PERSON)))

    def handler(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function (or generator) with its exceptions turned into messages on the page; the server goes on."""
        if inspect.isgeneratorfunction(function):

            @functools.wraps(function)
            def steps(*args: Any, **kwargs: Any) -> Iterator[Any]:
                try:
                    yield from (outputs or gr.skip() for outputs in function(*args, **kwargs))
                except Exception as error:
                    yield {self["progress"]: "", self["stop"]: gr.update(visible=False)}
                    raise self.message(error) from error

            return steps

        @functools.wraps(function)
        def once(*args: Any, **kwargs: Any) -> Any:
            try:
                outputs = function(*args, **kwargs)
            except Exception as error:
                raise self.message(error) from error
            # Gradio takes an empty dict for one value, not for "no component changes".
            return gr.skip() if isinstance(outputs, dict) and not outputs else outputs

        return once

    def message(self, error: Exception) -> Exception:
        """An exception as Gradio shows it; what was not foreseen goes to the terminal."""
        known = isinstance(error, MaterialistError)
        text = f"Something went wrong inside ({type(error).__name__}); the terminal of the studio has the details."
        if known:  # its message may hold a name that a stranger chose
            text = escape(self.studio.shown(str(error)), quote=False)
        elif not isinstance(error, gr.Error):
            traceback.print_exception(error)
        title = "That did not work" if known else "Our mistake"
        shown = gr.Error(text, duration=SETTINGS.message_seconds, title=title, print_exception=False)
        return error if isinstance(error, gr.Error) else shown

    def picture(self, session: Session, coarse: bool = False) -> dict[Any, Any]:
        """Updates after a change of edits."""
        return {self["stage"]: stage(session, coarse=coarse), **self.listed(session)}

    def listed(self, session: Session) -> dict[Any, Any]:
        """The list of edits, and the commands that do the same."""
        return {self["steps"]: steps(session), self["commands"]: commands(session)}

    def everything(self, session: Session) -> dict[Any, Any]:
        """Updates after a change of the selection, of the current step, or of the scene."""
        return {**self.picture(session), **self.controls(session)}

    def controls(self, session: Session) -> dict[Any, Any]:
        """Sliders as the current step, or the selected object, has them; as they are where a step is not valid."""
        if session.live is None:
            return {}
        return {self[name]: value for name, value in control_values(session).items()}

    @property
    def picture_parts(self) -> list[Any]:
        return [self["stage"], self["steps"], self["commands"]]

    @property
    def all_parts(self) -> list[Any]:
        return [*self.picture_parts, *(self[name] for name in CONTROLS)]

    @property
    def job_parts(self) -> list[Any]:
        """Outputs of every handler that is a generator."""
        return [self["progress"], self["stop"]]

    def on(
        self, event: Any, change: Callable[..., Any], inputs: Any = None, *, everything: bool = False,
        coarse: bool = False, more: tuple[Any, ...] = (), **how: Any,
    ) -> Any:  # fmt: skip
        """Let an event call change(session, *values of inputs), and show the (coarse) picture, or everything.

        `change` returns further updates, of the components `more`, or False where nothing has changed. `how` are
        arguments of Gradio's event beside LIVE.
        """

        @self.handler
        def run(request: gr.Request, *values: Any) -> dict[Any, Any]:
            session = self.session(request)
            updates = change(session, *values)
            if updates is False:
                return {}
            return {**(self.everything(session) if everything else self.picture(session, coarse)), **(updates or {})}

        outputs = [*(self.all_parts if everything else self.picture_parts), *more]
        return event(run, inputs, outputs, **{**LIVE, **how})

    def bind(self, *names: str, coarse: bool = False) -> None:
        """Let controls set the options that they stand for."""
        for name in names:
            self.on(self[name].input, partial(set_option, name), self[name], coarse=coarse)

    def on_upload(self, name: str, change: Callable[[Session, Path], Any], **how: Any) -> None:
        """Let an uploaded file call change(session, file); a file that is refused is taken off the page."""
        sent = self.on(self[name].upload, lambda session, file: change(session, Path(file)), self[name], **how)
        sent.failure(lambda: None, None, self[name], **LIVE)

    def following(self, job: Job) -> Iterator[dict[Any, Any]]:
        """Updates of the progress and its button whenever a job has moved on; the last one says how it ended."""
        last = None
        while not job.over:
            if (state := self.state(job)) != last:
                yield {self["progress"]: (last := state), self["stop"]: gr.update(visible=True)}
            time.sleep(SETTINGS.poll_seconds)
        yield {self["progress"]: self.state(job), self["stop"]: gr.update(visible=False)}

    def state(self, job: Job) -> str:
        """The state of a job as HTML."""
        if job.state == QUEUED:
            return box(f"Waiting: {self.studio.jobs.ahead(job)} before yours.", 0.0)
        if job.state == STOPPED:
            return box("Stopped; nothing was changed.")
        if job.state == FAILED:
            return box(self.studio.shown(failure(job)), bad=True)
        if job.over:
            return box(f"Done in {job.seconds:.0f} s.")
        part = min(1.0, job.done / job.total) if job.total else 0.0
        return box(f"{words(job.stage)} … {job.seconds:.0f} s", part)

    def traced(self, session: Session, spp: int) -> Generator[Any, Any, FinalPicture | None]:
        """Path-trace the edits of a page, if that is not done yet, with the updates of `following`.

        Returns the picture, which the session keeps; None where the job failed or was stopped.
        """
        steps, known, project = session.edits.active, session.final, session.project
        if known is not None and known.of(steps) and known.spp >= spp:
            return known
        assert project is not None
        target = self.studio.final_file(session)
        given = {"scene": str(project.scene), "steps": steps, "output": str(target), "spp": spp}
        job = self.studio.submit(session, tasks.final, target.parent, **given)
        yield from self.following(job)
        if job.state != DONE:
            return None
        session.final = FinalPicture(steps, target, spp)
        return session.final


def failure(job: Job) -> str:
    """The reason of a failure; it names the photo by its title."""
    photo = job.arguments.get("photo")
    return job.message.replace(str(photo), job.arguments["title"]) if photo else job.message


def words(stage: str) -> str:
    """A stage in words; names such as `light 2` or `materials: albedo` go by their first word."""
    return _WORDS.get(stage) or _WORDS.get(stage.replace(":", " ").partition(" ")[0], stage.capitalize())


def box(text: str, part: float | None = None, bad: bool = False) -> str:
    bar = "" if part is None else f'<div class="bar"><i style="width:{100 * part:.0f}%"></i></div>'
    kind, role = ("progress bad", "alert") if bad else ("progress", "status")
    return f'<div class="{kind}" role="{role}">{escape(text)}{bar}</div>'


def steps(session: Session) -> list[dict[str, Any]]:
    return [
        {"text": summary(step), "on": not step.skipped, "current": k == session.edits.current}
        for k, step in enumerate(session.edits.steps)
    ]


def commands(session: Session) -> str:
    """The commands that give the same result; nothing where no photo is open."""
    project = session.project
    if project is None:
        return ""
    place = str if session.local else session.shown
    lines, scene = [f"cd {quote(place(str(project.folder)))}"], quote(place(str(project.scene)))
    if session.edits.active:
        lines.append(f"materialist apply {scene} {session.workspace.name}/{EDITS} -o out.png --save edited.scene")
        scene = "edited.scene"
    else:
        lines.append(f"materialist render {scene} -o out.png")
    lines.append(f"materialist export {scene} --to glb -o out.glb")
    return "\n".join(lines)
