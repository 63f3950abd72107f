"""`bench edit`: the fidelity of edits on synthetic photographs whose true edited picture is known.

The paper shows its edits (sections "Material Editing", "Object insertion and relighting") without such figures.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from materialist import metrics
from materialist.bench.benchmark import Benchmark, Clock
from materialist.bench.edits import Edit, edits, true_scene
from materialist.bench.report import CEILING, Column, Report, write
from materialist.color import linear_to_srgb
from materialist.errors import InputError
from materialist.procedural.synthetic import SyntheticSample, make_sample
from materialist.types import Array, Photo, Scene

KINDS = ("hue", "metal", "relight", "insert")
COLUMNS = (
    Column("inside", "PSNR inside", "higher", 2),
    Column("outside", "PSNR outside", "higher", 2),
    Column("overall", "PSNR overall", "higher", 2),
    Column("fit_seconds", "fit s", "lower", 1),
    Column("seconds", "s", "lower", 2),
    Column("cpu_seconds", "CPU s", "lower", 2),
)
NOTE = """Synthetic photographs are fitted, edited and compared with the true scene, rendered after the same edit;
PSNR on sRGB-encoded, clipped pictures. `hue` turns the largest object's albedo by 120 degrees, `metal` makes it copper
(roughness 0.3), `relight` shows the photo under another light, `insert` puts a cup on the floor. Inside is the edited
object; for `insert` the cup and every pixel in which the true picture changes by more than 0.02; for `relight` all.
`ceiling` is the same edit path-traced with the true maps and the true light on the mesh of the true depth, no photo in
it; `ceiling, composite` the same brought into the photo. `edit` is fitted with the true maps as prior, composited;
`edit, predicted` with the predictor that is named. `untouched`
is the photo as it was. `preview` rows: seconds of one preview by cached transport, `final` those of the composite at
256 paths, both at the latency size, and of bringing it into a photo of 24 megapixels (without the paths); CPU seconds
hardly depend on what else the computer does."""


@dataclass(frozen=True, kw_only=True)
class EditBench(Benchmark):
    """Edit `scenes` synthetic photos of `size` pixels in the `kinds` of ways (separated by commas).

    `predictor` adds a row fitted with that predictor's maps;
    `latency` is the size of the picture that previews and the final edit are timed on, 0 for no such rows. The report
    is written after every row.
    """

    least: ClassVar = {"size": 32, "spp": 2, "truth_spp": 1}

    scenes: int = 3
    size: int = 96
    kinds: str = ",".join(KINDS)
    predictor: str = ""
    spp: int = 256
    truth_spp: int = 576
    latency: int = 512
    large: int = 4900  # sides of the large photo that an edit is brought into, pixels

    def run(self, data: Path | None, output: Path) -> None:
        chosen = tuple(kind.strip() for kind in str(self.kinds).split(","))
        for kind in chosen:
            if kind not in KINDS:
                raise InputError(f"There is no edit '{kind}' in bench edit; choose of: {', '.join(KINDS)}.")
        from rich.console import Console
        from rich.progress import track

        from materialist.render.variant import setup

        setup(self.device)
        rows: list[dict[str, Any]] = []
        strips: list[list[Array]] = []
        report = Report("Edits", NOTE, self.settings(data), COLUMNS, rows, draw=lambda _, path: _sheet(strips, path))
        for scene in track(range(self.scenes), "bench edit", console=Console(stderr=True)):
            sample, other = (
                make_sample(scene, 0, k, size=self.size, data=data, seed=self.seed) for k in (scene, scene + 1)
            )
            for row in _edited(self, sample, other.envmap, chosen, strips):
                rows.append({**row, "sample": sample.name})
                write(report, output)
        if self.latency:
            for row in _latencies(self, data):
                rows.append(row)
                write(report, output)


def _edited(
    bench: EditBench, sample: SyntheticSample, light: Array, kinds: tuple[str, ...], strips: list[list[Array]]
) -> Iterator[dict[str, Any]]:
    """Rows of all edits of one sample."""
    from materialist import pipeline

    def inverted(**options: Any) -> tuple[Scene, float]:
        clock = Clock()
        found = pipeline.invert(sample.photo, seed=bench.seed, device=bench.device, **options)
        return found, clock.read()["seconds"]

    fitted = {"edit": inverted(prior=sample.truth)}
    if bench.predictor:
        fitted["edit, predicted"] = inverted(predictor=bench.predictor)
    perfect = true_scene(sample)
    for edit in edits(sample, light, kinds):
        yield from _compared(bench, edit, sample, perfect, fitted, strips)


def _compared(
    bench: EditBench, edit: Edit, sample: SyntheticSample, perfect: Scene,
    fitted: dict[str, tuple[Scene, float]], strips: list[list[Array]],
) -> Iterator[dict[str, Any]]:  # fmt: skip
    """Rows of one edit: untouched, the ceilings, and each fit."""
    from materialist.edits.composite.composite import composite

    before = sample.render(sample.envmap, spp=bench.truth_spp, seed=bench.seed + 5)
    after = edit.render(edit.envmap, spp=bench.truth_spp, seed=bench.seed + 5)
    inside = edit.region(before, after)
    score = lambda picture: _scores(picture, after, inside)  # noqa: E731
    yield {"method": f"{edit.kind}: untouched", **score(sample.photo.linear)}
    shared: dict[str, Any] = {"spp": bench.spp, "seed": bench.seed, "device": bench.device}
    strip = [linear_to_srgb(p) for p in (sample.photo.linear, after)]
    strips.append(strip)
    truly = edit.change(perfect)
    best = composite(perfect, truly, full_render=True, **shared)
    strip.append(linear_to_srgb(best))
    yield {"method": f"{CEILING} {edit.kind}", **score(best)}
    brought = composite(perfect, truly, **shared)
    yield {"method": f"{CEILING} {edit.kind}, composite", **score(brought)}
    for name, (scene, fit_seconds) in fitted.items():
        clock = Clock()
        picture = composite(scene, edit.change(scene), **shared)
        strip.append(linear_to_srgb(picture))
        yield {"method": f"{edit.kind}: {name}", **score(picture), "fit_seconds": fit_seconds, **clock.read()}


def _scores(picture: Array, truth: Array, inside: Array) -> dict[str, float]:
    """PSNR inside, outside and overall; nan where there is no such pixel."""
    inner = metrics.psnr(picture, truth, mask=inside) if inside.any() else np.nan
    outer = np.nan if inside.all() else metrics.psnr(picture, truth, mask=~inside)
    return {"inside": inner, "outside": outer, "overall": metrics.psnr(picture, truth)}


def _latencies(bench: EditBench, data: Path | None) -> Iterator[dict[str, Any]]:
    """How long previews and a final edit take; the scene has the true maps, which cost the same as fitted ones."""
    from materialist.edits.composite.composite import composite
    from materialist.edits.composite.into_photo import into_photo
    from materialist.edits.composite.layers import render_layers
    from materialist.edits.core.renderer import EditRenderer
    from materialist.edits.light.relight import relight
    from materialist.edits.material.material import edit
    from materialist.edits.preview import Preview

    size, seed, device = bench.latency, bench.seed, bench.device
    scene = true_scene(make_sample(0, 0, 0, size=size, data=data, seed=seed, spp=16))
    mask = np.zeros(scene.depth.shape, bool)
    mask[size // 3 : size // 2, size // 3 : size // 2] = True
    mask &= scene.depth > 0
    clock = Clock()
    preview = Preview(scene, seed=seed, device=device)
    sample = f"{size} x {size}"
    yield {"method": "preview: built once", "sample": sample, **clock.read()}
    changes = [edit(scene, mask, hue=30.0 * k, roughness=0.1 * k) for k in range(1, 6)]
    turns = [relight(scene, rotate=40.0 * k) for k in range(1, 4)]
    for name, edited in (("preview: material", changes), ("preview: light", turns)):
        preview.render(edited[0])  # the first one compiles
        for one in edited[1:]:
            clock = Clock()
            preview.render(one)
            yield {"method": name, "sample": sample, **clock.read()}
    clock = Clock()
    composite(scene, changes[0], spp=256, seed=seed, device=device)
    yield {"method": "final: material, 256 paths", "sample": sample, **clock.read()}
    layers = render_layers(EditRenderer(scene, device=device), changes[0], spp=16, seed=seed)
    photo = _enlarged(scene.photo, bench.large)
    clock = Clock()
    into_photo(photo, layers)
    yield {"method": "final: into a large photo", "sample": f"{bench.large} x {bench.large}", **clock.read()}


def _enlarged(photo: Photo, side: int, noise: float = 0.03) -> Photo:
    """The same photo with an original of `side` pixels, and grain."""
    import cv2

    large = np.asarray(cv2.resize(photo.original, (side, side), interpolation=cv2.INTER_CUBIC))
    grain = noise * np.random.default_rng(0).standard_normal((side, side, 1), np.float32)
    return replace(photo, original=np.clip(large * (1 + grain), 0, 1))


def _sheet(strips: list[list[Array]], path: Path) -> None:
    """A row for each edit: photo, truth, ceilings, edits."""
    from materialist.io.image import write_png_bytes

    if not strips:
        return
    gap = np.ones((strips[0][0].shape[0], 3, 3), np.float32)
    rows = [np.concatenate([part for picture in strip for part in (picture, gap)], 1) for strip in strips]
    width = max(row.shape[1] for row in rows)
    padded = [np.pad(row, ((0, 3), (0, width - row.shape[1]), (0, 0)), constant_values=1) for row in rows]
    write_png_bytes(path, np.round(np.concatenate(padded) * 255).astype(np.uint8))
