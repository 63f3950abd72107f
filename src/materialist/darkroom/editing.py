"""Requests that select and change: each returns the page's new state."""

from functools import partial
from typing import Any

from materialist.darkroom import requests
from materialist.darkroom.desk import Desk
from materialist.darkroom.removing import take_away, when_filled
from materialist.darkroom.state import outline, settable, state
from materialist.edits.core.operation import Target
from materialist.edits.light import presets
from materialist.edits.registry import OPERATIONS
from materialist.errors import InputError
from materialist.option_kinds import declarations
from materialist.studio import objects, reopening, uploads
from materialist.studio.lights import change_lamp, light_file, number_text, place_lamp
from materialist.studio.live import views
from materialist.studio.session import Session

State = dict[str, Any]
CLEARED = {"texture", "envmap", "gain", "mesh", "lamps"}
"""Options that a request may clear, and sets by other means."""
_NUMBERS = {"click": 2, "box": 4, "brush": 0}
"""Tool -> how many numbers say where it was used."""


def pick(desk: Desk, body: requests.Pick) -> State:
    """A click, a box or a brush stroke."""
    if len(body.at) != _NUMBERS[body.tool] or min(body.at, default=0) < 0:
        raise InputError("The click could not be read; reload the page.")
    if body.tool == "click" and body.mode == "new":
        # What was edited already opens its edit, with the selection that it was made with.
        index = edit_at(desk.session, *body.at)
        if index is not None:
            desk.session.act("choose", index)
            return state(desk)
    desk.session.pick(**body.model_dump())
    return state(desk)


def point(desk: Desk, body: requests.Pointed) -> State:
    """The outline of what a click would take, or of the edit that it would open."""
    session = desk.session
    index = edit_at(session, *body.at)
    if index is not None:
        step = session.edits.steps[index]
        placed = step.operation.target is Target.PLACE
        if placed:
            return {"region": ""}
        return {"region": outline(session.preview.call(views.region, step=step))}
    return {"region": outline(desk.pointed(*body.at))}


def edit_at(session: Session, x: float, y: float) -> int | None:
    """The place in the list of the edit that a click at a place of the photo means, if any."""
    column, row = session.pixel(x, y)
    edits = session.edits
    if not edits.active:
        return None
    arguments = {"listed": edits.steps, "current": edits.current, "column": column, "row": row}
    return session.preview.call(reopening.edit_at, **arguments)


def resize(desk: Desk, body: requests.Resized) -> State:
    """The selection with the next larger, or smaller, object at the last click."""
    session = desk.session
    session.reselect(lambda selection: selection.resized(body.larger, session.preview.select))
    return state(desk)


def keep_material(desk: Desk, body: requests.Nothing) -> State:
    """Of what the last click selected only what has its material."""
    session = desk.session
    narrowed = partial(session.preview.call, views.of_material)
    session.reselect(lambda selection: selection.of_material(narrowed))
    return state(desk)


def deselect(desk: Desk, body: requests.Nothing) -> State:
    desk.session.deselect()
    return state(desk)


def set_options(desk: Desk, body: requests.Options) -> State:
    """Set or clear options of the current edit, of the light, or of the object."""
    options = {name: _text(body.kind, name, value) for name, value in body.options.items()}
    session = desk.session
    if body.kind == "relight":
        session.light(**options)
    elif body.kind == "insert":
        for name, value in options.items():
            objects.set_object_option(session, name, value)
    elif body.kind == "remove":
        take_away(desk, options)
    else:
        session.set(body.kind, **options)
    return state(desk, coarse=body.coarse, quiet=body.quiet)


def _text(kind: str, name: str, value: Any) -> Any:
    """An option as the list of edits has it; None clears it. Raises InputError for one that no request may set."""
    if name not in settable(kind) | (CLEARED if value is None else set()):
        raise InputError(f"'{name}' of {kind} cannot be set in this way.")
    # The default is left out of the list: it says nothing.
    if value is None or value == declarations(OPERATIONS[kind].options)[name][1]:
        return None
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return [number_text(number) for number in value]
    return value if isinstance(value, str) else number_text(value)


def use_file(desk: Desk, body: requests.File) -> State:
    """Use an upload as a texture, an environment, or an object."""
    session = desk.session
    file = desk.studio.files.path(session.person, body.file)

    def use(name: str) -> None:
        if body.option == "texture":
            session.set("edit", albedo=None, texture=name)
        elif body.option == "envmap":
            session.light(envmap=name, gain="auto")
        else:
            objects.set_object_option(session, "mesh", name)

    uploads.used(session.workspace, file, body.option, session.allowance, use)
    return state(desk)


# Light


def choose_light(desk: Desk, body: requests.Chosen) -> State:
    """A computed environment, or the photo's own light (None)."""
    session = desk.session
    if body.name is None:
        session.light(envmap=None, gain=None)
    elif body.name in presets.LIGHTS:
        session.light(envmap=light_file(session, body.name), gain="auto")
    else:
        raise InputError(f"There is no light '{body.name}'; choose one of the list.")
    return state(desk)


def add_lamp(desk: Desk, body: requests.NewLamp) -> State:
    place_lamp(desk.session, *body.at, body.kelvin, body.power, body.before)
    return state(desk)


def set_lamp(desk: Desk, body: requests.MovedLamp) -> State:
    """One lamp moved, changed or taken away: the others stay as they are, whoever moves them meanwhile."""
    session = desk.session
    if body.lamp is not None:
        session.pixel(body.lamp[0], body.lamp[1])
    change_lamp(session, body.index, body.lamp)
    return state(desk, quiet=body.quiet)


# Objects


def choose_object(desk: Desk, body: requests.Chosen) -> State:
    """An object of the library; the next place that is clicked gets it."""
    if body.name not in objects.LIBRARY:
        raise InputError(f"There is no object '{body.name}'; choose one of the list.")
    file = objects.library_file(desk.session, body.name)
    objects.set_object_option(desk.session, "mesh", file)
    return state(desk)


def put_object(desk: Desk, body: requests.Put) -> State:
    """Stand the current object, or a new one, at a place; a drag sends many."""
    objects.place(desk.session, *body.at)
    return state(desk, quiet=body.quiet)


def let_fall(desk: Desk, body: requests.Fall) -> State:
    notes = objects.let_fall(desk.session, body.height)
    return {**state(desk), "notes": [desk.session.without_folders(note) for note in notes]}


# The list


def act(desk: Desk, body: requests.Act) -> State:
    session = desk.session
    if body.action == "choose":
        session.act(body.action, body.index)
    else:
        after = session.edits.acted(body.action, body.index)
        when_filled(desk, after, lambda: session.act(body.action, body.index))
    return state(desk)


def undo(desk: Desk, body: requests.Undo) -> State:
    session = desk.session
    after = session.undone(again=body.again)
    when_filled(desk, after, lambda: session.undo(again=body.again))
    return state(desk)
