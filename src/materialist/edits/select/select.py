"""Regions by click, box or mask (paper, Opaque Material Editing: one object, chosen by the user)."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from materialist.edits.core.region import (
    HIDDEN,
    PLACED,
    body_coverage,
    checked_pixel,
    checked_region,
)
from materialist.edits.select.material import of_material, part_at
from materialist.edits.select.objects import (
    EXTENTS,
    SETTINGS,
    box_overlap,
    object_at_points,
    object_in,
)
from materialist.edits.select.parts import without
from materialist.errors import InputError
from materialist.forks import check_process
from materialist.geometry.silhouette import window
from materialist.io.image import read_mask
from materialist.option_kinds import parse_numbers, several
from materialist.predict.clicks.features import Box
from materialist.spelling import spelled
from materialist.types import Array, Scene

METHODS = ("network", "grabcut")
FORMER = {"sam2": "network"}
"""Names of recipes of before: SAM 2, whose weights nobody had, and which selects no better on photos."""


@spelled
def select(
    scene: Scene,
    *,
    click: Sequence[float] | Sequence[Sequence[float]] | None = None,
    box: Sequence[float] | None = None,
    mask: Array | str | Path | None = None,
    method: str = "network",
    extent: str = "auto",
    same_material: bool = False,
    exclude: Sequence[float] | Sequence[Sequence[float]] | None = None,
    sharpen: bool = True,
    device: str = "auto",
) -> Array:
    """[H, W] bool mask at working size of the object at a click, in a box, or the given mask, checked.

    Args:
        click: (x, y) at working size, or several, all of them on the object. box: (x0, y0, x1, y1) around the object.
        mask: [H, W] bool, or a file of the photo's shape; taken as it is.
        extent: of the object at a click: `auto`, or `small`, `medium` or `large`, the part, the thing or the group that
            the network sees there.
        same_material: of the object at the clicks only what has the material of one of them: cloth without legs. It
            goes by colour: grey paint and grey glass are alike.
        exclude: (x, y), or several, of what is taken away again: the smallest part there, or what is of one colour.
        sharpen: look at the object that the network finds once more, at it alone, which takes a second: its border is
            sharper.
        method: `network` (MobileSAM and ClickNet) or `grabcut` (by colours alone); `sam2` is `network`.
        device: of no effect; both run on the processor.

    Raises InputError for none or several of click, box and mask; a click or box outside the photo or on the sky; an
    empty mask or one of another shape. SetupError, WeightsError: a method without its library or weights.
    """
    # --- Exactly one way to say what is meant; a mask is taken as it is ---
    check_process()
    if sum(v is not None for v in (click, box, mask)) != 1:
        raise InputError("Give exactly one of a click, a box or a mask.")
    method = FORMER.get(str(method), method)
    if method not in METHODS:
        raise InputError(f"The method is '{method}'; choose one of {', '.join(METHODS)}.")
    if extent not in EXTENTS:
        raise InputError(f"The extent is '{extent}'; choose one of {', '.join(EXTENTS)}.")
    if extent != "auto" and (click is None or method != "network"):
        raise InputError("An extent is of a click that the network answers; leave it out.")
    if same_material and click is None:
        raise InputError("The same material is that of a click; give one, or leave it out.")
    if isinstance(mask, str | Path):
        mask = read_mask(mask, scene.depth.shape, scene.photo.original.shape[:2])
    # --- The object, by the chosen method ---
    network = method == "network"
    taken = () if exclude is None else several(exclude)
    unwanted = [checked_pixel(scene, point, "excluded pixel") for point in taken]
    if mask is not None:
        return _reduced(scene, checked_region(scene, mask) > 0.5, unwanted, network=network)
    points = [] if click is None else _points(scene, click)
    frame = None if box is None else _box(scene, box)
    if frame is not None:
        if method == "grabcut":
            _check_background(scene, frame)
        region = object_in(scene, frame, network=network, sharpen=sharpen)
    else:
        region = object_at_points(scene, points, network=network, extent=extent, sharpen=sharpen)
    # --- Refused where it is empty, or does not fit the box ---
    region = region & (scene.depth > 0)
    if not region.any():
        other = (
            "draw the box a little larger"
            if frame is not None
            else "click another place on the object"
        )
        raise InputError(f"Nothing was found there; {other}, or give a mask.")
    if frame is not None and box_overlap(region, frame) < SETTINGS.min_box_overlap:
        rows, columns = window(region)
        raise InputError(
            f"What is found in the box {','.join(map(str, frame))} lies in a small part of it, "
            f"{columns.start},{rows.start},{columns.stop},{rows.stop}; give that box if it is meant, "
            "else one that fits the object, or click the object."
        )
    # --- The part of it that is meant ---
    if same_material:
        region = of_material(scene, region, points, network=network)
    return _reduced(scene, region, unwanted, points, network=network)


def _reduced(
    scene: Scene,
    region: Array,
    unwanted: Sequence[tuple[int, int]],
    points: Sequence[tuple[int, int]] = (),
    *,
    network: bool,
) -> Array:
    """[H, W] bool: a region without what is at the unwanted (column, row) points; what is at `points` stays."""
    for x, y in unwanted:
        if not region[y, x]:
            raise InputError(
                f"{x},{y} is not selected, so nothing is taken away there; leave it out."
            )
    for x, y in unwanted:
        # One of them may have taken another with it.
        if not region[y, x]:
            continue
        part = part_at(scene, region, (x, y)) if network else None
        rest = without(scene.materials.albedo, region, (x, y), part, points)
        if rest is None:
            raise InputError(
                f"What is at {x},{y} is most of the selection, or holds one of its clicks; click another place of "
                "what is not meant, or give a mask."
            )
        region = rest
    return region


def _points(scene: Scene, click) -> list[tuple[int, int]]:
    """One click or several as (column, row), each on a surface."""
    points = [checked_pixel(scene, point) for point in several(click)]
    if not points:
        raise InputError("The list of clicks is empty; give one pixel of the object.")
    hidden = body_coverage(scene) > HIDDEN if scene.bodies else np.zeros(scene.depth.shape, bool)
    for x, y in points:
        if scene.depth[y, x] <= 0:
            raise InputError(
                f"The click {x},{y} is on the sky, where there is no surface; click on an object."
            )
        if hidden[y, x]:
            raise InputError(f"The click {x},{y} is on {PLACED}, or click on something else.")
    return points


def _box(scene: Scene, box: Sequence[float]) -> Box:
    x0, y0, x1, y1 = parse_numbers(box, 4, "box")
    width = scene.camera.width
    height = scene.camera.height
    left, right = np.clip(sorted((x0, x1)), 0, width)
    top, bottom = np.clip(sorted((y0, y1)), 0, height)
    if not (right - left >= 3 and bottom - top >= 3):
        raise InputError(
            f"The box {x0:g},{y0:g},{x1:g},{y1:g} covers less than 3 x 3 pixels of the photo ({width} x {height})."
        )
    return int(left), int(top), int(right), int(bottom)


def _check_background(scene: Scene, box: Box) -> None:
    """Raise InputError for the whole photo: GrabCut needs to see what is not of the object."""
    if box == (0, 0, scene.camera.width, scene.camera.height):
        raise InputError("The box is the whole photo; leave some background around the object.")
