"""Meshes put into the photograph (paper, Object insertion and relighting; Shadow Effects)."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from scipy.spatial.transform import Rotation
from trimesh import Trimesh, sample

from materialist.camera import rays_through, unit, unproject
from materialist.edits.core.notes import noted, warned
from materialist.edits.core.region import checked_pixel
from materialist.edits.insert.meshes import MeshModel, read_model, repainted
from materialist.edits.insert.options import Insertion, InsertionKeywords
from materialist.errors import InputError
from materialist.option_kinds import documented
from materialist.render.bodies import is_transparent
from materialist.types import Array, Body, Scene


@dataclass(frozen=True)
class InsertSettings:
    """Size of an inserted mesh, and the plane that it stands on; tuned by eye."""

    width: float = 1 / 6  # longest side at scale 1, share of the picture's width at its depth
    min_depth: float = 0.02  # that a mesh may reach, share of the depth of its place
    samples: int = 6000  # points that stand for its surface where it falls
    min_cosine: float = 0.7  # of a neighbour's normal that counts as of the same surface
    min_pixels: int = 12  # whose median counts; with fewer the one pixel decides
    support_radius: float = 1 / 24  # share of the picture's width, where no radius is given
    glass_gap: float = 0.005  # air under glass, share of its side: else one block with the floor


SETTINGS = InsertSettings()


@dataclass(frozen=True)
class Support:
    """A tangent plane."""

    point: Array
    """[3] float64: where the pixel's ray meets it, camera frame, scene units."""
    normal: Array
    """[3] float64 unit, to the camera."""

    @property
    def depth(self) -> float:
        """Planar depth of the point, scene units."""
        return float(-self.point[2])


@documented(Insertion)
def insert(
    scene: Scene,
    mesh: str | Path | MeshModel,
    at: tuple[float, float],
    options: Insertion | None = None,
    **values: Unpack[InsertionKeywords],
) -> Scene:
    """The scene with a mesh standing on the surface under a pixel, one more body for each material of the mesh.

    What is wrong with the mesh, or its place, is added to `report.warnings`.

    Args:
        mesh: an OBJ, PLY, STL, glTF or GLB file, or what `meshes.read_model` made of one.
        at: (x, y) at working size: where the middle of its base stands. Its up axis is the surface's normal, its
            front (+Z) looks to the camera.
        options, values: see `options.Insertion`; `values` are fields of it, as in `insert(scene, mesh, at, scale=2)`.

    Raises InputError for a place outside the photo, on the sky, or so near that the mesh would reach behind the
    camera; a mesh that cannot be used; a number out of its range.
    """
    # --- The model in its material, where it is to stand ---
    options = Insertion.merged(options, **values)
    model = repainted(
        mesh if isinstance(mesh, MeshModel) else read_model(mesh, up=options.up), options.material
    )
    placed, _, longest = put(
        scene, model, at, scale=options.scale, turn=options.turn, size=options.size
    )
    facts: dict[str, Any] = {
        "mesh": model.name,
        "at": [float(v) for v in at],
        "scale": options.scale,
        "turn": options.turn,
        "material": options.material,
        "size": longest,
        "triangles": sum(len(body.faces) for body in placed),
    }
    return noted(
        warned(replace(scene, bodies=(*scene.bodies, *placed)), *model.warnings), "insert", facts
    )


def put(
    scene: Scene,
    model: MeshModel,
    at: tuple[float, float],
    *,
    scale: float = 1.0,
    turn: float = 0.0,
    size: float | None = None,
) -> tuple[tuple[Body, ...], Support, float]:
    """The model's parts as they stand in the camera frame, the plane they stand on, and their longest side.

    The side is the model's own, in scene units; see `insert`.
    """
    low = model.vertices.min(0).astype(np.float64)
    high = model.vertices.max(0).astype(np.float64)
    longest = float((high - low).max())
    # --- Size, by the depth at the place; then the plane under the whole footprint ---
    first = support_at(scene, at)
    factor = (
        scale
        * (size if size is not None else SETTINGS.width * picture_width(scene, first.depth))
        / longest
    )
    footprint = factor * float(np.hypot(high[0] - low[0], high[2] - low[2])) / 2
    support = support_at(scene, at, footprint)
    # --- Place: the middle of the base on the plane, turned about its normal ---
    base = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    turned = support_frame(support) @ Rotation.from_euler("y", turn, degrees=True).as_matrix()
    has_glass = any(is_transparent(part.surface) for part in model.parts)
    air = SETTINGS.glass_gap * factor * longest if has_glass else 0.0
    origin = support.point + air * support.normal - (turned * factor) @ base
    bodies = tuple(moved_body(part, turned * factor, origin) for part in model.parts)
    # --- A mesh behind the camera would fill the picture ---
    nearest = -max(float(body.vertices[:, 2].max()) for body in bodies)
    if nearest < SETTINGS.min_depth * support.depth:
        raise InputError(
            f"{model.name} would reach behind the camera at scale {scale:g}; choose a smaller scale, or a place "
            "further away."
        )
    return bodies, support, factor * longest


def support_at(scene: Scene, at: tuple[float, float], radius: float | None = None) -> Support:
    """The plane through the surface around a point (x, y) of the working size.

    Its normal is the median of the scene's normals over the dominant plane that the point lies on, elsewhere over the
    pixels within `radius` (scene units) whose normals are alike: predicted depth bends planes more than predicted
    normals do. Its place along the normal is the median of the surface within the radius.

    Raises InputError for a point outside the photo, or on the sky.
    """
    column, row = checked_pixel(scene, at, "place")
    depth = float(scene.depth[row, column])
    if not depth > 0:
        raise InputError(
            f"The place {at[0]:g},{at[1]:g} is sky, where nothing can stand; choose a surface."
        )
    # --- The point on the surface, and how far around it counts ---
    camera = scene.camera
    ray = rays_through(np.array(at), camera)
    point = ray * depth
    reach = radius if radius else picture_width(scene, depth) * SETTINGS.support_radius
    # --- The normal: over the plane that the point lies on, else over alike pixels nearby ---
    near = _near(scene, point, reach, row, column)
    label = scene.geometry.plane_label[row, column]
    members = (scene.geometry.plane_label == label) & (scene.depth > 0) if label >= 0 else near
    normal = scene.normal[row, column].astype(np.float64)
    if members.sum() >= SETTINGS.min_pixels:
        normal = unit(np.median(scene.normal[members].astype(np.float64), axis=0))
    # --- The place along the normal: the median of the surface nearby ---
    if near.sum() >= SETTINGS.min_pixels:
        points = unproject(scene.depth, camera)[near].astype(np.float64)
        offset = np.median(points @ normal)
        along = float(ray @ normal)
        if along < -0.05:  # a surface seen edge-on keeps the pixel's own point
            point = ray * np.clip(offset / along, 0.8 * depth, 1.25 * depth)
    return Support(point, normal)


def picture_width(scene: Scene, depth: float) -> float:
    """Width of what the picture shows at a planar depth, scene units."""
    return depth * scene.camera.width / scene.camera.focal


def _near(scene: Scene, point: Array, reach: float, row: int, column: int) -> Array:
    """[H, W] bool: pixels whose surface lies within `reach` of the point and faces about the same way."""
    points = unproject(scene.depth, scene.camera)
    close = ((points - point) ** 2).sum(-1) < reach**2
    window = np.s_[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]
    facing = unit(np.median(scene.normal[window].reshape(-1, 3), axis=0))
    return close & (scene.depth > 0) & (scene.normal @ facing > SETTINGS.min_cosine)


def support_frame(support: Support) -> Array:
    """[3, 3] rotation whose columns are right, up (the normal) and front: towards the camera along the surface.

    Where the surface faces the camera, front is down the picture instead.
    """
    up = support.normal
    towards = -unit(support.point)
    front = towards - (towards @ up) * up
    down = np.array([0.0, -1.0, 0.0])
    down = down - (down @ up) * up
    # A steep wall turns gently from one to the other.
    share = np.clip((np.linalg.norm(front) - 0.2) / 0.2, 0, 1)
    front = share * front + (1 - share) * down
    if np.linalg.norm(front) < 1e-6:
        front = np.cross([1.0, 0.0, 0.0], up)
    front = unit(front)
    return np.stack([np.cross(up, front), up, front], -1)


def moved_body(body: Body, linear: Array, shift: Array) -> Body:
    """The body under x -> linear x + shift; `linear` [3, 3] is a rotation times a factor."""
    factor = np.cbrt(np.linalg.det(linear))
    vertices = (body.vertices.astype(np.float64) @ linear.T + shift).astype(np.float32)
    normals = (body.normals.astype(np.float64) @ (linear / factor).T).astype(np.float32)
    return replace(body, vertices=vertices, normals=normals)


def surface_points(body: Body) -> Array:
    """[n, 3] points evenly over the body's surface, always the same ones."""
    mesh = Trimesh(body.vertices, body.faces, process=False)
    return np.asarray(sample.sample_surface(mesh, SETTINGS.samples, seed=0)[0])
