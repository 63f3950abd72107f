"""The project's environment map in Mitsuba's terms."""

import numpy as np

from materialist.envmap import row_solid_angle
from materialist.errors import InputError
from materialist.types import Array

PEAKED = 3.0
"""Mean squared over squared mean luminance of a map from which its light counts as hard."""


def on_mitsuba_grid(envmap, xp):
    """The data of Mitsuba's `envmap` emitter [2h + 1, 2h + 2, 3] for a map [h, 2h, 3]; `xp` is numpy or torch.

    Mitsuba's rows run from pole to pole inclusive, ours have their centres half a row inside. At 2h + 1 rows every
    second one is a texel centre of ours and the rest lie midway, so that its bilinear lookup equals ours to rounding.
    Its columns are padded by one on either side. To be used with `half_turn`.
    """
    # --- Rows: pole, texel centres and the means between them, pole ---
    first = envmap[:1]
    last = envmap[-1:]
    middle = (envmap[:-1] + envmap[1:]) / 2
    h = envmap.shape[0]
    inner = xp.stack([envmap[:-1], middle], 1).reshape(2 * (h - 1), *envmap.shape[1:])
    rows = xp.concatenate([first, inner, last, last], 0)
    # --- Columns: the last before the first and the first after the last, for the seam ---
    return xp.concatenate([rows[:, -1:], rows, rows[:, :1]], 1)


def half_turn(mi):
    """The emitter's `to_world`: Mitsuba's map has -Z at its left edge, ours in its centre."""
    return mi.ScalarTransform4f().rotate([0, 1, 0], 180)


def emitter(mi) -> dict:
    """A grey emitter whose `data` is exchanged for `on_mitsuba_grid` of a map."""
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap(np.ones((9, 8, 3), np.float32)),
        "to_world": half_turn(mi),
    }


def check_envmap(envmap: Array) -> None:
    """Raise InputError unless the map is [h, 2h, 3] with h >= 4, finite and >= 0."""
    shape = np.shape(envmap)
    if len(shape) != 3 or shape[2] != 3 or shape[0] < 4 or shape[1] != 2 * shape[0]:
        raise InputError(
            f"The environment map is {shape}; it must be twice as wide as high, RGB, and 4 rows or more."
        )
    low = float(np.min(envmap))
    high = float(np.max(envmap))
    if not (low >= 0 and np.isfinite(high)):
        raise InputError(
            f"The environment map has values from {low:g} to {high:g}; it must be finite and >= 0."
        )


def is_peaked(envmap: Array) -> bool:
    """Whether the light of [h, 2h, 3] is hard: mean squared over squared mean luminance over the sphere."""
    luma = envmap.mean(-1)
    share = row_solid_angle(len(envmap))[:, None] / (4 * np.pi)
    return float((luma**2 * share).sum()) > PEAKED * max(float((luma * share).sum()) ** 2, 1e-30)
