"""Where meshes that fell come to rest: one picture instead of a film (paper, Physical Simulation)."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from materialist.camera import project
from materialist.edits.drop.drop import Falling, moves, prepared
from materialist.edits.drop.physics import Pose, fall
from materialist.edits.insert.meshes import MeshModel
from materialist.errors import InputError
from materialist.options import Drop
from materialist.types import Body, Scene

LONGEST = 20.0
"""Seconds after which a thing that still rolls is left where it is."""
LOOKS = 24
"""Looks at the things a second."""
STILL = 12
"""Looks in a row without motion after which things are at rest."""


def settle(
    scene: Scene, meshes: Sequence[str | Path | MeshModel], at: tuple[float, float] | Sequence[tuple[float, float]],
    options: Drop | None = None, **values: Any,
) -> Scene:  # fmt: skip
    """The scene with meshes that fell onto the surface under a pixel and lie where they came to rest.

    Everything is as in `drop.drop`, of which this is the last frame, however long that takes: things are at rest
    when nothing has moved for half a second. What falls beside everything the photo shows is left out, and what
    still rolls after 20 seconds stays where it is then; warnings tell of both, and of things that lie out of view.

    Raises:
        InputError: a place or mesh that cannot be used, a number out of its range, or nothing comes to rest in sight.
        SetupError: mujoco or coacd is missing.
    """
    falling = prepared(scene, meshes, at, Drop.given(options, **values))
    poses, gone, rests = _rested(falling)
    names = falling.what["meshes"]
    if len(gone) == len(names):
        raise InputError(
            f"{', '.join(names)} falls beside everything that the photo shows; choose a place further from the edge of "
            "the surface, a smaller height, or another seed."
        )
    notes = [f"{names[k]} falls beside everything that the photo shows, and was left out." for k in sorted(gone)]
    if not rests:
        notes.append(f"After {LONGEST:g} seconds not everything that fell is at rest; it stays where it is then.")
    edited = falling.at(poses, tuple(notes), gone)
    if not any(_in_view(scene, body) for body in edited.bodies[len(scene.bodies) :]):
        return falling.at(poses, (*notes, "What fell came to rest where the camera does not look."), gone)
    return edited


def _rested(falling: Falling) -> tuple[list[Pose], frozenset[int], bool]:
    """(the last poses, numbers of the things that fell out of the scene, whether the rest lies still)."""
    bottom = min((float(block[:, 2].min()) for block in falling.ground), default=-np.inf)
    recent: deque[list[Pose]] = deque(maxlen=STILL + 1)
    gone: frozenset[int] = frozenset()
    for poses in fall(falling.things, falling.ground, frames=round(LONGEST * LOOKS) + 1, fps=LOOKS):
        gone = frozenset(k for k, pose in enumerate(poses) if pose.centre[2] < bottom)
        recent.append([pose for k, pose in enumerate(poses) if k not in gone])
        # A thing at the top of its flight is slow, too, but not for half a second.
        if not recent[-1] or (len(recent) > STILL and _still(list(recent), falling.what["metres"])):
            return poses, gone, True
    return poses, gone, False


def _in_view(scene: Scene, body: Body) -> bool:
    place, depth = project(body.vertices, scene.camera)
    return bool(((depth > 0) & (place > 0).all(-1) & (place < (scene.camera.width, scene.camera.height)).all(-1)).any())


def _still(recent: list[list[Pose]], metres: float) -> bool:
    return all(len(look) == len(recent[-1]) and not moves(look, recent[-1], metres) for look in recent[:-1])
