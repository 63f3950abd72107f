"""`bench glass`: how close an object made glass comes to the same object truly of glass.

The paper's protocol (section "Evaluation of Transparency Editing", and "Sensitivity Analysis of d"): a grey diffuse
object is seen; its glass is predicted from what is seen of it, and compared with a path-traced dielectric within the
object's mask, on sRGB-encoded pictures at the exposure of the photo. Symmetric and asymmetric objects, the true
background or one inpainted.

docs/benchmarks.md says what the rows are. `frame` spreads the same squared error over all pixels of the picture, as a
metric does that is computed after everything outside the mask was made black. The error of `d` is mean absolute over
mean true thickness; `noise` multiplies the predicted d by 1 + e, e uniform in [-0.5, 0.5], one e a draw. The inpainted
background is that of `materialist glass`. LPIPS only where the package and its weights are installed. sheet.png, from
the left: photo, true glass, two_interface by true and by predicted d, closed by predicted d, before the true and the
inpainted background.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from materialist import metrics
from materialist.edits.glass.glass_preview import GlassPreview
from materialist.geometry.silhouette import window
from materialist.option_kinds import option
from materialist.predict.refraction.thickness import Thickness
from materialist.types import Array
from materialist_lab.bench import glass_models as models
from materialist_lab.bench import glass_scenes as scenes
from materialist_lab.bench.benchmark import COUNT, COUNT_OR_0, SIZE, Benchmark, Row, numbers, timed
from materialist_lab.bench.edits import awaited, true_scene
from materialist_lab.bench.glass_models import Background, Case
from materialist_lab.bench.report import CEILING, Column, Report, side_by_side
from materialist_lab.metrics.lpips import lpips
from materialist_lab.procedural.synthetic import photographed

DRAWN = (
    "two_interface, true d",
    "two_interface, predicted d",
    "closed, predicted d",
    "closed, predicted d, inpainted",
)
"""The methods whose pictures are shown."""


@dataclass(frozen=True, kw_only=True)
class GlassBench(Benchmark):
    """Compare the two-interface model and the closed proxy with true glass."""

    columns = (
        Column("psnr_symmetric", "PSNR symmetric", "higher", 2),
        Column("psnr_asymmetric", "PSNR asymmetric", "higher", 2),
        Column("frame_symmetric", "PSNR symmetric, frame", "higher", 2),
        Column("frame_asymmetric", "PSNR asymmetric, frame", "higher", 2),
        Column("ssim_symmetric", "SSIM symmetric", "higher"),
        Column("ssim_asymmetric", "SSIM asymmetric", "higher"),
        Column("lpips_symmetric", "LPIPS symmetric", "lower"),
        Column("lpips_asymmetric", "LPIPS asymmetric", "lower"),
        Column("thickness_symmetric", "d error symmetric", "lower"),
        Column("thickness_asymmetric", "d error asymmetric", "lower"),
        Column("seconds", "s", "lower", 2),
        Column("cpu_seconds", "CPU s", "lower", 2),
    )

    shapes: int = option(2, "Objects of each group.", **COUNT_OR_0)
    jugs: int = option(0, "Jugs with a handle, besides.", **COUNT_OR_0)
    envmaps: int = option(2, "Lights of each object.", **COUNT)
    iors: str = option("1.1,1.3", "Indices of refraction.", kind="name")
    background: str = option(
        "room",
        "A patterned floor and wall, or the light alone.",
        kind="word",
        choices=("room", "envmap"),
    )
    size: int = option(128, "Width and height of the pictures.", **SIZE)
    spp: int = option(144, "Paths a pixel of predictions.", **COUNT)
    reference: int = option(1024, "Paths a pixel of photos and truth.", **COUNT)
    draws: int = option(10, "Noisy thicknesses a case.", **COUNT_OR_0)
    pictures: int = option(6, "Cases that are drawn.", **COUNT_OR_0)
    latency: int = option(0, "Size of the timed preview; 0: none.", **COUNT_OR_0)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        iors = numbers("iors", self.iors, 1.001, 3, float)
        for case, behind in self._cases(data, iors):
            shown: dict[str, Array] = {}
            yield from self._compared(case, behind, shown)
            # --- The pictures: truth and predictions inside the mask, the room around them ---
            if len(report.sheet) < self.pictures:
                inside = case.stage.mask[..., None]
                room = behind["true"].picture
                glass = [case.truth, *(shown[name] for name in DRAWN)]
                pictures = [np.where(inside, picture, room) for picture in glass]
                report.sheet.append(side_by_side(case.scene.photo.linear, *pictures))
        if self.latency:
            yield from self._latencies(data)

    def _cases(
        self, data: Path | None, iors: list[float]
    ) -> Iterator[tuple[Case, dict[str, Background]]]:
        """Every case with what is behind its object: the 'true' room, and what the photo tells, 'inpainted'."""
        lights = {group: count() for group in scenes.GROUPS}  # both groups see the same ones
        things = scenes.things(data, self.shapes, self.seed) if self.shapes else []
        for thing in [*things, *scenes.jugs(self.jugs, self.seed)]:
            stage = scenes.GlassScene(thing, self.size, self.seed, self.background)
            for j in range(self.envmaps):
                light = scenes.environment(
                    next(lights[thing.group]), stage, data=data, seed=self.seed
                )
                # One exposure for room, grey object and glass.
                room = stage.room.render(light, self.reference, seed=1)
                gain = scenes.room_exposure(room)
                grey = stage.grey.render(light * gain, self.reference, seed=2)
                scene = true_scene(photographed(stage.grey, grey, light * gain, thing.name))
                behind = {
                    "true": Background(room * gain, stage.room.truth).fitted(
                        scene.envmap, stage.room
                    ),
                    "inpainted": models.inpainted_background(scene, stage),
                }
                for ior in iors:
                    truth = stage.glass(ior).render(scene.envmap, self.reference, seed=3)
                    name = f"{thing.name} light {j} ior {ior:g}"
                    yield Case(stage, scene, truth, ior, name, self.spp), behind

    def _compared(
        self, case: Case, behind: dict[str, Background], shown: dict[str, Array]
    ) -> Iterator[Row]:
        """The rows of all methods for one case; their pictures go into `shown`."""
        stage = case.stage
        true = behind["true"]
        # --- Thickness by every way of finding it ---
        d = models.thicknesses(case.scene, stage, true)

        def row(method: str, picture: Array, thickness: Thickness | None = None) -> Row:
            shown[method] = picture
            return {"method": method, "sample": case.name, **figures(case, picture, thickness)}

        # --- What bounds the figures: no glass at all, and the true mesh ---
        for kind, background in behind.items():
            yield row(f"background alone, {kind}", background.picture)
        yield row(f"{CEILING}, true mesh", models.before(case, stage.item.solid, true))
        again = stage.glass(case.ior).render(case.scene.envmap, self.spp, seed=4)
        yield row(f"{CEILING}, truth again", again)
        # --- Both models with every thickness ---
        for model in (models.two_interface, models.closed):
            name = model.__name__
            for source, thickness in d.items():
                yield row(f"{name}, {source} d", model(case, thickness, true), thickness)
            inpainted = model(case, d["predicted"], behind["inpainted"])
            yield row(f"{name}, predicted d, inpainted", inpainted, d["predicted"])
        # --- The body of the edit, which may have several parts ---
        if stage.room.items:
            yield row("closed, of the edit", models.edited(case, true))
        # --- How much the normal of the back is worth ---
        for source in ("true", "network"):
            leaning = replace(d[source], back=stage.front.back)
            yield row(f"closed, {source} d, true back", models.closed(case, leaning, true), leaning)
        same = models.two_interface(case, d["predicted"], true, papers_back=True)
        yield row("two_interface, predicted d, back normal = front normal", same, d["predicted"])
        yield from sensitivity(case, d["predicted"], true, draws=self.draws, seed=self.seed)

    def _latencies(self, data: Path | None) -> Iterator[Row]:
        """Rows of the preview: built, its first picture, and one picture after another, as a person changes sliders."""
        # The preview as the studio has it.
        scene, mask, sample = awaited(self.latency, data, self.seed)
        preview, cost = timed(lambda: GlassPreview(scene, mask, device=self.device, seed=self.seed))
        yield {"method": "preview: built once", "sample": sample, **cost}
        # Kernels are compiled at the first picture of a kind.
        changes: list[tuple[str, dict[str, Any]]] = [
            ("first picture of a kind", {"roughness": r}) for r in (0.0, 0.3)
        ]
        changes += [("ior", {"ior": ior}) for ior in (1.3, 1.7)] + [
            ("tint", {"tint": (0.6, 0.9, 0.7)})
        ]
        changes += [("roughness", {"roughness": r}) for r in (0.2, 0.4)] + [
            ("transmission", {"transmission": 0.9})
        ]
        for name, change in changes:
            _, cost = timed(preview.picture, **change, spp=16, seed=self.seed)
            yield {"method": f"preview: {name}", "sample": sample, **cost}


def sensitivity(
    case: Case, d: Thickness, behind: Background, *, draws: int, seed: int
) -> Iterator[Row]:
    """Rows of the two-interface model with thickness d (1 + e) (paper, Sensitivity Analysis of d).

    As there, the back's normal is the front's: the row to compare with is that of the same assumption.
    """
    # The name seeds the noise: a case has the same in any selection of cases.
    rng = np.random.default_rng([seed, 10, *case.name.encode()])
    largest = scenes.PROTOCOL.noise
    for k in range(draws):
        noisy = replace(d, solid=d.solid * (1 + rng.uniform(-largest, largest)))
        picture = models.two_interface(case, noisy, behind, papers_back=True)
        row = {"method": "two_interface, noise on d", "sample": f"{case.name} draw {k}"}
        yield {**row, **figures(case, picture, noisy)}


def figures(case: Case, picture: Array, thickness: Thickness | None) -> dict[str, float]:
    """The figures of a picture [H, W, 3] inside the mask, named by the object's group."""
    mask = case.stage.mask
    group = case.stage.thing.group
    truth = case.truth
    # Outside the mask both are the truth, so that windows that reach over its border compare equals.
    inside = np.where(mask[..., None], picture, truth)
    values = {
        "psnr": metrics.psnr(inside, truth, mask=mask),
        "ssim": metrics.ssim(inside, truth, mask=mask),
    }
    # The squared error over all pixels is the mask's share of that inside it.
    values["frame"] = float(values["psnr"] - 10 * np.log10(mask.mean()))
    box = window(mask)
    if (distance := lpips(inside[box], truth[box])) is not None:
        values["lpips"] = distance
    if thickness is not None:
        true = case.stage.front.thickness
        values["thickness"] = float(np.abs(thickness.solid - true)[mask].sum() / true[mask].sum())
    return {f"{name}_{group}": value for name, value in values.items()}
