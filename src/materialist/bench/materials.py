"""`bench materials`: how good a predictor's maps are (paper, Table 1).

Data: a set of `materialist train data`, InteriorVerse, or any folder of photos with true maps. Pictures are given to
the predictor as photographs (clipped to [0, 1]; the procedural ones with tone, noise, blur and JPEG, unless
`photographic` is off), with their true field of view.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from materialist.bench.benchmark import Benchmark
from materialist.bench.report import Column, Pace, Report, write
from materialist.errors import InputError
from materialist.predict.protocol import MAPS
from materialist.types import Array, Camera, Materials, Photo, Prediction

COLUMNS = (
    Column("albedo_psnr", "albedo PSNR", "higher", 2),
    Column("albedo_ssim", "albedo SSIM", "higher"),
    Column("albedo_lpips", "albedo LPIPS", "lower"),
    Column("albedo_psnr_raw", "albedo PSNR raw", "higher", 2),
    Column("roughness_psnr", "roughness PSNR", "higher", 2),
    Column("roughness_psnr_pooled", "roughness PSNR pooled", "higher", 2),
    Column("roughness_ssim", "roughness SSIM", "higher"),
    Column("roughness_lpips", "roughness LPIPS", "lower"),
    Column("metallic_psnr", "metallic PSNR", "higher", 2),
    Column("metallic_psnr_pooled", "metallic PSNR pooled", "higher", 2),
    Column("metallic_ssim", "metallic SSIM", "higher"),
    Column("metallic_lpips", "metallic LPIPS", "lower"),
    Column("depth_mae", "depth MAE", "lower"),
    Column("depth_rmse", "depth RMSE", "lower"),
    Column("depth_mae_raw", "depth MAE raw", "lower"),
    Column("depth_rmse_raw", "depth RMSE raw", "lower"),
    Column("depth_si_log_rmse", "depth SI log RMSE", "lower"),
    Column("depth_order", "depth order", "higher"),
    Column("normal_angle", "normal angle", "lower", 1),
    Column("mask_iou", "surface IoU", "higher"),
    Column("seconds", "s", "lower", 2),
)
NOTE = (
    "Pixels with a true surface count. Albedo: sRGB-encoded, clipped to [0, 1], after one factor a picture (least "
    "squares of linear values); `raw` without it. Roughness and metallic: as they are, in [0, 1]; `pooled` is the PSNR "
    "of the mean square error over all pictures, which pictures without any metal (infinite PSNR) cannot inflate; a "
    "PSNR is at most 100. Depth: MAE and RMSE in units of the truth after one factor (least squares), `raw` without "
    "it; SI log RMSE is the standard deviation of log depth error; `order` the part of random pixel pairs in the right "
    "order (a constant gets 0.5). Normals: mean angle, degrees. LPIPS (AlexNet, of sRGB-encoded maps, with the "
    "truth where there is no surface) only where the lpips package and its weights are installed. Rows named "
    "procedural are seeded held-out pictures of `train data`."
)

HELD_OUT = 24
"""Procedural pictures that are made where `data` holds none."""
FILES = ("maps:", "moge:")
"""Predictors that know one picture's maps."""


@dataclass(frozen=True, kw_only=True)
class MaterialsBench(Benchmark):
    """Score predictors (comma-separated) on `data`, and on so many held-out procedural pictures made for it.

    `limit` scores at most so many samples of `data`, spread over the set (0: all); `split` is InteriorVerse's;
    `pictures` of each kind are drawn into sheet.png. `procedural` is HELD_OUT unless `data` is a set of `train data`
    itself; they have `size` pixels a side and use the files of `meshes` and `envmaps` that are kept aside, if given.
    """

    predictor: str = "auto"
    limit: int = 0
    split: str = "test"
    photographic: bool = True
    pictures: int = 8
    procedural: int | None = None
    meshes: str = ""
    envmaps: str = ""
    size: int = 256

    def run(self, data: Path | None, output: Path) -> None:
        from materialist.bench.predictors import opened, specs_of

        own_set = data is not None and (data / "samples").is_dir()
        count = (0 if own_set else HELD_OUT) if self.procedural is None else self.procedural
        if data is None and count < 1:
            raise InputError("There is nothing to score; give --data DIR (docs/training.md), or --procedural above 0.")
        specs = specs_of(self.predictor)
        sources = {spec: opened(spec, self.device) for spec in specs}
        rows: list[dict[str, Any]] = []
        strips: dict[tuple[str, int], list] = {}
        settings = self.settings(data, procedural=count)

        def tell() -> None:
            report = Report(
                "Predicted maps", NOTE, settings, COLUMNS, _with_pooled(rows), ("albedo_psnr", "normal_angle")
            )
            write(report, output)

        pace = Pace()

        def add(folder: Path, kind: str, most: int) -> None:
            for spec in [s for s in specs if not (kind and s.startswith(FILES))]:
                unreadable: list[str] = []
                samples = labelled(
                    folder, split=self.split, limit=most, photographic=self.photographic, unreadable=unreadable
                )
                for k, (name, photo, truth) in enumerate(samples):
                    prediction, row = _scored(sources[spec], photo, truth, self.seed)
                    rows.append({"method": spec + kind, "sample": name, **row})
                    if k < self.pictures:
                        strips.setdefault((kind, k), [photo.linear, truth]).insert(-1, prediction)
                    absent = absent_maps(truth)
                    settings.update({f"no true {which}": True for which in absent})
                    if pace.due():
                        tell()
                if unreadable:
                    settings["left out"] = "; ".join(unreadable)
            if not rows:
                raise InputError(settings.get("left out") or f"{folder} holds nothing to score.")

        if data is not None:
            add(data, "", self.limit)
            settings |= lost(data, self.split)
        if count:
            from materialist.procedural.dataset import CONTENT

            settings["procedural content"] = CONTENT
            with tempfile.TemporaryDirectory() as place:
                add(
                    held_out(Path(place) / "set", count, self.size, self.seed, self.meshes, self.envmaps, self.device),
                    ", procedural",
                    0,
                )
        tell()
        _draw(list(strips.values()), output / "sheet.png")


def held_out(folder: Path, count: int, size: int, seed: int, meshes: str, envmaps: str, device: str) -> Path:
    """A new set of held-out procedural pictures; see `train.data.produce`."""
    from materialist.procedural.dataset import options_for, produce

    options = options_for(
        size=size, seed=seed, split="heldout", device=device, meshes=Path(meshes) if meshes else None,
        envmaps=Path(envmaps) if envmaps else None,
    )  # fmt: skip
    produce(folder, options, count=count)
    return folder


def lost(data: Path, split: str) -> dict[str, Any]:
    """How many scenes of an InteriorVerse split are not there, and how many pictures have been scored without them."""
    from materialist.io.datasets import InteriorVerse, is_interiorverse

    if photo_folders(data) or not is_interiorverse(data):
        return {}
    source = InteriorVerse(data, split)
    return {"pictures there": len(source), "scenes missing": len(source.missing), "pictures without maps": source.bare}


def labelled(
    data: Path, *, split: str = "test", limit: int = 0, photographic: bool = True, unreadable: list[str] | None = None
) -> Iterator[tuple[str, Photo, Prediction]]:
    """(name, photo, truth) of every sample; see the module for what `data` may be. Raises InputError.

    Samples that cannot be read are left out, and told in `unreadable`, if given.
    """
    for name, read in _samples(data, split, limit, photographic):
        try:
            yield name, *read()
        except InputError as error:
            if unreadable is None:
                raise
            unreadable.append(str(error))


def _samples(
    data: Path, split: str, limit: int, photographic: bool
) -> Iterator[tuple[str, Callable[[], tuple[Photo, Prediction]]]]:
    """(name, what reads it) of every sample."""
    folders = photo_folders(data)
    if folders:
        yield from ((folder.name, partial(_read_folder, folder)) for folder in _spread(folders, limit))
        return
    from materialist.io.datasets import open_source
    from materialist.io.samples import SampleFolder
    from materialist.procedural.photographic import as_photo

    source = open_source(data, split=split)
    procedural = isinstance(source, SampleFolder)

    def read(index: int) -> tuple[Photo, Prediction]:
        sample = source.read(index)
        seen = as_photo(sample, np.random.default_rng((11, index))) if procedural and photographic else sample
        linear = np.clip(seen.image, 0, 1).astype(np.float32)
        height, width = linear.shape[:2]
        fov = 2 * np.degrees(np.arctan(sample.rays[0, -1, 0] * width / (width - 1)))
        photo = Photo(linear=linear, camera=Camera(width, height, float(fov)), original=linear, fov_source="option")
        return photo, sample.truth()

    yield from ((f"{index:07d}", partial(read, index)) for index in _spread(list(range(len(source))), limit))


def absent_maps(truth: Prediction) -> list[str]:
    """Names of the maps that a truth lacks; what stands in their place is no truth."""
    return [name for name in MAPS if truth.sources and name not in truth.sources]


def photo_folders(data: Path) -> list[Path]:
    """Folders with a photo and true maps: `data` itself or those in it. The maps lie beside the photo or in maps/."""
    places = [data, *sorted(p for p in data.iterdir() if p.is_dir())] if data.is_dir() else []
    return [p for p in places if _photo(p) is not None and _maps(p) is not None]


def _photo(folder: Path) -> Path | None:
    return next((p for s in ("exr", "png", "jpg") if (p := folder / f"photo.{s}").is_file()), None)


def _maps(folder: Path) -> Path | None:
    return next((p for p in (folder / "maps", folder) if any(p.glob("albedo.*"))), None)


def _read_folder(folder: Path) -> tuple[Photo, Prediction]:
    """The photo at its own size (at most 1024) and its true maps at that size."""
    from materialist.io.photo import read_photo
    from materialist.predict.maps import MapsPredictor

    path, maps = _photo(folder), _maps(folder)
    assert path is not None and maps is not None
    photo = read_photo(str(path), size=1024)
    truth = MapsPredictor(maps).predict(photo)
    there = {name: "truth" for name in MAPS if any(maps.glob(f"{name}.*"))}
    return replace(photo, linear=np.clip(photo.linear, 0, 1)), replace(truth, sources=there)


def _spread(things: list, limit: int) -> list:
    """At most `limit` of them (0: all), evenly spread."""
    if not limit or limit >= len(things):
        return things
    return [things[k] for k in np.unique(np.linspace(0, len(things) - 1, limit).astype(int))]


def _scored(source: Any, photo: Photo, truth: Prediction, seed: int) -> tuple[Prediction, dict[str, float]]:
    """The prediction and its figures."""
    from materialist.bench.predictors import predicted
    from materialist.metrics.maps import ordinal_accuracy, score

    prediction, seconds = predicted(source, photo, seed)
    found = score(prediction, truth)
    surface = truth.depth > 0
    if surface.any():
        found["depth_order"] = ordinal_accuracy(prediction.depth, truth.depth)
        found |= _perceptual(prediction.materials, truth.materials, surface)
    absent = tuple(f"{name}_" for name in absent_maps(truth))
    found = {key: value for key, value in found.items() if not key.startswith(absent)} if absent else found
    return prediction, {**found, "seconds": seconds}


def _perceptual(found: Materials, true: Materials, surface: Array) -> dict[str, float]:
    """LPIPS of albedo (after one factor), roughness and metallic over the true surface, where it is installed."""
    from materialist.metrics.lpips import lpips
    from materialist.metrics.maps import best_scale

    scale = np.float32(best_scale(found.albedo, true.albedo, surface))
    pairs = {"albedo": (found.albedo * scale, true.albedo)}
    pairs |= {name: (getattr(found, name), getattr(true, name)) for name in ("roughness", "metallic")}
    out: dict[str, float] = {}
    for name, (a, b) in pairs.items():
        distance = lpips(np.where(surface[..., None] if a.ndim == 3 else surface, a, b), b)
        out |= {} if distance is None else {f"{name}_lpips": distance}
    return out


def _with_pooled(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows with the pooled PSNRs of their method, the same in each, so that the table of means shows them."""
    from materialist.metrics.maps import summary

    figures = ("roughness_psnr_pooled", "metallic_psnr_pooled")
    pooled = {}
    for method in {row["method"] for row in rows}:
        means = summary([{k: v for k, v in r.items() if k.endswith("_mse")} for r in rows if r["method"] == method])
        pooled[method] = {k: means[k] for k in figures if k in means}
    return [{**row, **pooled[row["method"]]} for row in rows]


def _draw(lines: list[list], path: Path) -> None:
    """Each picture with the maps of every predictor under each other, the truth last."""
    from materialist.io.display import strip, write_sheet

    write_sheet([strip(image, *predictions) for image, *predictions in lines], path)
