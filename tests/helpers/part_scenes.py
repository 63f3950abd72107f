"""A thing of two materials: red cloth, part of it darker, on brown legs."""

from dataclasses import replace

import numpy as np
from edit_scenes import scene_of

from materialist.types import Camera

H, W = 90, 120
THING = np.zeros((H, W), bool)
THING[10:80, 20:100] = True
LEGS = np.zeros((H, W), bool)
LEGS[60:80, 20:100] = True
SHADE = np.zeros((H, W), bool)
SHADE[10:60, 70:100] = True
CLOTH = (60, 30)


def albedo(shade=0.6):
    """[H, W, 3] linear, with noise; grey beyond the thing."""
    rng = np.random.default_rng(2)
    colour = np.full((H, W, 3), 0.5)
    colour[THING] = (0.5, 0.1, 0.1)
    colour[SHADE] *= shade
    colour[LEGS] = (0.25, 0.18, 0.1)
    return (colour * rng.uniform(0.95, 1.05, (H, W, 1))).astype(np.float32)


def scene(colour=None):
    """A wall with this albedo."""
    colour = albedo() if colour is None else colour
    made = scene_of(
        Camera(W, H, 40.0),
        np.full((H, W), 2, np.float32),
        np.broadcast_to([0, 0, 1], (H, W, 3)),
        colour,
        completion="none",
    )
    return replace(made, materials=replace(made.materials, albedo=colour))
