"""`bench light`: how well the light of a photograph is found, on synthetic samples with known light.

The paper's protocol (section "Environment Map Optimization", tables "Quantitative evaluation of envmap optimization"
and "Ablation study on envmap settings"): scenes x viewpoints x lightings; full size 10 x 10 x 10.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, product
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from materialist import metrics
from materialist.bench.benchmark import Benchmark, Clock
from materialist.bench.report import CEILING, Column, Report, write
from materialist.errors import InputError
from materialist.predict import NEUTRAL_METALLIC
from materialist.procedural.synthetic import SyntheticSample, make_sample
from materialist.types import Array, Materials

NEUTRAL = 0.5
"""Albedo and roughness of the paper's runs without given materials (A = R = 0.5, M = 0.1)."""

NOTE = """Light fitted to synthetic photographs whose materials, geometry and light are known.
`envmap` figures compare the fitted with the true map (SSIM and PSNR sRGB-encoded and clipped, no exposure fitted; MSE
linear and unclipped). `render` figures compare the true scene under the fitted light with the photograph, `mesh` the
depth mesh under it with the photograph, `relit` the depth mesh under another light with the true picture of it.
`ceiling` is the depth mesh with the true maps and the true light: what no fit on this mesh can beat. `inversion` is the
whole inversion by the default preset, light and materials, with the true maps as its prior; it and `default` end
walls where light explains the photograph best (`--completion auto`), the ceiling does not. `w/o
planes`: without continued planes (`--completion none`). `w/o
mat`: albedo and roughness 0.5, metallic 0.1 were given instead of the true maps. Seconds are those of the light fit and
its ray tracing, the choice of completion included, and for `inversion` those of all of it; CPU seconds add up all
processors and hardly depend on what else the computer does. The first sample's hold the compilation of kernels that the
computer has not met before. `128x64`: the paper's MLP is evaluated on a map of that size inside the fit instead of
512x256, which makes its steps cheaper."""

COLUMNS = (
    Column("envmap_ssim", "envmap SSIM", "higher"),
    Column("envmap_psnr", "envmap PSNR", "higher", 2),
    Column("envmap_mse", "envmap MSE", "lower"),
    Column("sh_error", "SH error", "lower"),
    Column("sh_error_relative", "SH error, relative", "lower"),
    Column("render_ssim", "render SSIM", "higher"),
    Column("render_psnr", "render PSNR", "higher", 2),
    Column("render_mse", "render MSE", "lower", 4),
    Column("mesh_psnr", "mesh PSNR", "higher", 2),
    Column("relit_psnr", "relit PSNR", "higher", 2),
    Column("albedo_l1", "albedo L1", "lower"),
    Column("steps", "steps", "", 0),
    Column("seconds", "s", "lower", 1),
    Column("cpu_seconds", "CPU s", "lower", 1),
)


@dataclass(frozen=True)
class Method:
    """One way to fit the light."""

    preset: str = "default"
    engine: str = "transport"
    given: bool = True
    """Whether the true materials are given, or neutral ones."""
    field: str | None = None
    """Another light field than the preset's: mlp, mlp-uv, texels, sh."""
    height: int | None = None
    """Another height of the field's map than the preset's."""
    path_height: int = 256
    """Rows of the envmap that the path engine renders with."""


METHODS = {
    "default": Method(),
    "default w/o mat": Method(given=False),
    "paper": Method("paper"),
    "paper w/o mat": Method("paper", given=False),
    "paper path": Method("paper", "path"),
    "paper path w/o mat": Method("paper", "path", given=False),
    "paper path 128x64": Method("paper", "path", path_height=64),
    "paper uv": Method("paper", field="mlp-uv"),
    "paper low": Method("paper", height=16),
    "paper uv low": Method("paper", field="mlp-uv", height=16),
    "paper sh": Method("paper", field="sh"),
    "paper texels": Method("paper", field="texels", height=32),
}


@dataclass(frozen=True, kw_only=True)
class LightBench(Benchmark):
    """Fit the light of scenes x views x lights samples of `size` pixels with each of the `methods`.

    `methods` are names of METHODS, separated by commas. The paper's full size is 10 x 10 x 10; every scene and view
    begins with another light, so that small runs meet several. `completion` is that of `invert` for the methods; for
    the paper's, `auto` is `planes`. With `relight`, whole inversions with and without continued planes are relit. `spp`
    are the samples a pixel of all pictures that are compared. The report is written after every row.
    """

    least: ClassVar = {"scenes": 1, "views": 1, "lights": 1, "size": 1, "spp": 1}

    scenes: int = 3
    views: int = 1
    lights: int = 2
    size: int = 96
    methods: str = "default,paper"
    completion: str = "auto"
    relight: bool = True
    spp: int = 256

    def run(self, data: Path | None, output: Path) -> None:
        chosen = _methods(self.methods)
        from rich.console import Console
        from rich.progress import track

        from materialist.render.variant import setup

        setup(self.device)
        rows: list[dict[str, Any]] = []
        plotted = ("sh_error_relative", "render_psnr", "seconds")
        report = Report("Light", NOTE, self.settings(data), COLUMNS, rows, plotted)
        indices = list(product(range(self.scenes), range(self.views), range(self.lights)))
        for scene, view, light in track(indices, "bench light", console=Console(stderr=True)):
            first = scene + view + light
            sample, other = (
                make_sample(scene, view, k, size=self.size, data=data, seed=self.seed) for k in (first, first + 1)
            )
            stage = _Stage(sample, other.envmap, self.spp, self.seed, self.device)
            for row in chain(stage.relit() if self.relight else (), stage.fitted(chosen, self.completion)):
                rows.append({**row, "sample": sample.name})
                write(report, output)


def _methods(names: str) -> dict[str, Method]:
    """The methods by their names; raises InputError for a name that is not there."""
    chosen = {}
    for name in (part.strip() for part in names.split(",")):
        if name not in METHODS:
            raise InputError(f"There is no method '{name}' in bench light; choose of: {', '.join(METHODS)}.")
        chosen[name] = METHODS[name]
    return chosen


ADDED = {"auto": "", "none": " w/o planes"}
"""`--completion` of the relit rows, and how their names end."""


class _Stage:
    """One sample, its depth meshes, and the true pictures that all rows are compared with."""

    def __init__(self, sample: SyntheticSample, other: Array, spp: int, seed: int, device: str):
        """`other` [h, 2h, 3] is the light of the relit pictures."""
        self.sample, self.other = sample, other
        self.spp, self.seed, self.device = spp, seed, device
        self.photo = sample.render(sample.envmap, spp=spp, seed=seed + 2)
        self.relit_photo = sample.render(other, spp=spp, seed=seed + 3)
        self._meshes: dict[str, tuple[Any, Any]] = {}

    def mesh(self, completion: str) -> tuple[Any, Any]:
        """Geometry and RenderScene of the true depth, built once."""
        from materialist.geometry.build import build_geometry
        from materialist.render.scene import RenderScene

        if completion not in self._meshes:
            camera, truth = self.sample.photo.camera, self.sample.truth
            geometry = build_geometry(truth.depth, truth.normal, camera, completion=completion, seed=self.seed)
            self._meshes[completion] = geometry, RenderScene(geometry, camera, device=self.device)
        return self._meshes[completion]

    def relit(self) -> Iterator[dict[str, Any]]:
        """Rows of the ceiling and of whole inversions, with and without what is added to the mesh."""
        from materialist import pipeline
        from materialist.render.scene import RenderScene

        truth = self.sample.truth
        for completion, suffix in ADDED.items():
            yield {"method": CEILING + suffix, **self._on_mesh(_all(completion), truth.materials, self.sample.envmap)}
            clock = Clock()
            found = pipeline.invert(
                self.sample.photo, prior=truth, completion=completion, seed=self.seed, device=self.device
            )
            cost = clock.read()
            surface = truth.depth > 0
            yield {
                "method": "inversion" + suffix,
                **self._of_light(found.envmap),
                **self._on(
                    RenderScene(found.geometry, found.camera, device=self.device), found.materials, found.envmap
                ),
                "albedo_l1": float(np.abs(found.materials.albedo - truth.materials.albedo)[surface].mean()),
                **cost,
            }

    def fitted(self, methods: dict[str, Method], completion: str) -> Iterator[dict[str, Any]]:
        """A row for every method of fitting the light."""
        for name, method in methods.items():
            taken, mesh = completion, None
            if method.preset == "paper":
                taken = _all(completion)
                mesh = self.mesh(taken)[1]
            clock = Clock()
            envmap, steps, mesh = fit(self.sample, method, taken, mesh=mesh, seed=self.seed, device=self.device)
            cost = clock.read()
            on_mesh = self._on(mesh, self.sample.truth.materials, envmap)
            yield {
                "method": name,
                **self._of_light(envmap),
                "mesh_psnr": on_mesh["mesh_psnr"],
                "steps": steps,
                **cost,
            }

    def _of_light(self, envmap: Array) -> dict[str, float]:
        """The map against the true one, and the true scene under it against the photo."""
        picture = self.sample.render(envmap, spp=self.spp, seed=self.seed + 4)
        return {
            **metrics.envmap_metrics(envmap, self.sample.envmap),
            "render_ssim": metrics.ssim(picture, self.photo),
            "render_psnr": metrics.psnr(picture, self.photo),
            "render_mse": metrics.mse(picture, self.photo),
        }

    def _on_mesh(self, completion: str, materials: Materials, envmap: Array) -> dict[str, float]:
        """PSNR of the depth mesh with these materials, under this light and under the other."""
        return self._on(self.mesh(completion)[1], materials, envmap)

    def _on(self, mesh: Any, materials: Materials, envmap: Array) -> dict[str, float]:
        """The same of any RenderScene."""
        mesh.set_materials(materials)
        mesh.set_envmap(envmap)
        picture = mesh.render(spp=self.spp, seed=self.seed + 1)
        mesh.set_envmap(self.other)
        relit = mesh.render(spp=self.spp, seed=self.seed + 1)
        return {"mesh_psnr": metrics.psnr(picture, self.photo), "relit_psnr": metrics.psnr(relit, self.relit_photo)}


def fit(
    sample: SyntheticSample, method: Method, completion: str, *, mesh: Any = None, seed: int = 0, device: str = "auto"
) -> tuple[Array, int, Any]:
    """The envmap [256, 512, 3] that the method finds for the sample's photo on the mesh of its true depth, in how many
    steps, and the scene of that mesh. `mesh` is the one that the path engine renders."""
    import torch

    from materialist.fit.alternation import paste_visible_sky
    from materialist.fit.engine import PathEngine, prepared_envmap
    from materialist.fit.invert import FitSetup, Inversion
    from materialist.fit.light import envmap_field, fit_light
    from materialist.fit.settings import preset

    photo, truth = sample.photo, sample.truth
    named = preset(method.preset)
    light = replace(named.light, albedo_relaxation=None) if method.given else named.light
    light = replace(light, field=method.field or light.field, height=method.height or light.height)
    height = sample.envmap.shape[0]
    surface = truth.depth > 0
    given = truth if method.given else replace(truth, materials=_neutral(truth.materials))
    engine: Any
    if method.engine == "path":
        pixels = np.flatnonzero(surface.reshape(-1))
        engine = PathEngine(mesh, photo.camera, pixels, envmap_height=method.path_height, seed=seed)
    else:
        setup = FitSetup(photo, given, named, completion, envmap_height=height, seed=seed, device=device)
        prepared = Inversion(setup).prepare()
        engine, mesh = prepared.fit.engine, prepared.renderer
    problem = engine.light_problem(given.materials)
    field = envmap_field(light, seed=seed)
    result = fit_light(problem, torch.from_numpy(photo.linear.reshape(-1, 3)), field, light, seed=seed)
    envmap = prepared_envmap(field(max(light.height, 16)), height)
    return paste_visible_sky(envmap, photo.linear, surface, photo.camera), result.steps, mesh


def _all(completion: str) -> str:
    """What `auto` adds where nothing speaks against it."""
    return "planes" if completion == "auto" else completion


def _neutral(materials: Materials) -> Materials:
    """The paper's materials where none are given: A = R = 0.5, M = 0.1."""
    return Materials(
        np.full_like(materials.albedo, NEUTRAL),
        np.full_like(materials.roughness, NEUTRAL),
        np.full_like(materials.metallic, NEUTRAL_METALLIC),
    )
