"""An inversion from the prior to the re-rendering: geometry, light, materials."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from materialist.fit.engine import Engine, PathEngine, TransportEngine
from materialist.fit.inversion import Fit
from materialist.fit.optimise import Progress
from materialist.fit.settings import FitSettings
from materialist.geometry.build import build_geometry
from materialist.render.scene import RenderScene
from materialist.types import Array, Geometry, Materials, Photo, Prediction


@dataclass(frozen=True)
class FitSetup:
    """What is asked of an inversion; see `pipeline.invert` for the fields."""

    photo: Photo
    prior: Prediction
    settings: FitSettings
    completion: str = "floors"
    engine: str = "transport"
    envmap_height: int = 256
    tau: float = 6.0
    mask: Array | None = None
    strategy: str = "default"
    seed: int = 0
    device: str = "auto"
    spp: int | None = None
    """Paths a pixel of the re-rendering; None: `settings.rerender_spp`."""


@dataclass(frozen=True)
class PreparedFit:
    """A mesh, its path tracer, and a fit that has not run."""

    geometry: Geometry
    renderer: RenderScene
    fit: Fit
    stages: tuple[dict, ...]

    def render(self, materials: Materials, envmap: Array, spp: int, seed: int) -> Array:
        """[H, W, 3] linear, path traced."""
        self.renderer.set_materials(materials)
        self.renderer.set_envmap(envmap)
        return self.renderer.render(spp=spp, seed=seed)


@dataclass(frozen=True)
class FitResult:
    """What an inversion came to."""

    prepared: PreparedFit
    materials: Materials
    envmap: Array
    """[h, 2h, 3] linear radiance."""
    halves: tuple[Array, Array]
    """Two independent path-traced re-renderings [H, W, 3] linear, of half the samples each."""
    spp: int
    """Paths a pixel of both together."""
    stages: tuple[dict, ...]

    @property
    def rerender(self) -> Array:
        """[H, W, 3] linear: the mean of both halves."""
        return (self.halves[0] + self.halves[1]) / 2


def prepare(setup: FitSetup, progress: Progress | None = None) -> PreparedFit:
    """The mesh and an engine on it."""
    tick, stages = progress or (lambda *_: None), list[dict]()
    photo, prior = setup.photo, setup.prior
    tick("geometry", 0, 1)
    geometry = timed(stages, "geometry", lambda: build_geometry(
        prior.depth, prior.normal, photo.camera, tau=setup.tau, completion=setup.completion, seed=setup.seed
    ))  # fmt: skip
    renderer = timed(stages, "scene", lambda: RenderScene(geometry, photo.camera, device=setup.device))
    engine = timed(stages, "engine", lambda: _engine(setup, renderer, geometry, progress))

    fit = Fit(
        photo, prior.materials, engine, setup.settings, envmap_height=setup.envmap_height, light=prior.light,
        mask=setup.mask, strategy=setup.strategy, seed=setup.seed, progress=progress,
    )  # fmt: skip
    return PreparedFit(geometry, renderer, fit, tuple(stages))


def invert(
    setup: FitSetup, *, progress: Progress | None = None, found: Callable[[str, Any], Any] = lambda *_: None
) -> FitResult:
    """Geometry, light, materials and the path-traced re-rendering of one photo.

    Args:
        progress: called as progress(stage, done, total).
        found: called as found("light", [h, 2h, 3]) and found("materials", Materials) as soon as each is there.
    """
    prepared = prepare(setup, progress)
    fit, stages, seed = prepared.fit, list(prepared.stages), setup.seed
    if isinstance(fit.engine, TransportEngine):
        timed(stages, "trace", fit.engine.cache.trace)
    state = fit.run()
    stages += state.stages
    materials = fit.materials(state)
    found("light", state.envmap)
    found("materials", materials)
    if progress is not None:
        progress("rerender", 0, 1)
    each = max(1, (setup.spp or setup.settings.rerender_spp) // 2)
    first, second = timed(stages, "rerender", lambda: [
        prepared.render(materials, state.envmap, each, seed + k) for k in (1, 2)
    ])  # fmt: skip
    return FitResult(prepared, materials, state.envmap, (first, second), 2 * each, tuple(stages))


def _engine(setup: FitSetup, renderer: RenderScene, geometry: Geometry, progress: Progress | None) -> Engine:
    camera, seed = setup.photo.camera, setup.seed
    if setup.engine == "path":
        surface = np.unique(geometry.mesh.face_pixel[geometry.mesh.face_plane < 0])
        return PathEngine(renderer, camera, surface, envmap_height=setup.envmap_height, seed=seed)
    return TransportEngine(
        geometry, camera, setup.photo.linear, seed=seed, light_height=setup.settings.light_grid, progress=progress
    )


def timed(stages: list[dict], name: str, work: Callable[[], Any]) -> Any:
    """The result of `work`; its seconds are added to `stages`."""
    start = time.perf_counter()
    result = work()
    stages.append({"name": name, "seconds": round(time.perf_counter() - start, 3)})
    return result
