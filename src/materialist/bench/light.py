"""`bench light`: how well the light of a photograph is found, on synthetic samples with known light.

The paper's protocol (section "Environment Map Optimization", tables "Quantitative evaluation of envmap optimization"
and "Ablation study on envmap settings"): scenes x viewpoints x lightings; full size 10 x 10 x 10.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from materialist import metrics
from materialist.bench.report import CEILING, Column, Report, write
from materialist.bench.synthetic import SyntheticSample, make_sample
from materialist.errors import InputError
from materialist.predict.base import NEUTRAL_METALLIC
from materialist.types import Array, Materials

NEUTRAL = 0.5
"""Albedo and roughness of the paper's runs without given materials (A = R = 0.5, M = 0.1)."""

NOTE = """Light fitted to synthetic photographs whose materials, geometry and light are known.
`envmap` figures compare the fitted with the true map (SSIM and PSNR sRGB-encoded and clipped, no exposure fitted; MSE
linear and unclipped). `render` figures compare the true scene under the fitted light with the photograph, `relit` the
depth mesh with the true materials under another light with the true picture of it. `ceiling` is the depth mesh with the
true maps and the true light: what no fit on this mesh can beat. Seconds are those of the light fit with its ray
tracing, without the mesh. `w/o mat`: albedo and roughness 0.5, metallic 0.1 were given instead of the true maps."""

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
    Column("seconds", "s", "lower", 1),
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


METHODS = {
    "default": Method(),
    "default w/o mat": Method(given=False),
    "paper": Method("paper"),
    "paper w/o mat": Method("paper", given=False),
    "paper path": Method("paper", "path"),
    "paper path w/o mat": Method("paper", "path", given=False),
    "paper uv": Method("paper", field="mlp-uv"),
    "paper low": Method("paper", height=16),
    "paper uv low": Method("paper", field="mlp-uv", height=16),
    "paper sh": Method("paper", field="sh"),
    "paper texels": Method("paper", field="texels", height=32),
}


def run(
    *,
    data: Path | None,
    output: Path,
    scenes: int = 3,
    views: int = 1,
    lights: int = 2,
    size: int = 96,
    methods: str = "default,paper",
    completion: str = "planes",
    spp: int = 256,
    seed: int = 0,
    device: str = "auto",
) -> Report:
    """Fit the light of scenes x views x lights samples of `size` pixels with each of the `methods`.

    `methods` are names of METHODS, separated by commas. The paper's full size is 10 x 10 x 10. `completion` is that of
    `invert`; `spp` the samples a pixel of all pictures that are compared. The report is written after every sample.
    """
    chosen = _methods(methods)
    from rich.console import Console
    from rich.progress import track

    from materialist.render.variant import setup

    setup(device)
    settings = {
        "scenes": scenes, "views": views, "lights": lights, "size": size, "completion": completion, "spp": spp,
        "seed": seed, "data": None if data is None else data.name,
    }  # fmt: skip
    rows: list[dict[str, Any]] = []
    report = Report("Light", NOTE, settings, COLUMNS, rows, plotted=("sh_error_relative", "render_psnr", "seconds"))
    indices = list(product(range(scenes), range(views), range(lights)))
    for scene, view, light in track(indices, "bench light", console=Console(stderr=True)):
        make = lambda k: make_sample(scene, view, k, size=size, data=data, seed=seed)  # noqa: B023, E731
        rows += _measure(make(light), make(light + 1).envmap, chosen, completion, spp, seed, device)
        write(report, output)
    return report


def _methods(names: str) -> dict[str, Method]:
    """The methods by their names; raises InputError for a name that is not there."""
    chosen = {}
    for name in (part.strip() for part in names.split(",")):
        if name not in METHODS:
            raise InputError(f"There is no method '{name}' in bench light; choose of: {', '.join(METHODS)}.")
        chosen[name] = METHODS[name]
    return chosen


def _measure(
    sample: SyntheticSample, other: Array, methods: dict[str, Method], completion: str, spp: int, seed: int, device: str
) -> Iterator[dict[str, Any]]:
    """Rows of one sample: the ceiling, and every method; `other` is the light of the relit pictures."""
    from materialist.geometry.build import build_geometry
    from materialist.render.scene import RenderScene

    camera, truth = sample.photo.camera, sample.truth
    geometry = build_geometry(truth.depth, truth.normal, camera, completion=completion, seed=seed)
    mesh = RenderScene(geometry, camera, device=device)

    def on_mesh(envmap: Array) -> Array:
        mesh.set_materials(truth.materials)
        mesh.set_envmap(envmap)
        return mesh.render(spp=spp, seed=seed + 1)

    true_picture = sample.render(sample.envmap, spp=spp, seed=seed + 2)
    relit = metrics.psnr(on_mesh(other), sample.render(other, spp=spp, seed=seed + 3))
    ceiling = metrics.psnr(on_mesh(sample.envmap), true_picture)
    yield {"method": CEILING, "sample": sample.name, "mesh_psnr": ceiling, "relit_psnr": relit}
    for name, method in methods.items():
        start = time.perf_counter()
        envmap = fit(sample, geometry, mesh, method, seed=seed)
        seconds = time.perf_counter() - start
        picture = sample.render(envmap, spp=spp, seed=seed + 4)
        yield {
            "method": name,
            "sample": sample.name,
            **metrics.envmap_metrics(envmap, sample.envmap),
            "render_ssim": metrics.ssim(picture, true_picture),
            "render_psnr": metrics.psnr(picture, true_picture),
            "render_mse": metrics.mse(picture, true_picture),
            "mesh_psnr": metrics.psnr(on_mesh(envmap), true_picture),
            "seconds": seconds,
        }


def fit(sample: SyntheticSample, geometry: Any, mesh: Any, method: Method, *, seed: int = 0) -> Array:
    """The envmap [256, 512, 3] that the method finds for the sample's photo on the mesh of its true depth."""
    import torch

    from materialist.fit.engine import PathEngine, TransportEngine, prepared_envmap
    from materialist.fit.inverse import paste_visible_sky
    from materialist.fit.light import envmap_field, fit_light
    from materialist.fit.settings import preset

    photo, truth = sample.photo, sample.truth
    named = preset(method.preset)
    # Given materials are not to be doubted: no slack of albedo.
    light = replace(named.light, slack=None) if method.given else named.light
    light = replace(light, field=method.field or light.field, height=method.height or light.height)
    height = sample.envmap.shape[0]
    surface = truth.depth > 0
    engine: Any
    if method.engine == "path":
        pixels = np.flatnonzero(surface.reshape(-1))
        engine = PathEngine(mesh, photo.camera, pixels, envmap_height=height, seed=seed)
    else:
        engine = TransportEngine(geometry, photo.camera, photo.linear, seed=seed, light_height=named.light_grid)
    problem = engine.light_problem(truth.materials if method.given else _neutral(truth.materials))
    field = envmap_field(light, seed=seed)
    fit_light(problem, torch.from_numpy(photo.linear.reshape(-1, 3)), field, light, seed=seed)
    envmap = prepared_envmap(field(max(light.height, 16)), height)
    return paste_visible_sky(envmap, photo.linear, surface, photo.camera)


def _neutral(materials: Materials) -> Materials:
    """The paper's materials where none are given: A = R = 0.5, M = 0.1."""
    return Materials(
        np.full_like(materials.albedo, NEUTRAL),
        np.full_like(materials.roughness, NEUTRAL),
        np.full_like(materials.metallic, NEUTRAL_METALLIC),
    )
