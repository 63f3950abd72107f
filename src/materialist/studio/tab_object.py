"""The tab for things that are put into the photo, and for glass."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gradio as gr

from materialist.errors import InputError
from materialist.studio import tab_glass, things, uploads
from materialist.studio.context import Context
from materialist.studio.follow import box, follow
from materialist.studio.guard import guarded
from materialist.studio.jobs import FAILED
from materialist.studio.session import Session
from materialist.studio.tab_material import hex_colour

LIBRARY = ("Ball", "Cube", "Cylinder", "Cone", "Ring", "Slab")
MATERIALS = (("As it is", "as-is"), ("Glass", "glass"), ("Mirror", "mirror"), ("Colour", "colour"))


def layout(context: Context) -> None:
    """The components."""
    parts = context.parts
    with gr.Tab("Objects", id="object"):
        gr.Markdown("Choose an object, then the tool **Place an object**, and click where it should stand.")
        parts["thing"] = gr.Dropdown([*LIBRARY], value=None, label="Object", elem_id="thing")
        parts["own_mesh"] = gr.File(
            elem_id="own_mesh", label="Your own: one GLB, PLY, OBJ or STL file", type="filepath", height=150,
            file_types=[".glb", ".ply", ".obj", ".stl"],
        )  # fmt: skip
        parts["scale"] = gr.Slider(0.1, 5, 1, step=0.05, label="Size", buttons=[], elem_id="scale")
        parts["turn"] = gr.Slider(-180, 180, 0, step=1, label="Turn, degrees", buttons=[])
        with gr.Row():
            parts["made_of"] = gr.Dropdown(list(MATERIALS), value="as-is", label="Material", min_width=120)
            parts["thing_colour"] = gr.ColorPicker("#c2563a", label="Its colour", min_width=120)
        gr.Markdown("The live preview shows only where it stands; shadows and reflections come with path tracing.")
        with gr.Accordion("Turn the selection to glass", open=False) as parts["glass_part"]:
            tab_glass.layout(context)
        with gr.Accordion("Take the selection away", open=False):
            parts["shadow"] = gr.Checkbox(True, label="Its shadow and reflection on the ground go along")
            parts["remove"] = gr.Button("Take it away", elem_id="remove", size="sm")
        with gr.Accordion("Let it fall", open=False):
            gr.Markdown("The object falls where it stands. Needs the physics extra.")
            parts["height"] = gr.Slider(
                0, 5, 1.5, step=0.1, label="How high above, in its own sizes", buttons=[], elem_id="height"
            )
            parts["rest"] = gr.Button("Let it fall, and lie there", elem_id="rest", size="sm")
            gr.Markdown("Once more, and it tumbles in another way.")
            parts["fall"] = gr.Button("Make a video of the fall", size="sm")
            with gr.Row():
                parts["fall_progress"] = gr.HTML("", js_on_load=None)
                parts["fall_stop"] = gr.Button("Stop", variant="stop", size="sm", visible=False, min_width=70)
            parts["fall_video"] = gr.Video(label="The fall", interactive=False, visible=False, buttons=["download"])


def wire(context: Context) -> None:
    """The events."""
    live: dict[str, Any] = {
        "queue": False, "trigger_mode": "always_last", "show_progress": "hidden", "api_visibility": "private",
    }  # fmt: skip
    _wire_things(context, live)
    tab_glass.wire(context, live)
    _wire_regions(context, live)
    _wire_fall(context)


def _wire_things(context: Context, live: dict[str, Any]) -> None:
    parts = context.parts

    @guarded
    def choose(name: str | None, request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        if name in LIBRARY:
            session.thing_option("mesh", library_file(session, str(name)))
        return {**context.picture(session), parts["tool"]: "place", parts["own_mesh"]: None}

    @guarded
    def uploaded(file: str | None, request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        if file is None:
            return {}
        from materialist.edits.insert.meshes import read_model

        suffix = uploads.checked_mesh(Path(file), Path(file).name)
        kept = session.keep(Path(file), "mesh", suffix)
        try:
            with uploads.called(session.desk / kept, Path(file).name):
                read_model(session.desk / kept)
        except Exception:
            (session.desk / kept).unlink(missing_ok=True)
            raise
        session.thing_option("mesh", kept)
        return {**context.picture(session), parts["tool"]: "place", parts["thing"]: None}

    def setter(name: str, text: Callable[[Any], str | None]) -> Any:
        @guarded
        def moved(value: Any, request: gr.Request) -> dict[Any, Any]:
            session = context.session(request)
            session.thing_option(name, text(value))
            return context.picture(session)

        return moved

    @guarded
    def made(kind: str, colour: str, request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        session.thing_option("material", hex_colour(colour) if kind == "colour" else kind)
        return context.picture(session)

    outputs = [*context.picture_parts, parts["tool"]]
    parts["thing"].input(choose, parts["thing"], [*outputs, parts["own_mesh"]], **live)
    sent = parts["own_mesh"].upload(uploaded, parts["own_mesh"], [*outputs, parts["thing"]], **live)
    sent.failure(lambda: None, None, parts["own_mesh"], **live)  # what was refused is not there
    parts["scale"].input(setter("scale", lambda v: f"{float(v):.4g}"), parts["scale"], context.picture_parts, **live)
    parts["turn"].input(setter("turn", lambda v: f"{float(v):.4g}"), parts["turn"], context.picture_parts, **live)
    for part in (parts["made_of"], parts["thing_colour"]):
        part.input(made, [parts["made_of"], parts["thing_colour"]], context.picture_parts, **live)


def _wire_regions(context: Context, live: dict[str, Any]) -> None:
    """Things that go."""
    parts = context.parts

    @guarded
    def remove(shadow: bool, request: gr.Request) -> Any:
        session = context.session(request)
        session.region_step("remove", shadow=None if shadow else "0")
        return context.picture(session)

    slow = {k: v for k, v in live.items() if k not in ("queue", "trigger_mode")} | {"show_progress": "minimal"}
    parts["remove"].click(remove, parts["shadow"], context.picture_parts, **slow)


def _wire_fall(context: Context) -> None:
    """An object that falls: to lie there, or as a video."""
    parts, hub = context.parts, context.hub
    free: dict[str, Any] = {"show_progress": "hidden", "concurrency_limit": None, "api_visibility": "private"}

    @guarded
    def fall(height: float, request: gr.Request) -> Any:
        session = context.session(request)
        scene = str(session.project.scene) if session.scene and session.project else ""
        place = things.last(session)
        if place is None:
            raise InputError("Place an object first; it falls where it stands.")
        step, file = session.stack.steps[place], session.new_name("fall", ".mp4")
        told = {k: step.options[k] for k in ("scale", "material", "height", "seed") if k in step.options}
        told = {"height": f"{float(height):.3g}", **told}
        if step.kind == "insert":  # what has fallen falls in the video as it did
            told["seed"] = str(things.tries(session, step))
        job = hub.jobs.submit(
            "fall", session.person, session.desk, scene=scene, mesh=str(session.desk / step.options["mesh"]),
            at=[float(v) for v in step.options["at"]], output=str(file), **told,
        )  # fmt: skip
        session.asked("fall", job)
        for html in follow(hub.jobs, job):
            yield {parts["fall_progress"]: html, parts["fall_stop"]: gr.update(visible=not job.over)}
        if job.state == FAILED and step.kind == "insert":
            things.fell_in_vain(session, step)
        if job.state == "done":
            yield {parts["fall_video"]: gr.update(value=hub.handed(file), visible=True)}

    @guarded
    def stop(request: gr.Request) -> None:
        context.session(request).stop(hub.jobs, "fall")

    @guarded
    def rest(height: float, request: gr.Request) -> Any:
        session = context.session(request)
        yield {parts["fall_progress"]: box("It falls …")}
        try:
            notes = things.let_fall(session, float(height))
        finally:
            yield {parts["fall_progress"]: ""}
        yield {**context.everything(session), parts["fall_progress"]: box(" ".join(notes)) if notes else ""}

    parts["rest"].click(rest, parts["height"], [*context.all_parts, parts["fall_progress"]], **free)
    parts["fall"].click(
        fall, parts["height"], [parts["fall_progress"], parts["fall_stop"], parts["fall_video"]], **free
    )
    parts["fall_stop"].click(stop, None, None, queue=False, show_progress="hidden", api_visibility="private")


def file_of(name: str) -> str:
    """What the file of a computed mesh is called."""
    return f"thing-{name.lower()}.ply"


def library_file(session: Session, name: str) -> str:
    """A computed mesh as a file on the desk, +Y up."""
    file = session.desk / file_of(name)
    if not file.is_file():
        shape(name).export(file)
    return file.name


def shape(name: str) -> Any:
    """One of the library as a trimesh, +Y up, longest side 1."""
    import numpy as np
    from trimesh import creation, transformations

    made: dict[str, Callable[[], Any]] = {
        "Ball": lambda: creation.icosphere(subdivisions=4, radius=0.5),
        "Cube": lambda: creation.box((1, 1, 1)),
        "Cylinder": lambda: creation.cylinder(0.3, 1, sections=96),
        "Cone": lambda: creation.cone(0.4, 1, sections=96),
        "Ring": lambda: creation.torus(0.35, 0.15, major_sections=96, minor_sections=48),
        "Slab": lambda: creation.box((1, 1, 0.12)),
    }
    mesh = made[name]()
    # trimesh builds along +Z; a ring lies flat as it is.
    mesh.apply_transform(transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    return mesh
