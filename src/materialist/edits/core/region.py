"""The region of an edit: a mask at working size that has been checked."""

import cv2
import numpy as np

from materialist.edits.core.renderer import EditRenderer
from materialist.errors import InputError
from materialist.geometry.silhouette import disc
from materialist.option_kinds import parse_numbers
from materialist.types import Array, Scene

HIDDEN = 0.5
"""Share of a mask, or of a pixel, from which it is hidden by a body (a definition)."""
PLACED = (
    "a thing that was put into the scene, or made glass, and edits reach only what the photo shows: put it there "
    "again as you want it"
)
DIMMED = "a light of the photo that an earlier step dimmed: edit it first, and dim afterwards"


def checked_region(scene: Scene, mask: Array) -> Array:
    """[H, W] float32 weight in [0, 1] of an edit, from a bool mask or soft weights; 0 where there is no surface.

    Raises InputError when the mask is of another size, has values outside [0, 1], is empty, or covers no surface.
    """
    mask = np.asarray(mask)
    shape = (scene.camera.height, scene.camera.width)
    if mask.shape != shape:
        raise InputError(
            f"The mask is {mask.shape}, the photo at working size {shape} (rows, columns); resize it."
        )
    # --- Weights: finite, in [0, 1], some of them on a surface ---
    weight = mask.astype(np.float32)
    if not (np.isfinite(weight).all() and weight.min() >= 0 and weight.max() <= 1):
        raise InputError(
            f"The mask has values from {weight.min():g} to {weight.max():g}; they must be 0 to 1, or bool."
        )
    if not weight.any():
        raise InputError("The mask is empty; mark at least one pixel.")
    weight = weight * (scene.depth > 0)
    if not weight.any():
        raise InputError(
            "The mask covers only sky, where the scene has no surface to edit; mark a surface."
        )
    # --- Edits act on what the photo shows, not on what covers it ---
    if scene.bodies and float((body_coverage(scene) * weight).sum()) > HIDDEN * float(weight.sum()):
        emitters = EditRenderer(scene).emitter_pixels(scene)
        obstacle = (
            DIMMED if float((emitters * weight).sum()) > HIDDEN * float(weight.sum()) else PLACED
        )
        raise InputError(f"What is marked is {obstacle}, or mark something else.")
    return weight


def reshaped(weight: Array, grow: float, feather: float) -> Array:
    """[H, W] weight of a region that is grown, or shrunk (grow < 0), and then feathered; shares of the longer side.

    Raises InputError when nothing is left of it.
    """
    longer = max(weight.shape)
    # Both lengths are shares of the longer side.
    if radius := round(abs(grow) * longer):
        weight = (cv2.dilate if grow > 0 else cv2.erode)(weight, disc(radius))
    if feather:
        weight = cv2.GaussianBlur(
            weight, (0, 0), feather * longer / 4
        )  # four standard deviations: nearly all of it
    if not weight.any():
        raise InputError(
            f"Shrunk by {-grow:g} of the longer side nothing is left of the region; shrink it less."
        )
    return np.asarray(weight)


def body_coverage(scene: Scene) -> Array:
    """[H, W] share of each pixel in which something is seen that was put into the scene, or made glass."""
    return EditRenderer(scene).body_coverage(scene)


def checked_pixel(scene: Scene, point: tuple[float, float], name: str = "click") -> tuple[int, int]:
    """(column, row) of a point (x, y) at working size. Raises InputError when it lies outside the picture."""
    width = scene.camera.width
    height = scene.camera.height
    x, y = parse_numbers(point, 2, name)
    if not (0 <= x < width and 0 <= y < height):
        rows, columns = scene.photo.original.shape[:2]
        small = f"{int(x * width / columns)},{int(y * height / rows)}"
        native = (
            f" In the file's own {columns} x {rows} pixels that point is {small} here: give this."
        )
        raise InputError(
            f"The {name} {x:g},{y:g} lies outside the photo, which is {width} x {height} pixels at working size."
            + native * (columns > width and 0 <= x < columns and 0 <= y < rows)
        )
    return int(x), int(y)
