"""`bench glass`: how close an object made glass comes to the same object truly of glass.

The paper's protocol (section "Evaluation of Transparency Editing", and "Sensitivity Analysis of d"): a grey diffuse
object is seen; its glass is predicted from what is seen of it, and compared with a path-traced dielectric within the
object's mask. Symmetric and asymmetric objects, the true background or one inpainted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from materialist import metrics
from materialist.bench import glass_models as models
from materialist.bench import glass_scenes as scenes
from materialist.bench.benchmark import Benchmark
from materialist.bench.glass_backdrop import Background, wall_ends
from materialist.bench.glass_latency import latencies
from materialist.bench.report import CEILING, Column, Report, write
from materialist.color import linear_to_srgb
from materialist.errors import InputError
from materialist.predict.refraction.thickness import Thickness
from materialist.types import Array

COLUMNS = (
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
NOTE = (
    "Within the object's mask only, on sRGB-encoded pictures at the exposure of the photo; truth is a path-traced "
    "dielectric. `frame` spreads the same squared error over all pixels of the picture, as a metric does that is "
    "computed after everything outside the mask was made black. True depth and normals of the visible side, true "
    "light. `d` says where the thickness comes from: `predicted` is what `materialist glass` takes by itself, "
    "`network` RefractionNet alone; its error is mean absolute over mean true thickness. `noise` multiplies the "
    "predicted d by 1 + e, e uniform in [-0.5, 0.5], one e a draw. `background alone` shows the background "
    "without any refraction. `ceiling, true mesh` is the object's own mesh before the background that the closed "
    "proxy stands before, `ceiling, truth again` the truth with other noise and as few paths as the predictions, "
    "not denoised. The inpainted background is that of `materialist glass`: patterns that go on "
    "and patches of the photo, on the continued planes of floor and wall, which end beyond the picture where "
    "`materialist invert` ends them, given the true maps. LPIPS only where the package and its weights "
    "are installed."
)
NOISE = 0.5
"""Largest relative error of the thickness in the sensitivity test (paper, eq. ablation_d)."""


@dataclass(frozen=True)
class Case:
    """One object under one light with one index of refraction."""

    scene: scenes.GlassScene
    envmap: Array
    photo: Array
    """[H, W, 3] linear radiance, the object grey."""
    truth: Array
    """[H, W, 3] linear radiance, the object glass."""
    gain: float
    """Exposure of all pictures of the case."""
    ior: float
    name: str


@dataclass(frozen=True, kw_only=True)
class GlassBench(Benchmark):
    """Compare the two-interface model and the closed proxy with true glass.

    `shapes` objects of each group, each under `envmaps` lights with each of `iors` (comma-separated); `full` is the
    paper's 20 objects x 30 lights x 1.1 and 1.3. `background` is 'room', a patterned floor and wall, or 'envmap',
    nothing but the light. Predictions have `spp` paths a pixel, photos and truth `reference`. `draws` noisy
    thicknesses a case; `pictures` cases are drawn. `latency` is the size of a picture on which the preview is timed;
    `shapes` may then be 0. `model` 'closed' or 'two-interface' leaves out the rows of the other.
    """

    least: ClassVar = {"envmaps": 1, "spp": 1, "reference": 1, "size": 32}

    shapes: int = 2
    envmaps: int = 2
    iors: str | float = "1.1,1.3"
    background: str = "room"
    size: int = 128
    spp: int = 144
    reference: int = 1024
    full: bool = False
    draws: int = 10
    pictures: int = 6
    latency: int = 0
    model: str = ""

    def run(self, data: Path | None, output: Path) -> None:
        """Every case by every method; the report and a sheet of the first cases are written after each."""
        from materialist.render.variant import setup

        if self.full:
            return replace(self, full=False, shapes=10, envmaps=30, iors="1.1,1.3").run(data, output)
        self._check()
        setup(self.device)
        rows: list[dict[str, Any]] = []
        drawn: list[Array] = []
        plotted = ("psnr_symmetric", "psnr_asymmetric")
        report = Report("Glass", NOTE, self.settings(data), COLUMNS, rows, plotted)
        for case, behind in self.cases(data) if self.shapes else ():
            found, titles, strip = compared(self, case, behind)
            rows.extend(found)
            if len(drawn) < self.pictures:
                drawn.append(strip)
                _draw(drawn, titles, output / "sheet.png")
            write(report, output)  # what is there already is worth having when a long run is stopped
        if self.latency:
            rows.extend(latencies(data, self.latency, spp=16, seed=self.seed, device=self.device))
            write(report, output)

    @property
    def indices(self) -> list[float]:
        """The indices of refraction; raises InputError where they are no numbers above 1 up to 3."""
        try:
            found = [float(x) for x in str(self.iors).split(",")]
        except ValueError:
            found = []
        if not found or not all(1 < x <= 3 for x in found):
            raise InputError(f"--iors is {self.iors!r}; give indices of refraction above 1 up to 3, such as 1.1,1.3.")
        return found

    def _check(self) -> None:
        """Raises InputError for options out of range."""
        if not (self.shapes or self.latency):
            raise InputError("--shapes is 0; give at least 1, or a --latency.")
        if self.model not in ("", *MODELS):
            raise InputError(f"The model is {self.model!r}; choose {' or '.join(MODELS)}, or leave it out for both.")
        if self.background not in scenes.ENVMAP_ROWS:
            raise InputError(f"The background is {self.background!r}; choose room or envmap.")
        _ = self.indices

    def cases(self, data: Path | None) -> Iterator[tuple[Case, dict[str, Background]]]:
        """Every case with what is behind its object: the 'true' room, and what the photo tells, 'inpainted'."""
        for k, thing in enumerate(scenes.things(data, self.shapes, self.seed)):
            scene = scenes.GlassScene(thing, self.size, self.seed, self.background)
            for j in range(self.envmaps):
                envmap = scenes.environment(k * self.envmaps + j, scene, data=data, seed=self.seed)
                room = scene.render(envmap, "room", spp=self.reference, seed=1)
                photo = scene.render(envmap, "diffuse", spp=self.reference, seed=2)
                gain = scenes.exposure(room)
                ends = wall_ends(scene, np.clip(photo * gain, 0, 1))
                behind = {
                    "true": models.true_background(scene, room, envmap, ends),
                    "inpainted": models.inpainted_background(scene, photo, envmap, gain, ends),
                }
                for ior in self.indices:
                    truth = scene.render(envmap, "glass", ior=ior, spp=self.reference, seed=3)
                    yield Case(scene, envmap, photo, truth, gain, ior, f"{thing.name} light {j} ior {ior:g}"), behind


def compared(
    bench: GlassBench, case: Case, behind: dict[str, Background]
) -> tuple[list[dict[str, Any]], list[str], Array]:
    """The rows of the methods for one case, and a strip of pictures with the title of each."""
    spp = bench.spp
    scene, shown = case.scene, {}
    seen = np.clip(case.photo * case.gain, 0, 1)
    d = models.thicknesses(scene, seen, behind["true"])
    best = "predicted"
    rows = []

    def add(method: str, picture: Array, found: Thickness | None = None) -> None:
        rows.append({"method": method, "sample": case.name, **figures(case, picture, found)})
        shown[method] = picture

    for kind, background in behind.items():
        add(f"background alone, {kind}", models.plain_background(scene, background))
    chosen = (bench.model,) if bench.model else MODELS
    if "closed" in chosen:
        ceiling = models.before(scene, scene.item.solid, behind["true"], case.envmap, case.ior, spp=spp)
        add(f"{CEILING}, true mesh", ceiling)
    again = scene.render(case.envmap, "glass", ior=case.ior, spp=spp, seed=4)
    add(f"{CEILING}, truth again", again)
    for model in (MODELS[name] for name in chosen):
        for source, found in d.items():
            add(f"{model.__name__[1:]}, {source} d", model(case, found, behind["true"], spp), found)
        name = f"{model.__name__[1:]}, {best} d, inpainted"
        add(name, model(case, d[best], behind["inpainted"], spp), d[best])
    for source in ("true", "network") if "closed" in chosen else ():
        if source in d:
            leaning = replace(d[source], back=scene.front.back)
            add(f"closed, {source} d, true back", _closed(case, leaning, behind["true"], spp), leaning)
    if "two-interface" in chosen:
        same = models.two_interface(scene, d[best], behind["true"], case.envmap, case.ior, papers_back=True)
        add(f"two_interface, {best} d, back normal = front normal", same, d[best])
        rows += sensitivity(case, d[best], behind["true"], draws=bench.draws, seed=bench.seed)
    titles = [name for name in DRAWN if name in shown]
    return rows, titles, _strip(case, behind["true"].picture, [shown[name] for name in titles])


def _two_interface(case: Case, found: Thickness, behind: Background, spp: int) -> Array:
    return models.two_interface(case.scene, found, behind, case.envmap, case.ior)


def _closed(case: Case, found: Thickness, behind: Background, spp: int) -> Array:
    return models.closed_proxy(case.scene, found, behind, case.envmap, case.ior, spp=spp)


Model = Callable[[Case, Thickness, Background, int], Array]
MODELS: dict[str, Model] = {"two-interface": _two_interface, "closed": _closed}
DRAWN = ("two_interface, true d", "two_interface, predicted d", "closed, predicted d", "closed, predicted d, inpainted")
"""The methods whose pictures are shown."""


def sensitivity(case: Case, d: Thickness, behind: Background, *, draws: int, seed: int) -> list[dict[str, Any]]:
    """Rows of the two-interface model with thickness d (1 + e) (paper, Sensitivity Analysis of d).

    As there, the back's normal is the front's: the row to compare with is that of the same assumption.
    """
    rng = np.random.default_rng([seed, 10, *case.name.encode()])
    rows = []
    for k in range(draws):
        noisy = replace(d, solid=d.solid * (1 + rng.uniform(-NOISE, NOISE)))
        picture = models.two_interface(case.scene, noisy, behind, case.envmap, case.ior, papers_back=True)
        row = {"method": "two_interface, noise on d", "sample": f"{case.name} draw {k}"}
        rows.append({**row, **figures(case, picture, noisy)})
    return rows


def figures(case: Case, picture: Array, thickness: Thickness | None) -> dict[str, float]:
    """The figures of a picture [H, W, 3] inside the mask, named by the object's group."""
    mask, group = case.scene.mask, case.scene.thing.group
    truth = case.truth * case.gain
    # Outside the mask both are the truth, so that windows that reach over its border compare equals.
    inside = np.where(mask[..., None], picture * case.gain, truth)
    found = {"psnr": metrics.psnr(inside, truth, mask=mask), "ssim": masked_ssim(inside, truth, mask)}
    found["frame"] = float(found["psnr"] - 10 * np.log10(mask.mean()))
    if (distance := _lpips(inside, truth, mask)) is not None:
        found["lpips"] = distance
    if thickness is not None:
        true = case.scene.front.thickness
        found["thickness"] = float(np.abs(thickness.solid - true)[mask].sum() / true[mask].sum())
    return {f"{name}_{group}": value for name, value in found.items()}


def masked_ssim(a: Array, b: Array, mask: Array) -> float:
    """SSIM of linear pictures [H, W, 3] on their sRGB encoding, its map averaged over the mask [H, W]."""
    from skimage.metrics import structural_similarity

    options: dict[str, Any] = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
    _, each = structural_similarity(
        linear_to_srgb(a), linear_to_srgb(b), data_range=1, channel_axis=-1, full=True, **options
    )
    return float(each[mask].mean())


def _lpips(a: Array, b: Array, mask: Array) -> float | None:
    from materialist.metrics.lpips import lpips

    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return lpips(a[window], b[window])


def _strip(case: Case, room: Array, pictures: list[Array]) -> Array:
    """[H, n W, 3] sRGB: the photo, the truth, and predictions, each before the true room."""
    inside = case.scene.mask[..., None]
    shown = [case.photo, *(np.where(inside, p, room) for p in (case.truth, *pictures))]
    return np.concatenate([linear_to_srgb(p * case.gain) for p in shown], 1)


def _draw(strips: list[Array], titles: list[str], path: Path) -> None:
    """The strips as one picture with a line of headings: the photo, true glass, and these."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    titles = ["photo", "true glass", *titles]
    wide = strips[0].shape[1] // len(titles)
    figure = Figure(figsize=(1.5 * len(titles), 1.5 * len(strips) + 0.2), dpi=110)
    FigureCanvasAgg(figure)
    axis = figure.add_axes((0, 0, 1, 1 - 0.2 / figure.get_figheight()))
    axis.imshow(np.concatenate(strips))
    axis.axis("off")
    for k, title in enumerate(titles):
        axis.text((k + 0.5) * wide, -4, title, ha="center", va="bottom", fontsize=7)
    figure.savefig(path)
