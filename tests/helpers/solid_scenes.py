"""Bodies of revolution that stand on a ground, and what a camera sees of them."""

import itertools

import numpy as np
import trimesh

from materialist.camera import pixel_rays
from materialist.solids.revolution import Axis
from materialist.types import Camera
from materialist_lab.bench.glass_scenes import SeenSide, seen
from materialist_lab.procedural.objects import shapes

CAMERA = Camera(120, 110, 40.0)
RAYS = pixel_rays(CAMERA).astype(float)
TILT = 0.25
UP = np.array([0, np.cos(TILT), np.sin(TILT)])
FOOT = np.array([0.1, -0.4, -3.0])
AXIS = Axis(UP, FOOT)
_FALLING = RAYS @ UP
GROUND = np.where(_FALLING < -1e-3, (FOOT @ UP) / np.where(_FALLING < -1e-3, _FALLING, -1), 0)
"""[H, W] planar depth of the plane through FOOT across UP."""


def standing(solid: shapes.Solid) -> shapes.Solid:
    """A body with its foot at the origin, on FOOT along UP."""
    right = np.array([1.0, 0, 0])
    frame = np.stack(
        [right, UP, np.cross(right, UP)]
    )  # rows: the body's x, y, z in the camera's frame
    return shapes.Solid(solid.vertices @ frame + FOOT, solid.faces, solid.normals @ frame, solid.uv)


def turned(corners) -> shapes.Solid:
    """The body of revolution of a profile [[radius, height], ...], standing."""
    return standing(shapes.lathe(np.asarray(corners, float), 256))


def lines(*corners):
    """A profile along straight lines, with points enough for sharp edges."""
    step = np.linspace(0.001, 0.999, 60)[:, None]
    return np.concatenate(
        [a + step * (np.asarray(b) - a) for a, b in itertools.pairwise(map(np.asarray, corners))]
    )


def arc(centre, radius, first=-90, last=90, count=90):
    """A profile along part of a circle, degrees."""
    angle = np.radians(np.linspace(first, last, count))
    return np.stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)], -1)


def view(solid, camera: Camera = CAMERA) -> tuple[SeenSide, np.ndarray]:
    """What is seen, and the mask."""
    front = seen(solid, camera)
    return front, front.depth > 0


def volume(shell) -> float:
    """Of a closed surface."""
    return float(trimesh.Trimesh(shell.vertices, shell.faces, process=False).volume)


def box() -> shapes.Solid:
    """A box standing on FOOT, turned a little."""
    solid = shapes.placed(shapes.box(np.array([0.6, 0.7, 0.5])), turn=0.35)
    return standing(
        shapes.Solid(
            solid.vertices - [0, solid.vertices[:, 1].min(), 0],
            solid.faces,
            solid.normals,
            solid.uv,
        )
    )
