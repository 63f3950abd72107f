"""The layouts of folders that `bench real` knows: where they are looked for, and their readers.

A layout is recognised by what lies in DIR/FOLDER, or in DIR itself. docs/benchmarks.md describes each.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from materialist_lab.bench.real import captures, public_sets
from materialist_lab.bench.real.photos import Reading, RealPhoto
from materialist_lab.bench.whdr import pairs


@dataclass(frozen=True)
class Layout:
    """One layout of a folder."""

    name: str
    """What rows of it are called."""
    folder: str
    """Where it is looked for in DIR."""
    holds: str
    """What such a folder holds, in words."""
    items: Callable[[Path], Sequence[Any]]
    """Its items in a folder (photos, views): what a limit counts; empty where there are none."""
    photos: Callable[[Any, Reading], Iterator[RealPhoto]]
    """The photos of an item. Raises InputError for what cannot be read."""


LAYOUTS = (
    Layout(
        name="objects",
        folder="real_light",
        holds="NAME/lights.json with light_NN.png",
        items=captures.objects,
        photos=captures.object_photos,
    ),
    Layout(
        name="room",
        folder="real_room",
        holds="photo.jpg with depth.png",
        items=captures.rooms,
        photos=captures.room_photo,
    ),
    Layout(
        name="garage",
        folder="photos/indoor",
        holds=f"{captures.GARAGE}.png with {captures.GARAGE}_disp.npz",
        items=captures.garages,
        photos=captures.garage_photo,
    ),
    Layout(
        name="published maps, no truth",
        folder="official_indoor",
        holds="photo.png with maps/",
        items=captures.published,
        photos=captures.published_photo,
    ),
    Layout(
        name="NYU Depth v2",
        folder="nyu",
        holds="ROOM/rgb_NNNNN.jpg with sync_depth_NNNNN.png",
        items=public_sets.nyu,
        photos=public_sets.nyu_photo,
    ),
    Layout(
        name="DIODE",
        folder="diode",
        holds="NAME.png with NAME_depth.npy and NAME_depth_mask.npy",
        items=public_sets.diode,
        photos=public_sets.diode_photo,
    ),
    Layout(
        name="IIW",
        folder="iiw",
        holds="NAME.png with NAME.json",
        items=pairs,
        photos=public_sets.iiw_photo,
    ),
    Layout(
        name="InteriorVerse, rendered",
        folder="interiorverse",
        holds="dataset_85 or dataset_120 with test.txt",
        items=public_sets.interiorverse,
        photos=public_sets.interiorverse_photo,
    ),
    Layout(
        name="WildRelight",
        folder="wildrelight",
        holds="SCENE/photo/timeN_hdr.exr with SCENE/envmap/timeN_envmap.exr",
        items=public_sets.wildrelight,
        photos=public_sets.wildrelight_photos,
    ),
    Layout(
        name="MIT multi-illumination",
        folder="multi_illumination",
        holds="SCENE/dir_N_mip2.exr (or .jpg) with SCENE/probes/dir_N_chrome256.exr",
        items=public_sets.multi_illumination,
        photos=public_sets.multi_illumination_photos,
    ),
)


def located(data: Path) -> dict[str, Sequence[Any]]:
    """Name of each layout -> its items in DATA/FOLDER, or else in DATA itself; empty where it has none."""
    return {
        layout.name: layout.items(data / layout.folder) or layout.items(data) for layout in LAYOUTS
    }
