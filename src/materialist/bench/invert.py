"""`bench invert`: what an inversion costs and how good it is, by size, run as a user runs it."""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from materialist.bench.benchmark import Benchmark
from materialist.bench.process import message, watched
from materialist.bench.report import Column, Report, write
from materialist.errors import InputError
from materialist.types import Photo

NATIVE = 512
"""Longer side of the synthetic photo; larger working sizes enlarge it."""
LARGEST = 8192
"""As `invert --size` takes it."""

NOTE = """`materialist invert` as a user runs it, every size in a fresh process. Seconds are wall clock from the start
of the process to its end, starting Python, reading and writing included, and so is the peak of its resident memory.
PSNR and SSIM compare the path-traced re-rendering (no denoiser) with the photo, sRGB-encoded; L1 figures are mean
distances of the fitted maps from the prior; `other` is the time that no stage claims: starting Python, tables and
corrections between the stages, writing. Sizes beyond the photo's own enlarge it (bicubic); the maps of the prior
are brought to each size by the predictor."""

STEP_NOTE = """`one step` compares one step of the material fit (all maps, full resolution, with gradients; medians
after a warm-up) in one process: with the cached transport, and with Mitsuba's PRB at 64 spp and depth 4, the
paper's."""

STAGES = {
    "predict": "prior",
    "walls": "walls",
    "geometry": "mesh",
    "scene": "scene",
    "engine": "cache",
    "light": "light",
    "materials": "materials",
    "rerender": "re-render",
}
"""Stages of report.json, and what the table calls them; see `_stages` for the rest."""

COLUMNS = (
    Column("seconds", "s", digits=1),
    Column("seconds_per_mpixel", "s per Mpixel", digits=0),
    Column("peak_mb", "peak MB", digits=0),
    Column("psnr", "PSNR", digits=2),
    Column("ssim", "SSIM"),
    Column("albedo_l1", "albedo L1"),
    Column("roughness_l1", "roughness L1"),
    Column("metallic_l1", "metallic L1"),
    *(Column(f"{key}_s", f"{title} s", digits=1) for key, title in STAGES.items()),
    Column("other_s", "other s", digits=1),
    Column("cached_step_ms", "cached step ms", digits=0),
    Column("prb_step_s", "PRB step s", digits=1),
    Column("prb_per_cached", "PRB / cached", digits=0),
)


@dataclass(frozen=True)
class Case:
    """The photo to invert and where its prior comes from."""

    name: str
    photo: Path | str
    predictor: str
    fov: str = "auto"


@dataclass(frozen=True, kw_only=True)
class InvertBench(Benchmark):
    """Invert one photo at every size (longer side, pixels), and compare the cost of a step with the paper's.

    The photo is DATA/official_indoor/photo.png (or DATA/photo.png) with the maps beside it as the prior; without
    `data`, a synthetic one with its true maps; or `photo`, a file or example:NAME, with the default predictor.
    `step_size` is the size of the step comparison; 0 leaves it out. The report is written after every size.
    Raises InputError for sizes that `invert` does not take, data without photo, or when an inversion fails.
    """

    sizes: str | int = "256,512"
    photo: str | None = None
    step_size: int = 512
    preset: str = "default"
    completion: str = "auto"

    def run(self, data: Path | None, output: Path) -> None:
        wanted = _sizes(self.sizes)
        rows: list[dict[str, Any]] = []
        with tempfile.TemporaryDirectory(prefix="materialist-bench-") as temporary:
            folder = Path(temporary)
            case = photo_case(data, self.photo, folder, min(NATIVE, max(wanted)), self.seed, self.device)
            note = f"{NOTE}\n{STEP_NOTE}" if self.step_size else NOTE
            report = Report("Inversion", note, self.settings(data, photo=case.name), COLUMNS, rows, draw=plot)
            options = [
                "--preset",
                self.preset,
                "--completion",
                self.completion,
                "--seed",
                str(self.seed),
                "--device",
                self.device,
            ]
            for size in wanted:
                rows.append(inversion(case, size, folder, options))
                write(report, output)
            if self.step_size:
                rows.append(_step_row(case, self.step_size, folder, self.seed, self.device))
                write(report, output)


def _sizes(text: str | int) -> list[int]:
    """[256, 512] of "256,512". Raises InputError for anything but whole numbers that `invert --size` takes."""
    try:
        sizes = [int(part) for part in str(text).split(",")]
    except ValueError:
        sizes = []
    if not sizes or not all(16 <= size <= LARGEST for size in sizes):
        raise InputError(f"Sizes are {text!r}; give whole numbers from 16 to {LARGEST} with commas, as in 256,512.")
    return sizes


def photo_case(data: Path | None, photo: str | None, folder: Path, size: int, seed: int, device: str) -> Case:
    """What to invert, by the options; a synthetic photo is written into `folder`."""
    if photo is not None:
        return Case(Path(photo).name, photo, "auto")
    if data is None:
        return _synthetic(folder, size, seed, device)
    for place in (data / "official_indoor", data):
        if (place / "photo.png").is_file() and (place / "maps").is_dir():
            return Case(place.name, place / "photo.png", f"maps:{place / 'maps'}")
    raise InputError(
        f"{data} holds neither official_indoor/ nor photo.png with maps/ beside it; give such a folder, a --photo, or "
        "leave out --data for a synthetic photo."
    )


def _synthetic(folder: Path, size: int, seed: int, device: str) -> Case:
    """A photo of the benchmark's own scenes, with its true maps as the prior."""
    from materialist.io.exr import write_exr
    from materialist.io.image import write_png
    from materialist.procedural.synthetic import make_sample
    from materialist.render.variant import setup

    setup(device)
    sample = make_sample(0, 0, 0, size=size, seed=seed)
    maps = folder / "maps"
    maps.mkdir()
    write_png(folder / "photo.png", sample.photo.linear)
    materials = sample.truth.materials
    named = {"albedo": materials.albedo, "roughness": materials.roughness, "metallic": materials.metallic}
    for name, values in {**named, "normal": sample.truth.normal, "depth": sample.truth.depth}.items():
        write_exr(maps / f"{name}.exr", values)
    return Case("synthetic", folder / "photo.png", f"maps:{maps}", f"{sample.photo.camera.fov:.6g}")


def inversion(case: Case, size: int, folder: Path, options: list[str]) -> dict[str, Any]:
    """The row of one inversion at `size`, in a process of its own; scratch files go into `folder`."""
    photo, scene = _at_least(case, size, folder), folder / f"scene{size}"
    command = [sys.executable, "-m", "materialist", "invert", str(photo), "-o", str(scene), "--json"]
    command += ["--predictor", case.predictor, "--fov", case.fov, "--size", str(size), *options]
    start = time.perf_counter()
    code, answer, peak_mb = watched(command)
    seconds = time.perf_counter() - start
    if code != 0:
        raise InputError(f"The inversion at size {size} ended with code {code}: {message(answer)}")
    report = json.loads((scene / "report.json").read_text())
    camera = json.loads((scene / "scene.json").read_text())["camera"]
    pixels = camera["width"] * camera["height"]
    return {
        "method": f"{camera['width']} × {camera['height']}",
        "sample": case.name,
        "pixels": pixels,
        "seconds": seconds,
        "seconds_per_mpixel": seconds / pixels * 1e6,
        "peak_mb": peak_mb,
        **_quality(report),
        **_stages(report, seconds),
    }


def _at_least(case: Case, size: int, folder: Path) -> Path | str:
    """The photo, or a copy enlarged to `size` when it is smaller: `invert` itself never enlarges."""
    import cv2
    import numpy as np

    from materialist.io.image import write_png

    linear = _photo(case, size).linear
    height, width = linear.shape[:2]
    scale = size / max(height, width)
    if scale <= 1:
        return case.photo
    target = (round(width * scale), round(height * scale))
    path = folder / f"photo{size}.png"
    write_png(path, np.clip(cv2.resize(linear, target, interpolation=cv2.INTER_CUBIC), 0, 1))
    return path


def _photo(case: Case, size: int) -> Photo:
    from materialist.io.photo import read_photo

    return read_photo(case.photo, size=size, fov=case.fov)


def _quality(report: dict[str, Any]) -> dict[str, float]:
    names = {f"{name}_l1": f"prior_l1_{name}" for name in ("albedo", "roughness", "metallic")}
    names |= {"psnr": "rerender_psnr_path", "ssim": "rerender_ssim_path"}
    return {ours: report[theirs] for ours, theirs in names.items() if report.get(theirs) is not None}


def _stages(report: dict[str, Any], seconds: float) -> dict[str, float]:
    """Seconds by stage, repeated stages added up; `other` is what no stage claims, start and writing among it."""
    spent: Counter[str] = Counter()
    for stage in report["stages"]:
        # Stages named by what they move, as the paper's, count as materials.
        name = {"prior light": "light", "trace": "engine"}.get(stage["name"], stage["name"])
        name = name if name in STAGES else "materials"
        spent[name] += stage["seconds"]
    return {**{f"{name}_s": spent[name] for name in STAGES}, "other_s": seconds - sum(spent.values())}


def _step_row(case: Case, size: int, folder: Path, seed: int, device: str) -> dict[str, Any]:
    """The row of the step comparison, measured in this process."""
    from dataclasses import replace

    from materialist.bench.steps import step_costs
    from materialist.predict import get_predictor

    photo = _photo(replace(case, photo=_at_least(case, size, folder)), size)
    prior = get_predictor(case.predictor).predict(photo, seed=seed)
    costs = step_costs(photo, prior, seed=seed, device=device)
    return {
        "method": f"one step, {photo.camera.width} × {photo.camera.height}",
        "sample": case.name,
        "cached_step_ms": 1000 * costs["cached_step"],
        "prb_step_s": costs["prb_step"],
        "prb_per_cached": costs["prb_per_cached"],
        "engine_s": costs["cache_seconds"],
    }


def plot(report: Report, path: Path) -> None:
    """Seconds and memory against pixels, both axes logarithmic, beside the line of exact proportion."""
    import numpy as np
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = sorted((row for row in report.rows if "pixels" in row), key=lambda row: row["pixels"])
    figure = Figure(figsize=(8, 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    pixels = np.array([row["pixels"] for row in rows]) / 1e6
    for axis, (key, title) in zip(
        figure.subplots(1, 2), (("seconds", "wall seconds"), ("peak_mb", "peak memory, MB")), strict=True
    ):
        values = np.array([row[key] or np.nan for row in rows])
        # A shorter axis would make noise look like growth.
        axis.set(xscale="log", yscale="log", ylim=(np.nanmin(values) / 2, np.nanmax(values) * 2))
        axis.plot(pixels, values, "o-", color="#1f3b5c")
        axis.plot(pixels, values[-1] * pixels / pixels[-1], "--", color="#9db8d9", label="proportional to pixels")
        for x, y in zip(pixels, values, strict=True):
            axis.annotate(f"{y:.0f}", (x, y), textcoords="offset points", xytext=(0, 6), ha="center", fontsize=8)
        axis.set_title(title, fontsize=9)
        axis.set_xlabel("Mpixel", fontsize=8)
        axis.margins(x=0.12)
        axis.tick_params(labelsize=8, which="both")
        axis.legend(fontsize=8)
        axis.grid(which="both", alpha=0.25)
    figure.savefig(path, dpi=110)
