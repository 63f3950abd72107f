"""The tab for objects that are put into the photo, let fall, turned to glass, or taken away."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import gradio as gr

from materialist.edits.glass.operation import GLASS
from materialist.edits.remove.operation import REMOVE
from materialist.studio import objects, uploads
from materialist.studio.controls import file_field, hex_colour, slider
from materialist.studio.session import Session
from materialist.studio.widgets import PageContext, Updates, message_box

_INSIDE = [("solid", ""), ("hollow", "true"), ("open at the top", "open")]


def layout(context: PageContext) -> None:
    parts = context.parts
    with gr.Tab("Objects", id="object"):
        gr.Markdown(
            "Choose an object, then the tool **Place an object**, and click where it should stand."
        )
        parts["thing"] = gr.Dropdown(
            [*objects.LIBRARY], value=None, label="Object", elem_id="thing"
        )
        parts["own_mesh"] = file_field(
            "own_mesh", "Your own: one GLB, PLY, OBJ or STL file", uploads.MESHES
        )
        parts["scale"] = slider("scale", "Size", 0.05, minimum=0.1, maximum=5)
        parts["turn"] = slider("turn", "Turn, degrees", 1, minimum=-180, maximum=180)
        with gr.Row():
            parts["made_of"] = gr.Dropdown(
                list(objects.MATERIALS), value="as-is", label="Material", min_width=120
            )
            parts["thing_colour"] = gr.ColorPicker("#c2563a", label="Its colour", min_width=120)
        gr.Markdown(
            "The live preview shows only where it stands; shadows and reflections come with path tracing."
        )
        with gr.Accordion("Turn the selection to glass", open=False) as parts["glass_part"]:
            _layout_glass(parts)
        with gr.Accordion("Take the selection away", open=False):
            parts["shadow"] = gr.Checkbox(
                True, label="Its shadow and reflection on the ground go along"
            )
            parts["remove"] = gr.Button("Take it away", elem_id="remove", size="sm")
        with gr.Accordion("Let it fall", open=False):
            gr.Markdown("The object falls where it stands. Needs the physics extra.")
            parts["height"] = slider("height", "How high above, in its own sizes", 0.1, maximum=5)
            parts["rest"] = gr.Button("Let it fall, and lie there", elem_id="rest", size="sm")
            gr.Markdown("Once more, and it tumbles in another way.")


def _layout_glass(parts: dict[str, Any]) -> None:
    parts["glass_ior"] = slider("glass_ior", "Index of refraction", 0.01, maximum=2.5)
    parts["glass_transmission"] = slider("glass_transmission", "How much light goes through", 0.01)
    parts["glass_roughness"] = slider("glass_roughness", "Roughness: clear to frosted", 0.01)
    parts["glass_tint"] = gr.ColorPicker("#ffffff", label="Tint")
    parts["glass_hollow"] = gr.Radio(_INSIDE, value="", label="Inside", elem_id="glass_hollow")
    parts["glass"] = gr.Button("Make it glass", elem_id="glass", size="sm")
    gr.Markdown(
        "Its body is built once, in half a minute or so; from then on the picture follows the sliders."
    )


def wire(context: PageContext) -> None:
    parts = context.parts
    context.live(parts["thing"].input, _choose, "thing", more=("tool", "own_mesh"))
    context.upload("own_mesh", _uploaded, more=("tool", "thing"))
    context.bind(
        "scale",
        "turn",
        *(f"glass_{name}" for name in ("ior", "transmission", "roughness", "tint", "hollow")),
    )
    for name in ("made_of", "thing_colour"):
        context.live(parts[name].input, _made_of, "made_of", "thing_colour")
    # Filling a hole takes seconds: in the queue, with a sign of work.
    slow: dict[str, Any] = {"queue": True, "trigger_mode": "once", "show_progress": "minimal"}
    context.live(parts["remove"].click, _remove, "shadow", **slow)
    context.live(parts["glass"].click, partial(Session.set, kind=GLASS.name), everything=True)
    # The stage itself asks for this where its glass is still to come.
    context.long(parts["stage"].follow, partial(_follow, context), trigger_mode="always_last")
    context.long(parts["rest"].click, partial(_fall, context), "height")


def _choose(session: Session, name: str | None) -> Updates:
    # Only names of ours: anything else would be a path from a stranger.
    if name in objects.LIBRARY:
        objects.set_object_option(session, "mesh", objects.library_file(session, str(name)))
    return {"tool": "place", "own_mesh": None}


def _uploaded(session: Session, file: Path) -> Updates:
    def use(name: str) -> None:
        objects.set_object_option(session, "mesh", name)

    uploads.used(session.workspace, file, uploads.MESH, session.allowance, use)
    return {"tool": "place", "thing": None}


def _made_of(session: Session, kind: str, colour: str) -> None:
    objects.set_object_option(session, "material", hex_colour(colour) if kind == "colour" else kind)


def _remove(session: Session, shadow: bool) -> None:
    session.set(REMOVE.name, shadow=None if shadow else "0")


def _follow(context: PageContext, session: Session) -> Iterator[Updates]:
    """Tell of the glass that the stage waits for, until it is there."""
    said = ""
    client = session.glass
    while client is not None and client is session.glass:
        state = client.state
        if not state.waiting:
            message = (
                message_box(session.without_folders(state.words), bad=True) if state.bad else ""
            )
            yield context.picture(session) | {"progress": message}
            return
        # Only what is new: every update is a message to the page.
        if state.words != said:
            said = state.words
            yield {"progress": message_box(said)}
        with client.changed:
            client.changed.wait(0.5)


def _fall(context: PageContext, session: Session, height: float) -> Iterator[Updates]:
    yield {"progress": message_box("It falls …")}
    notes = session.without_folders(" ".join(objects.let_fall(session, float(height))))
    yield context.everything(session) | {"progress": message_box(notes) if notes else ""}
