"""Photographs of one view under several lights: their lights as maps, and which two are compared."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from materialist.camera import unit
from materialist.envmap import row_solid_angle, texel_directions
from materialist.errors import InputError
from materialist.types import Array, Photo
from materialist_lab.bench.benchmark import spread
from materialist_lab.bench.real.photos import OtherLight

ROWS = 128
"""Rows of the environment maps that are made here."""
LAMP_RADIUS = 6.0
"""Degrees; that of a sun of `relight`."""


def views(
    files: Sequence[Path], envmaps: Sequence[Array], count: int, read: Callable[[Path], Photo]
) -> Iterator[tuple[str, Photo, OtherLight]]:
    """(name, photo, the same view under another light) of `count` of the files, evenly spread; 0: all.

    The other light is the one from the direction that is farthest. `envmaps` are the lights of the files.
    Raises InputError for fewer than two files, or one that is missing.
    """
    missing = [path for path in files if not path.is_file()]
    if missing:
        raise InputError(f"There is no photo at {missing[0]}, whose light is known.")
    if len(files) < 2:
        raise InputError("A view has fewer than two lights, so that none is another one.")
    for index in spread(list(range(len(files))), count):
        partner = farthest_light(envmaps, index)
        other = OtherLight(envmaps[partner], read(files[partner]).linear)
        yield files[index].stem, read(files[index]), other


def farthest_light(envmaps: Sequence[Array], index: int) -> int:
    """The map whose light comes from the direction that is farthest from that of map `index`."""
    # The smallest cosine is the largest angle; a map is not its own partner.
    directions = [mean_direction(envmap) for envmap in envmaps]
    cosines = [float(direction @ directions[index]) for direction in directions]
    cosines[index] = np.inf
    return int(np.argmin(cosines))


def mean_direction(envmap: Array) -> Array:
    """[3] unit: where the light of a map [h, 2h, 3] comes from on the whole."""
    rows, columns = envmap.shape[:2]
    power = envmap.mean(-1) * row_solid_angle(rows)[:, None]
    return unit((texel_directions(rows, columns) * power[..., None]).sum((0, 1)))


def lamp_light(direction: Sequence[float]) -> Array:
    """[h, 2h, 3] a white disc in that direction [3] (camera frame), and darkness."""
    cosine = texel_directions(ROWS, 2 * ROWS) @ unit(np.asarray(direction, np.float64))
    disc = cosine > np.cos(np.radians(LAMP_RADIUS))
    return np.repeat(disc[..., None], 3, -1).astype(np.float32)


def ball_light(ball: Array) -> Array:
    """[h, 2h, 3] the light that a mirror ball [s, s, 3] linear shows, which fills its picture and is far away."""
    # The normal is half way between the light's direction and the one to the viewer.
    normal = unit(texel_directions(ROWS, 2 * ROWS) + np.array([0, 0, 1], np.float32))
    radius = len(ball) / 2
    column = radius * (1 + normal[..., 0]) - 0.5
    row = radius * (1 - normal[..., 1]) - 0.5
    return cv2.remap(ball, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
