"""The tab that changes materials: colour, roughness, metal, a texture."""

from functools import partial
from pathlib import Path

import gradio as gr

from materialist.edits.material.operation import EDIT
from materialist.io.decode import RAW_SUFFIXES, SUFFIXES
from materialist.studio import uploads
from materialist.studio.controls import file_field, hex_colour, slider
from materialist.studio.session import Session
from materialist.studio.widgets import PageContext


def layout(context: PageContext) -> None:
    parts = context.parts
    with gr.Tab("Material", id="material"):
        parts["hue"] = slider("hue", "Hue, degrees", 1, minimum=-180, maximum=180)
        parts["saturation"] = slider("saturation", "Saturation", 0.02)
        parts["value"] = slider("value", "Brightness", 0.02)
        parts["roughness"] = slider("roughness", "Roughness: mirror to chalk", 0.01, value=0.5)
        parts["metallic"] = slider("metallic", "Metallic", 0.01, value=0)
        with gr.Row():
            parts["grow"] = slider(
                "grow", "Grow or shrink", 0.002, minimum=-0.05, maximum=0.05, min_width=120
            )
            parts["feather"] = slider(
                "feather", "Soften its border", 0.002, maximum=0.1, min_width=120
            )
        with gr.Row():
            parts["colour"] = gr.ColorPicker("#808080", label="One colour instead", min_width=120)
            parts["own"] = gr.Button("Own colours again", size="sm", min_width=120)
        with gr.Accordion("Texture", open=False):
            parts["texture"] = file_field(
                "texture", "A picture to lay on the surface", SUFFIXES - RAW_SUFFIXES
            )
            parts["texture_scale"] = slider(
                "texture_scale", "Size of the texture", 0.05, minimum=0.1, maximum=4
            )
        parts["as_fitted"] = gr.Button("Roughness and metallic as they were found", size="sm")


def wire(context: PageContext) -> None:
    parts = context.parts
    context.bind(
        "hue", "saturation", "value", "roughness", "metallic", "texture_scale", "grow", "feather"
    )
    context.live(parts["colour"].input, _coloured, "colour")
    # Buttons that take options back to what was fitted.
    cleared = {
        "own": ("albedo", "texture", "hue", "saturation", "value"),
        "as_fitted": ("roughness", "metallic"),
    }
    for button, names in cleared.items():
        context.live(parts[button].click, partial(_clear, names), everything=True)
    context.upload("texture", _textured, everything=True)


def _clear(names: tuple[str, ...], session: Session) -> None:
    session.set(EDIT.name, **dict.fromkeys(names))


def _coloured(session: Session, value: str) -> None:
    # A colour and a texture exclude each other.
    session.set(EDIT.name, texture=None, albedo=hex_colour(value))


def _textured(session: Session, file: Path) -> None:
    def use(name: str) -> None:
        session.set(EDIT.name, albedo=None, texture=name)

    uploads.used(session.workspace, file, "texture", session.allowance, use)
