"""The tab to take things away: pictures, the scene, other programs' formats, a video, the recipe, the commands."""

from __future__ import annotations

import shutil
from inspect import signature
from pathlib import Path
from shlex import join, quote
from typing import Any

import gradio as gr

from materialist.errors import InputError
from materialist.pipeline import invert
from materialist.studio.context import Context
from materialist.studio.follow import box, follow
from materialist.studio.guard import guarded
from materialist.studio.jobs import Job
from materialist.studio.pack import pack
from materialist.studio.session import EDITS, Session
from materialist.studio.showing import Final
from materialist.studio.tab_open import PREDICTORS

KINDS = {
    "png": ("Picture, PNG (path traced)", ".png"),
    "exr": ("Picture, EXR: linear, for further work", ".exr"),
    "edits": ("edits.yaml with its masks (zip)", ".zip"),
    "scene": ("The edited scene, a package (zip)", ".zip"),
    "glb": ("glTF with its light (zip)", ".zip"),
    "blend": ("Blender: script and files (zip)", ".zip"),
    "usd": ("USD (usdz)", ".usdz"),
    "mitsuba": ("Mitsuba (zip)", ".zip"),
    "html": ("A page that opens without a server", ".html"),
    "turn": ("A video: the light goes round", ".mp4"),
}
"""What can be taken -> its name, and the suffix of the file."""
SPP, FRAMES, FRAME_SPP = 256, 24, 32


def layout(context: Context) -> None:
    """The components."""
    parts = context.parts
    with gr.Tab("Take away", id="take"):
        choices = [(title, kind) for kind, (title, _) in KINDS.items()]
        parts["what"] = gr.Radio(choices, value="png", label="What to take", elem_id="what")
        with gr.Row():
            parts["make"] = gr.Button("Prepare the file", variant="primary", elem_id="make", min_width=140)
            parts["make_stop"] = gr.Button("Stop", variant="stop", visible=False, min_width=80)
        parts["make_progress"] = gr.HTML("", js_on_load=None, elem_id="make_progress")
        parts["download"] = gr.DownloadButton("Download", visible=False, elem_id="download")
        parts["recipe"] = gr.File(
            label="Load an edits.yaml, or the zip with its masks", type="filepath", height=150, elem_id="recipe",
            file_types=[".zip", ".yaml", ".yml"],
        )  # fmt: skip
        parts["commands"] = gr.Textbox(
            "", label="The same on the command line", lines=4, interactive=False, buttons=["copy"], elem_id="commands"
        )


def wire(context: Context) -> None:
    """The events."""
    parts, hub = context.parts, context.hub
    free: dict[str, Any] = {"show_progress": "hidden", "concurrency_limit": None, "api_visibility": "private"}
    outputs = [parts[name] for name in ("make_progress", "download", "make_stop", "stage")]

    @guarded
    def make(what: str, request: gr.Request) -> Any:
        session = context.session(request)
        if what not in KINDS:
            raise InputError("Choose one of the listed things.")
        _ = session.scene
        yield {parts["download"]: gr.update(visible=False)}
        file = session.new_name("take", KINDS[what][1])
        if what == "edits":
            _pack_edits(session, file)
        else:
            steps, final = session.stack.active, session.final
            job = _asked(context, session, what, file)
            if job is not None:
                session.asked("take", job)
                for html in follow(hub.jobs, job):
                    yield {parts["make_progress"]: html, parts["make_stop"]: gr.update(visible=not job.over)}
                if job.state != "done":
                    return
            if what in ("png", "exr"):
                if job is not None:
                    final = session.final = Final(steps, session.final_file, SPP)
                assert final is not None
                shutil.copyfile(final.path.with_suffix(file.suffix), file)
        label = f"Download {file.name} ({file.stat().st_size / 1e6:.1f} MB)"
        yield {
            parts["download"]: gr.update(value=hub.handed(file), label=label, visible=True),
            parts["make_progress"]: box("Ready."),
            parts["stage"]: session.stage(),
        }

    @guarded
    def stop(request: gr.Request) -> None:
        context.session(request).stop(hub.jobs, "take")

    @guarded
    def load(file: str | None, request: gr.Request) -> dict[Any, Any]:
        session = context.session(request)
        if file is not None:
            session.read_edits(Path(file))
        return context.everything(session)

    parts["make"].click(make, parts["what"], outputs, **free)
    parts["make_stop"].click(stop, None, None, queue=False, show_progress="hidden", api_visibility="private")
    sent = parts["recipe"].upload(load, parts["recipe"], context.all_parts, **free)
    sent.failure(lambda: None, None, parts["recipe"], **free)  # what was refused is not there


def _asked(context: Context, session: Session, what: str, file: Path) -> Job | None:
    """The job that makes the file; None where the final picture is there already."""
    assert session.project is not None
    edits, jobs = session.edits_now(), context.hub.jobs
    scene = str(session.project.scene)
    if what in ("png", "exr"):
        final = session.final
        if final is not None and final.of(session.stack.active) and final.spp >= SPP:
            return None
        output = str(session.final_file)
        return jobs.submit("final", session.person, session.desk, scene=scene, edits=edits, output=output, spp=SPP)
    more: dict[str, Any] = {"frames": FRAMES, "spp": FRAME_SPP} if what == "turn" else {}
    return jobs.submit(
        "take", session.person, session.desk, scene=scene, edits=edits, output=str(file), what=what, **more
    )


def _pack_edits(session: Session, file: Path) -> None:
    """edits.yaml and every file it names."""
    if not session.write_edits():
        raise InputError("There is no edit to take away yet: change something first.")
    pack(session.stack.steps, session.desk / EDITS, file)


def commands(session: Session) -> str:
    """What to type for the same result; nothing where no photo is open.

    The photo is taken apart again only where its scene is not there any more.
    """
    project = session.project
    if project is None:
        return ""
    lines, scene = [f"cd {quote(str(project.folder))}"], quote(str(project.scene))
    if project.photo is not None:
        scene = project.scene.name
        words = ["materialist", "invert", project.photo.name, "-o", scene, *_options(session.scene.provenance)]
        lines.append(f"test -e {scene} || {join(words)}")
    if session.stack.active:
        lines.append(f"materialist apply {scene} {session.desk.name}/{EDITS} -o out.png --save edited.scene")
        scene = "edited.scene"
    else:
        lines.append(f"materialist render {scene} -o out.png")
    lines.append(f"materialist export {scene} --to glb -o out.glb")
    return "\n".join(lines)


def _options(made: dict[str, Any]) -> list[str]:
    """The options of an inversion that were not the usual ones, as `invert` takes them."""
    usual = signature(invert).parameters
    found: list[str] = []
    predictor = str(made.get("predictor", "")).split(" ")[0]  # behind it are the weights
    if predictor in {name for _, name in PREDICTORS}:
        found += ["--predictor", predictor]
    if made.get("fov_source") == "option":
        found += ["--fov", f"{made['fov']:.12g}"]
    for name in ("engine", "preset", "size", "tau", "strategy", "seed"):
        if name in made and made[name] != usual[name].default:
            found += [f"--{name}", str(made[name])]
    return found
