"""The fit on one geometry: the light with the prior's materials, then the materials under that light."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np
import torch

from materialist.camera import pixel_rays
from materialist.envmap import texel_directions
from materialist.fit.engine import Engine, prepared_envmap
from materialist.fit.light import envmap_field, fit_light, start_light
from materialist.fit.losses import CLIPPED
from materialist.fit.materials import COLUMNS, fit_materials, material_field, remapped
from materialist.fit.optimise import Progress
from materialist.fit.settings import FitSettings, MaterialSettings, MaterialStage
from materialist.io.photo import HDR_CLIP
from materialist.types import Array, Camera, Materials, Photo


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
    envmap_height: int = 256
    light: Array | None = None
    """What is predicted of it; see `Prediction.light`."""
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
        settings = self.settings.materials
        if self.mask is not None:  # what the mask makes one value moves, too
            last = replace(settings.stages[-1], targets=tuple(COLUMNS))
            settings = replace(settings, stages=(*settings.stages[:-1], last))
        self._fit_light(state, self.prior)
        self._fit_materials(state, settings)
        return state

    # -- stages --------------------------------------------------------------------------------------------------------

    def _fit_light(self, state: FitState, materials: Materials) -> None:
        start, settings, photo = time.perf_counter(), self.settings.light, self._photo()
        problem = self.engine.light_problem(materials)
        begin = start_light(photo, settings, self.light, problem)
        light = envmap_field(settings, seed=self.seed, start=begin.radiance)
        result = fit_light(problem, photo, light, settings, start=begin, seed=self.seed, progress=self.progress)
        envmap = prepared_envmap(light(max(settings.height, 16)), self.envmap_height)
        white = HDR_CLIP if self.photo.hdr else CLIPPED
        state.envmap = paste_visible_sky(envmap, self.photo.linear, self._surface(), self.photo.camera, white=white)
        state.stages.append({**result.summary(), "seconds": round(time.perf_counter() - start, 3)})

    def _fit_materials(self, state: FitState, settings: MaterialSettings) -> None:
        """From the state's maps, which L_cons holds on to."""
        start = time.perf_counter()
        problem, pixels = self.engine.material_problem(state.envmap), self.engine.pixels
        held = remapped(state.maps) if settings.remap else state.maps
        inside = None if self.mask is None else torch.from_numpy(self.mask.reshape(-1)[pixels.numpy()])
        model = material_field(held, settings, pixels, self.photo.camera, inside=inside, seed=self.seed)
        results = fit_materials(problem, self._photo()[pixels], model, held, settings, progress=self.progress)
        summaries = [r.summary() for r in results]
        for first in summaries[:1]:  # the tables are its
            first["seconds"] += round(time.perf_counter() - start - sum(r.seconds for r in results), 3)
        state.stages += summaries
        state.maps = model().detach()

    def _white_light_first(self, state: FitState) -> FitState:
        """Roughness and metallic start at 0.5, and nothing is remapped on the way."""
        settings = replace(self.settings.materials, remap=False)
        schedule = settings.stages[0].schedule
        state.maps[:, 3:] = 0.5
        self._fit_materials(state, replace(settings, stages=(MaterialStage(("roughness", "metallic"), schedule),)))
        self._fit_light(state, self.materials(state))
        self._fit_materials(state, replace(settings, stages=(MaterialStage(("albedo",), schedule),)))
        return state

    # -- conversions ---------------------------------------------------------------------------------------------------

    def materials(self, state: FitState) -> Materials:
        """Full-size maps of the state; the prior's values where there is no surface."""
        out = _stacked(self.prior)
        out[self.engine.pixels.numpy()] = state.maps.numpy()
        out = out.reshape(*self.prior.roughness.shape, 5)
        return Materials(np.ascontiguousarray(out[..., :3]), out[..., 3].copy(), out[..., 4].copy())

    def prior_maps(self) -> torch.Tensor:
        """[P, 5] the prior's albedo, roughness and metallic of the surface pixels."""
        return torch.from_numpy(_stacked(self.prior))[self.engine.pixels]

    def _photo(self) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(self.photo.linear.reshape(-1, 3)))

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
