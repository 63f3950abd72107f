"""`bench select`: how well one click, or a box, finds the object that is meant.

Synthetic pictures whose objects are known (those of `bench light`); two clicks on every object of at least 400 pixels,
one in its middle and one anywhere, and two boxes around it, exact and a tenth too large. `bundled` maps are the bundled
network's, `true` ones the truth. Where DATA has photos of `assets/outlines.yaml`, the same on their objects, which were
outlined by eye; clicks on a whole keep off its parts that are listed. `network` is what `select` does by itself,
`one key` the best of that and of the next smaller and the next larger object at the click (the keys [ and ] of the
studio), `grabcut` goes by colours. IoU is intersection over union with the object's mask; `good` and `lost` are the
shares above 0.8 and below 0.3. `material` rows judge a click at a material of things that have several
(`assets/materials.yaml`): by itself, with `same_material`, and with `exclude` at the middle of the largest surplus.

Borders are judged at the photo's own size, by the matte that every edit is laid on the photo with. `border F`: the F
measure of its border against the outline, within 2 native pixels (outlines by eye are hardly better); an edit of the
hue leaves so much of the old colour inside of the outline, and spills so much of the new one beyond it, within a 64th
of the longer side, as shares of the colour inside. `border` rows:
a rendered mesh that no network has learnt from, over photos of DATA, so that the share of each pixel is known, by the
true mask at working size, that mask a pixel too large or too small, or what a box finds, and by the true mask where the
mesh is out of focus; `SAD` (thousands of pixels) and `MSE` (in thousandths, over the pixels within 8 native ones of the
border) are the matte's errors, `fringe` is the error of colours (of 255, RMS, there) when the mesh is painted anew.
"""

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.ndimage import distance_transform_edt
from skimage.draw import polygon

from materialist.edits.composite.matte import matte
from materialist.edits.select.extents import next_region
from materialist.edits.select.select import select
from materialist.errors import InputError
from materialist.geometry.silhouette import grown, window
from materialist.io.photo import read_photo
from materialist.option_kinds import option
from materialist.predict.bundled.predictor import BundledPredictor
from materialist.predict.clicks.features import Box
from materialist.types import Array, Scene
from materialist_lab.bench.benchmark import COUNT, COUNT_OR_0, SIZE, Benchmark, Row
from materialist_lab.bench.edits import scene_of, true_scene
from materialist_lab.bench.real.borders import (
    OUT_OF_FOCUS,
    boundary_f,
    colour_errors,
    known_composites,
)
from materialist_lab.bench.report import Column, Report
from materialist_lab.procedural.arrangements import arrangement
from materialist_lab.procedural.synthetic import make_sample

RIM = 1 / 64
"""Longer sides on both sides of a border within which colours are judged."""
THIN = 2.5
"""Pixels from its border that a surplus has to have for a click on it."""
METHODS = ("network", "grabcut")
"""Ways to select that need nothing but the package."""


@dataclass(frozen=True, kw_only=True)
class SelectBench(Benchmark):
    """Score clicks and boxes on the objects of synthetic pictures."""

    columns = (
        Column("iou", "IoU", "higher"),
        Column("good", "good", "higher", 2),
        Column("lost", "lost", "lower", 2),
        Column("border", "border F", "higher"),
        Column("left", "old colour left", "lower"),
        Column("spilt", "new colour spilt", "lower"),
        Column("sad", "SAD", "lower", 2),
        Column("mse", "MSE", "lower", 1),
        Column("fringe", "fringe", "lower", 1),
    )

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
    composites: int = option(6, "Photos with a rendered mesh in them.", **COUNT_OR_0)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        # A missing folder ends the bench before anything slow.
        if data is not None:
            arrangement(0, seed=self.seed, data=data)  # that there are meshes
        predictor = BundledPredictor()
        if data is not None:
            yield from self._outlined(data / "photos", predictor)
            yield from self._materials(data / "photos", predictor)
            yield from self._composed(data, predictor)
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
            scene = self._scene(folder / name, predictor)
            things = clickable(objects, scene.depth.shape)
            for thing in objects:
                yield {"sample": f"{name} {thing['name']}", **_outline_score(scene, thing)}
            for row in self._selected(scene, things, k):
                yield {
                    **row,
                    "method": f"{row['method']}, photos",
                    "sample": f"{name} {row['sample']}",
                }

    def _materials(self, folder: Path, predictor: BundledPredictor) -> Iterator[Row]:
        """Rows of clicks at one of the materials of a thing."""
        for name, parts in outlines("materials").items():
            if not (folder / name).is_file():
                continue
            scene = self._scene(folder / name, predictor)
            scale = max(scene.depth.shape) / 512
            for part in parts:
                mask = drawn(part, scene.depth.shape)
                x, y = part["click"]
                click = (int(x * scale), int(y * scale))
                for method, region in _narrowed(scene, mask, click):
                    row = {"method": f"material, {method}", "sample": f"{name} {part['name']}"}
                    yield {**row, **_compared(region, mask)}

    def _scene(self, file: Path, predictor: BundledPredictor) -> Scene:
        photo = read_photo(str(file), size=self.photo_size)
        # Selection uses the maps alone: any light will do.
        return scene_of(photo, predictor.predict(photo), np.ones((16, 32, 3), np.float32))

    def _composed(self, data: Path, predictor: BundledPredictor) -> Iterator[Row]:
        """Rows of rendered meshes over photos: how well their mattes are found."""
        there = [name for name in outlines() if (data / "photos" / name).is_file()]
        names = there[: self.composites]
        # --- Out of focus, by the true mask alone ---
        for known in known_composites(data, names, self.photo_size, self.seed, OUT_OF_FOCUS):
            row = {"method": "border, out of focus", "sample": known.name}
            yield {**row, **known.errors(known.mask)}
        # --- Sharp, by the true mask, by wrong ones, and as a box finds it ---
        for known in known_composites(data, names, self.photo_size, self.seed):
            maps = predictor.predict(known.photo)
            scene = scene_of(known.photo, maps, np.ones((16, 32, 3), np.float32))
            box = boxes(known.mask, self.loose)["exact box"]
            for prompt, mask in (
                ("true mask", known.mask),
                ("a pixel too large", grown(known.mask, 1)),
                ("a pixel too small", ~grown(~known.mask, 1)),
                ("exact box", _found(scene, known.mask, box=box)),
            ):
                yield {"method": f"border, {prompt}", "sample": known.name, **known.errors(mask)}

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
                if method == "network":
                    after = _resized(scene, mask, click)
                    yield {"method": "one key", "sample": f"object {j} click {k}", **after}
            for fit, box in boxes(mask, self.loose).items():
                scores = _scores(scene, mask, box=box, method=method)
                yield {"method": f"{method}, {fit}", "sample": f"object {j}", **scores}


def outlines(kind: str = "outlines") -> dict[str, list[dict[str, Any]]]:
    """Photo -> its objects, each with `outlines` and perhaps `holes`: (x, y) where the longer side is 512 pixels.

    kind: `outlines` of objects (of one `outline` each), or `materials`, of parts of objects.
    """
    text = (files("materialist_lab.bench") / "assets" / f"{kind}.yaml").read_text("utf-8")
    return dict(yaml.safe_load(text))


def drawn(thing: dict[str, Any], shape: tuple[int, ...]) -> Array:
    """[H, W] bool of an object of `outlines` in a photo of that shape."""
    mask = np.zeros(shape, bool)
    scale = max(shape) / 512
    whole = thing["outlines"] if "outlines" in thing else [thing["outline"]]
    for inside, polygons in ((True, whole), (False, thing.get("holes", []))):
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


def _found(scene: Scene, mask: Array, **prompt: Any) -> Array:
    """[H, W] bool like `mask`: what `select` finds, nothing where it refuses."""
    try:
        return select(scene, **prompt)
    except InputError:  # nothing was found there
        return np.zeros_like(mask)


def _resized(scene: Scene, mask: Array, click: tuple[int, int]) -> dict[str, float]:
    """The best of what a click finds, and of the next smaller and the next larger object there."""
    region = _found(scene, mask, click=click)
    others: list[Array | None] = []
    if region.any():
        choose = partial(select, scene)
        others = [next_region(choose, click, region, larger=larger) for larger in (False, True)]
    regions = [region, *(other for other in others if other is not None)]
    return max((_compared(region, mask) for region in regions), key=lambda row: row["iou"])


def _narrowed(scene: Scene, mask: Array, click: tuple[int, int]) -> Iterator[tuple[str, Array]]:
    """What a click at a material selects, and by further means: (what they are, [H, W] bool)."""
    for same_material, name in ((False, "one click"), (True, "same material")):
        region = _found(scene, mask, click=click, same_material=same_material)
        yield name, region
        excluded: list[tuple[int, int]] = []
        for count in ("one", "two"):
            surplus = distance_transform_edt(np.pad(region & ~mask, 1))[1:-1, 1:-1]
            row, column = np.unravel_index(int(surplus.argmax()), surplus.shape)
            more = [*excluded, (int(column), int(row))]
            # Nobody clicks on what is as thin as a border.
            if surplus.max() >= THIN:
                with contextlib.suppress(InputError):  # it cannot be told from the rest
                    region = select(scene, click=click, same_material=same_material, exclude=more)
                    excluded = more
            yield f"{name}, {count} excluded", region


def _scores(scene: Scene, mask: Array, **prompt: Any) -> dict[str, float]:
    return _compared(_found(scene, mask, **prompt), mask)


def _compared(selected: Array, mask: Array) -> dict[str, float]:
    iou = float((selected & mask).sum() / (selected | mask).sum())
    return {"iou": iou, "good": float(iou > 0.8), "lost": float(iou < 0.3)}


def _outline_score(scene: Scene, thing: dict[str, Any]) -> Row:
    """The border of an outlined object at the photo's own size, as its exact box finds it."""
    photo = scene.photo.original
    mask = drawn(thing, scene.depth.shape)
    selected = _found(scene, mask, box=boxes(mask, 0.1)["exact box"])
    share = matte(selected, photo)
    true = drawn(thing, photo.shape[:2])
    left, spilt = colour_errors(share, true, photo, RIM * max(photo.shape))
    return {
        "method": "border, photos, exact box",
        "border": boundary_f(share > 0.5, true),
        "left": left,
        "spilt": spilt,
    }


def boxes(mask: Array, loose: float) -> dict[str, Box]:
    """The boxes around a mask [H, W] bool: exact, and larger by `loose` of its shorter side on every side."""
    rows, columns = window(mask)
    more = max(1, round(loose * min(rows.stop - rows.start, columns.stop - columns.start)))
    sides = {"exact box": (rows, columns), "loose box": window(mask, margin=more)}
    return {name: (x.start, y.start, x.stop, y.stop) for name, (y, x) in sides.items()}
