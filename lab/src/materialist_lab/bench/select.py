"""`bench select`: how well one click, or a box, finds the object that is meant.

Synthetic pictures whose objects are known (those of `bench light`); two clicks on every object of at least 400 pixels,
one in its middle and one anywhere, and two boxes around it, exact and a tenth too large. `bundled` maps are the bundled
network's, `true` ones the truth. Where DATA has photos of `assets/outlines.yaml`, the same on their objects, which were
outlined by eye; clicks on a whole keep off its parts that are listed. `network` is what `select` does by itself,
`grabcut` goes by colours. IoU is intersection over union with the object's mask; `good` and `lost` are the shares above
0.8 and below 0.3.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.ndimage import distance_transform_edt
from skimage.draw import polygon

from materialist.edits.select.select import select
from materialist.errors import InputError
from materialist.geometry.silhouette import window
from materialist.io.photo import read_photo
from materialist.option_kinds import option
from materialist.predict.bundled.predictor import BundledPredictor
from materialist.predict.clicks.features import Box
from materialist.types import Array, Scene
from materialist_lab.bench.benchmark import COUNT, SIZE, Benchmark, Row
from materialist_lab.bench.edits import scene_of, true_scene
from materialist_lab.bench.report import Column, Report
from materialist_lab.procedural.arrangements import arrangement
from materialist_lab.procedural.synthetic import make_sample

METHODS = ("network", "grabcut")
"""Ways to select that need nothing but the package."""


@dataclass(frozen=True, kw_only=True)
class SelectBench(Benchmark):
    """Score clicks and boxes on the objects of synthetic pictures."""

    columns = (
        Column("iou", "IoU", "higher"),
        Column("good", "good", "higher", 2),
        Column("lost", "lost", "lower", 2),
    )
    plotted = ("iou",)

    scenes: int = option(
        12, "Pictures, and as many with captured meshes where DATA is given.", **COUNT
    )
    size: int = option(256, "Their width and height.", **SIZE)
    photo_size: int = option(512, "Longer side of photos with outlined objects.", **SIZE)
    smallest: int = option(400, "Pixels of an object that is clicked on.", **COUNT)
    loose: float = option(
        0.1, "What a loose box adds on each side, in the object's shorter side.", low=0, high=1
    )
    spp: int = option(100, "Samples a pixel of the pictures.", **COUNT)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        # A missing folder ends the bench before anything slow.
        if data is not None:
            arrangement(0, seed=self.seed, data=data)  # that there are meshes
        predictor = BundledPredictor()
        if data is not None:
            yield from self._outlined(data / "photos", predictor)
        # --- Synthetic pictures, procedural and of captured meshes, with both kinds of maps ---
        for folder in (None,) if data is None else (None, data):
            for k in range(self.scenes):
                sample = make_sample(
                    k, 1, k, size=self.size, data=folder, seed=self.seed, spp=self.spp
                )
                name = f"{'captured' if folder else 'procedural'} {sample.name}"
                for maps, prediction in (
                    ("bundled", predictor.predict(sample.photo)),
                    ("true", sample.truth),
                ):
                    things = [(mask, mask) for mask in sample.scene.things.values()]
                    for row in self._selected(true_scene(sample, prediction), things, k):
                        yield {
                            **row,
                            "method": f"{row['method']}, {maps} maps",
                            "sample": f"{name} {row['sample']}",
                        }

    def _outlined(self, folder: Path, predictor: BundledPredictor) -> Iterator[Row]:
        """Rows of the photos of a folder whose objects are known."""
        for k, (name, objects) in enumerate(outlines().items()):
            if not (folder / name).is_file():
                continue
            photo = read_photo(str(folder / name), size=self.photo_size)
            maps = predictor.predict(photo)
            # Selection uses the maps alone: any light will do.
            scene = scene_of(photo, maps, np.ones((16, 32, 3), np.float32))
            things = clickable(objects, maps.depth.shape)
            for row in self._selected(scene, things, k):
                yield {
                    **row,
                    "method": f"{row['method']}, photos",
                    "sample": f"{name} {row['sample']}",
                }

    def _selected(
        self, scene: Scene, things: Sequence[tuple[Array, Array]], number: int
    ) -> Iterator[Row]:
        """A row a click, and a box, by every method; `things` are masks and where in them clicks may lie."""
        for method, (j, (mask, place)) in product(METHODS, enumerate(things)):
            # What is hardly seen cannot be meant.
            if mask.sum() < self.smallest:
                continue
            for k, click in enumerate(
                clicks(place, scene.depth > 0, np.random.default_rng([number, j]))
            ):
                scores = _scores(scene, mask, click=click, method=method)
                yield {"method": method, "sample": f"object {j} click {k}", **scores}
            for fit, box in boxes(mask, self.loose).items():
                scores = _scores(scene, mask, box=box, method=method)
                yield {"method": f"{method}, {fit}", "sample": f"object {j}", **scores}


def outlines() -> dict[str, list[dict[str, Any]]]:
    """Photo -> its objects, each with an `outline` and perhaps `holes`: (x, y) where the longer side is 512 pixels."""
    text = (files("materialist_lab.bench") / "assets" / "outlines.yaml").read_text("utf-8")
    return dict(yaml.safe_load(text))


def drawn(thing: dict[str, Any], shape: tuple[int, ...]) -> Array:
    """[H, W] bool of an object of `outlines` in a photo of that shape."""
    mask = np.zeros(shape, bool)
    scale = max(shape) / 512
    for inside, polygons in ((True, [thing["outline"]]), (False, thing.get("holes", []))):
        for corners in polygons:
            # Outlines are in pixels of 512, whose centres are halves.
            columns, rows = np.array(corners, float).T * scale - 0.5
            mask[polygon(rows, columns, shape)] = inside
    return mask


def clickable(
    objects: Sequence[dict[str, Any]], shape: tuple[int, ...]
) -> list[tuple[Array, Array]]:
    """Masks of objects, and where in them a click means them: not on a `part`, which is an object of its own."""
    # A click on a part means the part, not the whole that it belongs to.
    masks = [drawn(thing, shape) for thing in objects]
    parts = [mask for thing, mask in zip(objects, masks, strict=True) if thing.get("part")]
    other = np.logical_or.reduce([np.zeros(shape, bool), *parts])
    return [
        (mask, mask if thing.get("part") else mask & ~other)
        for thing, mask in zip(objects, masks, strict=True)
    ]


def clicks(
    mask: Array, usable: Array, rng: np.random.Generator, inside: float = 2.5
) -> list[tuple[int, int]]:
    """Two (column, row) in a mask [H, W] bool: its middle, and any place `inside` pixels from its border or more; both
    `usable` [H, W] bool."""
    # Padded: the border of the picture is a border of the object.
    away = distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    places = [np.argwhere(away == away.max()), np.argwhere((away > inside) & usable)]
    chosen = [places[0][0], *([places[1][rng.integers(len(places[1]))]] if len(places[1]) else [])]
    return [(int(column), int(row)) for row, column in chosen if usable[row, column]]


def _scores(scene: Scene, mask: Array, **prompt: Any) -> dict[str, float]:
    try:
        selected = select(scene, **prompt)
    except InputError:  # nothing was found there
        selected = np.zeros_like(mask)
    iou = float((selected & mask).sum() / (selected | mask).sum())
    return {"iou": iou, "good": float(iou > 0.8), "lost": float(iou < 0.3)}


def boxes(mask: Array, loose: float) -> dict[str, Box]:
    """The boxes around a mask [H, W] bool: exact, and larger by `loose` of its shorter side on every side."""
    rows, columns = window(mask)
    more = max(1, round(loose * min(rows.stop - rows.start, columns.stop - columns.start)))
    sides = {"exact box": (rows, columns), "loose box": window(mask, margin=more)}
    return {name: (x.start, y.start, x.stop, y.stop) for name, (y, x) in sides.items()}
