"""`bench materials`: how good a predictor's maps are (paper, Table 1).

Data: a set of `materialist train data`, InteriorVerse, or any folder of photos with true maps. Pictures are given to
the predictor as photographs (clipped to [0, 1]; the procedural ones with tone, noise, blur and JPEG, unless
`photographic` is off), with their true field of view.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from materialist.bench.report import Column, Report, write
from materialist.errors import InputError
from materialist.types import Array, Camera, Photo, Prediction

COLUMNS = (
    Column("albedo_psnr", "albedo PSNR", "higher", 2),
    Column("albedo_ssim", "albedo SSIM", "higher"),
    Column("albedo_lpips", "albedo LPIPS", "lower"),
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
    Column("seconds", "s", "lower", 2),
)
NOTE = (
    "Pixels with a true surface count. Albedo: sRGB-encoded, clipped to [0, 1], after one factor a picture (least "
    "squares of linear values); `raw` without it. Roughness and metallic: as they are, in [0, 1]; `pooled` is the PSNR "
    "of the mean square error over all pictures, which pictures without any metal (infinite PSNR) cannot inflate; a "
    "PSNR is at most 100. Depth: MAE and RMSE in units of the truth after one factor (least squares), `raw` without "
    "it; SI log RMSE is the standard deviation of log depth error; `order` the part of random pixel pairs in the right "
    "order (a constant gets 0.5). Normals: mean angle, degrees. LPIPS (AlexNet) only where the lpips package and its "
    "weights are installed."
)


def run(
    *, data: Path | None, output: Path, predictor: str = "auto", limit: int = 0, split: str = "test",
    photographic: bool = True, pictures: int = 8, seed: int = 0, device: str = "auto",
) -> None:  # fmt: skip
    """Score predictors (comma-separated) on `data`.

    `limit` scores at most so many samples, spread over the set (0: all); `split` is InteriorVerse's; `pictures` are
    drawn into sheet.png.
    """
    if data is None:
        raise InputError("This benchmark needs labelled pictures: --data DIR (docs/training.md says which layouts).")
    from materialist.bench.predictors import opened

    rows: list[dict[str, Any]] = []
    strips: dict[int, list] = {}
    for spec in predictor.split(","):
        source = opened(spec, device)
        for k, (name, photo, truth) in enumerate(labelled(data, split=split, limit=limit, photographic=photographic)):
            prediction, row = _scored(source, photo, truth, seed)
            rows.append({"method": spec, "sample": name, **row})
            if k < pictures:
                strips.setdefault(k, [photo.linear]).append(prediction)
                strips[k].append(truth) if spec == predictor.split(",")[-1] else None
    rows = _with_pooled(rows)
    settings = {"data": str(data), "split": split, "photographic": photographic, "seed": seed}
    write(Report("Predicted maps", NOTE, settings, COLUMNS, rows, plotted=("albedo_psnr", "normal_angle")), output)
    _draw(list(strips.values()), output / "sheet.png")


def labelled(
    data: Path, *, split: str = "test", limit: int = 0, photographic: bool = True
) -> Iterator[tuple[str, Photo, Prediction]]:
    """(name, photo, truth) of every sample; see the module for what `data` may be. Raises InputError."""
    folders = photo_folders(data)
    if folders:
        for folder in _spread(folders, limit):
            yield folder.name, *_read_folder(folder)
        return
    from materialist.train.samples import SampleFolder
    from materialist.train.sources import open_source
    from materialist.train.tasks import as_photo

    source = open_source(data, split=split)
    procedural = isinstance(source, SampleFolder)
    for index in _spread(list(range(len(source))), limit):
        sample = source.read(index)
        seen = as_photo(sample, np.random.default_rng((11, index))) if procedural and photographic else sample
        linear = np.clip(seen.image, 0, 1).astype(np.float32)
        height, width = linear.shape[:2]
        fov = 2 * np.degrees(np.arctan(sample.rays[0, -1, 0] * width / (width - 1)))
        photo = Photo(linear=linear, camera=Camera(width, height, float(fov)), original=linear, fov_source="option")
        yield f"{index:07d}", photo, sample.truth()


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
    return replace(photo, linear=np.clip(photo.linear, 0, 1)), MapsPredictor(maps).predict(photo)


def _spread(things: list, limit: int) -> list:
    """At most `limit` of them (0: all), evenly spread."""
    if not limit or limit >= len(things):
        return things
    return [things[k] for k in np.unique(np.linspace(0, len(things) - 1, limit).astype(int))]


def _scored(source: Any, photo: Photo, truth: Prediction, seed: int) -> tuple[Prediction, dict[str, float]]:
    """The prediction and its figures."""
    from materialist.bench.predictors import predicted
    from materialist.train.scores import best_scale, ordinal_accuracy, score

    prediction, seconds = predicted(source, photo, seed)
    found = score(prediction, truth)
    surface = truth.depth > 0
    if surface.any():
        found["depth_order"] = ordinal_accuracy(prediction.depth, truth.depth)
        scale = best_scale(prediction.materials.albedo, truth.materials.albedo, surface)
        distance = lpips(prediction.materials.albedo * np.float32(scale), truth.materials.albedo)
        found |= {} if distance is None else {"albedo_lpips": distance}
    return prediction, {**found, "seconds": seconds}


def _with_pooled(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows with the pooled PSNRs of their method, the same in each, so that the table of means shows them."""
    from materialist.train.scores import summary

    figures = ("roughness_psnr_pooled", "metallic_psnr_pooled")
    pooled = {}
    for method in {row["method"] for row in rows}:
        means = summary([{k: v for k, v in r.items() if k.endswith("_mse")} for r in rows if r["method"] == method])
        pooled[method] = {k: means[k] for k in figures if k in means}
    return [{**row, **pooled[row["method"]]} for row in rows]


def lpips(a: Array, b: Array) -> float | None:
    """LPIPS (AlexNet) of two linear pictures [H, W, 3], sRGB-encoded; None where it is not installed with weights."""
    network = _lpips_network()
    if network is None:
        return None
    import torch

    from materialist.color import linear_to_srgb

    as_tensor = lambda x: torch.from_numpy(linear_to_srgb(x) * 2 - 1).permute(2, 0, 1)[None]  # noqa: E731
    with torch.inference_mode():
        return float(network(as_tensor(a), as_tensor(b)))


def _lpips_network(_kept: list = []) -> Any:  # noqa: B006 (the list is the memory)
    """The lpips package's network, once; None unless the package and its backbone are here: nothing is downloaded."""
    if not _kept:
        import torch

        backbone = list((Path(torch.hub.get_dir()) / "checkpoints").glob("alexnet*"))
        try:
            from lpips import LPIPS  # type: ignore[import-not-found]
        except ImportError:
            LPIPS = None
        _kept.append(LPIPS(net="alex", verbose=False).eval() if LPIPS is not None and backbone else None)
    return _kept[0]


def _draw(lines: list[list], path: Path) -> None:
    """Each picture with the maps of every predictor under each other, the truth last."""
    from materialist.train.sheets import strip, write_sheet

    write_sheet([strip(image, *predictions) for image, *predictions in lines], path)
