"""Synthetic photographs with everything known: materials, shape, light, and the true scene to render again.

The protocol is that of the paper (section "Environment Map Optimization": 10 scenes x 10 viewpoints x 10 lightings);
the scenes are our own. The frame of the camera is the only frame: objects and light are turned into it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.buffers import floats, tensor
from materialist.color import luminance
from materialist.envmap import bilinear
from materialist.render.envmap import emitter, on_mitsuba_grid
from materialist.render.scene import look_along, sensor, shape
from materialist.render.variant import recording
from materialist.types import Array, Camera, Materials, Photo, Prediction
from materialist_lab.procedural import arrangements as scenes
from materialist_lab.procedural import lights
from materialist_lab.procedural.world import Viewpoint

PHOTO_SPP = 576
"""Samples a pixel of a reference picture: two seeds then agree to about 40 dB. A square, for the stratified sampler."""
MAX_DEPTH = 6
GLASS_DEPTH = 24
"""Path length of the reference pictures: five bounces; longer through glass."""
WAVEFRONT = 2**24
"""Paths traced at a time."""
EXPOSED = 0.85
"""Luminance at which the brightest two hundredths of the surfaces are exposed."""


@dataclass(frozen=True)
class SyntheticSample:
    """One picture of the benchmark and its truth."""

    photo: Photo
    truth: Prediction
    """The true maps at the photo's size: shading normal, planar depth with 0 for sky."""
    envmap: Array
    """[256, 512, 3] float32 linear: the light of the photo, in the camera frame and at the photo's exposure."""
    scene: TrueScene
    name: str = ""


def make_sample(
    scene_index: int,
    view_index: int,
    light_index: int,
    *,
    size: int | tuple[int, int] = 128,
    data: Path | None = None,
    seed: int = 0,
    spp: int = PHOTO_SPP,
    unseen: bool = False,
) -> SyntheticSample:
    """The sample of these three numbers; the same numbers and seed give the same sample.

    `size` is the side of a square photo or (height, width), in pixels. With `data`, objects also come from
    DATA/meshes/**/*.ply and light from DATA/envmaps/*.exr; without, everything is procedural. `unseen`: natural
    colours, and only files that no training set may use. Raises InputError when DATA lacks files. Needs a Mitsuba
    variant to be set (render.variant.setup).
    """
    height, width = (size, size) if isinstance(size, int) else size
    truth_scene = _true_scene(scene_index, view_index, height, width, data, seed, unseen)
    # --- Light, in the camera frame ---
    radiance = lights.environment(light_index, seed=seed, data=data, unseen=unseen)
    envmap = lights.envmap(radiance, truth_scene.view.to_scene)
    photo_seed = int(
        np.random.default_rng((scene_index, view_index, light_index)).integers(1, 2**31)
    )
    # --- The picture, exposed; the light in the same units ---
    picture = truth_scene.render(envmap, spp=spp, seed=photo_seed)
    exposure = _exposure(picture, truth_scene.truth.depth > 0)
    name = f"scene {scene_index} view {view_index} light {light_index}"
    return photographed(
        truth_scene, picture * exposure, (envmap * exposure).astype(np.float32), name
    )


def photographed(scene: TrueScene, picture: Array, envmap: Array, name: str) -> SyntheticSample:
    """The sample of a true scene whose exposed picture [H, W, 3] shows it under the light [h, 2h, 3]."""
    linear = np.clip(picture, 0, 1).astype(np.float32)
    photo = Photo(
        linear=linear, camera=scene.camera, original=linear, fov_source="option", path=name
    )
    return SyntheticSample(photo, scene.truth, envmap, scene, name)


def _exposure(picture: Array, surface: Array) -> float:
    """Factor that brings the 98th percentile of the surfaces' luminance to EXPOSED, as a camera would."""
    bright = (
        float(np.percentile(luminance(picture)[surface], 98))
        if surface.any()
        else float(picture.max())
    )
    return EXPOSED / max(bright, 1e-6)


class TrueScene:
    """The true geometry and materials of one view in Mitsuba, to be rendered under any envmap."""

    def __init__(self, items: list[scenes.Item], view: Viewpoint, height: int, width: int):
        self.view = view
        self.camera = Camera(width, height, view.fov)
        self.items = items
        shapes = {f"item{k:02d}": _mesh(item) for k, item in enumerate(items)}
        # Which paths a photo has, and so its noise, depends on where its rays begin.
        light = emitter(mi)
        eye = sensor(self.camera, look_along(mi)) | {"near_clip": 1e-3, "far_clip": 1e3}
        self._scene = mi.load_dict({"type": "scene", "sensor": eye, "light": light, **shapes})
        self._params = mi.traverse(self._scene)
        self._params.keep(["light.data"])
        self._item_of_shape = _registry(list(shapes.values()))

    @property
    def seen(self) -> Array:
        """[H, W] number of the item at a pixel's centre, -1 for the sky."""
        return self._centre["item"]

    @property
    def things(self) -> dict[int, Array]:
        """Item number -> [H, W] bool mask, of the objects that are seen; ground and walls left out."""
        flat = {k for k, item in enumerate(self.items) if len(item.solid.vertices) <= 4}
        return {
            int(k): self.seen == k for k in np.unique(self.seen[self.seen >= 0]) if k not in flat
        }

    def render(self, envmap: Array, spp: int = PHOTO_SPP, seed: int = 0) -> Array:
        """[H, W, 3] float32 linear picture under envmap [h, 2h, 3], path traced, unclipped."""
        self._params["light.data"] = tensor(mi, on_mitsuba_grid(np.asarray(envmap, np.float32), np))
        self._params.update()
        integrator = {"type": "path", "max_depth": MAX_DEPTH}
        if any(item.ior for item in self.items):
            # Paths that end by chance would be 3 dB of noise behind glass.
            integrator |= {"max_depth": GLASS_DEPTH, "rr_depth": GLASS_DEPTH}
        path_tracer = mi.load_dict(integrator)
        # Whole squares suit the stratified sampler; batches bound the memory.
        total = np.zeros((self.camera.height, self.camera.width, 3))
        batches = self._batches(spp)
        for k, part in enumerate(batches):
            number = mi.UInt32((seed * 7919 + k) & 0xFFFFFFFF)
            with recording():
                picture = mi.render(self._scene, integrator=path_tracer, spp=part, seed=number)
            total += np.array(picture)[..., :3] * part
        return (total / sum(batches)).astype(np.float32)

    def _batches(self, spp: int) -> list[int]:
        """Samples a pixel of each pass: squares, together at least spp, each within WAVEFRONT paths."""
        max_spp = max(1, int(np.sqrt(WAVEFRONT / (self.camera.width * self.camera.height))) ** 2)
        count = -(-spp // max_spp)
        return [int(np.ceil(np.sqrt(spp / count))) ** 2] * count

    @cached_property
    def truth(self) -> Prediction:
        """Depth and normal at pixel centres; albedo averaged over 4 x 4 places on the object at the centre."""
        # Only rays that meet the item at the centre count: edges do not mix.
        centre = self._centre
        sub = 4
        item = centre["item"]
        total = np.zeros((*item.shape, 3))
        count = np.zeros((*item.shape, 1))
        for place in np.ndindex(sub, sub):
            part = self._probe(tuple((np.array(place) + 0.5) / sub))
            same = (part["item"] == item)[..., None]
            total += np.where(same, self._albedo(part), 0)
            count += same
        albedo = np.where(count > 0, total / np.maximum(count, 1), self._albedo(centre))
        # Item -1, the sky, finds the value at the end.
        roughness = np.array([*(i.roughness for i in self.items), 0.5])
        metallic = np.array([*(i.metallic for i in self.items), 0.0])
        materials = Materials(
            *(x.astype(np.float32) for x in (albedo, roughness[item], metallic[item]))
        )
        return Prediction(materials, centre["normal"], centre["depth"], predictor="truth")

    def _albedo(self, seen: dict[str, Array]) -> Array:
        """[H, W, 3] albedo of what a probe saw, looked up as Mitsuba does: bilinear, repeated; 0 for sky."""
        albedo = np.zeros((*seen["item"].shape, 3))
        for k, item in enumerate(self.items):
            inside = seen["item"] == k
            # A border of one texel lets bilinear lookups wrap around.
            around = np.pad(item.albedo, ((1, 1), (1, 1), (0, 0)), mode="wrap")
            place = seen["uv"][inside].astype(np.float64) % 1 * item.albedo.shape[1::-1]
            albedo[inside] = bilinear(around, place + 1)
        return albedo

    @cached_property
    def _centre(self) -> dict[str, Array]:
        """What is seen at the centres of pixels."""
        return self._probe((0.5, 0.5))

    def _probe(self, offset: tuple[float, float]) -> dict[str, Array]:
        """What rays through that (x, y) place in each pixel see: item (-1 = sky), depth, normal [., 3], uv [., 2]."""
        height = self.camera.height
        width = self.camera.width
        # The camera looks along -Z from the origin, y up.
        columns, rows = np.meshgrid(np.arange(width) + offset[0], np.arange(height) + offset[1])
        x = floats(mi, (columns - width / 2) / self.camera.focal)
        y = floats(mi, (height / 2 - rows) / self.camera.focal)
        si = self._scene.ray_intersect(mi.Ray3f(mi.Point3f(0), dr.normalize(mi.Vector3f(x, y, -1))))
        normal = dr.select(si.is_valid(), si.sh_frame.n, mi.Normal3f(0, 0, 1))
        depth = dr.select(si.is_valid(), -si.p.z, 0)

        def picture(v):
            return np.moveaxis(np.array(v, np.float32).reshape(-1, height, width), 0, -1)

        item = self._item_of_shape[np.array(dr.reinterpret_array(mi.UInt32, si.shape))].reshape(
            height, width
        )
        return {
            "item": item,
            "depth": picture(depth)[..., 0],
            "normal": picture(normal),
            "uv": picture(si.uv),
        }


@lru_cache(maxsize=1)
def _true_scene(
    scene_index: int,
    view_index: int,
    height: int,
    width: int,
    data: Path | None,
    seed: int,
    unseen: bool,
) -> TrueScene:
    """The scene of a view; the last one is kept, since all lights of a view share it."""
    view = scenes.view(scene_index, view_index, seed=seed)
    arrangement = scenes.arrangement(scene_index, seed=seed, data=data, unseen=unseen)
    items = [scenes.in_camera(item, view) for item in arrangement]
    return TrueScene(items, view, height, width)


def _registry(meshes: list[Any]) -> Array:
    """[n] item number by Mitsuba's number of a shape; -1 for number 0 (nothing was hit)."""
    numbers = [
        int(np.array(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(mesh)))[0]) for mesh in meshes
    ]
    table = np.full(max(numbers, default=0) + 1, -1)
    table[numbers] = np.arange(len(meshes))
    return table


def _mesh(item: scenes.Item) -> Any:
    """A Mitsuba mesh with the item's material."""

    def texture(values: Array) -> dict[str, Any]:
        bitmap = mi.Bitmap(np.ascontiguousarray(values, np.float32))
        return {"type": "bitmap", "bitmap": bitmap, "raw": True, "wrap_mode": "repeat"}

    if item.ior:
        return shape(mi, item.solid, {"type": "dielectric", "int_ior": item.ior, "ext_ior": 1.0})
    maps = {"base_color": texture(item.albedo)}
    maps |= {
        name: texture(np.full((2, 2, 1), getattr(item, name))) for name in ("roughness", "metallic")
    }
    return shape(mi, item.solid, {"type": "materialist_disney", **maps})
