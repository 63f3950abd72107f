"""Two ways to render inside the optimisation, behind one interface.

`TransportEngine` shades from cached transport; `PathEngine` is the paper's: Mitsuba's path replay backpropagation.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch

from materialist.buffers import placed
from materialist.camera import pixel_rays
from materialist.envmap import texels_around
from materialist.fit.fields import ALL, Rows, resize_envmap
from materialist.render.scene import MAX_DEPTH
from materialist.transport.cache import CacheSettings, Tables, TransportCache
from materialist.transport.filter import filter_tables, surface_guide
from materialist.transport.light import light_matrix
from materialist.transport.shading import shade
from materialist.types import Array, Camera, Geometry, Materials

LIGHT_PIXELS = 2048
LEAST_PIXELS = 256
"""Pixels that the light is fitted to, shared by surfaces and sky by their area; surfaces get at least the second."""


@dataclass(frozen=True)
class LightProblem:
    """Rendering as a function of the light, materials fixed."""

    pixels: torch.Tensor
    """[Q] int64 row-major pixels that `render` answers for, on the CPU; all else is on `buffers.torch_device()`."""
    height: int
    """Rows of the environment map that `render` takes."""
    render: Callable[[torch.Tensor], torch.Tensor]
    """render(envmap [height, 2 height, 3]) -> radiance [Q, 3], differentiable."""


MaterialProblem = Callable[[torch.Tensor, Rows], torch.Tensor]
"""Rendering as a function of materials, light fixed, differentiable.

From albedo, roughness and metallic [P, 5] of the surface pixels that the second argument names to radiance [P, 3].
"""


class TransportEngine:
    """Shading from cached transport; noise-free, a full-resolution step in tens of milliseconds.

    radiance: [H, W, 3] outgoing radiance of the surfaces, the source of indirect light where a problem has none of its
    own: the photograph.
    light_height: rows of the environment map inside the light fit. roughness: [H, W], where the fit leaves it alone.
    """

    def __init__(
        self,
        geometry: Geometry,
        camera: Camera,
        radiance: Array,
        *,
        roughness: Array | None = None,
        seed: int = 0,
        light_height: int = 32,
        cache: CacheSettings | None = None,
        progress=None,
    ):
        self.cache = TransportCache(
            geometry, camera, cache, roughness=roughness, seed=seed, progress=progress
        )
        self.camera = camera
        self.seed = seed
        self.light_height = light_height
        self.radiance = radiance
        self.pixels = torch.from_numpy(self.cache.pixels.astype(np.int64))
        # Pixels without a surface show the map itself: the light is fitted to them, too.
        seen = np.zeros(camera.width * camera.height, bool)
        seen[self.cache.pixels] = True
        self.sky = np.flatnonzero(~seen)
        self.guide = surface_guide(self.cache)

    def light_problem(self, materials: Materials, sent: Array | None = None) -> LightProblem:
        # --- Q pixels of surfaces and sky, by their share of the picture ---
        rng = np.random.default_rng(self.seed + 17)
        share = LIGHT_PIXELS / (self.camera.width * self.camera.height)
        count = len(self.cache.pixels)
        rows = _subset(rng, count, min(1.0, max(share, LEAST_PIXELS / max(count, 1))))
        sky = self.sky[_subset(rng, len(self.sky), min(1.0, share))]
        # --- Surfaces: radiance is T E + b, b the light that other surfaces send ---
        matrix = light_matrix(self.cache, materials, rows, self.light_height)
        sent = self.radiance if sent is None else sent
        indirect = matrix.indirect(placed(self.cache.slot_radiance(sent)))
        # --- Sky: the four texels around each ray, and their weights ---
        direction = pixel_rays(self.camera).reshape(-1, 3)[sky]
        direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
        index, weight = (placed(v) for v in texels_around(direction, matrix.shape))

        def render(envmap: torch.Tensor) -> torch.Tensor:
            flat = envmap.reshape(-1, 3)
            seen = (flat[index] * weight[..., None].float()).sum(1)
            return torch.cat([matrix.combine(matrix.direct(flat) + indirect), seen])

        pixels = torch.cat([matrix.pixels, torch.from_numpy(sky.astype(np.int64))])
        return LightProblem(pixels, self.light_height, render)

    def tables(self, envmap: Array) -> Tables:
        """Filtered transport tables under `envmap` [h, 2h, 3]."""
        return filter_tables(self.cache, self.cache.gather(envmap, self.radiance), self.guide)

    def bounced(self, maps: torch.Tensor, envmap: Array) -> Array:
        """[H, W, 3] what surfaces with maps [P, 5] send to each other under this light, in the path tracer's bounces.

        The surface that is seen is the last of a path, and the first meets the light alone.
        """
        sent = None
        for _ in range(MAX_DEPTH - 2):
            radiance = _shaded(self.cache.gather(envmap, sent), maps)
            sent = self.cache.image(radiance.cpu().numpy())
        assert sent is not None
        return sent

    def material_problem(self, envmap: Array, sent: Array | None = None) -> MaterialProblem:
        gathered = self.cache.gather(envmap, self.radiance if sent is None else sent)
        self.cache.forget()  # a fit asks once, as a rule
        tables = filter_tables(self.cache, gathered, self.guide)

        def render(maps: torch.Tensor, rows: Rows = ALL) -> torch.Tensor:
            return _shaded(
                Tables(tables.diffuse[rows], tables.specular[:, rows], tables.levels), maps
            )

        return render


class PathEngine:
    """The paper's engine: Mitsuba's PRB integrator on a `RenderScene`, a fresh seed in every step."""

    SPP = 64
    PATH_DEPTH = 4

    def __init__(
        self,
        scene,
        camera: Camera,
        pixels: Array,
        *,
        envmap_height: int = 256,
        seed: int = 0,
    ):
        self.scene = scene
        self.camera = camera
        self.pixels = torch.from_numpy(pixels.astype(np.int64))
        self.envmap_height = envmap_height
        self.seed = seed
        self._step = 0

    def _render(self, *maps_and_envmap: torch.Tensor) -> torch.Tensor:
        # Two seeds a step: `seed` of the picture, and `seed` + 1 of its gradient.
        self._step += 1
        return self.scene.render_torch(
            *maps_and_envmap,
            spp=self.SPP,
            seed=self.seed + 2 * self._step,
            max_depth=self.PATH_DEPTH,
        )

    def light_problem(self, materials: Materials, sent: Array | None = None) -> LightProblem:
        maps = [placed(np.ascontiguousarray(values)) for values in vars(materials).values()]
        everything = torch.arange(self.camera.width * self.camera.height)
        return LightProblem(
            everything,
            self.envmap_height,
            lambda envmap: self._render(*maps, envmap).reshape(-1, 3),
        )

    def bounced(self, maps: torch.Tensor, envmap: Array) -> None:
        """Nothing: every rendering follows the light from surface to surface."""

    def material_problem(self, envmap: Array, sent: Array | None = None) -> MaterialProblem:
        light = placed(np.ascontiguousarray(envmap, dtype=np.float32))
        h = self.camera.height
        w = self.camera.width

        def render(maps: torch.Tensor, rows: Rows = ALL) -> torch.Tensor:
            assert rows == ALL, "a path-traced step renders the whole picture"
            full = maps.new_zeros(h * w, 5).index_put((self.pixels,), maps).view(h, w, 5)
            parts = [part.contiguous() for part in (full[..., :3], full[..., 3], full[..., 4])]
            return self._render(*parts, light).reshape(-1, 3)[self.pixels]

        return render


Engine = TransportEngine | PathEngine
"""A differentiable renderer of one camera and geometry: `pixels` with a surface, and the two problems.

sent: [H, W, 3] what surfaces send to each other, as `bounced` makes it.
"""


def prepared_envmap(envmap: torch.Tensor, height: int) -> Array:
    """[height, 2 height, 3] float32 numpy map from a torch map of any size."""
    return resize_envmap(envmap.detach(), height).contiguous().cpu().numpy().astype(np.float32)


def _subset(rng, size: int, share: float) -> Array:
    """A sorted random subset of range(size), stratified: one of each run of 1 / share."""
    count = round(size * share)
    if count == 0:
        return np.zeros(0, np.int64)
    edges = np.linspace(0, size, count + 1)
    return np.minimum((edges[:-1] + rng.random(count) * np.diff(edges)).astype(np.int64), size - 1)


def _shaded(tables: Tables, maps: torch.Tensor) -> torch.Tensor:
    """[P, 3] radiance of maps [P, 5]."""
    return shade(tables, maps[:, :3], maps[:, 3], maps[:, 4])
