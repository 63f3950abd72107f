"""What a page of the darkroom shows, as one JSON object, and the outline of a region."""

import threading
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from materialist import __version__
from materialist.color import srgb_levels
from materialist.darkroom.desk import Desk
from materialist.edits.light import presets
from materialist.edits.registry import OPERATIONS
from materialist.errors import InputError
from materialist.io import display
from materialist.io.decode import SUFFIXES
from materialist.io.photo import EXAMPLES, example_path
from materialist.option_kinds import declarations
from materialist.options import InvertOptions
from materialist.studio import SETTINGS, drawn, objects, uploads
from materialist.studio.edit_list import step_summary
from materialist.studio.reporting import is_traced
from materialist.studio.selection import Selection
from materialist.studio.stage import commands, stage
from materialist.studio.studio import PREDICTORS, Studio
from materialist.studio.tasks import kinds_here
from materialist.studio.workspace import Project
from materialist.types import Array, Scene

SIZES = (256, 384, 512, 768, 1024)
"""Working sizes that the page offers, pixels of the longer side."""
SHOWN_SIDE = 2048
"""Longest side of the photo as the page shows it, pixels."""
_ENCODING = threading.Lock()
"""Held while a photo is encoded at its own resolution, which takes up to a gigabyte."""


def state(
    desk: Desk, *, with_edits: bool = True, coarse: bool = False, quiet: bool = False
) -> dict[str, Any]:
    """Everything that the page shows but jobs, whose progress comes by the channel.

    with_edits: False gives the photo at once, while the preview is still being built. quiet: without a picture.
    """
    session = desk.session
    revision = desk.revision
    shown = stage(session, with_edits=with_edits, coarse=coarse, quiet=quiet)
    with session.lock:
        edits = session.edits
        selection = session.selection
        undo, redo = session.can_undo
        outlined, fitted = _of_selection(desk, selection)
        return {
            "revision": revision,
            "project": project_facts(session.project),
            "expected": project_facts(desk.expected),
            # A page that has not got the edits yet asks again when there is a preview.
            "ready": with_edits and session.live is not None and session.live.ready,
            "traced": session.live is not None and is_traced(session.live.scene),
            "original": _original(desk),
            "stage": {**shown, "region": outlined, "clicked": selection.clicked is not None},
            "drawn": drawn.keys(session),
            "steps": [
                {
                    "text": step_summary(step),
                    "kind": step.kind,
                    "on": not step.skipped,
                    "options": step.options,
                }
                for step in edits.steps
            ],
            "current": edits.current,
            "light": edits.light,
            "fitted": fitted,
            "undo": undo,
            "redo": redo,
            "object": session.next_object,
            "commands": commands(session),
        }


def project_facts(project: Project | None) -> dict[str, Any] | None:
    """What a page shows of a project; None for none."""
    return None if project is None else {"name": project.name, "title": project.title}


def _original(desk: Desk) -> list[int] | None:
    """[width, height] of the open photo as it was taken."""
    live = desk.session.live
    if live is None:
        return None
    height, width = live.scene.photo.original.shape[:2]
    return [width, height]


def _of_selection(desk: Desk, selection: Selection) -> tuple[str, dict[str, Any] | None]:
    """Outline of a selection, and what was found under it: made once, as a slider asks for them with every picture."""
    scene = None if desk.session.live is None else desk.session.live.scene
    made = desk.selected
    if made is None or made[0] is not selection or made[1] is not scene:
        mask = selection.mask
        made = desk.selected = (selection, scene, outline(mask), _fitted(scene, mask))
    return made[2], made[3]


def _fitted(scene: Scene | None, mask: Array | None) -> dict[str, Any] | None:
    """What was found under a selection: its mean roughness and metallic, and its colour as #rrggbb."""
    if scene is None or mask is None:
        return None
    materials = scene.materials
    colour = srgb_levels(materials.albedo[mask].mean(0)[None])
    return {
        "roughness": round(float(materials.roughness[mask].mean()), 2),
        "metallic": round(float(materials.metallic[mask].mean()), 2),
        "colour": "#" + colour.tobytes().hex(),
    }


def outline(mask: Array | None) -> str:
    """The borders of a region [H, W] bool as the data of an SVG path in working pixels; empty for none."""
    if mask is None:
        return ""
    # At three times the size and blurred, borders run between pixels instead of around them.
    scale = 3
    large = cv2.resize(
        mask.astype(np.float32), None, fx=scale, fy=scale, interpolation=cv2.INTER_LINEAR
    )
    smooth = cv2.GaussianBlur(large, (0, 0), scale * 0.6, borderType=cv2.BORDER_REPLICATE)
    inside = (smooth > 0.5).astype(np.uint8)
    borders, _ = cv2.findContours(inside, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    # Each border as a path, its points where straight lines miss it by < 0.7 / 3 pixels.
    parts = []
    for border in borders:
        points = cv2.approxPolyDP(border, 0.7, True)[:, 0]
        if len(points) > 2:
            places = ((points + 0.5) / scale).round(1).tolist()
            parts.append("M" + "L".join(f"{x:g} {y:g}" for x, y in places) + "Z")
    return "".join(parts)


def about(studio: Studio, person: str) -> dict[str, Any]:
    """What does not change while a page is open: ranges of options, and what there is to choose from."""
    return {
        "version": __version__,
        "options": {kind: _ranges(kind) for kind in OPERATIONS},
        "examples": _examples(studio),
        "sizes": SIZES,
        "predictors": PREDICTORS,
        "fov": declarations(InvertOptions)["fov"][1],
        "lights": [*presets.LIGHTS],
        "objects": objects.LIBRARY,
        "takes": [[kind, title] for kind, (title, _) in kinds_here().items()],
        "megabytes": SETTINGS.upload_megabytes,
        "photos": sorted(SUFFIXES),
        "meshes": uploads.MESHES,
        "lamp_share": SETTINGS.lamp_share,
        "person": person,
    }


def _examples(studio: Studio) -> list[list[str]]:
    """[name, title, credit] of the photos that are offered: that of the command line first."""
    start = studio.start
    first = [["start", start.name, ""]] if isinstance(start, Path) else []
    return first + [[name, name.capitalize(), credit] for name, (_, credit) in EXAMPLES.items()]


def _ranges(kind: str) -> dict[str, dict[str, Any]]:
    """Name of an option -> its default, and its range where it has one."""
    ranges: dict[str, dict[str, Any]] = {}
    for name, (declared, default) in declarations(OPERATIONS[kind].options).items():
        facts: dict[str, Any] = {"default": default, "help": declared.help}
        if np.isfinite(declared.low):
            facts["low"] = declared.low
        if np.isfinite(declared.high):
            facts["high"] = declared.high
        ranges[name] = facts
    return ranges


def settable(kind: str) -> set[str]:
    """Options of an edit that a request may set by a value: no files, and no models."""
    plain = ("number", "shift", "colour", "switch", "word", "span", "numbers", "paint")
    return {
        name
        for name, (declared, _) in declarations(OPERATIONS[kind].options).items()
        if declared.kind in plain and declared.written
    }


@lru_cache(8)
def photo_jpeg(path: str, changed: float, longest: int) -> bytes:
    """The photo of a scene package as a JPEG of at most `longest` pixels a side, as the file at `path` has it.

    changed: when the file was written; another time makes the picture anew.
    """
    picture = cv2.imread(path, cv2.IMREAD_COLOR_RGB)
    if picture is None:
        raise InputError("That picture has no thumbnail.")
    return display.encoded(display.shrunk(picture, longest), "JPEG", quality=92)


def native_jpeg(desk: Desk, longest: int = SHOWN_SIDE, quality: int = 93) -> bytes:
    """The open photo at its own resolution, up to `longest` pixels a side, as a JPEG: made once."""
    live = desk.session.preview
    with _ENCODING:
        key = (longest, quality)
        if key not in live.photos:
            photo = display.shrunk(live.scene.photo.original, longest)
            live.photos[key] = display.encoded(srgb_levels(photo), "JPEG", quality=quality)
        return live.photos[key]


def working_jpeg(desk: Desk) -> bytes:
    """The open photo at working size, encoded as its edits are: where nothing was changed the two are equal."""
    photo = srgb_levels(desk.session.scene.photo.linear)
    return display.encoded(photo, "JPEG", quality=SETTINGS.jpeg_quality)


@cache
def light_jpeg(name: str) -> bytes:
    """A computed environment as a small picture. Raises InputError for another name."""
    if name not in presets.LIGHTS:
        raise InputError(f"There is no light {name!r}.")
    return display.encoded(display.light(presets.preset_light(name, 64)), "JPEG", quality=88)


def example_file(studio: Studio, name: str) -> Path:
    """The photo of an example, or that of the command line. Raises InputError for another name."""
    if name == "start" and isinstance(studio.start, Path):
        return studio.start
    if name not in EXAMPLES:
        raise InputError(f"There is no example {name!r}; choose one of the list.")
    return example_path(name)
