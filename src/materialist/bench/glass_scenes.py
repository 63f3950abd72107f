"""Objects in front of a textured floor and wall, as a photo shows them opaque and as they truly look as glass."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from materialist.camera import pixel_rays
from materialist.color import luminance
from materialist.errors import InputError
from materialist.procedural import arrangements as scenes
from materialist.procedural import lights, patterns
from materialist.procedural.objects import shapes
from materialist.procedural.objects.shapes import Solid
from materialist.procedural.world import Viewpoint
from materialist.types import Array, Camera

GROUPS = ("symmetric", "asymmetric")
"""Whether an object's back is its front mirrored, as the paper sorts its objects."""
VESSELS = ("bowl", "coffeemug", "teapot_newell", "wineglass")
"""Meshes of the data folder that are walls around air; the protocol is about solid objects."""
DEPTH = {"diffuse": 6, "glass": 40}
"""Path lengths of the reference pictures."""
ENVMAP_ROWS = {"room": 64, "envmap": 256}
"""Light in a room is brought to few rows: small suns make caustics that no affordable picture shows cleanly."""
BRIGHTEST = 60.0
"""Largest radiance of the light, as a multiple of its mean."""
LIFT = 0.002
"""Air between an object and the floor: where two surfaces are one, which of them a ray meets first is an accident."""
EXPOSED = 0.8
"""Luminance of the brightest fiftieth of the background."""


@dataclass(frozen=True)
class Thing:
    """An object of the benchmark, standing on y = 0, its longest side about 0.7."""

    name: str
    group: str
    solid: Solid


@dataclass(frozen=True)
class Front:
    """What is seen of a mesh from a camera."""

    depth: Array
    """[H, W] planar, 0 where there is nothing."""
    normal: Array
    """[H, W, 3] unit, camera frame, towards the viewer."""
    thickness: Array
    """[H, W] from the first to the last surface along the ray."""
    back: Array
    """[H, W, 3] unit normal of that last surface, away from the viewer."""


def things(data: Path | None, count: int, seed: int = 0) -> list[Thing]:
    """The first `count` symmetric and `count` asymmetric objects: procedural, or watertight meshes of DATA/meshes."""
    if data is None:
        return [thing for k in range(count) for thing in (_turned(k, seed), _free(k, seed))]
    found = []
    for group in GROUPS:
        files = sorted((data / "meshes" / group).glob("*.ply"))
        files = [f for f in files if f.stem not in VESSELS]
        order = np.random.default_rng([seed, 6]).permutation(len(files))
        loaded = (Thing(files[k].stem, group, shapes.placed(shapes.load(files[k]), scale=0.7)) for k in order)
        closed = [thing for _, thing in zip(range(count), (t for t in loaded if is_closed(t.solid)), strict=False)]
        if not closed:
            raise InputError(f"{data / 'meshes' / group} holds no closed .ply mesh; give another --data, or none.")
        found.append(closed)
    return [thing for pair in zip(*found, strict=False) for thing in pair] + [
        thing for rest in found for thing in rest[min(map(len, found)) :]
    ]


def is_closed(solid: Solid) -> bool:
    """Whether every edge of the mesh has two faces that run through it in opposite directions."""
    _, place = np.unique(np.round(solid.vertices, 7), axis=0, return_inverse=True)
    faces = place.reshape(-1)[solid.faces]
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there = np.unique(edges @ np.array([1, place.max() + 1]), return_counts=True)
    back = np.unique(edges @ np.array([place.max() + 1, 1]), return_counts=True)
    return bool(np.array_equal(there[0], back[0]) and np.array_equal(there[1], back[1]))


def _turned(index: int, seed: int) -> Thing:
    """A solid of revolution or a superellipsoid: its own mirror image."""
    rng = np.random.default_rng([seed, 7, index])
    kind = index % 4
    if kind == 0:
        return Thing(f"ellipsoid {index}", "symmetric", shapes.superquadric(rng.uniform(0.45, 0.7, 3), 1, 1))
    if kind == 1:
        y = np.linspace(0, 1, 60)
        radius = 0.17 + 0.07 * np.sin(rng.uniform(4, 8) * y + rng.uniform(0, 6)) + 0.05 * rng.uniform(-1, 1) * y
        radius = radius * np.sqrt(np.clip(y / 0.12, 0, 1) * np.clip((1 - y) / 0.12, 0, 1))
        return Thing(f"baluster {index}", "symmetric", shapes.lathe(np.stack([radius, 0.7 * y], -1)))
    if kind == 2:
        return Thing(f"capsule {index}", "symmetric", shapes.capsule(rng.uniform(0.13, 0.2), rng.uniform(0.2, 0.35)))
    extent = rng.uniform(0.4, 0.65, 3)
    return Thing(
        f"cushion {index}", "symmetric", shapes.superquadric(extent, rng.uniform(0.5, 0.8), rng.uniform(0.5, 1))
    )


def _free(index: int, seed: int) -> Thing:
    """A lumpy or twisted body."""
    from materialist.procedural.objects.glassware import centred

    rng = np.random.default_rng([seed, 8, index])
    if index % 2:
        turn, bend = rng.choice([-1, 1]) * rng.uniform(1, 3), rng.uniform(-0.4, 0.4)
        column = shapes.superquadric(np.array([0.5, 1, rng.uniform(0.25, 0.5)]), 0.6, rng.uniform(0.5, 1))
        body = centred(shapes.warped(column, lambda p: _twist(p, turn, bend)))
        name = f"twisted {index}"
    else:
        body = centred(shapes.blob(rng, rng.uniform(0.6, 1, 3), rng.uniform(0.2, 0.4), 72))
        name = f"blob {index}"
    return Thing(name, "asymmetric", shapes.grounded(shapes.placed(body, scale=0.65)))


def _twist(points: Array, turn: float, bend: float) -> Array:
    """[V, 3] turned about Y in proportion to their height, and bent aside."""
    angle = turn * points[:, 1]
    x = points[:, 0] * np.cos(angle) - points[:, 2] * np.sin(angle) + bend * points[:, 1] ** 2
    return np.stack([x, points[:, 1], points[:, 0] * np.sin(angle) + points[:, 2] * np.cos(angle)], -1)


class GlassScene:
    """One object, seen by a camera: maps that a photo would give, and pictures under any light.

    `background` is 'room', a floor and a wall, or 'envmap': nothing but the light, as in the paper.
    """

    def __init__(self, thing: Thing, size: int, seed: int = 0, background: str = "room"):
        from materialist.render.variant import setup

        self._mi = setup()
        rng = np.random.default_rng([seed, 9, *thing.name.encode()])
        self.thing, self.background = thing, background
        view = _view(thing.solid, rng)
        self.to_scene = view.to_scene
        self.camera = Camera(size, size, view.fov)
        turned = shapes.placed(thing.solid, turn=rng.uniform(-0.5, 0.5))
        turned = replace(turned, vertices=turned.vertices + np.array([0, LIFT, 0]))
        item = scenes.Item(turned, np.full((2, 2, 3), 0.5, np.float32), 1.0, 0.0)
        self.item = scenes.in_camera(item, view)
        self.room = [scenes.in_camera(i, view) for i in _room(rng)] if background == "room" else []

    @cached_property
    def front(self) -> Front:
        """The object alone."""
        return seen(self.item.solid, self.camera)

    @cached_property
    def behind(self) -> Front:
        """The room alone."""
        if not self.room:
            size = (self.camera.height, self.camera.width)
            normal = np.broadcast_to(np.array([0, 0, 1], np.float32), (*size, 3))
            return Front(np.zeros(size, np.float32), normal, np.zeros(size, np.float32), -normal)
        return seen(shapes.joined([i.solid for i in self.room]), self.camera)

    @cached_property
    def mask(self) -> Array:
        """[H, W] bool: where the object is."""
        return self.front.depth > 0

    @cached_property
    def albedo(self) -> Array:
        """[H, W, 3] linear: of what the camera sees first, the object grey."""
        mi = self._mi
        description: dict[str, Any] = {
            f"room{k}": _mesh(mi, i.solid, _paint(mi, i.albedo)) for k, i in enumerate(self.room)
        }
        description["object"] = _mesh(mi, self.item.solid, _paint(mi, self.item.albedo))
        seen = {"type": "aov", "aovs": "albedo:albedo"}
        return path_traced(mi, {"type": "scene", **description}, self.camera, spp=64, seed=0, integrator=seen)

    def render(self, envmap: Array, what: str, *, ior: float = 1.5, spp: int = 64, seed: int = 0) -> Array:
        """[H, W, 3] float32 linear: 'diffuse' (the object grey, albedo 0.5), 'glass', or 'room' (without it).

        Of 'glass' only the rectangle around the object is rendered, the rest is 0.
        """
        mi = self._mi
        description: dict[str, Any] = {"type": "scene", **_light(mi, envmap)}
        description |= {f"room{k}": _mesh(mi, i.solid, _paint(mi, i.albedo)) for k, i in enumerate(self.room)}
        if what == "diffuse":
            description["object"] = _mesh(mi, self.item.solid, _paint(mi, self.item.albedo))
        elif what == "glass":
            description["object"] = _mesh(mi, self.item.solid, {"type": "dielectric", "int_ior": ior, "ext_ior": 1.0})
        if what != "glass":
            return path_traced(mi, description, self.camera, depth=DEPTH["diffuse"], spp=spp, seed=seed)
        return path_traced(mi, description, self.camera, depth=DEPTH["glass"], spp=spp, seed=seed, around=self.mask)


def seen(solid: Solid, camera: Camera) -> Front:
    """What the camera sees of a mesh in its frame."""
    from materialist.procedural.thickness.ray_paths import ShapeTracer, towards

    rays = pixel_rays(camera)
    shape = rays.shape[:2]
    # Off the centres of pixels by a little: rays through the edges of meshes may slip between faces.
    direction = rays.reshape(-1, 3).astype(np.float64) + np.array([3e-5, 2e-5, 0])
    found = ShapeTracer(solid).trace(np.zeros_like(direction), direction)
    hit = np.isfinite(found.first)
    normal = towards(np.where(hit[:, None], found.normal, [0, 0, 1]), direction, -1)
    back = towards(np.where(hit[:, None], found.exit_normal, [0, 0, -1]), direction, 1)
    thickness = found.solid * np.linalg.norm(direction, axis=-1)
    depth = np.where(hit, found.first, 0)
    return Front(
        depth.reshape(shape).astype(np.float32), normal.reshape(*shape, 3).astype(np.float32),
        thickness.reshape(shape).astype(np.float32), back.reshape(*shape, 3).astype(np.float32),
    )  # fmt: skip


def environment(index: int, scene: GlassScene, *, data: Path | None, seed: int = 0) -> Array:
    """[h, 2h, 3] light of that number in the frame of the scene's camera, its peaks clipped; h is ENVMAP_ROWS."""
    import cv2

    full = lights.envmap(lights.environment(index, seed=seed, data=data), scene.to_scene)
    rows = ENVMAP_ROWS[scene.background]
    small = full if rows == len(full) else cv2.resize(full, (2 * rows, rows), interpolation=cv2.INTER_AREA)
    return np.minimum(small, BRIGHTEST * luminance(small).mean()).astype(np.float32)


def exposure(background: Array) -> float:
    """The factor that exposes a picture of the room as a camera would."""
    return EXPOSED / max(float(np.percentile(luminance(background), 98)), 1e-6)


def path_traced(
    mi,
    description: dict[str, Any],
    camera: Camera,
    *,
    depth: int = 0,
    spp: int,
    seed: int,
    around: Array | None = None,
    integrator: dict[str, Any] | None = None,
) -> Array:
    """[H, W, 3] float32 linear picture of a Mitsuba scene without a sensor, or of the rectangle around a mask of it.

    By paths of `depth` at most, or by another `integrator`.
    """
    from materialist.procedural.synthetic import _sensor

    sensor, window = _sensor(camera), np.s_[:, :]
    if around is not None:
        rows, columns = np.flatnonzero(around.any(1)), np.flatnonzero(around.any(0))
        window = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        sensor["film"] |= {
            "crop_offset_x": int(columns[0]), "crop_offset_y": int(rows[0]),
            "crop_width": int(columns[-1] - columns[0] + 1), "crop_height": int(rows[-1] - rows[0] + 1),
        }  # fmt: skip
    scene = mi.load_dict({**description, "sensor": sensor})
    how = mi.load_dict(integrator or {"type": "path", "max_depth": depth, "rr_depth": 64})
    side = int(np.ceil(np.sqrt(spp)))  # whole squares suit the stratified sampler
    picture = np.array(mi.render(scene, integrator=how, spp=side * side, seed=seed & 0x7FFFFFFF))[..., :3]
    whole = np.zeros((camera.height, camera.width, 3), np.float32)
    whole[window] = np.nan_to_num(picture)
    return whole


def _room(rng: np.random.Generator) -> list[scenes.Item]:
    """A floor and a wall 0.6 to 1 behind the object, both patterned."""
    x, y, z = np.eye(3)
    back = rng.uniform(0.6, 1.0)
    floor = shapes.panel(np.array([-3.0, 0, 3]), 6 * x, -(3 + back) * z, (9, 6))
    wall = shapes.panel(np.array([-3.0, 0, -back]), 6 * x, 3 * y, (7, 3.5))
    kinds = ("checker", "noise", "stripes", "wood", "spots")
    chosen = rng.choice(kinds, 2)
    return [scenes.Item(p, patterns.pattern(rng, str(k)), 1.0, 0.0) for p, k in zip((floor, wall), chosen, strict=True)]


def _view(solid: Solid, rng: np.random.Generator) -> Viewpoint:
    """A camera that looks down 8 to 25 degrees at the object, which takes about half of the picture."""
    fov, tilt, azimuth = rng.uniform(30, 45), np.radians(rng.uniform(8, 25)), rng.uniform(-0.25, 0.25)
    height = float(solid.vertices[:, 1].max())
    reach = max(height, float(np.abs(solid.vertices[:, [0, 2]]).max()) * 1.6)
    distance = reach / np.tan(np.radians(fov) / 2)
    back = np.array([np.cos(tilt) * np.sin(azimuth), np.sin(tilt), np.cos(tilt) * np.cos(azimuth)])
    right = np.cross([0, 1, 0], back)
    right /= np.linalg.norm(right)
    return Viewpoint(
        np.array([0, height / 2, 0]) + distance * back, np.stack([right, np.cross(back, right), back], -1), float(fov)
    )


def _light(mi, envmap: Array) -> dict[str, Any]:
    from materialist.render.envmap import half_turn, on_mitsuba_grid

    data = np.ascontiguousarray(on_mitsuba_grid(np.asarray(envmap, np.float32), np))
    return {"light": {"type": "envmap", "bitmap": mi.Bitmap(data[:, :-1]), "to_world": half_turn(mi)}}


def _paint(mi, albedo: Array) -> dict[str, Any]:
    bitmap = mi.Bitmap(np.ascontiguousarray(albedo, np.float32))
    return {"type": "diffuse", "reflectance": {"type": "bitmap", "bitmap": bitmap, "raw": True}}


def _mesh(mi, solid: Any, bsdf: dict[str, Any], emitter: dict[str, Any] | None = None) -> Any:
    """A Mitsuba mesh of anything with vertices, faces, normals and uv."""
    from materialist.buffers import floats, integers

    props = mi.Properties()
    props["bsdf"] = mi.load_dict(bsdf)
    if emitter is not None:
        props["emitter"] = mi.load_dict(emitter)
    mesh = mi.Mesh(
        "mesh", len(solid.vertices), len(solid.faces), props=props, has_vertex_normals=True, has_vertex_texcoords=True
    )
    params = mi.traverse(mesh)
    params["vertex_positions"], params["vertex_normals"] = floats(mi, solid.vertices), floats(mi, solid.normals)
    params["vertex_texcoords"], params["faces"] = floats(mi, solid.uv), integers(mi, solid.faces)
    params.update()
    return mesh
