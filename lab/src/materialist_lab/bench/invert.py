"""`bench invert`: what an inversion costs and how good it is, by size, run as a user runs it.

`materialist invert` as a user runs it, every size in a fresh process. Seconds are wall clock from the start of the
process to its end, starting Python, reading and writing included; peak MB is its resident memory as report.json has it.
PSNR and SSIM compare the path-traced re-rendering (no denoiser) with the photo, sRGB-encoded; L1 figures are mean
distances of the fitted maps from the prior; `other` is the time that no stage claims: starting Python, tables between
the stages, writing. Sizes beyond the photo's own enlarge it (bicubic); the maps of the prior are
brought to each size by the predictor. `one step` compares one step of the material fit (all maps, full resolution, with
gradients; medians after a warm-up) in one process: with the cached transport, and with Mitsuba's PRB at 64 spp and
depth 4, the paper's.
"""

import json
import tempfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from materialist.buffers import placed
from materialist.errors import InputError
from materialist.fit.engine import PathEngine, TransportEngine
from materialist.fit.invert import stacked
from materialist.geometry.build import build_geometry
from materialist.io.exr import write_exr
from materialist.io.image import write_png
from materialist.io.photo import read_photo
from materialist.option_kinds import option
from materialist.predict import get_predictor
from materialist.render.scene import RenderScene
from materialist.render.variant import setup
from materialist.types import Photo, Prediction
from materialist_lab.bench.benchmark import (
    COUNT,
    COUNT_OR_0,
    Benchmark,
    Row,
    materialist,
    numbers,
    timed,
)
from materialist_lab.bench.report import Column, Report
from materialist_lab.procedural.synthetic import make_sample

NATIVE = 512
"""Longer side of the synthetic photo; larger working sizes enlarge it."""
STAGES = {
    "predict": "prior",
    "geometry": "mesh",
    "scene": "scene",
    "engine": "cache",
    "light": "light",
    "materials": "materials",
    "rerender": "re-render",
}
"""Stages of report.json, and what the table calls them; see `stages` for the rest."""


@dataclass(frozen=True)
class InvertedPhoto:
    """The photo to invert and where its prior comes from."""

    name: str
    photo: Path | str
    predictor: str
    fov: str = "auto"


@dataclass(frozen=True, kw_only=True)
class InvertBench(Benchmark):
    """Invert one photo at every size, and compare the cost of a step with the paper's.

    The photo is DATA/official_indoor/photo.png (or DATA/photo.png) with the maps beside it as the prior; without
    `data`, a synthetic one with its true maps; or `photo`. Raises InputError for data without photo.
    """

    columns = (
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

    sizes: str = option("256,512", "Longer sides, pixels, with commas.", kind="name")
    photo: str = option(
        "", "A file or example:NAME, inverted with the default predictor.", kind="name"
    )
    step_size: int = option(512, "Size of the step comparison; 0: none.", **COUNT_OR_0)
    preset: str = option("default", "That of `invert`.", kind="name")
    completion: str = option("auto", "That of `invert`.", kind="name")
    at_once: int = option(1, "With 2 or more, so many inversions at the same time, too.", **COUNT)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        # A synthetic photo is made once, as large as the largest size needs it.
        sizes = numbers("sizes", self.sizes, 16, 8192)
        with tempfile.TemporaryDirectory(prefix="materialist-bench-") as temporary:
            folder = Path(temporary)
            case = photo_case(self, data, self.photo, folder, min(NATIVE, max(sizes)))
            report.settings["photo"] = case.name
            options = ("--preset", self.preset, "--completion", self.completion)
            # --- Whole inversions ---
            for size in sizes:
                yield inversion(self, case, size, folder, *options)
                if self.at_once > 1:
                    yield self._together(case, size, folder, *options)
            # --- One step of the material fit ---
            if self.step_size:
                photo = read_photo(
                    _at_least(case, self.step_size, folder), size=self.step_size, fov=case.fov
                )
                prior = get_predictor(case.predictor, device=self.device).predict(
                    photo, seed=self.seed
                )
                yield step_row(photo, prior, self) | {"sample": case.name}

    def _together(self, case: InvertedPhoto, size: int, folder: Path, *options: str) -> Row:
        """The row of `at_once` inversions: the time until the last of them ends. Twice that of one is fair for two."""
        # Folders of their own: scenes of one size have one name.
        places = [Path(tempfile.mkdtemp(dir=folder)) for _ in range(self.at_once)]
        with ThreadPoolExecutor(self.at_once) as pool:
            cost = timed(
                lambda: list(
                    pool.map(lambda place: inversion(self, case, size, place, *options), places)
                )
            )[1]
        return {
            "method": f"{self.at_once} at once, {size}",
            "sample": case.name,
            "seconds": cost["seconds"],
        }


def photo_case(
    bench: Benchmark, data: Path | None, photo: str, folder: Path, size: int
) -> InvertedPhoto:
    """What to invert, by the options; a synthetic photo with its true maps is written into `folder`."""
    # --- A photo of the user's, of DATA, or a synthetic one ---
    if photo:
        return InvertedPhoto(Path(photo).name, photo, "auto")
    if data is not None:
        for place in (data / "official_indoor", data):
            if (place / "photo.png").is_file() and (place / "maps").is_dir():
                return InvertedPhoto(place.name, place / "photo.png", f"maps:{place / 'maps'}")
        raise InputError(
            f"{data} holds neither official_indoor/ nor photo.png with maps/ beside it; give such a folder, a --photo, "
            "or leave out --data for a synthetic photo."
        )
    # The true maps are the prior, as the published network's are for DATA.
    setup(bench.device)
    sample = make_sample(0, 0, 0, size=size, seed=bench.seed)
    write_png(folder / "photo.png", sample.photo.linear)
    (folder / "maps").mkdir()
    for name, values in {**vars(sample.truth.materials), "normal": sample.truth.normal}.items():
        write_exr(folder / "maps" / f"{name}.exr", values)
    write_exr(folder / "maps" / "depth.exr", sample.truth.depth)
    return InvertedPhoto(
        "synthetic",
        folder / "photo.png",
        f"maps:{folder / 'maps'}",
        f"{sample.photo.camera.fov:.6g}",
    )


def inversion(bench: Benchmark, case: InvertedPhoto, size: int, folder: Path, *options: str) -> Row:
    """The row of one inversion at `size`, in a process of its own; scratch files go into `folder`."""
    photo = _at_least(case, size, folder)
    scene = folder / f"scene{size}"
    command = (
        "invert",
        str(photo),
        "-o",
        str(scene),
        "--predictor",
        case.predictor,
        "--fov",
        case.fov,
        "--size",
        str(size),
        "--seed",
        str(bench.seed),
        "--device",
        bench.device,
        "--json",
        *options,
    )
    # The clock sees what a user waits for: start of Python, reading and writing included.
    seconds = timed(lambda: materialist(*command))[1]["seconds"]
    report = json.loads((scene / "report.json").read_text())
    camera = json.loads((scene / "scene.json").read_text())["camera"]
    # Column -> key in the inversion's report; those that it lacks stay empty.
    names = {f"{name}_l1": f"prior_l1_{name}" for name in ("albedo", "roughness", "metallic")}
    names |= {"psnr": "rerender_psnr_path", "ssim": "rerender_ssim_path", "peak_mb": "peak_rss_mb"}
    return {
        "method": f"{camera['width']} × {camera['height']}",
        "sample": case.name,
        "seconds": seconds,
        "seconds_per_mpixel": seconds / (camera["width"] * camera["height"]) * 1e6,
        **{
            ours: report[theirs] for ours, theirs in names.items() if report.get(theirs) is not None
        },
        **stages(report["stages"], seconds),
    }


def _at_least(case: InvertedPhoto, size: int, folder: Path) -> Path | str:
    """The photo, or a copy enlarged to `size` when it is smaller: `invert` itself never enlarges."""
    linear = read_photo(case.photo, size=size).linear
    height, width = linear.shape[:2]
    scale = size / max(height, width)
    if scale <= 1:
        return case.photo
    target = (round(width * scale), round(height * scale))
    path = folder / f"photo{size}.png"
    write_png(path, np.clip(cv2.resize(linear, target, interpolation=cv2.INTER_CUBIC), 0, 1))
    return path


def stages(timings: list[dict[str, Any]], seconds: float) -> dict[str, float]:
    """Seconds by stage, repeated stages added up; `other` is what no stage claims, start and writing among it."""
    spent: Counter[str] = Counter()
    for stage in timings:
        # Stages named by what they move, as albedo, count as materials.
        name = {"trace": "engine"}.get(stage["name"], stage["name"])
        spent[name if name in STAGES else "materials"] += stage["seconds"]
    return {
        **{f"{name}_s": spent[name] for name in STAGES},
        "other_s": seconds - sum(spent.values()),
    }


def step_row(photo: Photo, prior: Prediction, bench: Benchmark) -> Row:
    """One step of a material fit, cached and by Mitsuba's path replay backpropagation, in this process.

    Both render at full resolution with gradients of all maps; only the engine differs. The first four cached steps
    allocate memory, and the first one of PRB compiles kernels; they do not count. The light is grey, which changes no
    cost.
    """
    seed = bench.seed
    camera = photo.camera
    light = np.full((256, 512, 3), 0.6, np.float32)
    # --- Both engines for one scene, on the pixels that the cached one fits ---
    geometry = build_geometry(prior.depth, prior.normal, camera, seed=seed)
    cached: Any = TransportEngine(geometry, camera, photo.linear, seed=seed)
    problem, traced = timed(lambda: cached.material_problem(light))
    mesh = RenderScene(geometry, camera, device=bench.device)
    path: Any = PathEngine(mesh, camera, cached.pixels.numpy(), seed=seed)
    # --- Steps: L1 and its gradients, without the optimiser, which is the same for both ---
    maps = placed(stacked(prior.materials))[cached.pixels]
    target = placed(photo.linear.reshape(-1, 3))[cached.pixels]

    def seconds(problem: Any, steps: int) -> list[float]:
        def step() -> None:
            (problem(maps.clone().requires_grad_()) - target).abs().mean().backward()

        return [timed(step)[1]["seconds"] for _ in range(steps)]

    fast = np.median(seconds(problem, 24)[4:])
    slow = np.median(seconds(path.material_problem(light), 3)[1:])
    return {
        "method": f"one step, {camera.width} × {camera.height}",
        "cached_step_ms": 1000 * fast,
        "prb_step_s": slow,
        "prb_per_cached": slow / fast,
        "engine_s": traced["seconds"],
    }
