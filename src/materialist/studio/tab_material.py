"""The tab that changes materials: colour, roughness, metal, a texture."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import gradio as gr

from materialist.studio import uploads
from materialist.studio.context import Context
from materialist.studio.guard import guarded

_RANGES = {
    "hue": (-180, 180, 1, "Hue, degrees"),
    "saturation": (-1, 1, 0.02, "Saturation"),
    "value": (-1, 1, 0.02, "Brightness"),
    "roughness": (0, 1, 0.01, "Roughness: mirror to chalk"),
    "metallic": (0, 1, 0.01, "Metallic"),
}


def layout(context: Context) -> None:
    """The components."""
    parts = context.parts
    with gr.Tab("Material", id="material"):
        for name, (low, high, step, label) in _RANGES.items():
            start = 0.5 if name == "roughness" else 0
            parts[name] = gr.Slider(low, high, start, step=step, label=label, elem_id=name, buttons=[])
        with gr.Row():
            parts["colour"] = gr.ColorPicker("#808080", label="One colour instead", min_width=120)
            parts["own"] = gr.Button("Own colours again", size="sm", min_width=120)
        with gr.Accordion("Texture", open=False):
            parts["texture"] = gr.File(
                label="A picture to lay on the surface", type="filepath", height=150, file_types=sorted(uploads.PHOTOS)
            )
            parts["texture_scale"] = gr.Slider(0.1, 4, 1, step=0.05, label="Size of the texture", buttons=[])
        parts["as_fitted"] = gr.Button("Roughness and metallic as they were found", size="sm")


def wire(context: Context) -> None:
    """The events; sliders skip the queue, and while one request is under way only the newest value waits."""
    parts = context.parts
    live: dict[str, Any] = {
        "queue": False, "trigger_mode": "always_last", "show_progress": "hidden", "api_visibility": "private",
    }  # fmt: skip

    def setter(name: str) -> Any:
        @guarded
        def moved(value: float, request: gr.Request) -> dict[Any, Any]:
            session = context.session(request)
            session.material(name, f"{float(value):.4g}")
            return context.picture(session)

        return moved

    for name in (*_RANGES, "texture_scale"):
        parts[name].input(setter(name), parts[name], context.picture_parts, **live)

    @guarded
    def coloured(value: str, request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        session.materials({"texture": None, "albedo": hex_colour(value)})
        return context.picture(session)

    @guarded
    def own(request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        session.materials(dict.fromkeys(("albedo", "texture", "hue", "saturation", "value")))
        return context.everything(session)

    @guarded
    def as_fitted(request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        session.materials(dict.fromkeys(("roughness", "metallic")))
        return context.everything(session)

    @guarded
    def textured(file: str | None, request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        if file is None:
            return {}
        from materialist.edits.material.texture import read_texture

        suffix = uploads.checked_picture(Path(file), Path(file).name)
        with uploads.called(Path(file), Path(file).name):
            read_texture(file)
        session.materials({"albedo": None, "texture": session.keep(Path(file), "texture", suffix)})
        return context.everything(session)

    parts["colour"].input(coloured, parts["colour"], context.picture_parts, **live)
    parts["own"].click(own, None, context.all_parts, **live)
    parts["as_fitted"].click(as_fitted, None, context.all_parts, **live)
    sent = parts["texture"].upload(textured, parts["texture"], context.all_parts, **live)
    sent.failure(lambda: None, None, parts["texture"], **live)  # what was refused is not there


def hex_colour(value: str) -> str:
    """A colour picker's text (#rrggbb or rgba(r, g, b, a)) as #rrggbb."""
    if re.fullmatch(r"#[0-9a-fA-F]{6}", value):
        return value.lower()
    numbers = [float(v) for v in re.findall(r"[\d.]+", value)[:3]]
    if len(numbers) == 3 and all(0 <= v <= 255 for v in numbers):
        return "#" + "".join(f"{round(v):02x}" for v in numbers)
    return "#808080"
