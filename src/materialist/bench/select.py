"""`bench select`: how well one click, or a box, finds the object that is meant."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from materialist.bench.benchmark import Benchmark
from materialist.bench.report import Column, Report, write
from materialist.edits.select.objects import Box
from materialist.procedural.arrangements import arrangement
from materialist.procedural.synthetic import SyntheticSample, make_sample
from materialist.types import Array, Prediction, Scene

NOTE = """Synthetic pictures whose objects are known (those of `bench light`); two clicks on every object of at least
400 pixels, one in its middle and one anywhere, and two boxes around it, exact and a tenth too large. `bundled` maps are
the bundled network's, `true` ones the truth; `network` is what `select` does by itself, `grabcut` the same without
ClickNet. IoU is intersection over union with the object's mask; `good` and `lost` are the shares above 0.8 and below
0.3."""
COLUMNS = (
    Column("iou", "IoU", "higher"),
    Column("good", "good", "higher", 2),
    Column("lost", "lost", "lower", 2),
)
METHODS = ("network", "grabcut")
"""Ways to select that need nothing but the package."""


@dataclass(frozen=True, kw_only=True)
class SelectBench(Benchmark):
    """Score one click on the objects of `scenes` pictures, and of as many with captured meshes where DATA is given.

    Raises InputError for counts below 1.
    """

    least: ClassVar = {"scenes": 1, "size": 64}

    scenes: int = 12
    size: int = 256
    smallest: int = 400  # pixels of an object that is clicked on
    loose: float = 0.1  # how much larger a loose box is on each side, in units of the object's shorter side
    spp: int = 100

    def run(self, data: Path | None, output: Path) -> None:
        from materialist.predict.bundled.predictor import BundledPredictor
        from materialist.render.variant import setup

        setup(self.device)
        if data is not None:
            arrangement(0, seed=self.seed, data=data)  # that there are meshes
        rows: list[dict[str, Any]] = []
        report = Report("Objects by one click, or a box", NOTE, self.settings(data), COLUMNS, rows, plotted=("iou",))
        predictor = BundledPredictor()
        for folder in (None,) if data is None else (None, data):
            for k in range(self.scenes):
                sample = make_sample(k, 1, k, size=self.size, data=folder, seed=self.seed, spp=self.spp)
                kind = "captured" if folder else "procedural"
                for maps, found in (("bundled", predictor.predict(sample.photo)), ("true", sample.truth)):
                    for method in METHODS:
                        rows += self._rows(sample, found, f"{maps} maps", method, f"{kind} {sample.name}", k)
                write(report, output)

    def _rows(
        self, sample: SyntheticSample, prior: Prediction, maps: str, method: str, name: str, number: int
    ) -> list[dict[str, Any]]:
        """A row a click, and a box."""
        from materialist.edits.select.select import select

        rows, scene = [], _scene(sample, prior)
        for j, mask in enumerate(sample.things):
            if mask.sum() < self.smallest:
                continue
            for k, click in enumerate(clicks(mask, scene.depth > 0, np.random.default_rng([number, j]))):
                found = select(scene, click=click, method=method)
                rows.append(_row(found, mask, f"{method}, {maps}", f"{name} object {j} click {k}"))
            for what, box in boxes(mask, self.loose).items():
                found = select(scene, box=box, method=method)
                rows.append(_row(found, mask, f"{method}, {what}, {maps}", f"{name} object {j}"))
        return rows


def clicks(mask: Array, usable: Array, rng: np.random.Generator, inside: float = 2.5) -> list[tuple[int, int]]:
    """Two (column, row) in a mask [H, W] bool: its middle, and any place `inside` pixels from its border or more; both
    `usable` [H, W] bool."""
    from scipy.ndimage import distance_transform_edt

    away = distance_transform_edt(np.pad(mask, 1))[1:-1, 1:-1]
    places = [np.argwhere(away == away.max()), np.argwhere((away > inside) & usable)]
    chosen = [places[0][0], *([places[1][rng.integers(len(places[1]))]] if len(places[1]) else [])]
    return [(int(column), int(row)) for row, column in chosen if usable[row, column]]


def _row(found: Array, mask: Array, method: str, sample: str) -> dict[str, Any]:
    iou = float((found & mask).sum() / (found | mask).sum())
    return {"method": method, "sample": sample, "iou": iou, "good": float(iou > 0.8), "lost": float(iou < 0.3)}


def boxes(mask: Array, loose: float) -> dict[str, Box]:
    """The boxes around a mask [H, W] bool: exact, and larger by `loose` of its shorter side on every side."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    exact = int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1
    more = max(1, round(loose * min(exact[2] - exact[0], exact[3] - exact[1])))
    around = (
        max(exact[0] - more, 0), max(exact[1] - more, 0),
        min(exact[2] + more, mask.shape[1]), min(exact[3] + more, mask.shape[0]),
    )  # fmt: skip
    return {"exact box": exact, "loose box": around}


def _scene(sample: SyntheticSample, found: Prediction) -> Scene:
    """A scene before it is fitted: a selection looks at the photo and its maps."""
    from materialist.geometry.build import build_geometry

    return Scene(
        camera=sample.photo.camera, photo=sample.photo, prior=found, materials=found.materials, normal=found.normal,
        depth=found.depth, geometry=build_geometry(found.depth, found.normal, sample.photo.camera, completion="none"),
        envmap=sample.envmap, rerender=sample.photo.linear,
    )  # fmt: skip
