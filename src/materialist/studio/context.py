"""What the tabs of the page share: the hub, and the components that more than one of them changes."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from materialist.studio import things
from materialist.studio.hub import Hub
from materialist.studio.session import Session
from materialist.studio.stack import summary

SLIDERS = ("hue", "saturation", "value", "roughness", "metallic")


@dataclass
class Context:
    """The hub and the shared components of one page."""

    hub: Hub
    parts: dict[str, Any] = field(default_factory=dict)
    """Name -> Gradio component."""

    def __getitem__(self, name: str) -> Any:
        return self.parts[name]

    def session(self, request: Any) -> Session:
        """The session of the page that sent a request."""
        return self.hub.session(request.session_hash)

    def picture(self, session: Session) -> dict[Any, Any]:
        """Updates after a change of edits."""
        return {self["stage"]: session.stage(), **self.listed(session)}

    def listed(self, session: Session) -> dict[Any, Any]:
        """The list of edits, and the commands that do the same."""
        from materialist.studio.tab_take import commands

        return {self["steps"]: steps(session), self["commands"]: commands(session)}

    def everything(self, session: Session) -> dict[Any, Any]:
        """Updates after a change of the selection, of the step in hand, or of the scene."""
        return {**self.picture(session), **self.controls(session)}

    def controls(self, session: Session) -> dict[Any, Any]:
        """Sliders as the step in hand, or the selected object, has them; as they are where a step says nonsense."""
        if session.live is None:
            return {}
        values: dict[str, Any] = {}
        for read in (material_values, light_values, glass_values, thing_values):
            with suppress(TypeError, ValueError):
                values |= read(session)
        return {self[name]: value for name, value in values.items()}

    @property
    def picture_parts(self) -> list[Any]:
        return [self["stage"], self["steps"], self["commands"]]

    @property
    def all_parts(self) -> list[Any]:
        return [*self.picture_parts, *(self[name] for name in (*MATERIAL, *LIGHT, *GLASS, *THING))]


MATERIAL = (*SLIDERS, "colour", "texture_scale")
LIGHT = ("rotate", "ambient", "sun_on", "azimuth", "elevation", "sun_power")
GLASS = ("glass_ior", "glass_transmission", "glass_roughness", "glass_tint", "glass_hollow")
THING = ("thing", "scale", "turn", "made_of", "thing_colour", "height")
_DEFAULTS = {"rotate": 0.0, "ambient": 1.0, "azimuth": 45.0, "elevation": 40.0, "sun_power": 1.0}


def steps(session: Session) -> list[dict[str, Any]]:
    """The stack as the list shows it."""
    stack = session.stack
    return [
        {"text": summary(step), "on": not step.skipped, "current": k == stack.current}
        for k, step in enumerate(stack.steps)
    ]


def material_values(session: Session) -> dict[str, Any]:
    """Values of the sliders: the step's own, else those of the fit under the selection."""
    stack, mask = session.stack, session.selection.mask
    step = stack.steps[stack.current] if stack.current is not None else None
    options = step.options if step is not None and step.kind == "edit" else {}
    values: dict[str, Any] = {"hue": 0.0, "saturation": 0.0, "value": 0.0, "roughness": 0.5, "metallic": 0.0}
    if mask is not None:
        for name in ("roughness", "metallic"):
            values[name] = round(float(getattr(session.scene.materials, name)[mask].mean()), 2)
    for name in values:
        text = str(options.get(name, ""))
        if text and (name not in ("roughness", "metallic") or text[0] not in "+-"):
            values[name] = float(text)
    colour = options.get("albedo")
    values["colour"] = colour if isinstance(colour, str) and colour.startswith("#") else "#808080"
    values["texture_scale"] = float(options.get("texture_scale", 1.0))
    return values


def light_values(session: Session) -> dict[str, Any]:
    """Values of the light's controls."""
    place = session.stack.light
    options = session.stack.steps[place].options if place is not None else {}
    values: dict[str, Any] = {name: float(options.get(name, default)) for name, default in _DEFAULTS.items()}
    sun = options.get("sun")
    values["sun_on"] = sun is not None
    if isinstance(sun, list | tuple):
        values["azimuth"], values["elevation"] = (float(v) for v in sun)
    return values


def glass_values(session: Session) -> dict[str, Any]:
    """Values of the controls of glass, where there is glass in hand; else they stay."""
    from materialist.studio.tab_glass import tint_colour

    stack = session.stack
    if session.in_hand != "glass" or stack.current is None:
        return {}
    options = stack.steps[stack.current].options
    numbers = {"ior": 1.5, "transmission": 1.0, "roughness": 0.0}
    values: dict[str, Any] = {f"glass_{name}": float(options.get(name, plain)) for name, plain in numbers.items()}
    values["glass_tint"] = tint_colour(options.get("tint", "1,1,1"))
    hollow = str(options.get("hollow", "")).lower()
    values["glass_hollow"] = hollow if hollow == "open" else "true" if hollow in ("true", "yes", "on", "1") else ""
    return values


def thing_values(session: Session) -> dict[str, Any]:
    """Values of the controls of objects, where there is one in hand; else they stay."""
    from materialist.studio.tab_glass import tint_colour
    from materialist.studio.tab_object import LIBRARY, MATERIALS, file_of

    step = things.in_hand(session)
    if step is None:
        return {}
    options = step.options
    values: dict[str, Any] = {"thing": next((n for n in LIBRARY if file_of(n) == options.get("mesh")), None)}
    values |= {name: float(options.get(name, plain)) for name, plain in (("scale", 1.0), ("turn", 0.0))}
    if "height" in options:
        values["height"] = float(options["height"])
    made_of = options.get("material", "as-is")
    if made_of in [value for _, value in MATERIALS]:
        return {**values, "made_of": made_of}
    return {**values, "made_of": "colour", "thing_colour": tint_colour(made_of)}
