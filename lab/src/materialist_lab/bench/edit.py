"""`bench edit`: the fidelity of edits on synthetic photographs whose true edited picture is known.

Synthetic photographs are fitted, edited and compared with the true scene, rendered after the same edit; PSNR on
sRGB-encoded, clipped pictures; docs/benchmarks.md says what the edits and rows are. Inside is the edited object; for
`insert` the cup and every pixel in which the true picture changes by more than 0.02; for `relight` all. `preview` rows:
seconds of one preview by cached transport, `final` those of an edit and its composite, `drop` those of a film, at the
latency size, and of bringing it into a photo of 24 megapixels (without the paths); CPU seconds hardly depend on what
else the computer does. sheet.png, from the left: photo, truth, ceiling, edit.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from materialist import metrics, pipeline
from materialist.color import linear_to_srgb
from materialist.edits.composite.composite import composite, pictures
from materialist.edits.composite.into_photo import into_photo
from materialist.edits.composite.layers import render_layers
from materialist.edits.core.renderer import EditRenderer, RenderOptions
from materialist.edits.drop.drop import drop
from materialist.edits.glass.glass import glass
from materialist.edits.insert.insert import insert
from materialist.edits.light.relight import relight
from materialist.edits.material import material
from materialist.edits.preview import Preview
from materialist.edits.remove.remove import remove
from materialist.geometry.silhouette import grown
from materialist.option_kinds import option
from materialist.types import Array, Scene
from materialist_lab.bench.benchmark import COUNT, COUNT_OR_0, SIZE, Benchmark, Row, names, timed
from materialist_lab.bench.edits import (
    KINDS,
    Edit,
    awaited,
    cup,
    edits,
    free_place,
    sample_and_light,
    true_scene,
)
from materialist_lab.bench.report import CEILING, Column, Report, side_by_side
from materialist_lab.procedural.synthetic import SyntheticSample

STRAY = 8 / 255
"""Change of an sRGB-encoded channel that is seen as a dot."""
MARGIN = 4
"""Pixels beside those that an edit's light reaches in the truth; the fitted scene's are a little elsewhere."""


@dataclass(frozen=True, kw_only=True)
class EditBench(Benchmark):
    """Edit synthetic photos and compare with the truth."""

    columns = (
        Column("inside", "PSNR inside", "higher", 2),
        Column("outside", "PSNR outside", "higher", 2),
        Column("overall", "PSNR overall", "higher", 2),
        Column("stray", "stray pixels", "lower", 0),
        Column("fit_seconds", "fit s", "lower", 1),
        Column("seconds", "s", "lower", 2),
        Column("cpu_seconds", "CPU s", "lower", 2),
    )

    scenes: int = option(3, "Synthetic photos.", **COUNT_OR_0)
    size: int = option(96, "Their width and height.", **SIZE)
    kinds: str = option(
        ",".join(k for k in KINDS if k not in ("glass", "remove")),
        "Edits, with commas.",
        kind="name",
    )
    spp: int = option(256, "Paths a pixel of composites.", **COUNT)
    truth_spp: int = option(576, "Paths a pixel of the truth.", **COUNT)
    caustics: int = option(
        16, "Times as many of the truth where light comes through glass: few find it.", **COUNT
    )
    latency: int = option(512, "Size of the timed previews and final edit; 0: none.", **COUNT_OR_0)
    frames: int = option(36, "Frames of the timed film (extra physics); 0: none.", **COUNT_OR_0)
    large: int = option(4900, "Side of the large photo that an edit is brought into.", **SIZE)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        kinds = names("kinds", self.kinds, KINDS)
        for scene in range(self.scenes):
            sample, other = sample_and_light(
                scene, 0, scene, size=self.size, data=data, seed=self.seed
            )
            fitted, cost = timed(
                pipeline.invert,
                sample.photo,
                prior=sample.truth,
                seed=self.seed,
                device=self.device,
            )
            # The ceiling: the edit of the true scene.
            perfect = true_scene(sample)
            before = sample.scene.render(sample.envmap, spp=self.truth_spp, seed=self.seed + 5)
            for edit in edits(sample, other, kinds):
                for row in self._compared(
                    edit, sample, before, perfect, (fitted, cost["seconds"]), report
                ):
                    yield {**row, "sample": sample.name}
        if self.latency:
            yield from self._latencies(data)

    def _compared(
        self,
        edit: Edit,
        sample: SyntheticSample,
        before: Array,
        perfect: Scene,
        fitted: tuple[Scene, float],
        report: Report,
    ) -> Iterator[Row]:
        """Rows of one edit: untouched, the ceilings, and the fit; and its strip of the sheet.

        before: the true picture of the photo.
        """
        # Light through glass onto the floor is noisy: more paths.
        caustics = self.caustics if edit.kind == "glass cup" else 1
        after = edit.truth.render(edit.envmap, spp=caustics * self.truth_spp, seed=self.seed + 5)
        inside = edit.region(before, after)
        shared: dict[str, Any] = {"spp": self.spp, "seed": self.seed, "device": self.device}
        photo = sample.photo.linear
        # --- Ceilings: the whole edited picture, and its difference brought into the photo ---
        truly = edit.change(perfect)
        yield {"method": f"{edit.kind}: untouched", **scores(photo, after, inside)}
        best = composite(perfect, truly, full_render=True, **shared)
        yield {"method": f"{CEILING} {edit.kind}", **scores(best, after, inside)}
        brought = composite(perfect, truly, **shared)
        yield {"method": f"{CEILING} {edit.kind}, composite", **scores(brought, after, inside)}
        # --- The edit of the fitted scene ---
        scene, seconds = fitted
        picture, cost = timed(composite, scene, edit.change(scene), **shared)
        yield {
            "method": f"{edit.kind}: edit",
            **scores(picture, after, inside),
            "stray": stray(picture, photo, before, after, inside),
            "fit_seconds": seconds,
            **cost,
        }
        report.sheet.append(side_by_side(photo, after, best, picture))

    def _latencies(self, data: Path | None) -> Iterator[Row]:
        # --- The live preview, once everything is prepared ---
        scene, mask, sample = awaited(self.latency, data, self.seed)
        preview, cost = timed(Preview, scene)
        yield {"method": "preview: built once", "sample": sample, **cost}
        while preview.prepare():
            pass
        changes = [material.edit(scene, mask, hue=30.0 * k, roughness=0.1 * k) for k in range(1, 6)]
        turns = [relight(scene, rotate=40.0 * k) for k in range(1, 4)]
        for name, edited in (("preview: material", changes), ("preview: light", turns)):
            preview.render(edited[0])  # the first one compiles
            for edited_scene in edited[1:]:
                yield {"method": name, "sample": sample, **timed(preview.render, edited_scene)[1]}
        # --- Final pictures ---
        yield from self._finals(
            scene, mask, {"material": lambda: changes[0], "light": lambda: turns[0]}, sample
        )
        layers = render_layers(
            EditRenderer(scene, device=self.device), changes[0], RenderOptions(seed=self.seed)
        )
        # --- Into a large photo, with grain as cameras have it ---
        side = (self.large, self.large)
        large = np.asarray(cv2.resize(scene.photo.original, side, interpolation=cv2.INTER_CUBIC))
        grain = 0.03 * np.random.default_rng(0).standard_normal((*side, 1), np.float32)
        photo = replace(scene.photo, original=np.clip(large * (1 + grain), 0, 1))
        _, cost = timed(into_photo, photo, layers)
        yield {
            "method": "final: into a large photo",
            "sample": f"{self.large} x {self.large}",
            **cost,
        }

    def _finals(
        self, scene: Scene, mask: Array, changes: dict[str, Callable[[], Scene]], sample: str
    ) -> Iterator[Row]:
        """Seconds of edits from their options to their pictures, and of a film."""
        shared: dict[str, Any] = {"seed": self.seed, "device": self.device}
        vessel = cup()[1]
        # Something to stand on; the middle where there is no floor.
        floor = (scene.normal[..., 1] > 0.9) & (scene.depth > 0)
        place = free_place(floor) or (self.latency / 2, self.latency / 2)
        kinds = changes | {
            "insertion": lambda: insert(scene, vessel, place),
            "removal": lambda: remove(scene, mask),
            "glass": lambda: glass(scene, mask),
        }
        for name, change in kinds.items():
            _, cost = timed(lambda change=change: composite(scene, change(), **shared))
            yield {"method": f"final: {name}", "sample": sample, **cost}
        if self.frames:

            def film():
                return list(
                    pictures(scene, drop(scene, vessel, place, frames=self.frames), **shared)
                )

            yield {"method": f"drop: {self.frames} frames", "sample": sample, **timed(film)[1]}


def stray(picture: Array, photo: Array, before: Array, after: Array, inside: Array) -> int:
    """Pixels that an edit moves by more than STRAY farther than its light reaches; pictures [H, W, 3] linear.

    before, after: the true picture without and with the edit. Its light reaches the edited object `inside` [H, W] bool,
    the pixels around which the truth changes in the mean by a level of 255 or more, and MARGIN pixels beyond.
    """
    moved = np.abs(linear_to_srgb(picture) - linear_to_srgb(photo)).max(-1) > STRAY
    smooth = [cv2.GaussianBlur(linear_to_srgb(p), (0, 0), 2.0) for p in (before, after)]
    lit = np.abs(smooth[1] - smooth[0]).max(-1) >= 1 / 255
    return int((moved & ~grown(lit | inside, MARGIN)).sum())


def scores(picture: Array, truth: Array, inside: Array) -> dict[str, float]:
    """PSNR inside [H, W] bool, outside and overall of linear pictures [H, W, 3]; nan where there is no such pixel."""
    inner = metrics.psnr(picture, truth, mask=inside) if inside.any() else np.nan
    outer = np.nan if inside.all() else metrics.psnr(picture, truth, mask=~inside)
    return {"inside": inner, "outside": outer, "overall": metrics.psnr(picture, truth)}
