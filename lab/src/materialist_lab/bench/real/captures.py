"""Readers of single captures: objects under lamps, a room, a garage, and published maps; see `layouts`."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from materialist.errors import InputError
from materialist.io.exr import read_exr
from materialist.io.image import read_mask
from materialist.io.photo import read_photo
from materialist.predict import resample
from materialist.predict.maps import MapsPredictor
from materialist.types import Photo
from materialist_lab.bench.real.lights import lamp_light, views
from materialist_lab.bench.real.photos import (
    Reading,
    RealPhoto,
    linear_photo,
    read_array,
    read_millimetres,
    with_depth,
)

OBJECT_FOV = 10.0
"""Degrees: the camera was far away."""
KINECT_FOV = 63.3
"""Degrees: 640 pixels at a focal length of 518.86 pixels."""
PUBLISHED_FOV = 35.0
"""Degrees: that of the published network's runs."""
GARAGE = "motorcycle_garage"
FOCAL = 994.978
BASELINE = 0.193001
OFFSET = 31.086
"""Pixels, metres and pixels of a stereo pair (Middlebury 2014): depth = focal baseline / (disparity + offset)."""


def objects(place: Path) -> list[Path]:
    """Folders of objects."""
    return sorted(path.parent for path in place.glob("*/lights.json"))


def object_photos(folder: Path, reading: Reading) -> Iterator[RealPhoto]:
    """An object under one lamp at a time; the truth is photometric stereo of all lamps together."""
    # --- One directional light for each photo ---
    file = folder / "lights.json"
    try:
        (directions,) = json.loads(file.read_text("utf-8")).values()
        envmaps = [lamp_light(direction) for direction in directions]
    except (OSError, ValueError, AttributeError, TypeError) as error:
        raise InputError(
            f"{file} does not hold one list of directions to lamps ({error})."
        ) from error
    files = [folder / f"light_{k:02d}.png" for k in range(len(envmaps))]

    def read(path: Path) -> Photo:
        return linear_photo(path, reading.size, OBJECT_FOV)

    # --- Truth at the size of the photo; reads anew for each, which is cheap beside a fit ---
    for name, photo, other in views(files, envmaps, reading.lamps, read):
        height, width = photo.linear.shape[:2]
        albedo = resample.values(read_exr(folder / "albedo.exr"), (height, width))
        normal = resample.normals(read_exr(folder / "normal.exr"), (height, width))
        mask = read_mask(folder / "mask.png", (height, width))
        yield RealPhoto(f"{folder.name} {name}", photo, albedo, normal, mask=mask, other=other)


def rooms(place: Path) -> list[Path]:
    """The photo of a room with a depth camera's picture beside it."""
    files = (place / "photo.jpg", place / "depth.png")
    return [files[0]] if all(path.is_file() for path in files) else []


def room_photo(path: Path, reading: Reading) -> Iterator[RealPhoto]:
    """A room and its depth in millimetres."""
    photo = read_photo(path, size=reading.size, fov=KINECT_FOV)
    yield with_depth("room", photo, read_millimetres(path.with_name("depth.png")))


def garages(place: Path) -> list[Path]:
    """The left photo of a stereo pair with its disparity beside it."""
    files = (place / f"{GARAGE}.png", place / f"{GARAGE}_disp.npz")
    return [files[0]] if all(path.is_file() for path in files) else []


def garage_photo(path: Path, reading: Reading) -> Iterator[RealPhoto]:
    """A garage and its depth by structured light."""
    # Pixels that were not matched have no finite disparity.
    disparity = read_array(path.with_name(f"{GARAGE}_disp.npz"))
    known = np.isfinite(disparity) & (disparity > 0)
    distance = FOCAL * BASELINE / (np.where(known, disparity, 1) + OFFSET)
    depth = np.where(known, distance, 0).astype(np.float32)
    fov = float(2 * np.degrees(np.arctan(depth.shape[1] / 2 / FOCAL)))
    yield with_depth("garage", read_photo(path, size=reading.size, fov=fov), depth)


def published(place: Path) -> list[Path]:
    """A photo with another network's maps beside it."""
    return (
        [place / "photo.png"]
        if (place / "photo.png").is_file() and (place / "maps").is_dir()
        else []
    )


def published_photo(path: Path, reading: Reading) -> Iterator[RealPhoto]:
    """That network's maps stand where the others have truth."""
    photo = read_photo(path, size=reading.size, fov=PUBLISHED_FOV)
    maps = MapsPredictor(path.parent / "maps").predict(photo)
    surface = maps.depth > 0
    reference = RealPhoto(
        "indoor", photo, maps.materials.albedo, maps.normal, maps.depth, mask=surface
    )
    yield replace(reference, source="published maps")
