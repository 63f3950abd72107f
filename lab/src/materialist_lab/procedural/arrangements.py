"""Random arrangements of objects on a floor, and cameras that look at them."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from materialist.types import Array
from materialist_lab.procedural import patterns
from materialist_lab.procedural.objects import shapes
from materialist_lab.procedural.objects.shapes import Solid
from materialist_lab.procedural.options import captures
from materialist_lab.procedural.world import Viewpoint, orbit


@dataclass(frozen=True)
class Item:
    """One object of a scene: its shape and its material."""

    solid: Solid
    albedo: Array
    """[h, w, 3] float32 linear picture, repeated over the texture coordinates."""
    roughness: float
    metallic: float
    ior: float | None = None
    """Index of refraction of clear glass, of which the rest of the material does not count; None: opaque."""


def arrangement(
    scene_index: int, *, seed: int, data: Path | None, unseen: bool = False
) -> list[Item]:
    """The floor (with none, one or two walls) and 3 to 7 objects standing on it; the same numbers, the same scene.

    unseen: natural colours, and of the meshes only those that no training set may use.
    """
    rng = np.random.default_rng([seed, 1, scene_index])
    meshes = captures(data / "meshes", "**/*.ply", unseen or None) if data else []
    items = _room(rng, walls=scene_index % 3, natural=unseen)
    taken: list[tuple[float, float, float]] = []
    for _ in range(int(rng.integers(3, 8))):
        solid = _object(rng, meshes)
        turned = shapes.placed(solid, scale=rng.uniform(0.75, 1.25), turn=rng.uniform(0, 2 * np.pi))
        radius = float(np.hypot(turned.vertices[:, 0], turned.vertices[:, 2]).max())
        # Where there is no room, the object is left out.
        at = _free_place(rng, radius, taken)
        if at is not None:
            taken.append((*at, radius))
            items.append(_painted(rng, shapes.placed(turned, at=at), natural=unseen))
    return items


def view(scene_index: int, view_index: int, *, seed: int) -> Viewpoint:
    """A camera that looks down 10 to 35 degrees onto the objects, with a field of view of 35 to 60 degrees.

    It stays on the side of the scene that has no wall.
    """
    rng = np.random.default_rng([seed, 2, scene_index, view_index])
    fov = rng.uniform(35, 60)
    tilt = np.radians(rng.uniform(10, 35))
    # By the number of walls: from anywhere, before one wall, before a corner.
    azimuth = np.radians(
        {0: rng.uniform(-180, 180), 1: rng.uniform(-55, 55), 2: rng.uniform(5, 60)}[scene_index % 3]
    )
    # So far that about two metres fit into the picture.
    distance = 0.95 / np.tan(np.radians(fov) / 2) + 0.3
    target = np.array([rng.uniform(-0.1, 0.1), rng.uniform(0.2, 0.35), rng.uniform(-0.1, 0.1)])
    return orbit(target, distance, azimuth, tilt, fov)


def in_camera(item: Item, camera: Viewpoint) -> Item:
    """The item with its shape in the frame of the camera."""
    solid = item.solid
    vertices = (solid.vertices - camera.position) @ camera.to_scene
    return replace(
        item, solid=replace(solid, vertices=vertices, normals=solid.normals @ camera.to_scene)
    )


def _room(rng: np.random.Generator, walls: int, natural: bool) -> list[Item]:
    """Floor, back wall and left wall, as many as wanted; a floor alone is a table top under the open sky."""
    half = rng.uniform(1.5, 2.0) if walls == 0 else 4.0
    edge = 2 * half
    x, y, z = np.eye(3)
    floor = shapes.panel(np.array([-half, 0, half]), edge * x, -edge * z, (edge, edge))
    panels = [
        _painted(rng, floor, kinds=("wood", "checker", "noise", "plain"), metals=0, natural=natural)
    ]
    back = rng.uniform(1.3, 1.7)
    height = rng.uniform(1.0, 1.6)
    # The back wall, then the left one.
    if walls >= 1:
        wall = shapes.panel(
            np.array([-half, 0, -back]), edge * x, height * y, (edge / 2, height / 2)
        )
        panels.append(
            _painted(rng, wall, kinds=("plain", "noise", "stripes"), metals=0, natural=natural)
        )
    if walls >= 2:
        wall = shapes.panel(
            np.array([-back, 0, half]), -edge * z, height * y, (edge / 2, height / 2)
        )
        panels.append(_painted(rng, wall, kinds=("plain", "noise"), metals=0, natural=natural))
    return panels


def _object(rng: np.random.Generator, meshes: list[Path]) -> Solid:
    """One solid of about 0.3 to 0.8 metres: a mesh from the folder, if there are any, in 60 % of the cases."""
    if meshes and rng.random() < 0.6:
        return shapes.placed(
            shapes.load(meshes[rng.integers(len(meshes))]), scale=rng.uniform(0.5, 0.75)
        )
    # Box, ball, superquadric, capsule, vase, bowl: each as likely.
    size = rng.uniform(0.25, 0.55, 3)
    kind = rng.integers(6)
    if kind == 0:
        return shapes.box(size)
    if kind == 1:
        return shapes.superquadric(np.full(3, rng.uniform(0.35, 0.6)), 1, 1)
    if kind == 2:
        return shapes.superquadric(size, rng.uniform(0.25, 0.8), rng.uniform(0.25, 1))
    if kind == 3:
        return shapes.capsule(rng.uniform(0.1, 0.18), rng.uniform(0.15, 0.4))
    if kind == 4:
        radius = rng.uniform(0.12, 0.2)
        height = rng.uniform(0.4, 0.75)
        neck = rng.uniform(0.4, 0.7)
        # (radius, height) of a belly and a neck.
        control = np.array(
            [(0.6, 0), (1, 0.3), (rng.uniform(0.8, 1.0), 0.5), (neck, 0.8), (neck * 1.2, 1)]
        )
        return shapes.vessel(control * [radius, height], thickness=0.02)
    radius = rng.uniform(0.13, 0.22)
    control = np.array([(0.7, 0), (0.9, 0.2), (1, 0.6), (1.02, 1)]) * [
        radius,
        rng.uniform(1.2, 2.2) * radius,
    ]
    return shapes.vessel(control, thickness=0.025)


def _painted(
    rng: np.random.Generator,
    solid: Solid,
    kinds: tuple[str, ...] = patterns.KINDS,
    metals: float = 0.2,
    natural: bool = False,
) -> Item:
    """The solid with a random material: a share `metals` of them is metal, the others dielectric."""
    # Metals have one colour and are never rough.
    metal = rng.random() < metals
    kind = "plain" if metal else str(rng.choice(kinds))
    roughness = rng.uniform(0.2, 0.5) if metal else rng.uniform(0.25, 0.9)
    return Item(
        solid,
        patterns.pattern(rng, kind, metal=metal, natural=natural),
        float(roughness),
        float(metal),
    )


def _free_place(
    rng: np.random.Generator, radius: float, taken: list[tuple[float, float, float]]
) -> tuple[float, float] | None:
    """A place (x, z) where a disc of that radius touches no other (x, z, radius); None when none was found."""
    for _ in range(60):
        # Uniform over a disc: the radius goes with the square root.
        angle = rng.uniform(0, 2 * np.pi)
        distance = 0.85 * np.sqrt(rng.random())
        x = distance * np.cos(angle)
        z = distance * np.sin(angle)
        if all(np.hypot(x - a, z - b) > radius + r + 0.02 for a, b, r in taken):
            return float(x), float(z)
    return None
