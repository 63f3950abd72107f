"""The whole fit: light, then materials, alternated and corrected as the preset says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import torch
from torch import nn

from materialist.camera import pixel_rays
from materialist.color import linear_to_srgb
from materialist.envmap import texel_directions
from materialist.fit.engine import Engine, PathEngine, TransportEngine, prepared_envmap
from materialist.fit.fields import EnvmapTexels
from materialist.fit.light import envmap_field, fit_light, slack_albedo, start_radiance
from materialist.fit.loop import Progress
from materialist.fit.losses import residual, too_pure
from materialist.fit.materials import better_start, fit_materials, material_field, remapped
from materialist.fit.neighbours import neighbours
from materialist.fit.settings import FitSettings, LightSettings, MaterialStage
from materialist.transport.filter import joint_filter
from materialist.types import Array, Camera, Materials, Photo

STRICT_STEPS = 120
"""Steps of the light fit that measures how far the prior can be trusted."""
FINE_STEPS = 60
"""The same on the finer map, from the coarse light on."""
NEARER = 0.4
"""Learning rate of a light fit that begins with a light, relative to that of one that begins with none."""
WHITE = 0.99
"""Linear value from which a channel of a photo that is not HDR is taken for clipped."""

Judge = Callable[[Materials, Array, int, int], Array]
"""judge(materials, envmap, spp, seed) -> path-traced [H, W, 3]."""


@dataclass
class FitState:
    """What the fit has found so far."""

    maps: torch.Tensor
    """[P, 5] albedo, roughness, metallic of the surface pixels."""
    envmap: Array
    """[h, 2h, 3]."""
    stages: list[dict] = field(default_factory=list)
    rows: tuple[Array, Array] | None = None
    """Pixels [Q] (row-major) that the last light was fitted on, and the albedo [Q, 3] that it took for theirs."""


@dataclass(frozen=True)
class Fit:
    """One inverse problem: a photo, an engine to render with, and the settings."""

    photo: Photo
    prior: Materials
    engine: Engine
    settings: FitSettings
    envmap_height: int = 256
    judge: Judge | None = None
    """Path tracer for the fixed-point corrections; None: no corrections."""
    mask: Array | None = None
    """[H, W] bool: roughness and metallic are one value inside."""
    strategy: str = "default"
    """`default`: light, then materials. `white-light-first`: under a white map, roughness and metallic from 0.5,
    then light, then albedo (paper, Material Editing Settings)."""
    seed: int = 0
    progress: Progress | None = None
    white: float = WHITE
    """Value from which a channel of the photo is taken for clipped."""

    def run(self, state: FitState | None = None) -> FitState:
        """Fit; returns maps and light. `state`: what `lit` came to, if that is known."""
        if self.strategy == "white-light-first":
            return self._white_light_first(self._unlit())
        state = state or self.lit()
        fit = self._trusting()
        for round_ in range(self.settings.rounds):
            if round_ > 0:
                fit._light(state, round_)
            fit._materials(state, corrections=self.settings.corrections * (round_ == self.settings.rounds - 1))
        return state

    def lit(self) -> FitState:
        """The first light, and how far the prior is trusted: where `run` begins."""
        state = self._unlit()
        start = None
        if self.settings.trust is not None:
            stage, light = self._explained
            state.stages.append({**stage, "prior_trust": self._trust()})
            start = light if self._fine() else None  # a sun is far from where a light begins
        self._trusting()._light(state, start=start)
        return state

    def _unlit(self) -> FitState:
        return FitState(self._prior_maps(), np.ones((self.envmap_height, 2 * self.envmap_height, 3), np.float32))

    def _trust(self) -> float:
        return self.settings.trust_at(self.prior_error())

    def _trusting(self) -> Fit:
        """The fit with the prices of leaving the prior scaled by how well the prior explains the photo.

        A colour that is surely not the materials' is the light's: its price falls as theirs rise.
        """
        settings = self.settings
        if settings.trust is None:
            return self
        scale = self._trust()
        light = self._fine() or settings.light
        slack = None if light.slack is None else light.slack * scale
        light = replace(light, slack=slack, chroma=light.chroma / scale)
        materials = replace(settings.materials, delta=settings.materials.delta * scale)
        return replace(self, settings=replace(settings, light=light, materials=materials))

    def prior_error(self) -> float:
        """Mean absolute error (encoded) that the best light leaves with the prior's materials as they are."""
        return self._explained[0]["prior_error"]

    @cached_property
    def _explained(self) -> tuple[dict, Array]:
        """The stage in which that light is fitted, and the light [h, 2h, 3]; more rows where the prior is trusted."""
        found, light = self._strict(self.settings.light)
        fine = self.settings.finer(found["prior_error"])
        if fine is None:
            return found, light
        finer, sharper = self._strict(fine, light, steps=FINE_STEPS)
        better = finer["prior_error"] < found["prior_error"]
        both = {name: found[name] + finer[name] for name in ("steps", "seconds", "loss_curve")}
        stage = {**(finer if better else found), **both, "loss_first": found["loss_first"]}
        return stage, sharper if better else light

    def _fine(self) -> LightSettings | None:
        """The settings of the finer light, where that explained the photo better."""
        fine = self.settings.fine_light
        return fine if fine and self._explained[0]["rows"] == fine.height else None

    def _strict(
        self, settings: LightSettings, start: Array | None = None, *, steps: int = STRICT_STEPS
    ) -> tuple[dict, Array]:
        """The stage of the light that explains the photo best with the prior as it is, and that light [h, 2h, 3];
        `start`: one to begin with."""
        strict = replace(settings, slack=None)
        problem = self.engine.light_problem(self.prior, self._grid(strict.height))
        light = self._field(strict, start)
        result = fit_light(problem, self._photo(), light, strict, steps=steps, seed=self.seed, progress=self.progress)
        with torch.no_grad():
            envmap, photo = light(problem.height), self._photo()[problem.pixels]
            off = residual(problem.render(envmap), photo, strict.encoding, clipped=strict.clipped, pure=too_pure(photo))
            error = float(off.abs().mean())
        return {**result.summary(), "name": "trust", "prior_error": error, "rows": strict.height}, envmap.numpy()

    def _field(self, settings: LightSettings, start: Array | None) -> nn.Module:
        """A light to fit, of texels from `start` [h, 2h, 3] on if there is one."""
        light = envmap_field(settings, seed=self.seed, start=start_radiance(self._photo()))
        if start is not None and isinstance(light, EnvmapTexels):
            with torch.no_grad():
                light.log.copy_(state_log(start, settings.height))
        return light

    def _grid(self, rows: int) -> int | None:
        """Rows of the light that the engine should resolve for a map of `rows`; None: as many as it does."""
        return rows if rows == self.settings.light.fine else None

    # -- stages --------------------------------------------------------------------------------------------------------

    def _light(self, state: FitState, round_: int = 0, start: Array | None = None) -> None:
        """Fit the light with the materials of the prior: the light must not explain what later stages have baked in.

        `start`: [h, 2h, 3] where the first round begins.
        """
        settings = self.settings.light
        given = self.prior if round_ == 0 else self._slack_base(state)
        problem = self.engine.light_problem(given, self._grid(settings.height))
        light = self._field(settings, state.envmap if round_ > 0 else start)
        if start is not None:  # Adam's first steps have the full length, however near the light is
            schedule = settings.schedule
            settings = replace(settings, schedule=replace(schedule, learning_rate=NEARER * schedule.learning_rate))
        steps = settings.refit_steps if round_ > 0 and settings.refit_steps else None
        slack = slack_albedo(problem, settings)
        result = fit_light(
            problem, self._photo(), light, settings, steps=steps, seed=self.seed, progress=self.progress, slack=slack
        )
        state.stages.append(result.summary())
        if slack is not None and problem.matrix is not None:
            state.rows = problem.matrix.pixels.numpy(), slack.detach().numpy()
        state.envmap = prepared_envmap(light(max(settings.height, 16)), self.envmap_height)
        state.envmap = paste_visible_sky(
            state.envmap, self.photo.linear, self._surface(), self.photo.camera, white=self.white
        )  # fmt: skip

    def _slack_base(self, state: FitState) -> Materials:
        """The prior's albedo with the roughness and metallic found so far."""
        fitted = self.materials(state)
        return replace(self.prior, roughness=fitted.roughness, metallic=fitted.metallic)

    def _materials(self, state: FitState, *, corrections: int = 0, stages: tuple[MaterialStage, ...] = ()) -> None:
        settings = self.settings.materials
        if stages:
            settings = replace(settings, stages=stages)
        problem = self.engine.material_problem(state.envmap)
        prior = self._prior_maps()
        held = remapped(prior) if settings.remap else prior
        first = all(stage["name"] != "materials" for stage in state.stages)
        start = state.maps if settings.field == "maps" and not first else held
        inside = None if self.mask is None else torch.from_numpy(self.mask.reshape(-1)[self.engine.pixels.numpy()])
        pairs = (
            neighbours(self.engine.pixels.numpy(), linear_to_srgb(self.photo.linear)) if any(settings.smooth) else None
        )
        photo = self._photo()[self.engine.pixels]
        if settings.other_metallic is not None and settings.field == "maps" and first and not stages:
            start = better_start(
                problem, photo, start, held, settings, self._smooth, inside=inside, progress=self.progress
            )
        model = material_field(
            start, replace(settings, remap=False), self.engine.pixels, self.photo.camera, inside=inside, seed=self.seed
        )
        correction = None
        for k in range(corrections + 1):
            results = fit_materials(
                problem, photo, model, held, settings, pairs, factor=correction, progress=self.progress
            )
            state.stages += [r.summary() for r in results]
            state.maps = model().detach()
            if k < corrections:
                correction = self._correction(state, problem.render, self.seed + 101 + k)
        if isinstance(self.engine, TransportEngine):
            self.engine.set_radiance(self._image(problem.render(state.maps)))

    def _correction(self, state: FitState, render, seed: int) -> torch.Tensor:
        """[P, 3] ratio of the path-traced to the cached rendering, both smoothed along surfaces.

        A factor, not a difference: where the cache is too bright, a difference would leave nothing to optimise.
        """
        assert self.judge is not None
        traced = self.judge(self.materials(state), state.envmap, self.settings.correction_spp, seed)
        cached = self._image(render(state.maps))
        both = torch.from_numpy(np.concatenate([traced, cached], -1)).reshape(-1, 6)[self.engine.pixels]
        traced_smooth, cached_smooth = self._smooth(both, (1, 2)).split(3, -1)
        return ((traced_smooth + 1e-3) / (cached_smooth + 1e-3)).clamp(0.1, 4)

    def _smooth(self, values: torch.Tensor, steps: tuple[int, ...] = (1, 4, 16)) -> torch.Tensor:
        """`values` [P, C] averaged along surfaces, over as wide a neighbourhood as the filter's steps reach."""
        assert isinstance(self.engine, TransportEngine)
        shape = (*self.prior.roughness.shape, values.shape[1])
        grid = torch.zeros(shape[0] * shape[1], shape[2]).index_copy(0, self.engine.pixels, values).view(shape)
        for step in steps:
            grid = joint_filter(grid, self.engine.guide, step=step)
        return grid.reshape(-1, shape[2])[self.engine.pixels]

    def _white_light_first(self, state: FitState) -> FitState:
        neutral = state.maps.clone()
        neutral[:, 3:] = 0.5
        schedule = self.settings.materials.stages[0].schedule
        # 0.5 is where they start, and what was fitted is kept: nothing is remapped on the way.
        settings = replace(self.settings, materials=replace(self.settings.materials, remap=False))
        start = replace(self, prior=self._as_materials(neutral), strategy="default", settings=settings)
        state.maps = neutral
        start._materials(state, stages=(MaterialStage(("roughness", "metallic"), schedule),))
        refined = replace(start, prior=self._as_materials(state.maps))
        if isinstance(self.engine, TransportEngine):  # what the white map made surfaces send is not in the photo
            self.engine.set_radiance(self.photo.linear)
        refined._light(state)
        refined._materials(state, stages=(MaterialStage(("albedo",), schedule),), corrections=self.settings.corrections)
        return state

    # -- conversions ---------------------------------------------------------------------------------------------------

    def materials(self, state: FitState) -> Materials:
        """Full-size maps of the state; the prior's values where there is no surface."""
        return self._as_materials(state.maps)

    def _as_materials(self, maps: torch.Tensor) -> Materials:
        pixels, values = self.engine.pixels.numpy(), maps.numpy()
        out = [m.reshape(m.shape[0] * m.shape[1], -1).copy() for m in _maps(self.prior)]
        out[0][pixels], out[1][pixels], out[2][pixels] = values[:, :3], values[:, 3:4], values[:, 4:5]
        shape = self.prior.roughness.shape
        return Materials(out[0].reshape(*shape, 3), out[1].reshape(shape), out[2].reshape(shape))

    def _prior_maps(self) -> torch.Tensor:
        flat = [m.reshape(m.shape[0] * m.shape[1], -1) for m in _maps(self.prior)]
        return torch.from_numpy(np.concatenate(flat, 1).astype(np.float32))[self.engine.pixels]

    def _photo(self) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(self.photo.linear.reshape(-1, 3)))

    def _image(self, values: torch.Tensor) -> Array:
        out = np.zeros((self.photo.linear.shape[0] * self.photo.linear.shape[1], 3), np.float32)
        out[self.engine.pixels.numpy()] = values.detach().numpy()
        return out.reshape(self.photo.linear.shape)

    def _surface(self) -> Array:
        surface = np.zeros(self.photo.linear.shape[0] * self.photo.linear.shape[1], bool)
        surface[self.engine.pixels.numpy()] = True
        return surface.reshape(self.photo.linear.shape[:2])


def _maps(materials: Materials) -> tuple[Array, Array, Array]:
    return materials.albedo, materials.roughness, materials.metallic


def state_log(envmap: Array, height: int) -> torch.Tensor:
    """Log of an envmap at `height` rows, to go on from."""
    from materialist.fit.fields import resize_envmap

    return resize_envmap(torch.from_numpy(np.ascontiguousarray(envmap)), height).clamp_min(1e-6).log()


def paste_visible_sky(
    envmap: Array, photo: Array, surface: Array, camera: Camera, *, white: float = WHITE
) -> Array:  # fmt: skip
    """The map with what the photo itself shows of it: texels seen past every surface take the photo's radiance.

    That is the mean of the pixels in a texel, or the pixel at its centre where texels are smaller. Photo pixels from
    `white` on, which are clipped, only raise a texel. surface: [H, W] bool.
    """
    if surface.all():
        return envmap
    h, w = envmap.shape[:2]
    d = texel_directions(h, w)
    depth = np.where(d[..., 2] < -1e-3, -d[..., 2], np.inf)
    col = np.floor(d[..., 0] / depth * camera.focal + camera.width / 2)
    row = np.floor(-d[..., 1] / depth * camera.focal + camera.height / 2)
    inside = np.isfinite(depth) & (col >= 0) & (col < camera.width) & (row >= 0) & (row < camera.height)
    r, c = np.where(inside, row, 0).astype(int), np.where(inside, col, 0).astype(int)
    seen = (inside & ~surface[r, c])[..., None]

    def raised(pixels: Array, texels: Array) -> Array:
        return np.where(pixels >= white, np.maximum(pixels, texels), pixels)

    # The pixels of the sky, each in the texel that it looks through.
    rays = pixel_rays(camera)[~surface].astype(np.float64)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    column = ((np.arctan2(rays[:, 0], -rays[:, 2]) / (2 * np.pi) + 0.5) * w).astype(int) % w
    texel = np.minimum((np.arccos(np.clip(rays[:, 1], -1, 1)) / np.pi * h).astype(int), h - 1) * w + column
    count = np.bincount(texel, minlength=h * w).reshape(h, w, 1)
    pixels = raised(photo[~surface], envmap.reshape(-1, 3)[texel])
    total = np.stack([np.bincount(texel, pixels[:, k], h * w) for k in range(3)], -1).reshape(h, w, 3)
    value = np.where(count > 0, total / np.maximum(count, 1), raised(photo[r, c], envmap))
    return np.where(seen, value, envmap).astype(np.float32)


__all__ = ["Fit", "FitState", "PathEngine", "TransportEngine", "paste_visible_sky"]
