"""The tab to look: every map, the light, the mesh, and the report in plain words."""

from typing import Any

import gradio as gr

from materialist.studio import tasks
from materialist.studio.stage import maps, report
from materialist.studio.widgets import LONG, PageContext

MESH = "mesh.glb"


def layout(context: PageContext) -> None:
    parts = context.parts
    with gr.Tab("Look", id="look") as tab:
        parts["look"] = tab
        parts["report"] = gr.Markdown("Open a photo first.", elem_id="report")
        parts["maps"] = gr.Gallery(
            label="What was found", columns=2, height="auto", object_fit="contain", interactive=False, format="jpeg",
            buttons=["fullscreen"], elem_id="maps",
        )  # fmt: skip
        parts["mesh_button"] = gr.Button("Show the mesh", size="sm")
        parts["mesh"] = gr.Model3D(
            label="The mesh: drag to turn, wheel to zoom", height=380, clear_color=(0.9, 0.92, 0.94, 1.0),
            interactive=False, elem_id="mesh",
        )  # fmt: skip


def wire(context: PageContext) -> None:
    parts, studio = context.parts, context.studio

    @context.handler
    def look(request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        if session.live is None:
            return {}
        return {parts["report"]: session.shown(report(session.scene)), parts["maps"]: maps(session.scene)}

    @context.handler
    def make_mesh(request: gr.Request) -> Any:
        session = context.session(request)
        _ = session.scene
        assert session.project is not None
        file = session.workspace / MESH
        if file.is_file():
            return
        scene = str(session.project.scene)
        job = studio.submit(session, tasks.mesh, session.workspace, scene=scene, output=str(file))
        yield from context.following(job)

    @context.handler
    def show_mesh(request: gr.Request) -> Any:
        file = context.session(request).workspace / MESH
        return studio.public_copy(file) if file.is_file() else None

    parts["look"].select(look, None, [parts["report"], parts["maps"]], **LONG)
    # Two steps: the viewer loads nothing when its value is sent twice, as the end of a generator does.
    made = parts["mesh_button"].click(make_mesh, None, context.job_parts, **LONG)
    made.then(show_mesh, None, parts["mesh"], **LONG)
