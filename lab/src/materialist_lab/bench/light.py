"""`bench light`: how well the light of a photograph is found, on synthetic samples with known light.

The paper's protocol (section "Environment Map Optimization", tables "Quantitative evaluation of envmap optimization"
and "Ablation study on envmap settings"): scenes x viewpoints x lightings; full size 10 x 10 x 10.

Light fitted to synthetic photographs whose materials, geometry and light are known; docs/benchmarks.md says what the
rows are. `envmap` figures compare the fitted with the true map (SSIM and PSNR sRGB-encoded and clipped, no exposure
fitted; MSE linear and unclipped), `render` figures the true scene under the fitted light with the photograph, `mesh`
the depth mesh under it with the photograph, `relit` the depth mesh under another light with the true picture of it.
`with walls`: walls and ceilings are continued, too (`--completion planes`); `w/o planes`: nothing is (`none`). Seconds
are those of the light fit and its ray tracing and for `inversion` those of all of it; CPU seconds add up all
processors. The first sample's hold the compilation of kernels that the computer has not met before.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, product
from pathlib import Path
from typing import Any

import numpy as np

from materialist import metrics, pipeline
from materialist.buffers import placed
from materialist.edits.core.renderer import rendered
from materialist.fit.invert import FitSetup, prepare
from materialist.fit.light import start_light
from materialist.fit.settings import preset
from materialist.option_kinds import option
from materialist.predict import NEUTRAL_METALLIC, get_predictor
from materialist.types import Array, Geometry, Materials, Prediction, Scene
from materialist_lab.bench.benchmark import COUNT, SIZE, Benchmark, Row, names, timed
from materialist_lab.bench.edits import sample_and_light, staged, true_scene
from materialist_lab.bench.report import CEILING, Column, Report
from materialist_lab.metrics.envmaps import envmap_metrics
from materialist_lab.procedural.synthetic import SyntheticSample, photographed

NEUTRAL = (0.5, 0.5, NEUTRAL_METALLIC)
"""Albedo, roughness and metallic of the paper's runs without given materials."""

FITLESS = ("constant", "prior")
"""One colour of light, and the light that the network predicts."""


@dataclass(frozen=True)
class Method:
    """One way to fit the light."""

    preset: str = "default"
    engine: str = "transport"
    maps: str = "true"
    """The materials that are given: `true`, `predicted` by the bundled network, or `neutral`."""
    shape: str = "true"
    """The depth and normals that are given: `true` or `predicted`."""
    field: str | None = None
    """Another light field than the preset's: mlp, mlp-uv, texels, sh, or one of FITLESS."""
    height: int | None = None
    """Another height of the field's map than the preset's."""


METHODS = {
    "default": Method(),
    "default w/o mat": Method(maps="neutral"),
    "default predicted": Method(maps="predicted", shape="predicted"),
    "paper": Method("paper"),
    "paper w/o mat": Method("paper", maps="neutral"),
    "paper predicted": Method("paper", maps="predicted", shape="predicted"),
    "paper predicted w/o mat": Method("paper", maps="neutral", shape="predicted"),
    "constant predicted": Method(maps="predicted", shape="predicted", field="constant"),
    "prior predicted": Method(maps="predicted", shape="predicted", field="prior"),
    "paper path": Method("paper", "path"),
    "paper path w/o mat": Method("paper", "path", maps="neutral"),
    "paper uv": Method("paper", field="mlp-uv"),
    "paper low": Method("paper", height=16),
    "paper path low": Method("paper", "path", height=16),
    "paper uv low": Method("paper", field="mlp-uv", height=16),
    "paper sh": Method("paper", field="sh"),
    "paper texels": Method("paper", field="texels", height=32),
}


@dataclass(frozen=True, kw_only=True)
class LightBench(Benchmark):
    """Fit the light of scenes x views x lights samples with each of the methods."""

    columns = (
        Column("envmap_ssim", "envmap SSIM", "higher"),
        Column("envmap_psnr", "envmap PSNR", "higher", 2),
        Column("envmap_mse", "envmap MSE", "lower"),
        Column("sh_error", "SH error", "lower"),
        Column("sh_error_relative", "SH error, relative", "lower"),
        Column("render_ssim", "render SSIM", "higher"),
        Column("render_psnr", "render PSNR", "higher", 2),
        Column("render_mse", "render MSE", "lower", 4),
        Column("surface_ssim", "surface SSIM", "higher"),
        Column("surface_psnr", "surface PSNR", "higher", 2),
        Column("mesh_psnr", "mesh PSNR", "higher", 2),
        Column("relit_psnr", "relit PSNR", "higher", 2),
        Column("albedo_l1", "albedo L1", "lower"),
        Column("steps", "steps", "", 0),
        Column("seconds", "s", "lower", 1),
        Column("cpu_seconds", "CPU s", "lower", 1),
    )

    scenes: int = option(
        3, "Scenes; the paper has 10. Every scene and view begins with another light.", **COUNT
    )
    views: int = option(1, "Viewpoints of each; the paper has 10.", **COUNT)
    lights: int = option(2, "Lights of each view; the paper has 10.", **COUNT)
    size: int = option(96, "Width and height of the photos.", **SIZE)
    methods: str = option("default,paper", "Names of METHODS, with commas.", kind="name")
    completion: str = option("auto", "That of `invert`.", kind="name")
    relight: bool = option(
        True,
        "Relight whole inversions, with and without continued planes.",
        kind="switch",
        flag="--relight/--no-relight",
    )
    spp: int = option(256, "Samples a pixel of all pictures that are compared.", **COUNT)
    unseen: bool = option(
        False, "Scenes in natural colours that no network was trained on.", kind="switch"
    )
    mirrors: bool = option(
        False, "Objects of polished metal (paper, table ab_envmap).", kind="switch"
    )

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        # Unknown names end the bench before anything slow.
        methods = names("methods", self.methods, METHODS)
        for scene, view, light in product(
            range(self.scenes), range(self.views), range(self.lights)
        ):
            options: dict[str, Any] = {
                "size": self.size,
                "data": data,
                "seed": self.seed,
                "unseen": self.unseen,
            }
            sample, other = sample_and_light(scene, view, scene + view + light, **options)
            sample = with_mirrors(sample) if self.mirrors else sample
            stage = _Stage(self, sample, other)
            for row in chain(stage.relit() if self.relight else (), stage.fitted(methods)):
                yield {**row, "sample": sample.name}


COMPLETIONS = {"auto": "", "planes": " with walls", "none": " w/o planes"}
"""`--completion` of the relit rows, and how their names end."""


class _Stage:
    """One sample, its depth meshes, and the true pictures that all rows are compared with."""

    def __init__(self, bench: LightBench, sample: SyntheticSample, other: Array):
        """`other` [h, 2h, 3] is the light of the relit pictures."""
        self.bench = bench
        self.sample = sample
        self.other = other
        self.photo = sample.scene.render(sample.envmap, spp=bench.spp, seed=bench.seed + 2)

    def relit(self) -> Iterator[Row]:
        """Rows of the ceiling and of whole inversions, with and without what is added to the mesh."""
        truth = self.sample.truth
        device = self.bench.device
        after = self.sample.scene.render(self.other, spp=self.bench.spp, seed=self.bench.seed + 3)

        def on(scene: Scene) -> dict[str, float]:
            relit = self._rendered(replace(scene, envmap=self.other))
            return self._on(scene) | {"relit_psnr": metrics.psnr(relit, after)}

        # The ceiling is the true scene, limited by its depth mesh alone.
        for completion, suffix in COMPLETIONS.items():
            perfect = true_scene(self.sample, completion=completion, seed=self.bench.seed)
            yield {"method": CEILING + suffix, **on(perfect)}
            options: dict[str, Any] = {
                "completion": completion,
                "seed": self.bench.seed,
                "device": device,
            }
            inverted, cost = timed(pipeline.invert, self.sample.photo, prior=truth, **options)
            # Only where there is a surface.
            off = np.abs(inverted.materials.albedo - truth.materials.albedo)[truth.depth > 0]
            figures = self._of_light(inverted.envmap) | on(inverted)
            yield {
                "method": "inversion" + suffix,
                **figures,
                "albedo_l1": float(off.mean()),
                **cost,
            }

    def fitted(self, methods: list[str]) -> Iterator[Row]:
        """A row for every method of fitting the light."""
        bench = self.bench
        # All methods are judged on the true maps, with their own mesh and light.
        perfect = true_scene(self.sample)
        for name in methods:
            method = METHODS[name]
            completion = bench.completion
            maps = given_maps(self.sample, method, seed=bench.seed, device=bench.device)
            (envmap, steps, geometry), cost = timed(
                fit, self.sample, method, maps, completion, seed=bench.seed, device=bench.device
            )
            figures = self._of_light(envmap) | self._on(
                replace(perfect, geometry=geometry, envmap=envmap)
            )
            yield {"method": name, **figures, "steps": steps, **cost}

    def _of_light(self, envmap: Array) -> dict[str, float]:
        """The map against the true one, and the true scene under it against the photo."""
        # Other seeds than the photo's: the same noise would flatter.
        picture = self.sample.scene.render(envmap, spp=self.bench.spp, seed=self.bench.seed + 4)
        of_map = envmap_metrics(envmap, self.sample.envmap)
        for part, mask in (("render", None), ("surface", self.sample.truth.depth > 0)):
            for name in ("ssim", "psnr", "mse") if mask is None else ("ssim", "psnr"):
                of_map[f"{part}_{name}"] = getattr(metrics, name)(picture, self.photo, mask=mask)
        return of_map

    def _on(self, scene: Scene) -> dict[str, float]:
        """PSNR of a scene under its light."""
        return {"mesh_psnr": metrics.psnr(self._rendered(scene), self.photo)}

    def _rendered(self, scene: Scene) -> Array:
        return rendered(
            scene, spp=self.bench.spp, seed=self.bench.seed + 1, device=self.bench.device
        )


def fit(
    sample: SyntheticSample,
    method: Method,
    maps: Prediction,
    completion: str,
    *,
    seed: int = 0,
    device: str = "auto",
) -> tuple[Array, int, Geometry]:
    """(envmap [256, 512, 3], steps, mesh): what the method finds for the photo with these `maps`."""
    # --- The preset, with the light field of the method ---
    photo = sample.photo
    named = preset(method.preset)
    height = sample.envmap.shape[0]
    light = named.light
    if method.field not in FITLESS:
        light = replace(
            light, field=method.field or light.field, height=method.height or light.height
        )
    # --- The geometry and the start, as an inversion has them ---
    setup = FitSetup(
        photo,
        maps,
        replace(named, light=light),
        completion,
        method.engine,
        envmap_height=height,
        seed=seed,
        device=device,
    )
    fit = prepare(setup)
    state = fit.start()
    # --- A light that needs no fit, or the fit ---
    if method.field in FITLESS:
        problem = fit.engine.light_problem(maps.materials)
        target = placed(photo.linear.reshape(-1, 3))
        if method.field == "constant":
            radiance = constant_light(problem, target)
        else:
            radiance = start_light(target, light, maps.light, problem).radiance
        state.envmap = fit.prepared_light(radiance)
    else:
        fit.fit_light(state, maps.materials)
    return state.envmap, sum(stage["steps"] for stage in state.stages), fit.geometry


def given_maps(sample: SyntheticSample, method: Method, *, seed: int, device: str) -> Prediction:
    """The maps that a method is given: true, predicted, or with the paper's neutral materials."""
    # Predicted once, for materials and shape alike.
    source: dict[str, Prediction] = {"true": sample.truth}
    if "predicted" in (method.maps, method.shape):
        source["predicted"] = get_predictor("bundled", device=device).predict(
            sample.photo, seed=seed
        )
    if method.maps != "neutral":
        return replace(source[method.shape], materials=source[method.maps].materials)
    # Neutral: the same value everywhere.
    maps = zip(vars(sample.truth.materials).values(), NEUTRAL, strict=True)
    return replace(
        source[method.shape], materials=Materials(*(np.full_like(m, v) for m, v in maps))
    )


def constant_light(problem: Any, photo: Any) -> Any:
    """[h, 2h, 3] tensor of the colour that explains the photo [H W, 3] with the least square error."""
    # Rendering is affine in the light: P(c) = P(0) + c (P(1) - P(0)).
    dark, lit = (
        problem.render(photo.new_full((problem.height, 2 * problem.height, 3), v))
        for v in (0.0, 1.0)
    )
    gain = lit - dark
    missing = photo[problem.pixels] - dark
    # Least squares for each channel.
    colour = ((missing * gain).sum(0) / (gain**2).sum(0)).clamp(min=0)
    return colour.expand(problem.height, 2 * problem.height, 3)


def with_mirrors(sample: SyntheticSample) -> SyntheticSample:
    """The sample with its objects in polished metal, photographed under the same light."""
    # Ground and walls keep their materials.
    stage = sample.scene
    polished: dict[str, Any] = {"roughness": 0.1, "metallic": 1.0}
    scene = staged(
        stage,
        [replace(x, **polished if k in stage.things else {}) for k, x in enumerate(stage.items)],
    )
    return photographed(
        scene, scene.render(sample.envmap, seed=1), sample.envmap, f"{sample.name} mirrors"
    )
