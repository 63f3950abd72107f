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
from shlex import join, quote
from typing import Any

import gradio as gr
import numpy as np

from materialist.errors import MaterialistError
from materialist.jobs.queue import Job
from materialist.option_kinds import OperationOptions, declarations, parse_colour
from materialist.options import Glass, Insertion, InvertOptions, MaterialEdit, Relight
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
MATERIAL = ("hue", "saturation", "value", "roughness", "metallic", "colour", "texture_scale")
LIGHT = ("rotate", "ambient", "sun_on", "azimuth", "elevation", "sun_power")
GLASS = ("glass_ior", "glass_transmission", "glass_roughness", "glass_tint", "glass_hollow")
THING = ("thing", "scale", "turn", "made_of", "thing_colour", "height")
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
        """Updates after a change of the selection, of the step in hand, or of the scene."""
        return {**self.picture(session), **self.controls(session)}

    def controls(self, session: Session) -> dict[Any, Any]:
        """Sliders as the step in hand, or the selected object, has them; as they are where a step is not valid."""
        if session.live is None:
            return {}
        values: dict[str, Any] = {}
        for read in (material_values, light_values, glass_values, object_values):
            with suppress(TypeError, ValueError):
                values |= read(session)
        return {self[name]: value for name, value in values.items()}

    @property
    def picture_parts(self) -> list[Any]:
        """Components of `picture`."""
        return [self["stage"], self["steps"], self["commands"]]

    @property
    def all_parts(self) -> list[Any]:
        """Components of `everything`."""
        return [*self.picture_parts, *(self[name] for name in (*MATERIAL, *LIGHT, *GLASS, *THING))]

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

    def stops(self, button: str, kind: str) -> None:
        """Let a button stop the last job of a kind that its page asked for."""

        @handler
        def stop(request: gr.Request) -> None:
            self.session(request).stop(self.studio.jobs, kind)

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


def material_values(session: Session) -> dict[str, Any]:
    """Values of the sliders: the step's own, else those of the fit under the selection."""
    step, mask = session.edits.in_hand, session.selection.mask
    options = step.options if step is not None and step.kind == "edit" else {}
    values: dict[str, Any] = {name: default(MaterialEdit, name) for name in ("hue", "saturation", "value")}
    values |= {"roughness": 0.5, "metallic": 0.0}
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
    place = session.edits.light
    options = session.edits.steps[place].options if place is not None else {}
    names = ("rotate", "ambient", "sun_power")
    values: dict[str, Any] = {name: float(options.get(name, default(Relight, name))) for name in names}
    sun = options.get("sun")
    values["sun_on"] = sun is not None
    where = sun if isinstance(sun, list | tuple) else SUN
    values["azimuth"], values["elevation"] = (float(v) for v in where)
    return values


def glass_values(session: Session) -> dict[str, Any]:
    """Values of the controls of glass, where there is glass in hand; else they stay."""
    step = session.edits.in_hand
    if step is None or step.kind != "glass":
        return {}
    names = ("ior", "transmission", "roughness")
    values: dict[str, Any] = {f"glass_{name}": float(step.options.get(name, default(Glass, name))) for name in names}
    values["glass_tint"] = tint_colour(step.options.get("tint", "1,1,1"))
    hollow = str(step.options.get("hollow", "")).lower()
    values["glass_hollow"] = hollow if hollow == "open" else "true" if hollow in ("true", "yes", "on", "1") else ""
    return values


def object_values(session: Session) -> dict[str, Any]:
    """Values of the controls of objects, where there is one in hand; else they stay."""
    step = objects.in_hand(session)
    if step is None:
        return {}
    options = step.options
    known = (name for name in objects.LIBRARY if objects.file_of(name) == options.get("mesh"))
    values: dict[str, Any] = {"thing": next(known, None)}
    values |= {name: float(options.get(name, default(Insertion, name))) for name in ("scale", "turn")}
    if "height" in options:
        values["height"] = float(options["height"])
    made_of = options.get("material", "as-is")
    if made_of in [value for _, value in objects.MATERIALS]:
        return {**values, "made_of": made_of}
    return {**values, "made_of": "colour", "thing_colour": tint_colour(made_of)}


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
    """The commands that give the same result; nothing where no photo is open.

    The photo is taken apart again only where its scene is not there any more.
    """
    project = session.project
    if project is None:
        return ""
    lines, scene = [f"cd {quote(str(project.folder))}"], quote(str(project.scene))
    if project.photo is not None:
        scene = project.scene.name
        words = ["materialist", "invert", project.photo.name, "-o", scene, *_invert_options(session.scene.provenance)]
        lines.append(f"test -e {scene} || {join(words)}")
    if session.edits.active:
        lines.append(f"materialist apply {scene} {session.workspace.name}/{EDITS} -o out.png --save edited.scene")
        scene = "edited.scene"
    else:
        lines.append(f"materialist render {scene} -o out.png")
    lines.append(f"materialist export {scene} --to glb -o out.glb")
    return "\n".join(lines)


def _invert_options(made: dict[str, Any]) -> list[str]:
    """The options of an inversion that differ from the defaults, as the command takes them."""
    found: list[str] = []
    predictor = str(made.get("predictor", "")).split(" ")[0]  # behind it are the weights
    if predictor in {name for _, name in PREDICTORS}:
        found += ["--predictor", predictor]
    if made.get("fov_source") == "option":
        found += ["--fov", f"{made['fov']:.12g}"]
    for name in ("engine", "preset", "size", "tau", "strategy", "seed"):
        if name in made and made[name] != default(InvertOptions, name):
            found += [f"--{name}", str(made[name])]
    return found
