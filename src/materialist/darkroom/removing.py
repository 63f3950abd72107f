"""What a removal hid is filled by a job, which takes seconds and can be stopped; the list changes when it is done."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from materialist.darkroom.desk import Desk, Followed
from materialist.edits.recipe import Step, options_of
from materialist.edits.remove.operation import REMOVE
from materialist.jobs.worker import DONE
from materialist.studio import tasks
from materialist.studio.edit_list import EditList, with_options
from materialist.studio.live import views
from materialist.studio.live.process import Live
from materialist.studio.session import Session


def take_away(desk: Desk, options: dict[str, Any]) -> None:
    """Begin to take the selection away, or to do that in another way; the list has the edit when that is done.

    Raises InputError where nothing is selected, and for values that are not valid.
    """
    session = desk.session
    # --- The edit as it will be, and the active ones before it ---
    with session.lock:
        planned = session.planned(REMOVE.name)
        index = planned.current or 0
        before = planned.steps[index]
        step = with_options(before, **options)
        options_of(step)
        if planned is session.edits and step == before:
            return
        earlier = [one for one in planned.steps[:index] if not one.skipped]

    def then(_: Followed, live: Live) -> None:
        # Applied once before the lock: other requests go on meanwhile.
        live.call(views.check, steps=_with(session, before, step).active)
        with session.lock:
            session.change(REMOVE.name, _with(session, before, step))

    _fill(desk, (*earlier, replace(step, options={**step.options, "skip": "false"})), then)


def when_filled(desk: Desk, after: EditList, change: Callable[[], None]) -> None:
    """Make a change that leads to a list of edits: at once, or when a job has filled what its removals hide.

    A removal hides something else when one before it is switched off, or the photo was opened by an older list.
    """
    session = desk.session
    steps = after.active
    removals = [k for k, step in enumerate(steps, 1) if step.kind == REMOVE.name]
    if not removals or not session.preview.call(views.unfilled, steps=steps):
        return change()
    before = session.edits

    def then(entry: Followed, _: Live) -> None:
        with session.lock:
            if session.edits == before:
                change()
            else:
                entry.notes.append("The list of edits has changed meanwhile; do it again.")

    _fill(desk, steps[: removals[-1]], then)


def _fill(desk: Desk, steps: tuple[Step, ...], then: Callable[[Followed, Live], None]) -> None:
    """Begin to fill what the last of the steps hides; `then` follows where the photo is still open."""
    session = desk.session
    project = session.opened
    # Only the newest counts.
    session.stop(desk.studio.jobs, tasks.removal.__name__)
    job = desk.studio.submit(
        session,
        tasks.removal,
        session.workspace,
        scene=str(project.scene),
        steps=steps,
        fillings=str(session.workspace),
    )

    def done(entry: Followed) -> None:
        if entry.job.state == DONE and session.live is not None and session.shows(project):
            then(entry, session.live)

    desk.follow(job, done)


def _with(session: Session, before: Step, step: Step) -> EditList:
    """The edits, as they are by now, with a step in place of the one before, or at their end."""
    steps = session.edits.steps
    if before in steps:
        return session.edits.put(steps.index(before), step)
    return session.edits.add(step)
