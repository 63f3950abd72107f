"""Regions by click, box or mask (paper, Opaque Material Editing: one object, chosen by the user)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from materialist.edits.core.region import HIDDEN, PLACED, body_coverage, checked_pixel, checked_region
from materialist.edits.select.objects import likely
from materialist.errors import InputError
from materialist.types import Array, Scene

METHODS = ("network", "grabcut", "sam2")
_SIZE = 256
"""Longer side at which an object is looked for; the border is then refined at working size."""


def select(
    scene: Scene,
    *,
    click: Sequence[float] | Sequence[Sequence[float]] | None = None,
    box: Sequence[float] | None = None,
    mask: Array | str | Path | None = None,
    method: str = "network",
    device: str = "auto",
) -> Array:
    """[H, W] bool mask at working size of the object at a click, in a box, or in a rough mask.

    Args:
        click: (x, y) at working size, or several, all of them on the object.
        box: (x0, y0, x1, y1) around the object.
        mask: [H, W] bool, or a file of the photo's shape; taken as it is.
        method: `network` (colour, depth, normals, and ClickNet), `grabcut` (without ClickNet) or `sam2` (needs its
            weights).
        device: `auto`, `cpu` or `cuda`, for `sam2`.

    Raises:
        InputError: none or several of click, box and mask; a click or box outside the photo or on the sky; an empty
            mask or one of another shape. SetupError, WeightsError: a method without its library or weights.
    """
    if sum(v is not None for v in (click, box, mask)) != 1:
        raise InputError("Give exactly one of a click, a box or a mask.")
    if method not in METHODS:
        raise InputError(f"The method is '{method}'; choose one of {', '.join(METHODS)}.")
    if mask is not None:
        return _given(scene, mask)
    points = [] if click is None else _points(scene, click)
    frame = None if box is None else _box(scene, box)
    if method == "sam2":
        from materialist.edits.select.sam import segment

        found = segment(scene.photo.linear, points, frame, device=device)
    elif frame is not None:
        from materialist.edits.select.boxes import in_box

        found = in_box(scene, frame, network=method == "network")
    elif method == "network":
        found = from_clicks(scene, points, likely(scene, points))
    else:
        found = from_clicks(scene, points)
    found = found & (scene.depth > 0)
    if not found.any():
        other = "draw the box a little larger" if frame is not None else "click another place on the object"
        raise InputError(f"Nothing was found there; {other}, or give a mask.")
    return found


def from_clicks(scene: Scene, points: Sequence[tuple[int, int]], share: Array | None = None) -> Array:
    """[H, W] bool of the object that all (column, row) points lie on; `share` [H, W]: what is `likely`."""
    import cv2

    from materialist.edits.select.objects import object_around
    from materialist.edits.select.refine import refined

    small, scale = _smaller(scene)
    # Rounded sides may be half a pixel short.
    seeds = [(min(int(x * scale), small.shape[1] - 1), min(int(y * scale), small.shape[0] - 1)) for x, y in points]
    shrunk = None if share is None else np.asarray(cv2.resize(share, small.shape[::-1], interpolation=cv2.INTER_AREA))
    rough = object_around(small, seeds, shrunk)
    return refined(scene, _larger(rough, scene), points, share)


class Features:
    """What tells surfaces apart, [H, W, ...] at one size: Lab colour, log depth, normals."""

    def __init__(self, linear: Array, depth: Array, normal: Array):
        import cv2

        from materialist.color import linear_to_srgb

        self.lab = cv2.cvtColor(linear_to_srgb(linear), cv2.COLOR_RGB2LAB)  # L in [0, 100]
        self.depth, self.normal, self.surface = depth, normal, depth > 0
        self.shape = depth.shape


def _smaller(scene: Scene) -> tuple[Features, float]:
    import cv2

    height, width = scene.depth.shape
    scale = min(1.0, _SIZE / max(height, width))
    size = (max(2, round(width * scale)), max(2, round(height * scale)))
    shrink = lambda v, how: np.array(cv2.resize(np.ascontiguousarray(v, np.float32), size, interpolation=how))  # noqa: E731
    normal = shrink(scene.normal, cv2.INTER_AREA)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-6)
    depth = shrink(scene.depth, cv2.INTER_NEAREST)
    return Features(shrink(scene.photo.linear, cv2.INTER_AREA), depth, normal), scale


def _larger(mask: Array, scene: Scene) -> Array:
    import cv2

    height, width = scene.depth.shape
    return np.asarray(cv2.resize(mask.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)) > 0.5


def _given(scene: Scene, mask: Array | str | Path) -> Array:
    if isinstance(mask, str | Path):
        from materialist.io.image import read_mask

        mask = read_mask(mask, scene.depth.shape, scene.photo.original.shape[:2])
    return checked_region(scene, mask) > 0.5


def _points(scene: Scene, click) -> list[tuple[int, int]]:
    """One click or several as (column, row), each on a surface."""
    try:
        single = len(click) == 2 and all(np.isscalar(v) for v in click)
    except TypeError as error:
        raise InputError(f"The click must be (x, y), or a list of such, not {click!r}.") from error
    points = [checked_pixel(scene, point) for point in ([click] if single else click)]
    if not points:
        raise InputError("The list of clicks is empty; give one pixel of the object.")
    for x, y in points:
        if scene.depth[y, x] <= 0:
            raise InputError(f"The click {x},{y} is on the sky, where there is no surface; click on an object.")
        if scene.bodies and body_coverage(scene)[y, x] > HIDDEN:
            raise InputError(f"The click {x},{y} is on {PLACED}, or click on something else.")
    return points


def _box(scene: Scene, box) -> tuple[int, int, int, int]:
    try:
        x0, y0, x1, y1 = (float(v) for v in box)
    except (TypeError, ValueError) as error:
        raise InputError(f"The box must be (x0, y0, x1, y1), not {box!r}.") from error
    width, height = scene.camera.width, scene.camera.height
    left, right, top, bottom = (
        max(0.0, min(x0, x1)),
        min(width, max(x0, x1)),
        max(0.0, min(y0, y1)),
        min(height, max(y0, y1)),
    )
    if not (right - left >= 3 and bottom - top >= 3):
        raise InputError(
            f"The box {x0:g},{y0:g},{x1:g},{y1:g} covers less than 3 x 3 pixels of the photo ({width} x {height})."
        )
    if right - left >= width and bottom - top >= height:
        raise InputError("The box is the whole photo; leave some background around the object.")
    return int(left), int(top), int(right), int(bottom)
