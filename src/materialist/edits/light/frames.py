"""Moving light: a list of relit scenes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from materialist.edits.core.surfaces import triple
from materialist.edits.light.relight import relight, resolved
from materialist.errors import InputError
from materialist.io.video import MAX_FRAMES
from materialist.options import Relight
from materialist.types import Array, Lamp, Scene


def moving_light(
    scene: Scene, count: int, options: Relight | None = None, *, suns: tuple[tuple[float, float], ...] = (),
    **values: Any,
) -> Iterator[Scene]:  # fmt: skip
    """`count` relit scenes: the light turns by `rotate` degrees in all, the sun and one lamp follow their stations.

    Several suns or lamps are stations of one that moves in straight lines at even time between them; a single one
    stands still. With nothing that moves the light makes a full turn. Lights that the photo shows (`lights`, or those
    that are found) stay where they are, all frames with the same `dim` (None: they are part of what turns).
    `options` and `values` are those of `relight`. Raises InputError for a count outside 2 to 3600.
    """
    if not 2 <= count <= MAX_FRAMES:
        raise InputError(f"The number of frames is {count}; it must lie in 2 to {MAX_FRAMES}.")
    wanted = resolved(scene, Relight.given(options, **values))
    turn, lamps = wanted.rotate, wanted.lamps
    if not turn and len(suns) < 2 and len(lamps) < 2:
        turn = 360.0
    if wanted.dim is not None or wanted.lights is not None:
        scene = relight(scene, dim=wanted.dim, lights=wanted.lights)  # once: finding the lights takes a rendering
        wanted = replace(wanted, dim=None, lights=None)
    closed = turn != 0 and turn % 360 == 0 and len(suns) < 2 and len(lamps) < 2  # the last frame then meets the first
    for k in range(count):
        t = k / (count if closed else count - 1)
        sun = tuple(_between(np.asarray(suns), t)) if suns else None
        lamp = _lamp_between(lamps, t) if lamps else None
        yield relight(scene, wanted, rotate=t * turn, sun=sun, lamps=(lamp,) if lamp else ())


def _between(stations: Array, t: float) -> Array:
    """[...] at time t in [0, 1] between stations [n, ...]."""
    place = t * (len(stations) - 1)
    k = min(int(place), max(len(stations) - 2, 0))
    following = stations[min(k + 1, len(stations) - 1)]
    return stations[k] + (following - stations[k]) * (place - k)


def _lamp_between(lamps: tuple[Lamp, ...], t: float) -> Lamp:
    at = lambda name: _between(np.array([getattr(lamp, name) for lamp in lamps], np.float64), t)  # noqa: E731
    return replace(lamps[0], position=triple(at("position")), power=triple(at("power")), radius=float(at("radius")))
