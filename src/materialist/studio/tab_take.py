"""The tab to take things away: pictures, the scene, other programs' formats, a video, the recipe, the commands."""

import shutil
from collections.abc import Iterator

import gradio as gr

from materialist.errors import InputError
from materialist.studio import tasks
from materialist.studio.archives import pack_edits
from materialist.studio.controls import file_field
from materialist.studio.session import EDITS, Session
from materialist.studio.stage import stage
from materialist.studio.tasks import KINDS
from materialist.studio.widgets import PageContext, Updates, message_box


def layout(context: PageContext) -> None:
    parts = context.parts
    with gr.Tab("Take away", id="take"):
        # Results by their titles.
        choices = [(title, kind) for kind, (title, _) in KINDS.items()]
        parts["what"] = gr.Radio(choices, value="png", label="What to take", elem_id="what")
        parts["make"] = gr.Button("Prepare the file", variant="primary", elem_id="make")
        parts["download"] = gr.DownloadButton("Download", visible=False, elem_id="download")
        label = "Load an edits.yaml, or the zip with its masks"
        parts["recipe"] = file_field("recipe", label, (".zip", ".yaml", ".yml"))
        parts["commands"] = gr.Textbox(
            "",
            label="The same on the command line",
            lines=4,
            interactive=False,
            buttons=["copy"],
            elem_id="commands",
        )


def wire(context: PageContext) -> None:
    def make(session: Session, kind: str) -> Iterator[Updates]:
        if kind not in KINDS:
            raise InputError("Choose one of the listed things.")
        file = session.workspace / f"take-{kind}{KINDS[kind][1]}"
        yield {"download": gr.update(visible=False)}
        # --- Make the file: here, by the final picture, or by a job ---
        if kind == "edits":
            session.save()
            if not session.edits.active:
                raise InputError("There is no edit to take away yet: change something first.")
            pack_edits(session.edits.steps, session.workspace / EDITS, file)
        elif kind in ("png", "exr"):
            final = yield from context.traced(session)
            if final is None:
                return
            shutil.copyfile(final.path.with_suffix(file.suffix), file)
        elif not (
            yield from context.work(
                session, tasks.take, file, steps=session.edits.active, kind=kind
            )
        ):
            return
        # --- Hand it over under a name that says what it is ---
        name = f"{session.opened.stem}-{'edited' if kind in ('png', 'exr') else kind}{file.suffix}"
        label = f"Download {name} ({file.stat().st_size / 1e6:.1f} MB)"
        button = gr.update(
            value=context.studio.public_copy(session.person, file, name), label=label, visible=True
        )
        yield {
            "download": button,
            "progress": message_box("The file is ready."),
            "stage": stage(session),
        }

    context.long(context.parts["make"].click, make, "what")
    context.upload("recipe", Session.read_edits, everything=True, queue=True, trigger_mode="once")
