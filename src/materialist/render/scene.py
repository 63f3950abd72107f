"""A scene that is built once and rendered many times: geometry fixed, materials and light exchanged."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from materialist.buffers import floats, integers, tensor, torch_device
from materialist.errors import InputError, SetupError
from materialist.geometry.build import part
from materialist.render.bodies import body_bsdf, body_emitter, opaque_bsdf
from materialist.render.envmap import check_envmap, emitter, on_mitsuba_grid
from materialist.render.pixels import radiance, stratified
from materialist.render.variant import recording, setup
from materialist.types import Array, Body, Camera, Geometry, Lamp, Materials, Mesh

MAX_DEPTH = 4
"""Path length of the re-rendering and of the paper's engine: light reaches the camera by up to three surfaces."""

GLASS_DEPTH = 16
"""Path length with transparent bodies: through two of them, with reflections inside, and on by three surfaces."""


class RenderScene:
    """Path tracing of one geometry from one camera, a pinhole at the origin.

    `mi_scene` is Mitsuba's scene. Its shapes are `surface`, with the faces that `geometry.mesh` gives the depth
    surface in their order, `plane0`, `plane1`, ...: the continued planes likewise (see `part`), `body0`, ...,
    and `lamp0`, ... The depth surface carries the per-pixel maps, a continued plane the mean of the maps over its
    pixels; bodies have materials of their own, lamps are glowing spheres.

    Raises InputError for a picture below 2 x 2 pixels, or a mesh without a depth surface; SetupError as `setup`.
    """

    def __init__(
        self,
        geometry: Geometry,
        camera: Camera,
        *,
        bodies: tuple[Body, ...] = (),
        lamps: tuple[Lamp, ...] = (),
        device: str = "auto",
    ):
        if min(camera.width, camera.height) < 2:
            raise InputError(
                f"The picture is {camera.width} x {camera.height}; rendering needs 2 x 2 pixels or more."
            )
        if not (geometry.mesh.face_plane == -1).any():
            raise InputError(
                "The mesh has no depth surface to render; give a depth map with some values above 0."
            )
        self.mi = mi = setup(device)
        self.camera = camera
        # --- Planes: each has one material, the mean of the pixels that lie on it ---
        self.planes = [int(k) for k in np.unique(geometry.mesh.face_plane) if k >= 0]
        members = {k: np.flatnonzero(geometry.plane_label.reshape(-1) == k) for k in self.planes}
        # A plane that no pixel lies on keeps the neutral material it starts with.
        self._members = {k: pixels for k, pixels in members.items() if len(pixels)}
        height = camera.height
        width = camera.width
        # --- The scene as Mitsuba's dictionary ---
        description = {
            "type": "scene",
            "embree_use_robust_intersections": True,
            "sensor": sensor(camera, look_along(mi)),
            "light": emitter(mi),
            "surface": seen_shape(mi, part(geometry.mesh, -1), _maps_bsdf(mi, height, width)),
        }
        for k in self.planes:
            description[f"plane{k}"] = seen_shape(mi, part(geometry.mesh, k), _maps_bsdf(mi, 2, 2))
        for k, body in enumerate(bodies):
            bsdf = body_bsdf(body.surface, opaque_bsdf(mi, body.surface))
            description[f"body{k}"] = seen_shape(mi, body, bsdf, body_emitter(body.surface))
        for k, lamp in enumerate(lamps):
            description[f"lamp{k}"] = sphere(lamp)
        # --- Of all its parameters only maps and light change: the others are let go ---
        self.mi_scene = mi.load_dict(description)
        self.params = mi.traverse(self.mi_scene)
        names = list(self.params.keys())
        self.params.keep(
            [k for k in names if k == "light.data" or (".bsdf." in k and k.endswith(".data"))]
        )

    def set_materials(self, materials: Materials) -> None:
        """Take other maps; their size must be the camera's, else InputError."""
        size = (self.camera.height, self.camera.width)
        for name, shape in (("albedo", (*size, 3)), ("roughness", size), ("metallic", size)):
            if getattr(materials, name).shape != shape:
                raise InputError(
                    f"The {name} map is {getattr(materials, name).shape}, the camera needs {shape}."
                )
        # Mitsuba's textures have a channel axis, also of one channel.
        maps = (materials.albedo, materials.roughness[..., None], materials.metallic[..., None])
        self._assign(*(tensor(self.mi, values) for values in maps))
        self.params.update()

    def set_envmap(self, envmap: Array) -> None:
        """Take another light: [h, 2h, 3] linear radiance >= 0, h >= 4, in the project's convention; else InputError."""
        check_envmap(envmap)
        self.params["light.data"] = tensor(
            self.mi, on_mitsuba_grid(np.asarray(envmap, np.float32), np)
        )
        self.params.update()

    def render(
        self,
        *,
        spp: int,
        seed: int = 0,
        max_depth: int = MAX_DEPTH,
        where: Array | None = None,
        unseen: Sequence[str] = (),
    ) -> Array:
        """[H, W, 3] float32 linear radiance, path-traced.

        spp: samples per pixel, at least this many. seed: equal seeds give equal pictures.
        max_depth: path length; 2 is direct light alone, 1 the sky alone.
        where: [H, W] bool: the pixels that are traced, at a cost in proportion; the others are 0. None: all.
        unseen: names of bodies and lamps whose rays do not count, see `pixels.radiance`.
        """
        _check_options(spp, max_depth)
        where = np.ones((self.camera.height, self.camera.width), bool) if where is None else where
        picture = np.zeros((*where.shape, 3), np.float32)
        picture[where] = radiance(
            self, where.shape, where, spp=spp, seed=seed, max_depth=max_depth, unseen=unseen
        )
        return picture

    def render_torch(
        self,
        albedo,
        roughness,
        metallic,
        envmap,
        *,
        spp: int,
        seed: int,
        max_depth: int = MAX_DEPTH,
    ):
        """[H, W, 3] linear, differentiable by path replay backpropagation (paper, section Implementation Details).

        Continued planes follow the means of the maps, and so do their gradients. The scene keeps materials and light.

        albedo: [H, W, 3]; roughness, metallic: [H, W]; envmap: [h, 2h, 3]. Float32, on `buffers.torch_device()`.
        spp: samples per pixel of the image; its gradient uses as many, with another seed. max_depth: as in `render`.
        """
        import drjit as dr
        import torch

        _check_options(spp, max_depth)
        if self.mi.variant().startswith("cuda") != (torch_device() == "cuda"):
            raise SetupError(
                'PyTorch here computes on the CPU alone: choose `device="cpu"`, or install one for CUDA.'
            )
        # Path replay backpropagation: gradients at the cost of a second pass, without storing
        # the paths.
        integrator = self.mi.load_dict({"type": "prb", "max_depth": max_depth})

        @dr.wrap(source="torch", target="drjit")
        # The whole step is one differentiable operation for torch: maps in, picture out.
        def run(albedo_map, roughness_map, metallic_map, envmap_data):
            self._assign(albedo_map, roughness_map, metallic_map)
            self.params["light.data"] = envmap_data
            self.params.update()
            options = {
                "integrator": integrator,
                "spp": stratified(spp),
                "seed": seed,
                "seed_grad": seed + 1,
            }
            with recording():
                return self.mi.render(self.mi_scene, self.params, **options)

        return run(
            albedo, roughness[..., None], metallic[..., None], on_mitsuba_grid(envmap, torch)
        )

    def _assign(self, albedo, roughness, metallic) -> None:
        # The depth surface has the maps, a continued plane their mean over its own pixels.
        for name, maps in (
            ("base_color", albedo),
            ("roughness", roughness),
            ("metallic", metallic),
        ):
            self.params[f"surface.bsdf.{name}.data"] = maps
            for k, members in self._members.items():
                self.params[f"plane{k}.bsdf.{name}.data"] = self._mean(maps, members)

    def _mean(self, maps, members: Array):
        """[2, 2, C] of the mean of a tensor [H, W, C] over the pixels `members`; differentiable."""
        import drjit as dr

        channels = maps.shape[2]
        index = integers(self.mi, members) * channels
        # The mean of each channel, as gathers, so that gradients reach the pixels of the plane.
        means = [dr.mean(dr.gather(self.mi.Float, maps.array, index + c)) for c in range(channels)]
        # Mitsuba takes no texture below 2 x 2.
        return self.mi.TensorXf(dr.concat(means * 4), (2, 2, channels))


def _check_options(spp: int, max_depth: int) -> None:
    if spp < 1:
        raise InputError(f"spp is {spp}; give at least 1 sample per pixel.")
    if max_depth < 1:
        raise InputError(f"max_depth is {max_depth}; give at least 1 (2 for direct light).")


def look_along(mi) -> Any:
    """The `to_world` of the photo's camera: from the origin along -Z, +Y up."""
    return mi.ScalarTransform4f().look_at(origin=[0, 0, 0], target=[0, 0, -1], up=[0, 1, 0])


def sensor(camera: Camera, transform) -> dict:
    """Mitsuba's description of the photo's pinhole; its `to_world` looks along -Z, +Y up."""
    return {
        "type": "perspective",
        "fov": camera.fov,
        "fov_axis": "x",
        "to_world": transform,
        # Far from any scene: planar depth has no unit.
        "near_clip": 1e-4,
        "far_clip": 1e7,
        "film": {
            "type": "hdrfilm",
            "width": camera.width,
            "height": camera.height,
            # A pixel is the mean over its square: pixels then do not depend on one another.
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        },
        "sampler": {"type": "multijitter"},
    }


def _maps_bsdf(mi, height: int, width: int) -> dict:
    # Values come by `set_materials`. Nearest texel: a pixel has one material, unmixed.
    def texture(channels: int, value: float) -> dict:
        data = tensor(mi, np.full((height, width, channels), value, np.float32))
        return {
            "type": "bitmap",
            "data": data,
            "raw": True,
            "filter_type": "nearest",
            "wrap_mode": "clamp",
        }

    return {
        "type": "materialist_disney",
        "base_color": texture(3, 0.5),
        "roughness": texture(1, 0.5),
        "metallic": texture(1, 0.0),
    }


def sphere(lamp: Lamp) -> dict:
    """Mitsuba's description of a black sphere whose radiant flux is the lamp's."""
    return {
        "type": "sphere",
        "center": [float(v) for v in lamp.position],
        "radius": float(lamp.radius),
        "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}},
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": list(lamp.radiance)}},
    }


def seen_shape(mi, mesh: Mesh | Body, bsdf: dict, emitter: dict | None = None) -> Any:
    """`shape` of a mesh, without normals exactly along X: u runs there on what faces the camera, and a shading frame
    about a normal along u is not a number."""
    # Tilt such normals by 1e-3: invisible, and enough for a frame.
    along = np.abs(mesh.normals[:, :1]) > 1 - 1e-6
    beside = (mesh.normals + np.array([0, 1e-3, 5e-4])) / np.sqrt(1 + 1.25e-6)
    normals = np.where(along, beside, mesh.normals).astype(np.float32)
    return shape(mi, replace(mesh, normals=normals), bsdf, emitter)


def shape(mi, mesh: Any, bsdf: dict | None = None, emitter: dict | None = None) -> Any:
    """A Mitsuba mesh of anything with vertices and faces, and, for a BSDF, shading normals and uv."""
    props = mi.Properties()
    # A shape without a BSDF is only hit by rays: it needs neither normals nor uv.
    seen = bsdf is not None
    for name, plugin in (("mesh_bsdf", bsdf), ("mesh_emitter", emitter)):
        if plugin is not None:
            props[name] = mi.load_dict(plugin)
    count = len(mesh.vertices), len(mesh.faces)
    mitsuba_mesh = mi.Mesh(
        "part", *count, has_vertex_normals=seen, has_vertex_texcoords=seen, props=props
    )
    params = mi.traverse(mitsuba_mesh)
    params["vertex_positions"] = floats(mi, mesh.vertices)
    params["faces"] = integers(mi, mesh.faces)
    if seen:
        params["vertex_normals"] = floats(mi, mesh.normals)
        params["vertex_texcoords"] = floats(mi, mesh.uv)
    params.update()
    return mitsuba_mesh
