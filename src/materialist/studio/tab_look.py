"""The tab to look: every map, the light, the mesh, and the report in plain words."""

from collections.abc import Iterator

import gradio as gr

from materialist.studio import tasks
from materialist.studio.session import Session
from materialist.studio.stage import named_maps, report
from materialist.studio.widgets import PageContext, Updates

MESH = "mesh.glb"


def layout(context: PageContext) -> None:
    parts = context.parts
    with gr.Tab("Look", id="look") as tab:
        parts["look"] = tab
        parts["report"] = gr.Markdown("Open a photo first.", elem_id="report")
        parts["maps"] = gr.Gallery(
            label="What was found",
            columns=2,
            height="auto",
            object_fit="contain",
            interactive=False,
            format="jpeg",
            buttons=["fullscreen"],
            elem_id="maps",
        )
        parts["mesh_button"] = gr.Button("Show the mesh", size="sm")
        parts["mesh"] = gr.Model3D(
            label="The mesh: drag to turn, wheel to zoom",
            height=380,
            clear_color=(0.9, 0.92, 0.94, 1.0),
            interactive=False,
            elem_id="mesh",
        )


def wire(context: PageContext) -> None:
    parts = context.parts
    studio = context.studio

    def look(session: Session) -> Iterator[Updates]:
        if session.live is not None:
            yield {
                "report": session.without_folders(report(session.scene)),
                "maps": named_maps(session.scene),
            }

    def show_mesh(session: Session) -> Iterator[Updates]:
        file = session.workspace / MESH
        if (yield from context.work(session, tasks.mesh, file)):
            yield {"mesh": studio.public_copy(session.person, file)}
            yield {}  # Gradio sends the last updates twice, and of a value sent twice the viewer loads nothing

    context.long(parts["look"].select, look)
    context.long(parts["mesh_button"].click, show_mesh)
