"""An inversion from the prior to the re-rendering: geometry, light with the prior's materials, materials under it."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import torch

from materialist.buffers import placed
from materialist.camera import pixel_rays, unit
from materialist.envmap import environment, paste_visible_sky, with_mirrored_photo
from materialist.fit.albedo import solve_albedo
from materialist.fit.engine import (
    Engine,
    MaterialProblem,
    PathEngine,
    TransportEngine,
    prepared_envmap,
)
from materialist.fit.fields import ALL, MaterialMaps
from materialist.fit.light import LightStart, envmap_field, fit_light, start_light
from materialist.fit.materials import COLUMNS, fit_materials, material_field, remapped
from materialist.fit.optimise import Stop, never
from materialist.fit.settings import FitSettings, MaterialSettings, MaterialStage
from materialist.geometry.build import build_geometry
from materialist.options import TAU
from materialist.render.scene import RenderScene
from materialist.transport.cache import CacheSettings
from materialist.types import Array, Geometry, Materials, Photo, Prediction, Progress


@dataclass(frozen=True)
class FitSetup:
    """What is asked of an inversion; see `pipeline.invert` for the fields."""

    photo: Photo
    prior: Prediction
    settings: FitSettings
    completion: str = "auto"
    """`auto` becomes that of the settings."""
    engine: str = "transport"
    envmap_height: int = 256
    tau: float = TAU
    mask: Array | None = None
    """[H, W] bool: roughness and metallic are one value inside."""
    strategy: str = "default"
    """`default`: light, then materials. `white-light-first`: under a white map, roughness and metallic from 0.5,
    then light, then albedo (paper, Material Editing Settings)."""
    seed: int = 0
    device: str = "auto"
    spp: int | None = None
    """Paths a pixel of the re-rendering; None: those of the settings."""

    def __post_init__(self) -> None:
        completion = self.settings.completion if self.completion == "auto" else self.completion
        object.__setattr__(self, "completion", completion)


@dataclass
class FitState:
    """What the fit has found so far."""

    maps: torch.Tensor
    """[P, 5] albedo, roughness, metallic of the surface pixels."""
    envmap: Array
    """[h, 2h, 3]."""
    stages: list[dict] = field(default_factory=list)
    light: tuple[torch.nn.Module, LightStart] | None = None
    """The field behind `envmap`, which a later fit moves on, and what it began with."""
    shaded: torch.Tensor | None = None
    """[P, 3] radiance of the surface pixels by the last materials and light; None where no stage rendered it."""


@dataclass(frozen=True)
class Fit:
    """One inverse problem: what is asked, the mesh, its path tracer, and an engine to render with."""

    setup: FitSetup
    geometry: Geometry
    renderer: RenderScene
    engine: Engine
    stages: tuple[dict, ...] = ()
    """What it took to make them."""
    progress: Progress | None = None
    stop: Stop = never

    def start(self) -> FitState:
        """The prior's maps under a white light."""
        height = self.setup.envmap_height
        maps = placed(stacked(self.setup.prior.materials))[self.engine.pixels]
        return FitState(maps, np.ones((height, 2 * height, 3), np.float32))

    def run(self) -> FitState:
        """Fit; returns maps and light."""
        setup = self.setup
        state = self.start()
        if setup.strategy == "white-light-first":
            return self._white_light_first(state)
        settings = setup.settings.materials
        if setup.mask is not None:  # what the mask makes one value moves, too
            last = replace(settings.stages[-1], targets=tuple(COLUMNS))
            settings = replace(settings, stages=(*settings.stages[:-1], last))
        # Light by the prior's materials first, then materials under that light (paper).
        self.fit_light(state, setup.prior.materials)
        self._fit_materials(state, settings)
        return state

    def fit_light(self, state: FitState, materials: Materials) -> None:
        """Find the state's light, under which these materials look like the photo."""
        start = time.perf_counter()
        setup = self.setup
        state.shaded = None
        photo = self._photo()
        settings = setup.settings.light
        # --- What surfaces send each other follows the fitted maps from the second fit on ---
        known = state.light is not None
        problem = self.engine.light_problem(materials, self._outgoing(state) if known else None)
        # --- The first fit starts a fresh field, a later one moves that field on ---
        if state.light is None:
            begin = start_light(photo, settings, setup.prior.light, problem)
            state.light = envmap_field(settings, begin.radiance, seed=setup.seed), begin
        elif settings.again is not None:
            settings = replace(settings, schedule=settings.again)
        light, begin = state.light
        # --- E* = argmin L_E over the field's parameters ---
        before = sum(stage["name"].startswith("light") for stage in state.stages)
        result = fit_light(
            problem,
            photo,
            light,
            settings,
            begin,
            name=f"light {before + 1}" if before else "light",
            seed=setup.seed,
            progress=self.progress,
            stop=self.stop,
        )
        # --- The map at the scene's size, and what the fit took ---
        state.envmap = self.prepared_light(light(max(settings.height, 16)))
        state.stages.append({**result.summary(), "seconds": round(time.perf_counter() - start, 3)})

    def prepared_light(self, radiance: torch.Tensor) -> Array:
        """[h, 2h, 3] a found light of any size, with the photo's own sky and detail where the settings want them."""
        setup = self.setup
        envmap = prepared_envmap(radiance, setup.envmap_height)
        if setup.settings.light.mirrored:
            envmap = with_mirrored_photo(envmap, setup.photo.linear, setup.photo.camera)
        if not setup.settings.light.sky:
            return envmap
        # Pixels without a surface show the light itself: the photo's sky is pasted in.
        surface = np.zeros(setup.photo.linear.shape[:2], bool)
        surface.reshape(-1)[self.engine.pixels.numpy()] = True
        white = setup.settings.light.white
        return paste_visible_sky(
            envmap, setup.photo.linear, surface, setup.photo.camera, white=white
        )

    def material_problem(self, state: FitState) -> MaterialProblem:
        """Rendering as a function of the materials, under the state's light."""
        return self.engine.material_problem(state.envmap, self._outgoing(state))

    def _outgoing(self, state: FitState) -> Array | None:
        """[H, W, 3] outgoing radiance of the surfaces, the source of indirect light; None: the photo.

        With `traced` bounces, what the path tracer will find with the state's maps and light.
        """
        if self.setup.settings.bounces == "photo":
            return None
        return self.engine.bounced(state.maps, state.envmap)

    def _fit_materials(self, state: FitState, settings: MaterialSettings) -> None:
        """From the state's maps, which L_cons holds on to."""
        setup = self.setup
        pixels = self.engine.pixels
        photo = self._photo()[pixels]
        if isinstance(self.engine, PathEngine):  # it renders all pixels anyway
            settings = replace(settings, step_pixels=0)
        # --- The maps that L_cons holds on to, and the field that moves ---
        held = remapped(state.maps) if settings.remap else state.maps
        inside = None if setup.mask is None else placed(setup.mask.reshape(-1)[pixels.numpy()])
        model = material_field(
            held, settings, pixels, setup.photo.camera, inside=inside, seed=setup.seed
        )
        # With cached transport, one stage, and nothing but albedo, each pixel is a problem of its own.
        separable = not isinstance(self.engine, PathEngine) and isinstance(model, MaterialMaps)
        separable &= settings.loss == "l2"
        separable &= [stage.targets for stage in settings.stages] == [("albedo",)]
        # --- Stage by stage, under the light of the state ---
        for stage in settings.stages:
            if self.stop():
                break
            start = time.perf_counter()
            problem = self.material_problem(state)
            if separable:
                state.maps, result = solve_albedo(
                    problem, photo, held, settings, progress=self.progress, stop=self.stop
                )
            else:
                (result,) = fit_materials(
                    problem,
                    photo,
                    model,
                    held,
                    replace(settings, stages=(stage,)),
                    seed=setup.seed,
                    progress=self.progress,
                    stop=self.stop,
                )
                state.maps = model().detach()
            if isinstance(self.engine, TransportEngine):
                with torch.no_grad():
                    state.shaded = problem(state.maps, ALL)
            seconds = round(time.perf_counter() - start, 3)  # with those of the tables
            state.stages.append({**result.summary(), "seconds": seconds})
            # As in the published code: the light once more under the new materials.
            again = setup.settings.light.again is not None and state.light is not None
            if again and not self.stop():
                self.fit_light(state, self.materials(state))

    def _white_light_first(self, state: FitState) -> FitState:
        """Roughness and metallic start at 0.5, and nothing is remapped on the way."""
        # R and M under the white map, then the light, then A.
        settings = replace(self.setup.settings.materials, remap=False)
        schedule = settings.stages[0].schedule
        state.maps[:, 3:] = 0.5
        self._fit_materials(
            state, replace(settings, stages=(MaterialStage(("roughness", "metallic"), schedule),))
        )
        self.fit_light(state, self.materials(state))
        self._fit_materials(
            state, replace(settings, stages=(MaterialStage(("albedo",), schedule),))
        )
        return state

    def picture(self, state: FitState) -> Array | None:
        """[H, W, 3] linear: the state as its last stage renders it, without noise; None where none did."""
        if state.shaded is None:
            return None
        rays = unit(pixel_rays(self.setup.photo.camera).reshape(-1, 3))
        picture = environment(rays, state.envmap).astype(np.float32)
        picture[self.engine.pixels.numpy()] = state.shaded.cpu().numpy()
        return picture.reshape(self.setup.photo.linear.shape)

    def materials(self, state: FitState) -> Materials:
        """Full-size maps of the state; the prior's values where there is no surface."""
        return replaced(self.setup.prior.materials, self.engine.pixels, state.maps)

    def render(self, materials: Materials, envmap: Array, spp: int, seed: int) -> Array:
        """[H, W, 3] linear, path traced."""
        self.renderer.set_materials(materials)
        self.renderer.set_envmap(envmap)
        return self.renderer.render(spp=spp, seed=seed)

    def _photo(self) -> torch.Tensor:
        return placed(np.ascontiguousarray(self.setup.photo.linear.reshape(-1, 3)))


def stacked(materials: Materials) -> Array:
    """[H * W, 5] float32 albedo, roughness, metallic."""
    maps = (materials.albedo, materials.roughness[..., None], materials.metallic[..., None])
    return np.concatenate(maps, -1).reshape(-1, 5).astype(np.float32)


def replaced(materials: Materials, pixels: torch.Tensor, maps: torch.Tensor) -> Materials:
    """The materials with maps [P, 5] in the place of those pixels."""
    out = stacked(materials)
    out[pixels.numpy()] = maps.cpu().numpy()
    out = out.reshape(*materials.roughness.shape, 5)
    return Materials(np.ascontiguousarray(out[..., :3]), out[..., 3].copy(), out[..., 4].copy())


@dataclass(frozen=True)
class FitResult:
    """What an inversion came to."""

    geometry: Geometry
    materials: Materials
    envmap: Array
    """[h, 2h, 3] linear radiance."""
    halves: tuple[Array, Array]
    """Two independent path-traced re-renderings [H, W, 3] linear, of half the samples each."""
    spp: int
    """Paths a pixel of both together; 0 where both are the same picture of the fit's own, without noise."""
    stages: tuple[dict, ...]
    stopped: bool = False
    """Whether the fit was ended before its end."""

    @property
    def rerender(self) -> Array:
        """[H, W, 3] linear: the mean of both halves."""
        return (self.halves[0] + self.halves[1]) / 2


def prepare(setup: FitSetup, progress: Progress | None = None, stop: Stop = never) -> Fit:
    """The mesh, and what renders it."""
    tick = progress or (lambda *_: None)
    stages = list[dict]()
    photo = setup.photo
    prior = setup.prior
    # --- The mesh of the predicted depth and normals ---
    tick("geometry", 0, 1)
    geometry = timed(
        stages,
        "geometry",
        lambda: build_geometry(
            prior.depth,
            prior.normal,
            photo.camera,
            tau=setup.tau,
            completion=setup.completion,
            seed=setup.seed,
        ),
    )
    # --- What renders it: a path tracer for results, an engine for the steps of the fit ---
    renderer = timed(
        stages, "scene", lambda: RenderScene(geometry, photo.camera, device=setup.device)
    )
    engine = timed(stages, "engine", lambda: _engine(setup, renderer, geometry, progress))
    return Fit(setup, geometry, renderer, engine, tuple(stages), progress, stop)


def invert(
    setup: FitSetup,
    *,
    progress: Progress | None = None,
    on_stage: Callable[[str, Any], Any] = lambda *_: None,
    stop: Stop = never,
) -> FitResult:
    """Geometry, light, materials and the path-traced re-rendering of one photo.

    on_stage: called as on_stage("light", [h, 2h, 3]) and on_stage("materials", Materials) as soon as each is there;
        then as on_stage("fitted", FitResult) with the fit's own picture, before paths are traced, where there is one.
    """
    fit = prepare(setup, progress, stop)
    stages = list(fit.stages)
    seed = setup.seed
    # --- The fit; tracing counts as a stage of its own, not as the light's ---
    if isinstance(fit.engine, TransportEngine):
        timed(stages, "trace", fit.engine.cache.trace)
    state = fit.run()
    stopped = stop()
    stages += state.stages
    materials = fit.materials(state)
    on_stage("light", state.envmap)
    on_stage("materials", materials)
    if (picture := fit.picture(state)) is not None:
        known = (picture, picture), 0, tuple(stages), stopped
        on_stage("fitted", FitResult(fit.geometry, materials, state.envmap, *known))
    # --- The re-rendering, in halves of two seeds: where they differ is noise ---
    if progress is not None:
        progress("rerender", 0, 1)
    settings = setup.settings
    pixels = setup.photo.linear.shape[0] * setup.photo.linear.shape[1]
    each = max(1, (setup.spp or settings.rerender_paths(pixels)) // 2)
    first, second = timed(
        stages,
        "rerender",
        lambda: [fit.render(materials, state.envmap, each, seed + k) for k in (1, 2)],
    )
    return FitResult(
        fit.geometry, materials, state.envmap, (first, second), 2 * each, tuple(stages), stopped
    )


def _engine(
    setup: FitSetup, renderer: RenderScene, geometry: Geometry, progress: Progress | None
) -> Engine:
    camera = setup.photo.camera
    seed = setup.seed
    # The paper's engine: PRB, on the pixels that some face of the depth surface has.
    if setup.engine == "path":
        surface = np.unique(geometry.mesh.face_pixel[geometry.mesh.face_plane < 0])
        return PathEngine(renderer, camera, surface, envmap_height=setup.envmap_height, seed=seed)
    settings = setup.settings.materials
    # A roughness that no stage moves needs one specular level in place of eight.
    stays = setup.mask is None and setup.strategy == "default" and not settings.remap
    stays &= all("roughness" not in stage.targets for stage in settings.stages)
    return TransportEngine(
        geometry,
        camera,
        setup.photo.linear,
        roughness=setup.prior.materials.roughness if stays else None,
        seed=seed,
        light_height=setup.settings.light_grid,
        cache=CacheSettings().at_size(camera.width * camera.height),
        progress=progress,
    )


def timed(stages: list[dict], name: str, work: Callable[[], Any]) -> Any:
    """The result of `work`; its seconds are added to `stages`."""
    start = time.perf_counter()
    result = work()
    stages.append({"name": name, "seconds": round(time.perf_counter() - start, 3)})
    return result
