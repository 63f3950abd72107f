"""Controls of the page, each for one option of an operation: how a value goes to the list of edits, and back."""

import re
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import gradio as gr
import numpy as np

from materialist.color import srgb_levels
from materialist.edits.core.operation import Target
from materialist.edits.drop.options import Drop
from materialist.edits.glass.options import Glass
from materialist.edits.insert.options import Insertion
from materialist.edits.light.options import Relight
from materialist.edits.material.options import MaterialEdit
from materialist.errors import InputError
from materialist.option_kinds import ON, OperationOptions, declarations, parse_colour
from materialist.studio import objects
from materialist.studio.lights import number_text
from materialist.studio.session import Session

SUN = (45.0, 40.0)
"""Where a new sun stands: degrees right of ahead, and above the horizon."""
WHITE, GREY = "#ffffff", "#808080"


def hex_colour(value: Any) -> str:
    """A colour picker's text (#rrggbb or rgba(r, g, b, a)) as #rrggbb; grey for anything else."""
    value = str(value)
    if re.fullmatch(r"#[0-9a-fA-F]{6}", value):
        return value.lower()
    # Gradio's picker gives rgba(r, g, b, a) after some moves.
    numbers = [float(v) for v in re.findall(r"[\d.]+", value)[:3]]
    if len(numbers) == 3 and all(0 <= v <= 255 for v in numbers):
        return "#" + "".join(f"{round(v):02x}" for v in numbers)
    return GREY


def picked_colour(colour: Any) -> str:
    """A colour of the list of edits, linear numbers or #rrggbb, as #rrggbb. Raises InputError for other words."""
    return "#" + srgb_levels(np.array(parse_colour(colour), np.float32)).tobytes().hex()


def _inside(hollow: Any) -> str:
    text = str(hollow).lower()
    return text if text == "open" else "true" if text in ON else ""


def _material(material: str) -> str:
    return material if material in [value for _, value in objects.MATERIALS] else "colour"


@dataclass(frozen=True)
class Control:
    """A component and its option."""

    operation: type[OperationOptions]
    option: str
    text: Callable[[Any], str | None] = number_text
    """Value of the component -> the option in the list of edits; None clears it."""
    value: Callable[[Any], Any] = float
    """The option -> value of the component; one that is not valid leaves the component as it is."""

    @property
    def default(self) -> Any:
        """The default of the option."""
        return declarations(self.operation).get(self.option, (None, None))[1]


CONTROLS = {
    **{
        name: Control(MaterialEdit, name)
        for name in ("hue", "saturation", "value", "roughness", "metallic")
    },
    **{name: Control(MaterialEdit, name) for name in ("texture_scale", "grow", "feather")},
    "colour": Control(MaterialEdit, "albedo", hex_colour, lambda v: picked_colour(v or GREY)),
    **{name: Control(Relight, name) for name in ("rotate", "ambient", "sun_power")},
    "sun_on": Control(Relight, "sun", value=lambda sun: sun is not None),
    "azimuth": Control(Relight, "sun", value=lambda sun: float((sun or SUN)[0])),
    "elevation": Control(Relight, "sun", value=lambda sun: float((sun or SUN)[1])),
    **{f"glass_{name}": Control(Glass, name) for name in ("ior", "transmission", "roughness")},
    "glass_tint": Control(
        Glass, "tint", lambda v: None if hex_colour(v) == WHITE else hex_colour(v), picked_colour
    ),
    "glass_hollow": Control(Glass, "hollow", lambda v: v or None, _inside),
    **{name: Control(Insertion, name) for name in ("scale", "turn")},
    "thing": Control(Insertion, "mesh", value=objects.library_name),
    "made_of": Control(Insertion, "material", value=_material),
    "thing_colour": Control(Insertion, "material", value=picked_colour),
    "height": Control(Drop, "height"),
}


def slider(name: str, label: str, step: float, **narrower: Any) -> Any:
    """A slider for a control, by the range and default of its option; `narrower` are arguments of Gradio's instead."""
    control = CONTROLS[name]
    declared = declarations(control.operation)[control.option][0]
    arguments = {
        "minimum": declared.low,
        "maximum": declared.high,
        "value": control.default,
        "elem_id": name,
        **narrower,
    }
    return gr.Slider(step=step, label=label, buttons=[], **arguments)


def file_field(name: str, label: str, suffixes: Iterable[str]) -> Any:
    """A field for one file, its name its id on the page."""
    return gr.File(
        label=label, type="filepath", height=150, file_types=sorted(suffixes), elem_id=name
    )


def set_option(name: str, session: Session, value: Any) -> None:
    """Set the option of a control, or clear it by the default."""
    control = CONTROLS[name]
    # The default is left out of the list: it says nothing.
    text = None if value == control.default else control.text(value)
    if control.operation is Relight:
        session.light(**{control.option: text})
    elif control.operation is Insertion:
        objects.set_object_option(session, control.option, text)
    else:
        session.set(control.operation.operation, **{control.option: text})


def control_values(session: Session) -> dict[str, Any]:
    """Values of the controls as the current step, or the light, has them.

    Without a current edit its controls show what was fitted under the selection, and those of glass its defaults; those
    of objects then stay as they are, for the next.
    """
    step = session.edits.current_step
    light = session.edits.light
    # --- The options that each group of controls shows ---
    options_by_kind: dict[type[OperationOptions], dict[str, Any]] = {
        MaterialEdit: {},
        Glass: {},
        Relight: session.edits.steps[light].options if light is not None else {},
    }
    if step is not None:
        options_by_kind[step.operation.options] = step.options
        if step.operation.target is Target.PLACE:
            options_by_kind[Insertion] = step.options
    values: dict[str, Any] = {}
    # A value that is not valid, as from a list made by hand, leaves its control as it is.
    for name, control in CONTROLS.items():
        if control.operation in options_by_kind:
            with suppress(TypeError, ValueError, InputError):
                values[name] = control.value(
                    options_by_kind[control.operation].get(control.option, control.default)
                )
    # Sliders of what an edit leaves as it was show what was fitted under the selection.
    for name, neutral in (("roughness", 0.5), ("metallic", 0.0)):
        if (
            str(options_by_kind[MaterialEdit].get(name, "+"))[0] in "+-"
        ):  # not set, or relative to the fit
            mask = session.selection.mask
            fitted = getattr(session.scene.materials, name)
            values[name] = neutral if mask is None else round(float(fitted[mask].mean()), 2)
    return values
