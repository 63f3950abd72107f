"""A small synthetic room whose materials and light are known, and its inverse problem."""

import numpy as np
from transport_scenes import furnished_room, windowed_sky

from materialist import metrics
from materialist.fit.engine import TransportEngine
from materialist.fit.invert import Fit, FitSetup
from materialist.fit.settings import FitSettings
from materialist.render.scene import RenderScene
from materialist.transport.cache import CacheSettings
from materialist.types import Materials, Photo, Prediction

ENVMAP_HEIGHT = 16


class Room:
    """A photograph of the room, path traced, and a prior that is wrong in every map."""

    def __init__(self, size: int = 32):
        self.camera, self.geometry, self.truth = furnished_room(size)
        self.light = windowed_sky(ENVMAP_HEIGHT)
        self.path = RenderScene(self.geometry, self.camera)
        linear = np.clip(self.render(self.truth, self.light, 256), 0, 1)
        self.photo = Photo(linear=linear, camera=self.camera, original=linear)
        ramp = np.linspace(-0.12, 0.12, self.camera.width, dtype=np.float32)[None, :]
        self.prior = Materials(
            np.clip(self.truth.albedo + ramp[..., None], 0.02, 1),
            np.clip(self.truth.roughness + ramp, 0.05, 1),
            np.clip(self.truth.metallic * 0.8 + 0.05, 0, 1),
        )
        self.start_error = metrics.sh_error_relative(np.full_like(self.light, 0.6), self.light)

    def render(self, materials, envmap, spp, seed=0):
        self.path.set_materials(materials)
        self.path.set_envmap(envmap)
        return self.path.render(spp=spp, seed=seed)

    def fit(self, settings: FitSettings, **options) -> Fit:
        engine = TransportEngine(
            self.geometry,
            self.camera,
            self.photo.linear,
            light_height=settings.light_grid,
            cache=CacheSettings(32, 8),
        )
        return Fit(self.setup(settings, **options), self.geometry, self.path, engine)

    def setup(self, settings: FitSettings, prior: Materials | None = None, **options) -> FitSetup:
        maps = Prediction(
            prior or self.prior,
            np.zeros_like(self.photo.linear),
            np.ones(self.photo.linear.shape[:2]),
        )
        return FitSetup(self.photo, maps, settings, envmap_height=ENVMAP_HEIGHT, **options)
