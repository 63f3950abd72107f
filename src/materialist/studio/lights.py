"""Lights that a page adds: lamps before a surface, and computed environments as files."""

import math
from typing import Any

from materialist.edits.light import presets
from materialist.errors import InputError
from materialist.io.image import write_image
from materialist.studio import SETTINGS
from materialist.studio.session import Session


def number_text(value: float) -> str:
    """A number as the list of edits has it. Raises InputError for what a slider cannot give."""
    if not math.isfinite(float(value)):
        raise InputError(f"The value {value} is no finite number; move the slider again.")
    return f"{float(value):.4g}"


def place_lamp(
    session: Session,
    x: float,
    y: float,
    kelvin: float = 2700,
    power: float = 1,
    before: float = SETTINGS.lamp_share,
) -> None:
    """Hang a lamp before the surface at a pixel, `before` its share of the way. Raises InputError without a surface."""
    column, row = session.pixel(x, y)
    depth = float(session.scene.depth[row, column])
    if depth <= 0:
        raise InputError("There is no surface to hang the lamp before; click on an object.")
    # The lamp hangs between the camera and the clicked surface.
    new = [str(column), str(row), *(number_text(v) for v in (depth * before, kelvin, power))]
    with session.lock:
        session.light(lamps=[*_lamps(session), new])


def change_lamp(session: Session, index: int, lamp: list[float] | None) -> None:
    """Another [x, y, depth, kelvin, power] for one lamp; None takes it away. Raises InputError where it is gone."""
    with session.lock:
        lamps = _lamps(session)
        if index >= len(lamps):
            raise InputError("That lamp is no longer there.")
        lamps[index : index + 1] = [] if lamp is None else [[number_text(v) for v in lamp]]
        session.light(lamps=lamps or None)


def _lamps(session: Session) -> list[Any]:
    place = session.edits.light
    return [] if place is None else [*session.edits.steps[place].options.get("lamps", [])]


def light_file(session: Session, name: str) -> str:
    """A computed light as a file in the workspace, so that the recipe can be replayed anywhere."""
    file = session.workspace / f"light-{name.lower()}.exr"
    if not file.is_file():
        write_image(file, presets.preset_light(name), force=True)
    return file.name
