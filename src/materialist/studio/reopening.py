"""A click on what was edited before opens its edit."""

from typing import Any

import numpy as np

from materialist.camera import project
from materialist.edits.core.operation import Target
from materialist.edits.recipe import Step, region_of
from materialist.errors import MaterialistError
from materialist.studio.live.preview import LivePreview
from materialist.types import Array, Body


def edit_at(
    live: LivePreview, listed: tuple[Step, ...], current: int | None, column: int, row: int
) -> int | None:
    """The place in the list of the edit that a click at a pixel means; None for none, and for the current one.

    What stands in front comes first: objects, then regions, each the latest first. A second click on the thing of the
    current edit selects as ever. It is a call of `studio.live.process`.
    """
    candidates: list[tuple[bool, int]] = []
    for index, step in enumerate(listed):
        if step.skipped:
            continue
        try:
            if step.operation.target is Target.PLACE:
                if _stands_at(live, listed[: index + 1], column, row):
                    candidates.append((True, index))
            elif (
                step.operation.target is Target.REGION and region_of(live.scene, step)[row, column]
            ):
                candidates.append((False, index))
        except MaterialistError:
            continue  # what cannot be applied is told by the picture
    if not candidates or max(candidates)[1] == current:
        return None
    return max(candidates)[1]


def _stands_at(live: LivePreview, steps: tuple[Step, ...], column: int, row: int) -> bool:
    """Whether an object, the last of some steps, is seen at a pixel."""
    before: tuple[Step, ...] = tuple(step for step in steps[:-1] if not step.skipped)
    known = {id(body) for body in live.edited(before).bodies}
    added = [body for body in live.edited((*before, steps[-1])).bodies if id(body) not in known]
    return any(_covers(body, live.scene.camera, column + 0.5, row + 0.5) for body in added)


def _covers(body: Body, camera: Any, x: float, y: float) -> bool:
    """Whether a triangle of a body lies over a place of the picture."""
    pixels, away = project(body.vertices, camera)
    corners = pixels[body.faces]  # [F, 3, 2]
    place = np.array([x, y])
    sides = [_side(corners[:, k], corners[:, (k + 1) % 3], place) for k in range(3)]
    inside = np.all(np.stack(sides) >= 0, 0) | np.all(np.stack(sides) <= 0, 0)
    return bool((inside & (away[body.faces] > 0).all(1)).any())


def _side(a: Array, b: Array, place: Array) -> Array:
    """[F] on which side of the lines from a to b [F, 2] a place lies, as a signed area."""
    edge = b - a
    to = place - a
    return edge[:, 0] * to[:, 1] - edge[:, 1] * to[:, 0]
