"""The fit on one geometry: light, then materials, alternated and corrected as the settings say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
import torch

from materialist.camera import pixel_rays
from materialist.color import linear_to_srgb
from materialist.envmap import texel_directions
from materialist.fit.engine import Engine, LightProblem, TransportEngine, prepared_envmap
from materialist.fit.light import envmap_field, fit_light, prior_light, start_radiance
from materialist.fit.losses import CLIPPED, edge_weights
from materialist.fit.materials import better_start, fit_materials, material_field, remapped
from materialist.fit.optimise import Progress
from materialist.fit.settings import FitSettings, MaterialStage
from materialist.io.photo import HDR_CLIP
from materialist.transport.filter import joint_filter
from materialist.types import Array, Camera, Materials, Photo

Renderer = Callable[[Materials, Array, int, int], Array]
"""renderer(materials, envmap, spp, seed) -> path-traced [H, W, 3]."""

SHORT_RANGE, LONG_RANGE = (1, 2), (1, 4, 16)
"""Steps, in pixels, of the joint filters that smooth corrections, and costs of the two starts."""


@dataclass
class FitState:
    """What the fit has found so far."""

    maps: torch.Tensor
    """[P, 5] albedo, roughness, metallic of the surface pixels."""
    envmap: Array
    """[h, 2h, 3]."""
    stages: list[dict] = field(default_factory=list)


@dataclass(frozen=True)
class Fit:
    """One inverse problem: a photo, an engine to render with, and the settings."""

    photo: Photo
    prior: Materials
    engine: Engine
    settings: FitSettings
    reference: Renderer
    """Path tracer, for the fixed-point corrections."""
    envmap_height: int = 256
    mask: Array | None = None
    """[H, W] bool: roughness and metallic are one value inside."""
    strategy: str = "default"
    """`default`: light, then materials. `white-light-first`: under a white map, roughness and metallic from 0.5,
    then light, then albedo (paper, Material Editing Settings)."""
    seed: int = 0
    progress: Progress | None = None

    def run(self) -> FitState:
        """Fit; returns maps and light."""
        state = FitState(self.prior_maps(), np.ones((self.envmap_height, 2 * self.envmap_height, 3), np.float32))
        if self.strategy == "white-light-first":
            return self._white_light_first(state)
        problem = self.engine.light_problem(self.prior)
        fit = self if self.settings.explained is None else self._confident(state, problem)
        for round_ in range(self.settings.rounds):
            if round_ > 0:
                found = self.materials(state)
                problem = self.engine.light_problem(
                    replace(self.prior, roughness=found.roughness, metallic=found.metallic)
                )
            fit._fit_light(state, problem, again=round_ > 0)
            last = round_ == self.settings.rounds - 1
            fit._fit_materials(state, corrections=self.settings.corrections * last)
        return state

    def _confident(self, state: FitState, problem: LightProblem) -> Fit:
        """The fit with what leaving the prior costs scaled by how well the prior explains the photo.

        A colour that is surely not the materials' is the light's: its weight falls as theirs rise.
        """
        result, error = prior_light(problem, self._photo(), self.settings.light, seed=self.seed, progress=self.progress)
        scale = self.settings.confidence(error)
        state.stages.append(
            {**result.summary(), "name": "prior light", "prior_error": error, "prior_confidence": scale}
        )
        light, materials = self.settings.light, self.settings.materials
        relaxation = None if light.albedo_relaxation is None else light.albedo_relaxation * scale
        light = replace(light, albedo_relaxation=relaxation, chroma=light.chroma / scale)
        materials = replace(materials, delta=materials.delta * scale)
        return replace(self, settings=replace(self.settings, light=light, materials=materials))

    # -- stages --------------------------------------------------------------------------------------------------------

    def _fit_light(self, state: FitState, problem: LightProblem, *, again: bool = False) -> None:
        """Fit the light with the prior's albedo: the light must not explain what later stages have baked in."""
        settings, photo = self.settings.light, self._photo()
        start = torch.from_numpy(state.envmap) if again else start_radiance(photo, settings)
        light = envmap_field(settings, seed=self.seed, start=start)
        steps = settings.refit_steps if again and settings.refit_steps else None
        result = fit_light(problem, photo, light, settings, steps=steps, seed=self.seed, progress=self.progress)
        state.stages.append(result.summary())
        envmap = prepared_envmap(light(max(settings.height, 16)), self.envmap_height)
        white = HDR_CLIP if self.photo.hdr else CLIPPED
        state.envmap = paste_visible_sky(envmap, self.photo.linear, self._surface(), self.photo.camera, white=white)

    def _fit_materials(self, state: FitState, *, corrections: int = 0, stages: tuple[MaterialStage, ...] = ()) -> None:
        settings = self.settings.materials
        if stages:
            settings = replace(settings, stages=stages)
        problem, pixels = self.engine.material_problem(state.envmap), self.engine.pixels
        photo, prior = self._photo()[pixels], self.prior_maps()
        held = remapped(prior) if settings.remap else prior
        first = all(stage["name"] != "materials" for stage in state.stages)
        start = state.maps if settings.field == "maps" and not first else held
        inside = None if self.mask is None else torch.from_numpy(self.mask.reshape(-1)[pixels.numpy()])
        edges = edge_weights(pixels.numpy(), linear_to_srgb(self.photo.linear)) if any(settings.smooth) else None
        if settings.second_metallic is not None and settings.field == "maps" and first and not stages:
            smooth = lambda cost: self._smooth(cost, LONG_RANGE)  # noqa: E731
            start = better_start(
                problem, photo, start, held, settings, smooth, inside=inside, progress=self.progress
            )  # fmt: skip
        settings = replace(settings, remap=False)
        model = material_field(start, settings, pixels, self.photo.camera, inside=inside, seed=self.seed)
        correction = None
        for k in range(corrections + 1):
            results = fit_materials(
                problem, photo, model, held, settings, edges, factor=correction, progress=self.progress
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
        traced = self.reference(self.materials(state), state.envmap, self.settings.correction_spp, seed)
        cached = self._image(render(state.maps))
        both = torch.from_numpy(np.concatenate([traced, cached], -1)).reshape(-1, 6)[self.engine.pixels]
        traced_smooth, cached_smooth = self._smooth(both, SHORT_RANGE).split(3, -1)
        return ((traced_smooth + 1e-3) / (cached_smooth + 1e-3)).clamp(0.1, 4)

    def _smooth(self, values: torch.Tensor, steps: tuple[int, ...]) -> torch.Tensor:
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
        start._fit_materials(state, stages=(MaterialStage(("roughness", "metallic"), schedule),))
        refined = replace(start, prior=self._as_materials(state.maps))
        if isinstance(self.engine, TransportEngine):  # what the white map made surfaces send is not in the photo
            self.engine.set_radiance(self.photo.linear)
        refined._fit_light(state, self.engine.light_problem(refined.prior))
        albedo = (MaterialStage(("albedo",), schedule),)
        refined._fit_materials(state, stages=albedo, corrections=self.settings.corrections)
        return state

    # -- conversions ---------------------------------------------------------------------------------------------------

    def materials(self, state: FitState) -> Materials:
        """Full-size maps of the state; the prior's values where there is no surface."""
        return self._as_materials(state.maps)

    def prior_maps(self) -> torch.Tensor:
        """[P, 5] the prior's albedo, roughness and metallic of the surface pixels."""
        return torch.from_numpy(_stacked(self.prior))[self.engine.pixels]

    def _as_materials(self, maps: torch.Tensor) -> Materials:
        out = _stacked(self.prior)
        out[self.engine.pixels.numpy()] = maps.numpy()
        out = out.reshape(*self.prior.roughness.shape, 5)
        return Materials(np.ascontiguousarray(out[..., :3]), out[..., 3].copy(), out[..., 4].copy())

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


def _stacked(materials: Materials) -> Array:
    """[H * W, 5] float32 albedo, roughness, metallic."""
    maps = (materials.albedo, materials.roughness[..., None], materials.metallic[..., None])
    return np.concatenate(maps, -1).reshape(-1, 5).astype(np.float32)


def paste_visible_sky(
    envmap: Array, photo: Array, surface: Array, camera: Camera, *, white: float = CLIPPED
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
