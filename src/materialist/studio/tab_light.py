"""The tab that changes the light: another map, a turn, a sun, lamps, dimming."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import gradio as gr
import numpy as np

from materialist.errors import InputError
from materialist.studio import lights, uploads
from materialist.studio.context import Context
from materialist.studio.guard import guarded
from materialist.studio.session import Session
from materialist.types import Array

OWN = "The photo's own"
_BEFORE = 0.75
"""Where a lamp hangs: this share of the way from the camera to what was clicked."""


def layout(context: Context) -> None:
    """The components."""
    parts = context.parts
    with gr.Tab("Light", id="light"):
        parts["lights"] = gr.Gallery(
            _gallery(), label="Light from all around", columns=3, height="auto", allow_preview=False,
            object_fit="cover", interactive=False, buttons=[], elem_id="lights", format="jpeg",
        )  # fmt: skip
        parts["own_map"] = gr.File(
            label="Your own environment map (2:1; HDR or EXR)", type="filepath", height=150, elem_id="own_map",
            file_types=[".exr", ".hdr", ".png", ".jpg"],
        )  # fmt: skip
        parts["rotate"] = gr.Slider(-180, 180, 0, step=1, label="Turn the light, degrees", elem_id="rotate", buttons=[])
        parts["ambient"] = gr.Slider(0, 2, 1, step=0.02, label="Dim or brighten", elem_id="ambient", buttons=[])
        with gr.Accordion("Sun", open=False):
            parts["sun_on"] = gr.Checkbox(False, label="A sun in the sky")
            parts["azimuth"] = gr.Slider(-180, 180, 45, step=1, label="Right of straight ahead, degrees", buttons=[])
            parts["elevation"] = gr.Slider(0, 90, 40, step=1, label="Above the horizon, degrees", buttons=[])
            parts["sun_power"] = gr.Slider(0, 5, 1, step=0.05, label="Strength", buttons=[])
        with gr.Accordion("Lamps", open=False):
            gr.Markdown("Choose the tool **Place a lamp** and click in the photo. Lamps show in path-traced pictures.")
            parts["kelvin"] = gr.Slider(1700, 12000, 2700, step=100, label="Colour, kelvin: warm to cold", buttons=[])
            parts["power"] = gr.Slider(0.05, 5, 1, step=0.05, label="Strength", buttons=[])
            parts["before"] = gr.Slider(
                0.2, 0.98, _BEFORE, step=0.01, label="Nearer to you, or to the surface", buttons=[]
            )
            parts["no_lamps"] = gr.Button("Take all lamps away", size="sm")


def wire(context: Context) -> None:
    """The events."""
    parts = context.parts
    live: dict[str, Any] = {
        "queue": False, "trigger_mode": "always_last", "show_progress": "hidden", "api_visibility": "private",
    }  # fmt: skip

    @guarded
    def choose(event: gr.SelectData, request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        number = int(event.index) - 1
        if number < 0:
            session.light(envmap=None, gain=None)
        else:
            name = lights.names()[number]
            session.light(envmap=_written(session, name), gain="auto")
        return context.picture(session)

    @guarded
    def uploaded(file: str | None, request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        if file is None:
            return {}
        from materialist.edits.light.relight import read_envmap

        suffix = uploads.checked_picture(Path(file), Path(file).name)
        with uploads.called(Path(file), Path(file).name):
            read_envmap(file)
        session.light(envmap=session.keep(Path(file), "light", suffix), gain="auto")
        return context.picture(session)

    def setter(name: str, plain: float) -> Any:
        @guarded
        def moved(value: float, request: gr.Request) -> dict[Any, Any]:
            session = context.session(request)
            session.light(**{name: None if value == plain else f"{float(value):.4g}"})
            return context.picture(session)

        return moved

    @guarded
    def sun(on: bool, azimuth: float, elevation: float, power: float, request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        where = [f"{float(azimuth):g}", f"{float(elevation):g}"] if on else None
        session.light(sun=where, sun_power=f"{float(power):.4g}" if on else None)
        return context.picture(session)

    @guarded
    def lamp_settings(kelvin: float, power: float, before: float, request: gr.Request) -> None:
        context.session(request).lamp = (float(kelvin), float(power), float(before))

    @guarded
    def no_lamps(request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        session.light(lamps=None)
        return context.everything(session)

    parts["lights"].select(choose, None, context.picture_parts, **live)
    sent = parts["own_map"].upload(uploaded, parts["own_map"], context.picture_parts, **live)
    sent.failure(lambda: None, None, parts["own_map"], **live)  # what was refused is not there
    parts["rotate"].input(setter("rotate", 0), parts["rotate"], context.picture_parts, **live)
    parts["ambient"].input(setter("ambient", 1), parts["ambient"], context.picture_parts, **live)
    sunny = [parts[name] for name in ("sun_on", "azimuth", "elevation", "sun_power")]
    for part in sunny:
        part.input(sun, sunny, context.picture_parts, **live)
    lamp = [parts[name] for name in ("kelvin", "power", "before")]
    for part in lamp:
        part.input(lamp_settings, lamp, None, **live)
    parts["no_lamps"].click(no_lamps, None, context.all_parts, **live)


def place_lamp(session: Session, x: float, y: float) -> None:
    """Hang a lamp before the surface at a pixel. Raises InputError where there is none."""
    kelvin, power, before = session.lamp
    depth = float(session.scene.depth[int(y), int(x)])
    if depth <= 0:
        raise InputError("There is no surface to hang the lamp before; click on an object.")
    new = [f"{x:.0f}", f"{y:.0f}", f"{depth * before:.4g}", f"{kelvin:g}", f"{power:.3g}"]
    place = session.stack.light
    known = session.stack.steps[place].options.get("lamps", []) if place is not None else []
    session.light(lamps=[*known, new])


def _written(session: Session, name: str) -> str:
    """A computed light as a file on the desk, so that the recipe can be replayed anywhere."""
    from materialist.io.exr import write_exr

    file = session.desk / f"light-{name.lower()}.exr"
    if not file.is_file():
        write_exr(file, lights.light(name))
    return file.name


@cache
def _gallery() -> list[tuple[Array, str]]:
    """Small pictures of the lights, the photo's own first."""
    from materialist.exporters.pictures import light

    own = np.full((64, 128, 3), 225, np.uint8)
    return [(own, OWN), *((light(lights.light(name, 64)), name) for name in lights.names())]
