"""Shared by the tabs of the page: components, events that change the session, and the values of the controls."""

import secrets
import time
import traceback
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field
from functools import partial
from html import escape
from pathlib import Path
from typing import Any

import gradio as gr

from materialist.edits.core.notes import noise_notes
from materialist.errors import MaterialistError
from materialist.jobs.queue import QUEUED, STOPPED, Job
from materialist.jobs.worker import DONE, FAILED
from materialist.studio import SETTINGS, tasks
from materialist.studio.controls import CONTROLS, control_values, set_option
from materialist.studio.session import FinalPicture, Session
from materialist.studio.stage import commands, failure_message, stage, steps, words
from materialist.studio.studio import LOCAL_PERSON, PERSON_HEADER, Studio

LIVE: dict[str, Any] = {
    "queue": False,
    "trigger_mode": "always_last",
    "show_progress": "hidden",
    "api_visibility": "private",
}
"""Events that skip the queue; while one request is under way only the newest value waits."""
LONG: dict[str, Any] = {
    "show_progress": "hidden",
    "concurrency_limit": None,
    "api_visibility": "private",
}
"""Events that take long, and send updates meanwhile."""


Updates = dict[str, Any]
"""Name of a component -> its new value, or an update of Gradio's."""
PICTURE = ("stage", "steps", "commands")
"""What a change of edits changes on the page."""


@dataclass
class PageContext:
    """The studio, and the components of one page by name."""

    studio: Studio
    parts: dict[str, Any] = field(default_factory=dict)

    def live(
        self,
        event: Any,
        change: Callable[..., Any],
        *inputs: str,
        everything: bool = False,
        coarse: bool = False,
        more: tuple[str, ...] = (),
        data: bool = False,
        **settings: Any,
    ) -> Any:
        """Let an event call change(session, *values of inputs) at once, and show the (coarse) picture, or everything.

        `change` may return further updates, of the components `more`. With `data` the event's own come before the
        values. `settings` are arguments of Gradio's event beside LIVE.
        """

        def run(request: gr.Request, event_data: gr.EventData, *values: Any) -> Any:
            try:
                session = self.session(request)
                # Counted: one page must not keep all threads busy.
                with session.allowance.request():
                    further = change(session, *([event_data._data] if data else []), *values) or {}
                    shown = (
                        self.everything(session) if everything else self.picture(session, coarse)
                    )
                return self._outputs(shown | further)
            except Exception as error:
                raise self.message(error) from error

        # Components that this event may update.
        names = [*PICTURE, *(CONTROLS if everything else ()), *more]
        input_parts = [self.parts[name] for name in inputs]
        outputs = [self.parts[name] for name in names]
        return event(run, input_parts, outputs, **LIVE | settings)

    def long(
        self,
        event: Any,
        change: Callable[..., Iterator[Updates]],
        *inputs: str,
        data: bool = False,
        **settings: Any,
    ) -> Any:
        """Let an event call change(session, *values of inputs), which yields updates of any components."""

        def run(request: gr.Request, event_data: gr.EventData, *values: Any) -> Iterator[Any]:
            updates = None
            try:
                for updates in change(
                    self.session(request), *([event_data._data] if data else []), *values
                ):
                    yield self._outputs(updates)
                if updates is None:  # Gradio would send None to every component
                    yield gr.skip()
            except Exception as error:
                yield self._outputs({"progress": "", "stop": gr.update(visible=False)})
                raise self.message(error) from error

        return event(
            run, [self.parts[name] for name in inputs], [*self.parts.values()], **LONG | settings
        )

    def bind(self, *names: str, coarse: bool = False) -> None:
        """Let controls set the options that they stand for."""
        for name in names:
            self.live(self.parts[name].input, partial(set_option, name), name, coarse=coarse)

    def upload(self, name: str, change: Callable[[Session, Path], Any], **settings: Any) -> None:
        """Let an uploaded file call change(session, file); a file that is refused is taken off the page."""
        part = self.parts[name]
        sent = self.live(
            part.upload, lambda session, file: change(session, Path(file)), name, **settings
        )
        sent.failure(lambda: None, None, part, **LIVE)

    def session(self, request: Any) -> Session:
        """The session of a request; the gate has put its person into a header."""
        person = LOCAL_PERSON if self.studio.single_user else request.headers.get(PERSON_HEADER, "")
        return self.studio.session(request.session_hash, person)

    def message(self, error: Exception) -> Exception:
        """An exception as Gradio shows it; what was not foreseen goes to the terminal."""
        known = isinstance(error, MaterialistError)
        text = f"Something went wrong inside ({type(error).__name__}); the terminal of the studio has the details."
        if known:  # its message may hold a name that a stranger chose
            text = escape(self.studio.without_folders(str(error)), quote=False)
        else:
            traceback.print_exception(error)
        title = "That did not work" if known else "Our mistake"
        return gr.Error(text, duration=SETTINGS.message_seconds, title=title, print_exception=False)

    def _outputs(self, updates: Updates) -> Any:
        # Gradio takes an empty dict for one value, not for "no component changes".
        return {self.parts[name]: value for name, value in updates.items()} or gr.skip()

    def picture(self, session: Session, coarse: bool = False) -> Updates:
        """The picture with a new list of edits, and the commands that do the same."""
        return {
            "stage": stage(session, coarse=coarse),
            "steps": steps(session),
            "commands": commands(session),
        }

    def everything(self, session: Session) -> Updates:
        """The picture, and sliders as the current step, or the selected object, has them."""
        return self.picture(session) | (control_values(session) if session.live is not None else {})

    def following(self, session: Session, job: Job) -> Iterator[Updates]:
        """Updates of the progress and its button whenever a job has moved on; the last one says how it ended.

        Between two looks the thread is free for others. It ends early where the page is closed, or follows the job
        anew; `follows` tells.
        """
        # Of several followers, as after a reload, the last one counts.
        follower = session.followers[id(job)] = object()
        last = None
        while not job.over and self.follows(session, job, follower):
            state = self.state(job)
            yield {"progress": state, "stop": gr.update(visible=True)} if state != last else {}
            last = state
            # A job reports through its queue; looking at it costs nothing.
            time.sleep(SETTINGS.poll_seconds)
        if self.follows(session, job, follower):
            yield {"progress": self.state(job), "stop": gr.update(visible=False)}

    def follows(self, session: Session, job: Job, follower: object) -> bool:
        """Whether a page is open, and this follower of a job the last that it has."""
        return not session.left and session.followers.get(id(job)) is follower

    def state(self, job: Job) -> str:
        """The state of a job as HTML."""
        if job.state == QUEUED:
            return message_box(f"Waiting: {self.studio.jobs.ahead(job)} before yours.", 0.0)
        if job.state == STOPPED:
            return message_box("Stopped; nothing was changed.")
        if job.state == FAILED:
            return message_box(self.studio.without_folders(failure_message(job)), bad=True)
        if job.over:
            pictures = job.kind in ("final", "take")
            notes = noise_notes() if pictures else []
            return message_box(" ".join([f"Done in {job.seconds:.0f} s.", *notes]))
        part = min(1.0, job.done / job.total) if job.total else 0.0
        return message_box(f"{words(job.stage)} … {job.seconds:.0f} s", part)

    def work(
        self, session: Session, task: tasks.Task, output: Path, **arguments: Any
    ) -> Generator[Updates, Any, bool]:
        """Let a task make OUTPUT of the open scene, with the updates of `following`; returns whether it did."""
        scene = str(session.opened.scene)
        job = self.studio.submit(
            session, task, output.parent, scene=scene, output=str(output), **arguments
        )
        yield from self.following(session, job)
        return job.state == DONE

    def traced(self, session: Session) -> Generator[Updates, Any, FinalPicture | None]:
        """Path-trace the edits of a page, if that is not done yet, with the updates of `following`.

        Returns the picture, which the session keeps; None where the job failed or was stopped.
        """
        steps = session.edits.active
        # A picture of just these edits is there already.
        known = session.final
        if known is not None and known.of(steps):
            return known
        picture = FinalPicture(steps, self.studio.work.cache / f"final-{secrets.token_hex(16)}")
        try:
            if (yield from self.work(session, tasks.final, picture.path, steps=steps)):
                known = session.final
                session.final = picture
                if known is not None:
                    known.remove()
                return picture
            return None
        finally:
            if session.final is not picture:  # it failed, was stopped, or the page was closed
                picture.remove()


def message_box(text: str, part: float | None = None, bad: bool = False) -> str:
    bar = "" if part is None else f'<div class="bar"><i style="width:{100 * part:.0f}%"></i></div>'
    kind, role = ("progress bad", "alert") if bad else ("progress", "status")
    return f'<div class="{kind}" role="{role}">{escape(text)}{bar}</div>'
