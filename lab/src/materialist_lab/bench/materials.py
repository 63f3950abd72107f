"""`bench materials`: how good a predictor's maps are (paper, Table 1).

Data: a set of `materialist train data`, InteriorVerse, or a folder with photo.* and true maps in maps/, or of such
folders. Pictures are given to the predictor as photographs (clipped to [0, 1]; the procedural ones with tone, noise,
blur and JPEG, unless `photographic` is off), with their true field of view.

Pixels with a true surface count. Albedo: sRGB-encoded, clipped to [0, 1], after one factor a picture (least squares of
linear values); `raw` without it. Roughness and metallic: as they are, in [0, 1]; `pooled` is the PSNR of the mean
square error over all pictures, which pictures without any metal (infinite PSNR) cannot inflate; a PSNR is at most 100.
Depth: MAE and RMSE in units of the truth after one factor (least squares), `raw` without it; SI log RMSE is the
standard deviation of log depth error; `order` the part of random pixel pairs in the right order (a constant gets 0.5).
Normals: mean angle, degrees. `within its spread`: share of pixels whose error is below the median that the predictor
expects, where it says what it expects; 0.5 is calibrated. sheet.png: the photo, and the maps of each predictor and the
true ones under each other.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from materialist.errors import InputError
from materialist.io.photo import read_photo
from materialist.option_kinds import option
from materialist.predict import get_predictor
from materialist.predict.maps import MapsPredictor
from materialist.predict.protocol import MAPS
from materialist.types import Camera, Photo, Prediction
from materialist_lab.bench.benchmark import COUNT_OR_0, Benchmark, Row, names, spread, timed
from materialist_lab.bench.report import Column, Report
from materialist_lab.data.datasets import InteriorVerse, open_sources
from materialist_lab.data.samples import Sample, SampleFolder
from materialist_lab.data.sheets import strip
from materialist_lab.metrics.maps import ordinal_accuracy, score, summary
from materialist_lab.procedural.photographic import as_photo


@dataclass(frozen=True, kw_only=True)
class MaterialsBench(Benchmark):
    """Score predictors on `data`."""

    columns = (
        Column("albedo_psnr", "albedo PSNR", "higher", 2),
        Column("albedo_ssim", "albedo SSIM", "higher"),
        Column("albedo_psnr_raw", "albedo PSNR raw", "higher", 2),
        Column("roughness_psnr", "roughness PSNR", "higher", 2),
        Column("roughness_psnr_pooled", "roughness PSNR pooled", "higher", 2),
        Column("roughness_ssim", "roughness SSIM", "higher"),
        Column("metallic_psnr", "metallic PSNR", "higher", 2),
        Column("metallic_psnr_pooled", "metallic PSNR pooled", "higher", 2),
        Column("metallic_ssim", "metallic SSIM", "higher"),
        Column("depth_mae", "depth MAE", "lower"),
        Column("depth_rmse", "depth RMSE", "lower"),
        Column("depth_mae_raw", "depth MAE raw", "lower"),
        Column("depth_rmse_raw", "depth RMSE raw", "lower"),
        Column("depth_si_log_rmse", "depth SI log RMSE", "lower"),
        Column("depth_order", "depth order", "higher"),
        Column("normal_angle", "normal angle", "lower", 1),
        Column("mask_iou", "surface IoU", "higher"),
        *(Column(f"{name}_calibration", f"{name} within its spread") for name in MAPS),
        Column("seconds", "s", "lower", 2),
    )

    predictor: str = option("auto", "Names, with commas.", kind="name")
    limit: int = option(0, "At most so many samples, spread over the set; 0: all.", **COUNT_OR_0)
    split: str = option("test", "InteriorVerse's.", kind="name")
    photographic: bool = option(
        True,
        "Tone, noise, blur and JPEG for procedural pictures.",
        kind="switch",
        flag="--photographic/--no-photographic",
    )
    pictures: int = option(8, "Samples in sheet.png.", **COUNT_OR_0)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        if data is None:
            raise InputError(
                "There is nothing to score; give --data DIR: materialist train data --split heldout -o DIR."
            )
        # Predictors are loaded once for all samples.
        sources = {
            spec: get_predictor(spec, device=self.device)
            for spec in names("predictor", self.predictor)
        }
        for k, (name, photo, truth) in enumerate(self.samples(data, report)):
            # Maps that the data set lacks are filled with something: no figures of them.
            absent = [name for name in MAPS if truth.sources and name not in truth.sources]
            report.settings.update({f"no true {which}": True for which in absent})
            predictions = []
            for spec, source in sources.items():
                predicted, cost = timed(source.predict, photo, seed=self.seed)
                predictions.append(predicted)
                yield {
                    "method": spec,
                    "sample": name,
                    **_scores(predicted, truth, absent),
                    "seconds": cost["seconds"],
                }
            if k < self.pictures:
                report.sheet.append(strip(photo.linear, *predictions, truth))
        _pool(report.rows)

    def samples(self, data: Path, report: Report) -> Iterator[tuple[str, Photo, Prediction]]:
        """(name, photo, truth) of the samples; see the module for what `data` may be. Raises InputError."""
        # --- Photographs with maps beside them, or a data set ---
        folders = photo_folders(data)
        if folders:
            for folder in spread(folders, self.limit):
                yield folder.name, *_read_folder(folder)
            return
        source = open_sources([data], split=self.split)
        if isinstance(source, InteriorVerse):
            report.settings["left out"] = " ".join(source.notes) or None
        for index in spread(list(range(len(source))), self.limit):
            sample = source.read(index)
            # Procedural pictures are clean; InteriorVerse's are left as they are.
            spoilt = self.photographic and isinstance(source, SampleFolder)
            seen = as_photo(sample, np.random.default_rng((11, index))) if spoilt else sample
            yield f"{index:07d}", sample_photo(seen), sample.truth()


def sample_photo(sample: Sample) -> Photo:
    """The picture of a sample as an ordinary photograph, clipped to [0, 1], with its true field of view."""
    linear = np.clip(sample.image, 0, 1).astype(np.float32)
    height, width = linear.shape[:2]
    # Rays go through pixel centres: the half width lies half a pixel further out.
    fov = 2 * np.degrees(np.arctan(sample.rays[0, -1, 0] * width / (width - 1)))
    return Photo(linear, Camera(width, height, float(fov)), original=linear, fov_source="option")


def photo_folders(data: Path) -> list[Path]:
    """Folders with a file photo.* and true maps in maps/: `data` itself or those in it."""
    places = [data, *sorted(p for p in data.iterdir() if p.is_dir())]
    return [p for p in places if any(p.glob("photo.*")) and any(p.glob("maps/albedo.*"))]


def _read_folder(folder: Path) -> tuple[Photo, Prediction]:
    """The photo at its own size (at most 1024) and its true maps at that size."""
    maps = folder / "maps"
    photo = read_photo(str(min(folder.glob("photo.*"))), size=1024)
    truth = MapsPredictor(maps).predict(photo)
    sources = {name: "truth" for name in MAPS if any(maps.glob(f"{name}.*"))}
    return replace(photo, linear=np.clip(photo.linear, 0, 1)), replace(truth, sources=sources)


def _scores(predicted: Prediction, truth: Prediction, absent: list[str]) -> dict[str, float]:
    """The figures of a prediction; none of the maps that the truth lacks, in whose place something else stands."""
    figures = score(predicted, truth)
    if (truth.depth > 0).any():
        figures["depth_order"] = ordinal_accuracy(predicted.depth, truth.depth)
    return {
        key: value
        for key, value in figures.items()
        if not key.startswith(tuple(f"{name}_" for name in absent))
    }


def _pool(rows: list[Row]) -> None:
    """Give all rows the pooled PSNRs of their method, so that the table of means shows them."""
    for method in {row["method"] for row in rows}:
        of_method = [row for row in rows if row["method"] == method]
        # Pooled: the mean of squared errors over all samples, then one PSNR of it.
        means = summary(
            [
                {key: value for key, value in row.items() if key.endswith("_mse")}
                for row in of_method
            ]
        )
        for row in of_method:
            row.update({key: value for key, value in means.items() if key.endswith("_psnr_pooled")})
