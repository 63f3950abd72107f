"""Shared by the tabs of the page: components, events that change the session, and the values of the controls."""

from __future__ import annotations

import functools
import inspect
import re
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from shlex import quote
from typing import Any

import gradio as gr
import numpy as np

from materialist.errors import MaterialistError
from materialist.jobs.queue import Job
from materialist.option_kinds import ON, OperationOptions, declarations, parse_colour
from materialist.options import Glass, Insertion, MaterialEdit, Relight
from materialist.studio import SETTINGS, objects
from materialist.studio.edit_list import summary
from materialist.studio.progress import follow
from materialist.studio.session import EDITS, Session
from materialist.studio.stage import stage
from materialist.studio.studio import Studio

LIVE: dict[str, Any] = {
    "queue": False, "trigger_mode": "always_last", "show_progress": "hidden", "api_visibility": "private",
}  # fmt: skip
"""Events that skip the queue; while one request is under way only the newest value waits."""
LONG: dict[str, Any] = {"show_progress": "hidden", "concurrency_limit": None, "api_visibility": "private"}
"""Events that take long, and send updates meanwhile."""
NUMBERS: dict[str, tuple[type[OperationOptions], str]] = {
    **{name: (MaterialEdit, name) for name in ("hue", "saturation", "value", "roughness", "metallic", "texture_scale")},
    **{name: (Relight, name) for name in ("rotate", "ambient", "sun_power")},
    **{f"glass_{name}": (Glass, name) for name in ("ior", "transmission", "roughness")},
    **{name: (Insertion, name) for name in ("scale", "turn")},
}
"""Slider -> the operation and the option that it sets."""
CONTROLS = (
    *NUMBERS, "colour", "sun_on", "azimuth", "elevation", "glass_tint", "glass_hollow", "thing", "made_of",
    "thing_colour", "height",
)  # fmt: skip
"""Components that show the current step."""
SUN = (45.0, 40.0)
"""Where a new sun stands: degrees right of ahead, and above the horizon."""
PREDICTORS = (("Automatic", "auto"), ("MatNet", "matnet"), ("Marigold", "marigold"))


def handler(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function (or generator) with its exceptions turned into messages on the page; the server goes on."""
    if inspect.isgeneratorfunction(function):

        @functools.wraps(function)
        def steps(*args: Any, **kwargs: Any) -> Iterator[Any]:
            try:
                yield from (outputs or gr.skip() for outputs in function(*args, **kwargs))
            except Exception as error:
                raise _message(error) from error

        return steps

    @functools.wraps(function)
    def once(*args: Any, **kwargs: Any) -> Any:
        try:
            outputs = function(*args, **kwargs)
        except Exception as error:
            raise _message(error) from error
        # Gradio takes an empty dict for one value, not for "no component changes".
        return gr.skip() if isinstance(outputs, dict) and not outputs else outputs

    return once


def _message(error: Exception) -> Exception:
    if isinstance(error, gr.Error):
        return error
    if isinstance(error, MaterialistError):  # its message may hold a name that a stranger chose
        text = escape(str(error), quote=False)
        return gr.Error(text, duration=SETTINGS.message_seconds, title="That did not work", print_exception=False)
    traceback.print_exception(error)
    text = f"Something went wrong inside ({type(error).__name__}); the terminal of the studio has the details."
    return gr.Error(text, duration=SETTINGS.message_seconds, title="Our mistake", print_exception=False)


@dataclass
class PageContext:
    """The studio, and the components of one page that more than one tab changes."""

    studio: Studio
    parts: dict[str, Any] = field(default_factory=dict)
    """Name -> Gradio component."""

    def __getitem__(self, name: str) -> Any:
        return self.parts[name]

    def session(self, request: Any) -> Session:
        """The session of the page that sent a request."""
        return self.studio.session(request.session_hash)

    def picture(self, session: Session) -> dict[Any, Any]:
        """Updates after a change of edits."""
        return {self["stage"]: stage(session), **self.listed(session)}

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
        """Components of `picture`."""
        return [self["stage"], self["steps"], self["commands"]]

    @property
    def all_parts(self) -> list[Any]:
        """Components of `everything`."""
        return [*self.picture_parts, *(self[name] for name in CONTROLS)]

    def on(
        self, event: Any, change: Callable[..., Any], inputs: Any = None, *, everything: bool = False,
        more: tuple[Any, ...] = (), **how: Any,
    ) -> Any:  # fmt: skip
        """Let an event call change(session, *values of inputs), and show the picture, or everything.

        `change` returns further updates, of the components `more`, or False where nothing has changed. `how` are
        arguments of Gradio's event beside LIVE.
        """

        @handler
        def run(request: gr.Request, *values: Any) -> dict[Any, Any]:
            session = self.session(request)
            updates = change(session, *values)
            if updates is False:
                return {}
            return {**(self.everything(session) if everything else self.picture(session)), **(updates or {})}

        outputs = [*(self.all_parts if everything else self.picture_parts), *more]
        return event(run, inputs, outputs, **{**LIVE, **how})

    def on_upload(self, name: str, change: Callable[[Session, Path], Any], **how: Any) -> None:
        """Let an uploaded file call change(session, file); a file that is refused is taken off the page."""
        sent = self.on(self[name].upload, lambda session, file: change(session, Path(file)), self[name], **how)
        sent.failure(lambda: None, None, self[name], **LIVE)

    def following(self, job: Job, words: str, stop: str) -> Iterator[dict[Any, Any]]:
        """Updates of the component `words` and of the button `stop` until a job is over."""
        for html in follow(self.studio.jobs, job):
            yield {self[words]: html, self[stop]: gr.update(visible=not job.over)}

    def stops(self, button: str, *kinds: str) -> None:
        """Let a button stop the jobs of some kinds that its page asked for."""

        @handler
        def stop(request: gr.Request) -> None:
            self.session(request).stop(self.studio.jobs, *kinds)

        self[button].click(stop, None, None, queue=False, show_progress="hidden", api_visibility="private")


def slider(kind: type[OperationOptions], name: str, label: str, step: float, **narrower: Any) -> Any:
    """A slider for an option, by its range and default; `narrower` are arguments of Gradio's slider instead."""
    declared, default = declarations(kind)[name]
    given = {"minimum": declared.low, "maximum": declared.high, "value": default, "elem_id": name, **narrower}
    return gr.Slider(step=step, label=label, buttons=[], **given)


def default(kind: type[OperationOptions], name: str) -> Any:
    """The default of an option."""
    return declarations(kind)[name][1]


def steps(session: Session) -> list[dict[str, Any]]:
    """The list of edits as the page shows it."""
    return [
        {"text": summary(step), "on": not step.skipped, "current": k == session.edits.current}
        for k, step in enumerate(session.edits.steps)
    ]


def control_values(session: Session) -> dict[str, Any]:
    """Values of the controls as the current step, or the light, has them.

    Without a current edit its controls show what was fitted under the selection; those of glass and of objects then
    stay as they are, for the next.
    """
    step, light = session.edits.current_step, session.edits.light
    kind, options = (step.kind, step.options) if step is not None else ("", {})
    given: dict[type[OperationOptions], dict[str, Any]] = {MaterialEdit: options if kind == "edit" else {}}
    given[Relight] = session.edits.steps[light].options if light is not None else {}
    given |= {Glass: options} if kind == "glass" else {Insertion: options} if kind in objects.KINDS else {}
    values: dict[str, Any] = {}
    for name, (operation, option) in NUMBERS.items():
        if operation in given:
            with suppress(TypeError, ValueError):
                values[name] = float(given[operation].get(option, default(operation, option)))
    for name, usual in (("roughness", 0.5), ("metallic", 0.0)):
        if str(given[MaterialEdit].get(name, "+"))[0] in "+-":  # not set, or relative to the fit
            mask, fitted = session.selection.mask, getattr(session.scene.materials, name)
            values[name] = usual if mask is None else round(float(fitted[mask].mean()), 2)
    colour = str(given[MaterialEdit].get("albedo", ""))
    values["colour"] = colour if colour.startswith("#") else "#808080"
    sun = given[Relight].get("sun")
    values["sun_on"] = sun is not None
    with suppress(TypeError, ValueError):
        values["azimuth"], values["elevation"] = (float(v) for v in sun or SUN)
    with suppress(TypeError, ValueError):
        if Glass in given:
            hollow = str(options.get("hollow", "")).lower()
            values["glass_hollow"] = hollow if hollow == "open" else "true" if hollow in ON else ""
            values["glass_tint"] = tint_colour(options.get("tint", "1,1,1"))
        if Insertion in given:
            known = (name for name in objects.LIBRARY if objects.file_of(name) == options.get("mesh"))
            made_of = options.get("material", "as-is")
            coloured = made_of not in [value for _, value in objects.MATERIALS]
            values |= {"thing": next(known, None), "made_of": "colour" if coloured else made_of}
            if coloured:
                values["thing_colour"] = tint_colour(made_of)
            if "height" in options:
                values["height"] = float(options["height"])
    return values


def hex_colour(value: str) -> str:
    """A colour picker's text (#rrggbb or rgba(r, g, b, a)) as #rrggbb."""
    if re.fullmatch(r"#[0-9a-fA-F]{6}", value):
        return value.lower()
    numbers = [float(v) for v in re.findall(r"[\d.]+", value)[:3]]
    if len(numbers) == 3 and all(0 <= v <= 255 for v in numbers):
        return "#" + "".join(f"{round(v):02x}" for v in numbers)
    return "#808080"


def tint_text(colour: str) -> str | None:
    """A picked colour as the option `tint` of glass, linear; None for white."""
    linear = parse_colour(hex_colour(colour))
    return None if min(linear) >= 1 else ",".join(f"{v:.4g}" for v in linear)


def tint_colour(tint: Any) -> str:
    """The option `tint`, linear numbers or #rrggbb, as #rrggbb."""
    from materialist.color import linear_to_srgb

    if isinstance(tint, str) and tint.startswith("#"):
        return tint
    numbers = tint.split(",") if isinstance(tint, str) else tint
    encoded = np.round(255 * linear_to_srgb(np.array([float(v) for v in numbers], np.float32)))
    return "#" + "".join(f"{int(v):02x}" for v in encoded)


def number_text(value: float) -> str:
    """A number as the list of edits has it."""
    return f"{float(value):.4g}"


def commands(session: Session) -> str:
    """The commands that give the same result; nothing where no photo is open."""
    project = session.project
    if project is None:
        return ""
    lines, scene = [f"cd {quote(str(project.folder))}"], quote(str(project.scene))
    if session.edits.active:
        lines.append(f"materialist apply {scene} {session.workspace.name}/{EDITS} -o out.png --save edited.scene")
        scene = "edited.scene"
    else:
        lines.append(f"materialist render {scene} -o out.png")
    lines.append(f"materialist export {scene} --to glb -o out.glb")
    return "\n".join(lines)
