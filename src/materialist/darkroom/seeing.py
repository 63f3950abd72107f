"""What a page looks at: the mesh of the edited scene, its maps, the photo's own pixels, and the colour of a surface."""

import re
from typing import Any

from materialist.darkroom import requests
from materialist.darkroom.desk import Desk
from materialist.edits.core.operation import Target
from materialist.errors import InputError
from materialist.studio.live import views

FULL_SIDE = 8192
"""Longest side of the photo's own pixels, which is the largest picture that graphics cards are sure to take."""


def mesh_bytes(desk: Desk) -> bytes:
    """The mesh of the edited scene, glass aside, as `views.mesh` writes it."""
    session = desk.session
    return bytes(session.preview.call(views.mesh, steps=session.edits.active))


def skin_jpeg(desk: Desk) -> bytes:
    """The edited picture without the objects in it, which the mesh has as such."""
    session = desk.session
    steps = tuple(s for s in session.edits.active if s.operation.target is not Target.PLACE)
    panes = {} if session.glass is None else session.glass.panes(steps)
    return bytes(session.preview.call(views.picture, steps=steps, panes=panes))


def colour_at(desk: Desk, body: requests.Pointed) -> dict[str, Any]:
    """The colour of the surface at a pixel, without the light on it, as #rrggbb."""
    session = desk.session
    column, row = session.pixel(*body.at)
    steps = session.edits.active
    return {"colour": session.preview.call(views.colour, steps=steps, column=column, row=row)}


def map_jpeg(desk: Desk, name: str) -> bytes:
    """A map of what the page shows, by its place in `reporting.named_maps`. Raises InputError for another name."""
    session = desk.session
    if not re.fullmatch("[0-9]{1,3}", name):
        raise InputError(f"There is no map {name!r}.")
    return bytes(session.preview.call(views.map_jpeg, steps=session.edits.active, place=int(name)))


def report_of(desk: Desk) -> dict[str, Any]:
    """The names of the maps, the quality in words, and the warnings of the edits."""
    session = desk.session
    facts: dict[str, Any] = session.preview.call(views.report, steps=session.edits.active)
    return {**facts, "report": session.without_folders(facts["report"])}
