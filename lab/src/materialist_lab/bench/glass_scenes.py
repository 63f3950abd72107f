"""Objects in front of a textured floor and wall, as a photo shows them opaque and as they truly look as glass."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice, zip_longest
from pathlib import Path

import cv2
import numpy as np
import trimesh

from materialist.camera import pixel_rays
from materialist.color import luminance
from materialist.errors import InputError
from materialist.types import Array, Camera
from materialist_lab.bench.edits import LIFT, staged
from materialist_lab.procedural import lights, patterns
from materialist_lab.procedural.arrangements import Item, in_camera
from materialist_lab.procedural.objects import shapes
from materialist_lab.procedural.objects.glassware import KINDS, jug, make_shape
from materialist_lab.procedural.objects.shapes import Solid
from materialist_lab.procedural.synthetic import SyntheticSample, TrueScene, photographed
from materialist_lab.procedural.thickness.dataset import CameraPose, look
from materialist_lab.procedural.thickness.ray_paths import ShapeTracer
from materialist_lab.procedural.world import Viewpoint, orbit

GROUPS = ("symmetric", "asymmetric")
"""Whether an object's back is its front mirrored, as the paper sorts its objects."""
VESSELS = ("bowl", "coffeemug", "teapot_newell", "wineglass")
"""Meshes of the data folder that are walls around air; the protocol is about solid objects."""
SOLIDS = {"symmetric": (0, 2, 12), "asymmetric": (5, 7, 3, 15)}
"""Kinds of shapes in `glassware` that are solid: turned bodies, superellipsoids; lumps, twists, creatures."""
ENVMAP_ROWS = {"room": 64, "envmap": 256}
"""Light in a room is brought to few rows: small suns make caustics that no affordable picture shows cleanly."""


@dataclass(frozen=True)
class GlassProtocol:
    """How the pictures of `bench glass` are made."""

    brightest: float = 60.0  # largest radiance of the light, in means
    exposed: float = 0.8  # luminance of the brightest fiftieth of the background
    albedo_spp: int = 256  # paths a pixel from which the light on the background is read, denoised
    brightest_albedo: float = 0.95  # largest albedo of the background
    noise: float = 0.5  # largest relative error of the thickness (paper, eq. ablation_d)


PROTOCOL = GlassProtocol()


@dataclass(frozen=True)
class GlassObject:
    """An object of the benchmark, standing on y = 0, its longest side about 0.7."""

    name: str
    group: str
    solid: Solid


@dataclass(frozen=True)
class SeenSide:
    """What is seen of a mesh from a camera."""

    depth: Array
    """[H, W] planar, 0 where there is nothing."""
    normal: Array
    """[H, W, 3] unit, camera frame, towards the viewer."""
    thickness: Array
    """[H, W] from the first to the last surface along the ray."""
    back: Array
    """[H, W, 3] unit normal of that last surface, away from the viewer."""


def jugs(count: int, seed: int = 0) -> list[GlassObject]:
    """Solid jugs with a handle at one side."""
    solids = [jug(np.random.default_rng([seed, 11, k])) for k in range(count)]
    return [
        GlassObject(f"jug {k}", "symmetric", shapes.grounded(shapes.placed(solid, scale=0.7)))
        for k, solid in enumerate(solids)
    ]


def things(data: Path | None, count: int, seed: int = 0) -> list[GlassObject]:
    """The first `count` symmetric and `count` asymmetric objects: procedural, or watertight meshes of DATA/meshes."""
    if data is None:
        return [_revolved(group, k, seed) for k in range(count) for group in GROUPS]
    groups: list[list[GlassObject]] = []
    for group in GROUPS:
        files = sorted((data / "meshes" / group).glob("*.ply"))
        files = [f for f in files if f.stem not in VESSELS]
        order = np.random.default_rng([seed, 6]).permutation(len(files))
        loaded = (
            GlassObject(files[k].stem, group, shapes.placed(shapes.load(files[k]), scale=0.7))
            for k in order
        )
        closed = list(islice((thing for thing in loaded if is_closed(thing.solid)), count))
        if not closed:
            raise InputError(
                f"{data / 'meshes' / group} holds no closed .ply mesh; give another --data, or none."
            )
        groups.append(closed)
    return [thing for pair in zip_longest(*groups) for thing in pair if thing]


def _revolved(group: str, k: int, seed: int) -> GlassObject:
    """Solid number k of a group, of the shapes that RefractionNet never saw."""
    kinds = SOLIDS[group]
    index = KINDS * (k // len(kinds)) + kinds[k % len(kinds)]
    solid = shapes.placed(make_shape(index, "heldout", seed).solid, scale=0.7)
    return GlassObject(f"{group} {k}", group, shapes.grounded(solid))


def is_closed(solid: Solid) -> bool:
    """Whether every edge of the mesh has two faces that run through it in opposite directions."""
    mesh = trimesh.Trimesh(np.round(solid.vertices, 7), solid.faces)  # merges vertices
    corners = np.sort(mesh.faces, 1)
    mesh.update_faces((np.diff(corners) > 0).all(1))
    return bool(mesh.is_watertight and mesh.is_winding_consistent)


class GlassScene:
    """One object, seen by a camera; its true pictures are those of `grey`, of `room` and of `glass`.

    `background` is 'room', a floor and a wall, or 'envmap': nothing but the light, as in the paper.
    """

    def __init__(self, thing: GlassObject, size: int, seed: int = 0, background: str = "room"):
        rng = np.random.default_rng([seed, 9, *thing.name.encode()])
        self.thing = thing
        self.background = background
        view = _view(thing.solid, rng)
        turned = shapes.placed(thing.solid, turn=rng.uniform(-0.5, 0.5))
        turned = replace(turned, vertices=turned.vertices + np.array([0, LIFT, 0]))
        self.item = in_camera(Item(turned, np.full((2, 2, 3), 0.5, np.float32), 1.0, 0.0), view)
        around = [in_camera(item, view) for item in _room(rng)] if background == "room" else []
        self.room = TrueScene(around, view, size, size)
        self.grey = staged(self.room, [*around, self.item])

    def glass(self, ior: float) -> TrueScene:
        """The room with the object of glass."""
        return staged(self.room, [*self.room.items, replace(self.item, ior=ior)])

    @cached_property
    def mask(self) -> Array:
        """[H, W] bool: where the object is."""
        return self.grey.seen == len(self.room.items)

    @cached_property
    def front(self) -> SeenSide:
        """The object alone."""
        return seen(self.item.solid, self.room.camera)


def seen(solid: Solid, camera: Camera) -> SeenSide:
    """What the camera sees of a mesh in its frame."""
    # Off the centres of pixels by a little: rays through the edges of meshes may slip between faces.
    rays = pixel_rays(camera).astype(np.float64) + np.array([3e-5, 2e-5, 0])
    paths, normal, back = look(
        ShapeTracer(solid), CameraPose(np.eye(3), np.eye(3), np.zeros(3)), rays
    )
    hit = np.isfinite(paths.first).reshape(rays.shape[:2])
    thickness = paths.solid.reshape(hit.shape) * np.linalg.norm(rays, axis=-1)
    depth = np.where(hit, paths.first.reshape(hit.shape), 0)
    away = np.array([0, 0, -1], np.float32)
    normal, back = (
        np.where(hit[..., None], x, none) for x, none in ((normal, -away), (back, away))
    )
    return SeenSide(depth.astype(np.float32), normal, thickness.astype(np.float32), back)


def environment(index: int, scene: GlassScene, *, data: Path | None, seed: int = 0) -> Array:
    """[h, 2h, 3] light of that number in the frame of the scene's camera, its peaks clipped; h is ENVMAP_ROWS."""
    full = lights.envmap(lights.environment(index, seed=seed, data=data), scene.room.view.to_scene)
    rows = ENVMAP_ROWS[scene.background]
    small = (
        full
        if rows == len(full)
        else cv2.resize(full, (2 * rows, rows), interpolation=cv2.INTER_AREA)
    )
    return np.minimum(small, PROTOCOL.brightest * luminance(small).mean()).astype(np.float32)


def photo_and_light(
    stage: GlassScene, index: int, data: Path | None, spp: int
) -> tuple[SyntheticSample, Array]:
    """The photo of a grey object under one light, and another light [h, 2h, 3] at its exposure."""
    first, second = (environment(k, stage, data=data) for k in (index, index + 1))
    gain = room_exposure(stage.room.render(first, spp, seed=1))
    grey = stage.grey.render(first * gain, spp, seed=2)
    return photographed(stage.grey, grey, first * gain, stage.thing.name), second * gain


def room_exposure(background: Array) -> float:
    """The factor that exposes a picture of the room as a camera would."""
    return PROTOCOL.exposed / max(float(np.percentile(luminance(background), 98)), 1e-6)


def _room(rng: np.random.Generator) -> list[Item]:
    """A floor and a wall 0.6 to 1 behind the object, both patterned."""
    x, y, z = np.eye(3)
    back = rng.uniform(0.6, 1.0)
    floor = shapes.panel(np.array([-3.0, 0, 3]), 6 * x, -(3 + back) * z, (9, 6))
    wall = shapes.panel(np.array([-3.0, 0, -back]), 6 * x, 3 * y, (7, 3.5))
    kinds = ("checker", "noise", "stripes", "wood", "spots")
    chosen = rng.choice(kinds, 2)
    return [
        Item(p, patterns.pattern(rng, str(k)), 1.0, 0.0)
        for p, k in zip((floor, wall), chosen, strict=True)
    ]


def _view(solid: Solid, rng: np.random.Generator) -> Viewpoint:
    """A camera that looks down 8 to 25 degrees at the object, which takes about half of the picture."""
    fov = rng.uniform(30, 45)
    tilt = np.radians(rng.uniform(8, 25))
    azimuth = rng.uniform(-0.25, 0.25)
    height = float(solid.vertices[:, 1].max())
    reach = max(height, float(np.abs(solid.vertices[:, [0, 2]]).max()) * 1.6)
    distance = reach / np.tan(np.radians(fov) / 2)
    return orbit(np.array([0, height / 2, 0]), distance, azimuth, tilt, fov)
