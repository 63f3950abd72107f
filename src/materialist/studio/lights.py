"""Lights that a page adds: lamps before a surface, and computed environments as files."""

import math

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
    place = session.edits.light
    known = session.edits.steps[place].options.get("lamps", []) if place is not None else []
    session.light(lamps=[*known, new])


def light_file(session: Session, name: str) -> str:
    """A computed light as a file in the workspace, so that the recipe can be replayed anywhere."""
    file = session.workspace / f"light-{name.lower()}.exr"
    if not file.is_file():
        write_image(file, presets.preset_light(name), force=True)
    return file.name
