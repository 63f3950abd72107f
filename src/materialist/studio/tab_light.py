"""The tab that changes the light: another map, a turn, a sun, lamps, dimming."""

from functools import cache
from pathlib import Path
from typing import Any

import gradio as gr
import numpy as np

from materialist.edits.light import presets
from materialist.io.display import light
from materialist.studio import SETTINGS, uploads
from materialist.studio.controls import SUN, file_field, slider
from materialist.studio.lights import light_file, number_text
from materialist.studio.session import Session
from materialist.studio.widgets import PageContext
from materialist.types import Array

PHOTO_LIGHT = "The photo's own"


def layout(context: PageContext) -> None:
    parts = context.parts
    with gr.Tab("Light", id="light"):
        # --- Light from all around: computed maps, or one's own ---
        parts["lights"] = gr.Gallery(
            _gallery(),
            label="Light from all around",
            columns=3,
            height="auto",
            allow_preview=False,
            object_fit="cover",
            interactive=False,
            buttons=[],
            elem_id="lights",
            format="jpeg",
        )
        suffixes = (".exr", ".hdr", ".png", ".jpg")
        parts["own_map"] = file_field(
            "own_map", "Your own environment map (2:1; HDR or EXR)", suffixes
        )
        parts["rotate"] = slider("rotate", "Turn the light, degrees", 1, minimum=-180, maximum=180)
        parts["ambient"] = slider("ambient", "Dim or brighten", 0.02, maximum=2)
        # --- Lights that are added ---
        with gr.Accordion("Sun", open=False):
            parts["sun_on"] = gr.Checkbox(False, label="A sun in the sky")
            parts["azimuth"] = gr.Slider(
                -180, 180, SUN[0], step=1, label="Right of straight ahead, degrees", buttons=[]
            )
            parts["elevation"] = gr.Slider(
                0, 90, SUN[1], step=1, label="Above the horizon, degrees", buttons=[]
            )
            parts["sun_power"] = slider("sun_power", "Strength", 0.05, maximum=5)
        with gr.Accordion("Lamps", open=False):
            gr.Markdown(
                "Choose the tool **Place a lamp** and click in the photo. Lamps show in path-traced pictures."
            )
            parts["kelvin"] = gr.Slider(
                1700, 12000, 2700, step=100, label="Colour, kelvin: warm to cold", buttons=[]
            )
            parts["power"] = gr.Slider(0.05, 5, 1, step=0.05, label="Strength", buttons=[])
            parts["before"] = gr.Slider(
                0.2,
                0.98,
                SETTINGS.lamp_share,
                step=0.01,
                label="Nearer to you, or to the surface",
                buttons=[],
            )
            parts["no_lamps"] = gr.Button("Take all lamps away", size="sm")


def wire(context: PageContext) -> None:
    parts = context.parts
    context.live(parts["lights"].select, _choose, data=True)
    context.upload("own_map", _uploaded)
    context.bind("rotate", "ambient", coarse=True)
    sunny = ("sun_on", "azimuth", "elevation", "sun_power")
    # Any of the four sets the whole sun: the list of edits has it as one option.
    for name in sunny:
        context.live(parts[name].input, _sun, *sunny, coarse=True)
    context.live(
        parts["no_lamps"].click, lambda session: session.light(lamps=None), everything=True
    )


def _choose(session: Session, data: Any) -> None:
    # The first picture of the gallery stands for the photo's own light.
    if data["index"] == 0:
        session.light(envmap=None, gain=None)
    else:
        session.light(
            envmap=light_file(session, [*presets.LIGHTS][int(data["index"]) - 1]), gain="auto"
        )


def _sun(session: Session, on: bool, azimuth: float, elevation: float, power: float) -> None:
    where = [f"{float(azimuth):g}", f"{float(elevation):g}"] if on else None
    session.light(sun=where, sun_power=number_text(power) if on else None)


def _uploaded(session: Session, file: Path) -> None:
    def use(name: str) -> None:
        session.light(envmap=name, gain="auto")

    uploads.used(session.workspace, file, "envmap", session.allowance, use)


@cache
def _gallery() -> list[tuple[Array, str]]:
    blank = np.full((64, 128, 3), 225, np.uint8)
    return [
        (blank, PHOTO_LIGHT),
        *((light(presets.preset_light(name, 64)), name) for name in presets.LIGHTS),
    ]
