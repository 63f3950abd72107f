"""A fit from the prior to the re-rendering, on one geometry; and whether to do without what completion has added."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from materialist import metrics
from materialist.color import linear_to_srgb
from materialist.fit.ends import find_ends
from materialist.fit.engine import Engine, PathEngine, TransportEngine
from materialist.fit.inverse import WHITE, Fit, FitState
from materialist.fit.settings import FitSettings
from materialist.geometry.build import build_geometry
from materialist.geometry.ends import Ends
from materialist.io.photo import HDR_CLIP
from materialist.render.envmap import is_sunny
from materialist.render.scene import RenderScene
from materialist.render.share import Share
from materialist.types import Array, Geometry, Materials, Photo, Prediction

AUTO, FULL = "auto", "planes"
FINAL_PATHS = 112
"""Paths a pixel of the re-rendering that a scene is judged by: 28 camera rays, or 38 where none aims at the light,
or under a sun as many samples."""
POOR = 28.0
"""dB of the re-rendering below which `--completion auto` tries to do without what it has added."""
CLEARLY = 2.0
"""dB by which that must be better to be kept: what completion adds helps every other light."""
DIM = 25.0
"""dB of the picture under the first light from which on nothing more is asked before the rest is fitted."""
NEARER = 1.0
"""dB by which a darker one must be better without what completion adds for that to be left out there and then."""
GLANCE = 24
"""Camera rays a pixel from which that is told, half of them for each of two pictures."""


@dataclass(frozen=True)
class Attempt:
    """What a fit on one geometry came to."""

    completion: str
    ends: tuple[Ends, ...]
    """Where walls end beyond the picture; empty: all alike."""
    geometry: Geometry
    materials: Materials
    envmap: Array
    """[h, 2h, 3] linear radiance."""
    rerender: Array
    """[H, W, 3] linear, path traced."""
    stages: tuple[dict, ...]
    spp: int = 0
    """Camera rays a pixel of that."""

    @property
    def doubted(self) -> bool:
        """Whether the prior's materials did not explain the photo, so that the fit was free to change them."""
        return prior_trust(self.stages) == 1.0


@dataclass(frozen=True)
class Begun:
    """A geometry and a fit on it that has not run."""

    completion: str
    ends: tuple[Ends, ...]
    """Where walls end beyond the picture; empty: all alike."""
    geometry: Geometry
    fit: Fit
    judge: Callable[..., Array]
    stages: list[dict]
    renderer: RenderScene
    state: FitState | None = None
    """Where the fit begins, once it has its first light."""


@dataclass(frozen=True)
class Job:
    """Everything about an inversion but how its geometry is completed; see `pipeline.invert` for the fields."""

    picture: Photo
    prior: Prediction
    settings: FitSettings
    engine: str
    envmap_height: int
    tau: float
    mask: Array | None
    strategy: str
    seed: int
    device: str
    spp: int | None
    """Camera rays a pixel of the re-rendering; None: those of FINAL_PATHS."""
    progress: Any
    found: Callable[[str, Any], Any]
    """Told "light" and "materials" as soon as each is there."""

    def run(self, completion: str) -> Attempt:
        """Mesh, light, materials, path-traced re-rendering."""
        return self.finish(self.begin(completion))

    def best(self, completion: str) -> tuple[Attempt, tuple[str, ...]]:
        """The attempt for `completion`, which may be `auto`, and what the report should say about the choice.

        A continued wall can shut out light that the photo shows. `auto` ends walls where the prior's materials then
        explain the photo best (`fit.ends`), and leaves out everything where the re-rendering stays poor and is clearly
        better without. Not so where the prior explains the photo well: then a good re-rendering would be bought with
        materials that are worse.
        """
        begun, notes = self.choose(completion)
        if completion == AUTO:
            begun, notes = self.glanced(begun, notes)
        full = self.finish(begun)
        del begun  # its cache: the next one is as large
        if completion != AUTO or full.completion != FULL:
            return full, notes
        before = self._psnr(full)
        if before >= POOR or not (full.doubted and (full.geometry.mesh.face_plane >= 0).any()):
            return full, notes
        bare = self.run("none")
        after = self._psnr(bare)
        if after < before + CLEARLY:
            return replace(full, stages=(*bare.stages, *full.stages)), notes
        return replace(bare, stages=(*full.stages, *bare.stages)), (_left_out(before, after),)

    def glanced(self, begun: Begun, notes: tuple[str, ...]) -> tuple[Begun, tuple[str, ...]]:
        """The same fit, or where its first light is far from the photo and clearly nearer without completion, that.

        A second whole fit then need not be made. What the report should say, too.
        """
        unasked = self.engine != "transport" or self.strategy != "default" or self.settings.trust is None
        if unasked or not (begun.geometry.mesh.face_plane >= 0).any():
            return begun, notes
        begun, before = self.lit(begun)
        if before is None or before >= DIM:
            return begun, notes
        bare, after = self.lit(self.begin("none"))
        if after is not None and after >= before + NEARER:
            kept, other, notes = bare, begun, (_left_out(before, after),)
        else:
            kept, other = begun, bare
        kept.stages[:0] = [*other.stages, *(other.state.stages if other.state else ())]
        return kept, notes

    def lit(self, begun: Begun) -> tuple[Begun, float | None]:
        """The fit with its first light, and how near the photo the path tracer then comes: dB without its noise.

        That is seen in the pixels that the light was fitted on, with the albedo that it took for theirs. None where
        the prior explains the photo, so that nothing is to be asked, and under a sun, whose tracer knows whole pictures
        alone.
        """
        begun = replace(begun, state=begun.fit.lit())
        state, renderer = begun.state, begun.renderer
        assert state is not None
        if prior_trust(state.stages) != 1.0 or state.rows is None or is_sunny(state.envmap):
            return begun, None
        self._tick("glance")
        return begun, timed(begun.stages, "glance", lambda: self._near(state, renderer))

    def _near(self, state: FitState, renderer: RenderScene) -> float:
        pixels, values = state.rows or (np.zeros(0, np.int64), np.zeros((0, 3)))
        albedo = self.prior.materials.albedo.reshape(-1, 3).copy()
        albedo[pixels] = values
        renderer.set_materials(replace(self.prior.materials, albedo=albedo.reshape(self.prior.materials.albedo.shape)))
        renderer.set_envmap(state.envmap)
        half = Share(2, pixels=pixels)
        photo = linear_to_srgb(self.picture.linear).reshape(-1, 3)[pixels].astype(np.float64)
        first, second = (
            linear_to_srgb(renderer.render(spp=GLANCE, seed=self.seed + k, share=half)).reshape(-1, 3)[pixels] - photo
            for k in (401, 402)
        )
        # Their noise is independent; what the sRGB curve makes of its mean stays.
        return float(-10 * np.log10(max(float((first * second).mean()), 1e-9)))

    def choose(self, completion: str) -> tuple[Begun, tuple[str, ...]]:
        """The fit to run for `completion`: for `auto`, with walls that end where the light says."""
        if completion != AUTO or self.settings.trust is None:
            return self.begin(FULL if completion == AUTO else completion), ()
        stages: list[dict] = []
        self._tick("walls")
        camera, settings = self.picture.camera, self.settings
        search = partial(find_ends, self.picture.linear, self.prior, camera, settings, tau=self.tau, seed=self.seed)
        found = timed(stages, "walls", search)
        begun = self.begin(FULL, found.ends if found else ())
        begun.stages[:0] = stages
        if not found:
            return begun, ()
        note = (
            f"Walls beyond the picture end where light explains the photo best with the predicted materials (error "
            f"{found.error:.3f}, not {found.usual:.3f}); --completion {FULL} ends them all alike."
        )
        return begun, (note,)

    def begin(self, completion: str, ends: Sequence[Ends] = ()) -> Begun:
        """The mesh, and an engine that has not traced anything yet."""
        stages: list[dict] = []
        self._tick("geometry")
        geometry = timed(stages, "geometry", lambda: self._geometry(completion, ends))
        renderer = timed(stages, "scene", lambda: RenderScene(geometry, self.picture.camera, device=self.device))
        judge = _judge(renderer)
        engine = timed(stages, "engine", lambda: self._engine(renderer, geometry))
        fit = Fit(
            self.picture, self.prior.materials, engine, self.settings, envmap_height=self.envmap_height, judge=judge,
            mask=self.mask, strategy=self.strategy, seed=self.seed, progress=self.progress,
            white=HDR_CLIP if self.picture.hdr else WHITE,
        )  # fmt: skip
        return Begun(completion, tuple(ends), geometry, fit, judge, stages, renderer)

    def _geometry(self, completion: str, ends: Sequence[Ends]) -> Geometry:
        prior, camera = self.prior, self.picture.camera
        return build_geometry(
            prior.depth, prior.normal, camera, tau=self.tau, completion=completion, ends=ends, seed=self.seed
        )

    def finish(self, begun: Begun) -> Attempt:
        """Light, materials, path-traced re-rendering."""
        fit, stages = begun.fit, list(begun.stages)
        if isinstance(fit.engine, TransportEngine):
            timed(stages, "trace", fit.engine.cache.trace)
        state = fit.run(begun.state)
        materials = fit.materials(state)
        envmap = state.envmap
        self.found("light", envmap)
        self.found("materials", materials)
        self._tick("rerender")
        stages += state.stages
        begun.renderer.set_envmap(envmap)
        spp = -(-FINAL_PATHS // begun.renderer.paths) if self.spp is None else self.spp
        rerender = timed(stages, "rerender", lambda: begun.judge(materials, envmap, spp, self.seed + 1))
        return Attempt(begun.completion, begun.ends, begun.geometry, materials, envmap, rerender, tuple(stages), spp)

    def _psnr(self, attempt: Attempt) -> float:
        return metrics.psnr(attempt.rerender, self.picture.linear)

    def _tick(self, stage: str) -> None:
        if self.progress is not None:
            self.progress(stage, 0, 1)

    def _engine(self, renderer: RenderScene, geometry: Geometry) -> Engine:
        camera = self.picture.camera
        if self.engine == "path":
            surface = np.unique(geometry.mesh.face_pixel[geometry.mesh.face_plane < 0])
            return PathEngine(renderer, camera, surface, envmap_height=self.envmap_height, seed=self.seed)
        return TransportEngine(
            geometry, camera, self.picture.linear, seed=self.seed, light_height=self.settings.light_grid,
            progress=self.progress,
        )  # fmt: skip


def prior_trust(stages: Sequence[dict]) -> float | None:
    """How firmly the prior was held in the last fit of those stages; None if that was not asked."""
    return next((stage["prior_trust"] for stage in reversed(stages) if "prior_trust" in stage), None)


def _left_out(before: float, after: float) -> str:
    """What a report says where completion is left out, PSNR with and without it in dB."""
    return (
        f"Continued planes shut out light that the photo shows ({before:.1f} dB); they "
        f"were left out ({after:.1f} dB). New lights and objects will miss them; --completion {FULL} keeps them."
    )


def _judge(renderer: RenderScene) -> Callable[..., Array]:
    """The path tracer as a function (materials, envmap, spp, seed) -> [H, W, 3]."""

    def judge(materials: Materials, envmap: Array, spp: int, seed: int = 0) -> Array:
        renderer.set_materials(materials)
        renderer.set_envmap(envmap)
        return renderer.render(spp=spp, seed=seed)

    return judge


def timed(stages: list[dict], name: str, work: Callable[[], Any]) -> Any:
    """The result of `work`; its seconds are added to `stages`."""
    start = time.perf_counter()
    result = work()
    stages.append({"name": name, "seconds": round(time.perf_counter() - start, 3)})
    return result
