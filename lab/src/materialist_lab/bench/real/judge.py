"""`bench real`: the maps and the fit judged on photographs whose truth was measured.

Rows are named by where the photos come from (docs/benchmarks.md has the layouts) and what is judged: `photo` is the
photograph itself taken for the albedo, or left as it is under another light; a predictor's name its maps; `fitted` the
inversion that begins with them. Nothing here may ever be trained or tuned on.

Normals: mean angle, degrees; those of a measured depth where a plane fits it, and the same without floors and table
tops. Albedo: PSNR, sRGB-encoded, after one
factor (least squares). Another light: the scene fitted to one photo is relit (`relight`, in the photo) with the
measured direction or map of the light that is farthest from it, and compared with the photo under that light after one
factor; `photo` is the untouched one. AbsRel: mean |error| of depth over depth after one factor (median). Order: share
of pixel pairs in the right order of depth; a constant has 0.5. WHDR: human judgements of brightness that the albedo
contradicts. `published maps` are another network's, no truth: a reference. Where there is a mask, figures are inside.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2

from materialist import pipeline
from materialist.edits.composite.composite import composite
from materialist.edits.light.relight import relight
from materialist.errors import InputError
from materialist.option_kinds import option
from materialist.predict import Predictor, get_predictor
from materialist.types import Array, Photo, Prediction, Scene
from materialist_lab.bench.benchmark import COUNT_OR_0, SIZE, Benchmark, Row, names, spread, timed
from materialist_lab.bench.real.layouts import LAYOUTS, Layout, located
from materialist_lab.bench.real.measures import albedo_figures, light_figures, map_figures
from materialist_lab.bench.real.photos import Reading, RealPhoto
from materialist_lab.bench.real.sheet import SheetRow, sheet, truth_row
from materialist_lab.bench.report import Column, Report


@dataclass(frozen=True, kw_only=True)
class RealBench(Benchmark):
    """Judge predictors, and the fit that begins with them, on `data`."""

    columns = (
        Column("normal_angle", "normals, degrees", "lower", 1),
        Column("steep_angle", "normals off floors", "lower", 1),
        Column("albedo_psnr", "albedo PSNR", "higher", 2),
        Column("relit_psnr", "another light PSNR", "higher", 2),
        Column("depth_abs_rel", "depth AbsRel", "lower", 3),
        Column("depth_order", "depth order", "higher", 3),
        Column("whdr", "WHDR", "lower", 3),
        Column("seconds", "s", "", 1),
    )

    predictor: str = option(
        "auto", "Names, with commas; bundled:FILE are other weights.", kind="name"
    )
    size: int = option(512, "Longer side of the photos.", **SIZE)
    lamps: int = option(
        3, "Photos of each view under several lights, evenly spread; 0: all.", **COUNT_OR_0
    )
    limit: int = option(
        8, "At most so many photos (or views) of a layout, evenly spread; 0: all.", **COUNT_OR_0
    )
    prior_only: bool = option(
        False, "Judges the maps alone, in seconds: no fit, no other light.", kind="switch"
    )
    pictures: int = option(8, "Photos of a layout with a sheet in pictures/.", **COUNT_OR_0)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        if data is None:
            raise InputError(
                "This benchmark needs photographs with measured truth; give --data DIR."
            )
        # --- What is judged, and on what ---
        specs = names("predictor", self.predictor)
        sources = {spec: get_predictor(spec, device=self.device) for spec in specs}
        # Layouts that are absent are named in the report.
        by_layout = located(data)
        if not any(by_layout.values()):
            places = ", ".join(_described(layout) for layout in LAYOUTS)
            raise InputError(
                f"{data} holds no photographs with measured truth; it may have {places}."
            )
        absent = [_described(layout) for layout in LAYOUTS if not by_layout[layout.name]]
        report.settings["skipped, since not there"] = "; ".join(absent) or None
        for layout in LAYOUTS:
            items = spread(list(by_layout[layout.name]), self.limit)
            yield from self._layout_rows(layout, items, sources, report)

    def _layout_rows(
        self, layout: Layout, items: list[Any], sources: dict[str, Predictor], report: Report
    ) -> Iterator[Row]:
        """The rows of the photos of a layout; adds their sheets to the report."""
        reading = Reading(self.size, self.lamps)
        # One photo at a time: whole sets do not fit into memory.
        photos = (real for item in items for real in layout.photos(item, reading))
        for count, real in enumerate(photos):
            shown: list[SheetRow] = []
            for row in self._photo_rows(real, sources, shown):
                yield {**row, "method": f"{layout.name}: {row['method']}", "sample": real.name}
            if count < self.pictures:
                name = f"{Path(layout.folder).name} {real.name}"
                report.pictures[name.replace(" ", "_")] = sheet(real, [*shown, truth_row(real)])

    def _photo_rows(
        self, real: RealPhoto, sources: dict[str, Predictor], shown: list[SheetRow]
    ) -> Iterator[Row]:
        """The rows of a photo; adds the maps and pictures to `shown`."""
        photo = real.photo
        # --- The photo itself as albedo and as the relit picture: what doing nothing gives ---
        untouched = albedo_figures(photo.linear, real) | light_figures(photo.linear, real)
        if untouched:
            yield {"method": "photo", **untouched}
        for spec, source in sources.items():
            # --- The maps of a predictor ---
            prior, cost = timed(source.predict, photo, seed=self.seed)
            picture = None if shown else photo.linear
            shown.append(
                SheetRow(spec, "photo", picture, prior.materials.albedo, prior.normal, prior.depth)
            )
            yield {"method": spec, **map_figures(prior, real), "seconds": cost["seconds"]}
            if real.other is None or self.prior_only:
                continue
            # --- The inversion that begins with them, under another light ---
            scene, relit, seconds = self._relit(photo, prior, real.other.envmap)
            name = f"{spec}, fitted"
            shown.append(SheetRow(name, "relit", relit, scene.materials.albedo))
            figures = albedo_figures(scene.materials.albedo, real) | light_figures(relit, real)
            yield {"method": name, **figures, "seconds": seconds}

    def _relit(self, photo: Photo, prior: Prediction, envmap: Array) -> tuple[Scene, Array, float]:
        """(the fitted scene, the photo under another light [h, 2h, 3], seconds of the fit)."""
        shared: dict[str, Any] = {"seed": self.seed, "device": self.device}
        scene, cost = timed(pipeline.invert, photo, prior=prior, **shared)
        # The other light's brightness is not known: it gets that of the fitted light, and the figures one factor.
        relit = relight(scene, envmap=envmap, gain="auto")
        picture = composite(scene, relit, **shared)
        size = photo.linear.shape[1::-1]
        return scene, cv2.resize(picture, size, interpolation=cv2.INTER_AREA), cost["seconds"]


def _described(layout: Layout) -> str:
    """Where a layout is looked for, and what it holds."""
    return f"{layout.folder}/ with {layout.holds}"
