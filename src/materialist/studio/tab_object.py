"""The tab for objects that are put into the photo, let fall, turned to glass, or taken away."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gradio as gr

from materialist.studio import objects, uploads
from materialist.studio.controls import hex_colour, option_text, slider
from materialist.studio.session import Session
from materialist.studio.widgets import LONG, PageContext, box
from materialist.studio.workspace import store

_INSIDE = [("solid", ""), ("hollow", "true"), ("open at the top", "open")]
_GLASS = ("ior", "transmission", "roughness", "tint", "hollow")


def layout(context: PageContext) -> None:
    parts = context.parts
    with gr.Tab("Objects", id="object"):
        gr.Markdown("Choose an object, then the tool **Place an object**, and click where it should stand.")
        parts["thing"] = gr.Dropdown([*objects.LIBRARY], value=None, label="Object", elem_id="thing")
        parts["own_mesh"] = gr.File(
            elem_id="own_mesh", label="Your own: one GLB, PLY, OBJ or STL file", type="filepath", height=150,
            file_types=[".glb", ".ply", ".obj", ".stl"],
        )  # fmt: skip
        parts["scale"] = slider("scale", "Size", 0.05, minimum=0.1, maximum=5)
        parts["turn"] = slider("turn", "Turn, degrees", 1, minimum=-180, maximum=180)
        with gr.Row():
            parts["made_of"] = gr.Dropdown(list(objects.MATERIALS), value="as-is", label="Material", min_width=120)
            parts["thing_colour"] = gr.ColorPicker("#c2563a", label="Its colour", min_width=120)
        gr.Markdown("The live preview shows only where it stands; shadows and reflections come with path tracing.")
        with gr.Accordion("Turn the selection to glass", open=False) as parts["glass_part"]:
            _layout_glass(parts)
        with gr.Accordion("Take the selection away", open=False):
            parts["shadow"] = gr.Checkbox(True, label="Its shadow and reflection on the ground go along")
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
    gr.Markdown("Its body is built once, in half a minute or so; from then on the picture follows the sliders.")


def wire(context: PageContext) -> None:
    parts = context.parts

    def choose(session: Session, name: str | None) -> dict[Any, Any]:
        if name in objects.LIBRARY:
            objects.set_option(session, "mesh", objects.library_file(session, str(name)))
        return {parts["tool"]: "place", parts["own_mesh"]: None}

    def uploaded(session: Session, file: Path) -> dict[Any, Any]:
        _take_mesh(session, file)
        return {parts["tool"]: "place", parts["thing"]: None}

    context.on(parts["thing"].input, choose, parts["thing"], more=(parts["tool"], parts["own_mesh"]))
    context.on_upload("own_mesh", uploaded, more=(parts["tool"], parts["thing"]))
    context.bind("scale", "turn", *(f"glass_{name}" for name in _GLASS))
    for part in (parts["made_of"], parts["thing_colour"]):
        context.on(part.input, _made_of, [parts["made_of"], parts["thing_colour"]])
    slow: dict[str, Any] = {"queue": True, "trigger_mode": "once", "show_progress": "minimal"}
    context.on(parts["remove"].click, _remove, parts["shadow"], **slow)
    # Sliders of glass change the current glass; without one they are for the next.
    values = [parts[f"glass_{name}"] for name in _GLASS]
    context.on(parts["glass"].click, _make_glass, values, everything=True)
    _wire_following(context)
    _wire_fall(context)


def _take_mesh(session: Session, file: Path) -> None:
    from materialist.edits.insert.meshes import read_model

    suffix = uploads.checked_mesh(file, file.name)
    read_model(file)
    objects.set_option(session, "mesh", store(session.workspace, file, "mesh", suffix))


def _made_of(session: Session, kind: str, colour: str) -> None:
    objects.set_option(session, "material", hex_colour(colour) if kind == "colour" else kind)


def _remove(session: Session, shadow: bool) -> None:
    session.set("remove", shadow=None if shadow else "0")


def _make_glass(session: Session, *values: Any) -> None:
    session.set("glass", **{name: option_text(f"glass_{name}", value) for name, value in zip(_GLASS, values)})


def _wire_following(context: PageContext) -> None:
    """The stage asks to be told when the glass that it waits for is there."""

    @context.handler
    def follow(request: gr.Request) -> Iterator[dict[Any, Any]]:
        session, said = context.session(request), ""
        client = session.glass
        while client is not None and client is session.glass:
            state = client.state
            if not state.waiting:
                end = box(session.shown(state.words), bad=True) if state.bad else ""
                yield {**context.picture(session), context["progress"]: end}
                return
            if state.words != said:
                said = state.words
                yield {context["progress"]: box(said)}
            with client.changed:
                client.changed.wait(0.5)

    outputs = [*context.picture_parts, *context.job_parts]
    context["stage"].follow(follow, None, outputs, trigger_mode="always_last", **LONG)


def _wire_fall(context: PageContext) -> None:
    parts = context.parts

    @context.handler
    def rest(height: float, request: gr.Request) -> Any:
        session = context.session(request)
        yield {parts["progress"]: box("It falls …")}
        notes = session.shown(" ".join(objects.let_fall(session, float(height))))
        yield {**context.everything(session), parts["progress"]: box(notes) if notes else ""}

    parts["rest"].click(rest, parts["height"], [*context.all_parts, *context.job_parts], **LONG)
