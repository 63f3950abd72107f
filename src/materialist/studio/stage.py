"""What a page shows: the picture with its label, maps, a report, the list of edits, and jobs in words."""

from math import isfinite
from shlex import quote
from time import time
from typing import Any

from materialist.edits.recipe import Step
from materialist.errors import MaterialistError
from materialist.jobs.queue import Job
from materialist.studio.edit_list import EditList, is_shaded
from materialist.studio.live import glass, views
from materialist.studio.live.process import PreviewLost
from materialist.studio.selection import data_url
from materialist.studio.session import EDITS, Session
from materialist.studio.tasks import before_of
from materialist.types import Array

_EMPTY: dict[str, Any] = {
    "picture": "",
    "width": 0,
    "height": 0,
    "badge": "",
    "lamps": [],
    "waiting": False,
    "bad": False,
    "coarse": False,
}
"""What the page shows without a photo."""
_WORDS = {
    "start": "Starting",
    "read": "Reading the photo",
    "predict": "Guessing colours, shapes and depth",
    "geometry": "Building the surface",
    "trace": "Tracing light paths",
    "light": "Finding the light",
    "albedo": "Finding the materials",
    "materials": "Finding the materials",
    "rerender": "Rendering the result",
    "save": "Saving",
    "load": "Loading",
    "removal": "Filling what it hid",
    "shadow": "Taking its shadow away",
    "render": "Path tracing",
    "frames": "Path tracing the frames",
    "export": "Writing the file",
}


def stage(
    session: Session, *, with_edits: bool = True, coarse: bool = False, quiet: bool = False
) -> dict[str, Any]:
    """The picture as a data URL, the lamps, and what the picture is.

    Without edits it is the photo, at once. Where there are any, it has no picture until the preview is ready: the
    page keeps the one it shows, and asks again then. Where they cannot be applied it is the photo, with the
    reason on it. The glass of the current step is asked for; `waiting` says whether its picture is still to come. The
    page ignores a picture with an older `serial` than the one it shows. `before` is the photo, shown while a key is
    held; empty where `picture` is the photo itself, which the page keeps for live previews (None). At rest the page
    asks for the full picture after a `coarse` one. A `quiet` one is none at all: the page has drawn the change itself.
    """
    # Pictures may arrive out of order: the page keeps the newest.
    serial = time()
    with session.lock:
        live = session.live
        edits = session.edits
        final = session.final
        # Taken together under the lock; the picture is made without it.
        client = session.glass
    shown = {**_EMPTY, "serial": serial, "before": None}
    if live is None:
        return shown
    camera = live.scene.camera
    steps = edits.active if with_edits else ()
    shown |= {"width": camera.width, "height": camera.height, "lamps": _lamps(edits)}
    current = edits.current_step
    off = "; the current edit is switched off" if current is not None and current.skipped else ""
    # --- A path-traced picture of just these edits ---
    if final is not None and final.of(steps):
        badge = f"Path traced{off}"
        picture, before = (
            data_url(file.read_bytes())
            for file in (final.path.with_suffix(".jpg"), before_of(final.path))
        )
        return {**shown, "picture": picture, "before": before, "badge": badge}
    # --- Glass is asked for while everything else is shown ---
    if current is not None and client is not None and current in steps and glass.is_traced(current):
        client.ask(steps, current)
    waiting = client is not None and with_edits and client.state.waiting
    # --- The live preview: not there yet, refused, or shown ---
    if steps and not live.ready:
        del shown["picture"]
        return {**shown, "badge": "Getting the live preview ready …"}
    badge = _badge(steps, client, waiting) + off
    shown |= {"before": None if steps else "", "badge": badge, "waiting": waiting}
    if quiet:
        del shown["picture"]
        return {**shown, "coarse": True}
    if not steps:
        return {**shown, "picture": jpeg_url(live.scene.photo.linear), "coarse": coarse}
    panes = {} if client is None else client.panes(steps)
    try:
        made = live.call(views.picture, steps=steps, panes=panes, coarse=coarse)
    except MaterialistError as error:
        photo = jpeg_url(live.scene.photo.linear)
        why = session.without_folders(str(error))
        # Edits are not to blame where the process has ended.
        mend = (
            ""
            if isinstance(error, PreviewLost)
            else " Switch off, or remove, what cannot be applied."
        )
        badge = f"The photo without its edits: {why}{mend}"
        return {
            **shown,
            "picture": photo,
            "before": "",
            "badge": badge,
            "waiting": False,
            "bad": True,
        }
    return {**shown, "picture": data_url(made), "coarse": coarse}


def _lamps(edits: EditList) -> list[list[float]]:
    """(x, y) of the lamps, for their marks; none where they are not readable, which the picture tells."""
    place = edits.light
    lamps = edits.steps[place].options.get("lamps", []) if place is not None else []
    try:
        places = [[float(v) for v in lamp[:2]] for lamp in lamps if isinstance(lamp, list)]
    except (TypeError, ValueError):
        return []
    # JSON has no NaN.
    return [marked for marked in places if all(map(isfinite, marked))]


def _badge(steps: tuple[Step, ...], client: glass.GlassClient | None, waiting: bool) -> str:
    """The label of a picture that is not path traced: its kind, and its omissions."""
    # What the picture lacks is said on it.
    panes = [step for step in steps if glass.is_traced(step)]
    sketched = (
        "; objects are sketched"
        if any(not is_shaded(step) and step not in panes for step in steps)
        else ""
    )
    if not steps:
        return "Photo"
    if waiting:
        return "Glass: tracing …" + sketched
    if panes and client and all(client.pane(step) for step in panes):
        if all(client.fresh(steps, step) for step in panes):
            return f"Glass traced; shadow and caustics in the final picture{sketched}"
        return f"Live preview; click the glass in the list to trace it anew{sketched}"
    if panes or sketched:
        return "Sketch: path tracing shows the rest"
    if any("lamps" in step.options for step in steps):
        return "Live preview: shadows of lamps show in the final picture"
    return "Live preview"


def jpeg_url(linear: Array) -> str:
    """A linear picture [H, W, 3] as a data URL."""
    return data_url(views.encoded(linear))


def failure_message(job: Job) -> str:
    """The reason of a failure; it names the photo by its title."""
    # The path on this machine is nothing for a page.
    photo = job.arguments.get("photo")
    return job.message.replace(str(photo), job.arguments["title"]) if photo else job.message


def words(stage: str) -> str:
    """A stage in words; names such as `light 2` or `materials: albedo` go by their first word."""
    return _WORDS.get(stage) or _WORDS.get(
        stage.replace(":", " ").partition(" ")[0], stage.capitalize()
    )


def commands(session: Session) -> str:
    """The commands that give the same result; nothing where no photo is open."""
    project = session.project
    if project is None:
        return ""
    # Whoever has no command line here gets the names alone.
    place = str if session.local else session.without_folders
    lines = [f"cd {quote(place(str(project.folder)))}"]
    scene = quote(place(str(project.scene)))
    if session.edits.active:
        lines.append(
            f"materialist apply {scene} {session.workspace.name}/{EDITS} -o out.png --save edited.scene"
        )
        scene = "edited.scene"
    else:
        lines.append(f"materialist render {scene} -o out.png")
    lines.append(f"materialist export {scene} --to glb -o out.glb")
    return "\n".join(lines)
