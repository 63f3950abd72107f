"""Readers of whole public sets in the layouts that they are published in; see `layouts`."""

import re
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np

from materialist.edits.light.relight import read_envmap
from materialist.io.photo import decode_photo, read_photo
from materialist_lab.bench.materials import sample_photo
from materialist_lab.bench.real.captures import KINECT_FOV
from materialist_lab.bench.real.lights import ball_light, views
from materialist_lab.bench.real.photos import (
    Reading,
    RealPhoto,
    read_array,
    read_millimetres,
    with_depth,
)
from materialist_lab.data.datasets import InteriorVerse, parts

NYU_CROP = (slice(45, 471), slice(41, 601))
"""Rows and columns that count (Eigen et al. 2014)."""
DIODE_FOV = 60.0
"""Degrees: 1024 pixels at a focal length of 886.81 pixels."""


def nyu(place: Path) -> list[Path]:
    """Photos of NYU Depth v2 (Silberman et al. 2012) that have a depth, as the official split is unpacked."""
    files = (*place.glob("**/rgb_*.jpg"), *place.glob("**/rgb_*.png"))
    return sorted(path for path in files if _nyu_depth(path).is_file())


def nyu_photo(path: Path, reading: Reading) -> Iterator[RealPhoto]:
    """A room and its depth in millimetres."""
    measured = read_millimetres(_nyu_depth(path))
    # The border holds no reliable depth.
    depth = np.zeros_like(measured)
    depth[NYU_CROP] = measured[NYU_CROP]
    name = f"{path.parent.name} {path.stem.removeprefix('rgb_')}"
    yield with_depth(name, read_photo(path, size=reading.size, fov=KINECT_FOV), depth)


def _nyu_depth(path: Path) -> Path:
    return path.with_name(f"sync_depth_{path.stem.removeprefix('rgb_')}.png")


def diode(place: Path) -> list[Path]:
    """Photos of DIODE (Vasiljevic et al. 2019) that have a depth."""
    masks = place.glob("**/*_depth_mask.npy")
    files = (path.with_name(path.name.replace("_depth_mask.npy", ".png")) for path in masks)
    return sorted(path for path in files if path.is_file())


def diode_photo(path: Path, reading: Reading) -> Iterator[RealPhoto]:
    """A photo and the depth of a laser scanner in metres."""
    depth = read_array(path.with_name(f"{path.stem}_depth.npy"))
    valid = read_array(path.with_name(f"{path.stem}_depth_mask.npy"))
    # Stored with an axis of one channel.
    depth = depth.reshape(valid.shape)
    measured = np.where((valid > 0) & np.isfinite(depth), depth, 0).astype(np.float32)
    yield with_depth(path.stem, read_photo(path, size=reading.size, fov=DIODE_FOV), measured)


def iiw_photo(files: tuple[Path, Path], reading: Reading) -> Iterator[RealPhoto]:
    """A photo of Intrinsic Images in the Wild (Bell et al. 2014) with what people said of its surfaces."""
    picture, judgements = files
    yield RealPhoto(picture.stem, read_photo(picture, size=reading.size), judgements=judgements)


def interiorverse(place: Path) -> list[tuple[InteriorVerse, int]]:
    """Pictures of the test split of InteriorVerse (Zhu et al. 2022)."""
    if not any((part / "test.txt").is_file() for part in parts(place)):
        return []
    source = InteriorVerse(place, "test")
    return [(source, index) for index in range(len(source))]


def interiorverse_photo(item: tuple[InteriorVerse, int], reading: Reading) -> Iterator[RealPhoto]:
    """A rendered room, at its own size."""
    source, index = item
    sample = source.read(index)
    photo = sample_photo(sample)
    inside = sample.mask > 0
    yield RealPhoto(f"{index:07d}", photo, sample.albedo, sample.normal, sample.depth, mask=inside)


def wildrelight(place: Path) -> list[Path]:
    """Scenes of WildRelight (Wang et al. 2026)."""
    return sorted({path.parents[1] for path in place.glob("**/envmap/time*_envmap.exr")})


def wildrelight_photos(folder: Path, reading: Reading) -> Iterator[RealPhoto]:
    """A view at several times of day, each with the light around the camera."""
    # One photo and one map for each time of day, in the same order.
    maps = sorted((folder / "envmap").glob("time*_envmap.exr"))
    files = [folder / "photo" / path.name.replace("_envmap", "_hdr") for path in maps]
    envmaps = [read_envmap(path) for path in maps]
    read = partial(read_photo, size=reading.size)
    for name, photo, other in views(files, envmaps, reading.lamps, read):
        yield RealPhoto(f"{folder.name} {name}", photo, other=other)


def multi_illumination(place: Path) -> list[Path]:
    """Scenes of the MIT multi-illumination set (Murmann et al. 2019)."""
    return sorted({path.parents[1] for path in place.glob("**/probes/dir_*_chrome*.*")})


def multi_illumination_photos(folder: Path, reading: Reading) -> Iterator[RealPhoto]:
    """A room with the flash in many directions, each with a mirror ball that shows the light."""
    balls = _by_direction(folder / "probes", "chrome")
    pictures = _by_direction(folder, "mip")
    # Directions that have both a photo and a ball.
    directions = sorted(balls.keys() & pictures.keys())
    files = [pictures[k] for k in directions]
    envmaps = [ball_light(decode_photo(balls[k]).linear) for k in directions]
    read = partial(read_photo, size=reading.size)
    for name, photo, other in views(files, envmaps, reading.lamps, read):
        yield RealPhoto(f"{folder.name} {name}", photo, other=other)


def _by_direction(folder: Path, kind: str) -> dict[int, Path]:
    """Direction of the flash -> its file dir_DIRECTION_KIND*; where there are several, the first by name."""
    files: dict[int, Path] = {}
    for path in sorted(folder.glob(f"dir_*_{kind}*.*")):
        if match := re.match(r"dir_(\d+)_", path.name):
            files.setdefault(int(match[1]), path)
    return files
