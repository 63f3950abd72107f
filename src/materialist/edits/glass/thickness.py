"""How thick the object under a mask is: given, of a surface of revolution, by RefractionNet, or mirrored."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from materialist.camera import pixel_rays
from materialist.errors import InputError
from materialist.geometry.silhouette import object_size, surface_in
from materialist.solids.front import smooth_front
from materialist.solids.revolution import Revolution
from materialist.solids.symmetry import symmetric_thickness
from materialist.types import Array, Scene

METHODS = ("auto", "network", "symmetry", "half-turn")
"""Names of `--thickness`; `half-turn`, of older recipes, is `auto`."""
WALL = 0.05
"""Wall of a hollow object, as a part of its size, where nothing tells it."""
WALLS = (0.015, 0.12)
"""Bounds on what is told."""


@dataclass(frozen=True)
class ObjectThickness:
    """Thickness of one object along the camera rays, scene units."""

    solid: Array
    """[H, W] float32 from the first to the last point; 0 outside the mask."""
    wall: float
    """Of the object, were it hollow."""
    method: str
    """Which method it comes from: one of those of `choice.Choice`, or `given`."""
    back: Array | None = None
    """[H, W, 3] unit outward normals of the back, where RefractionNet tells them."""
    revolution: Revolution | None = None
    """The whole object, where it is a surface of revolution."""


def object_thickness(
    scene: Scene, mask: Array, method: str | Array | Path = "auto", *, behind: Array | None = None
) -> ObjectThickness:
    """The thickness of the object under a mask (paper, Thickness Prior Prediction).

    Args:
        mask: [H, W] bool at working size.
        method: `auto` (a surface of revolution where its normals or its outline say so, else RefractionNet, without
            weights symmetry), `network` (RefractionNet), `symmetry` (the paper's assumption), a map [H, W] of scene
            units along the rays, or a file with one.
        behind: [H, W] planar depth of what stands behind the object, 0 = nothing.

    Raises:
        InputError: an unknown method, a map of another size or with negative values, a mask without a surface.
        WeightsError: `network` without weights.
    """
    inside = surface_in(mask, scene.depth, scene.camera)
    size = object_size(inside, scene.depth, pixel_rays(scene.camera))
    if isinstance(method, str) and method in METHODS:
        if method == "network":
            return _by_network(scene, inside, size)
        if method != "symmetry":
            return _chosen(scene, inside, size, behind)
        return ObjectThickness(_mirrored(scene, inside), WALL * size, "symmetry")
    given = _given(method, inside.shape)
    if not (given[inside] > 0).any():
        raise InputError("The thickness is 0 all over the mask; give scene units along the camera rays.")
    return ObjectThickness(np.where(inside, given, 0).astype(np.float32), WALL * size, "given")


def _by_network(scene: Scene, inside: Array, size: float) -> ObjectThickness:
    from materialist.predict.refraction import thickness

    found = thickness(scene.photo.linear, inside, scene.normal, scene.depth, scene.camera)
    return ObjectThickness(found.solid, _wall(scene, inside, found, size), "network", found.back)


def _chosen(scene: Scene, inside: Array, size: float, behind: Array | None) -> ObjectThickness:
    from materialist.predict.refraction.choice import best_thickness
    from materialist.solids.finder import upright

    up = upright(scene.depth, scene.normal, np.where(inside, -1, scene.geometry.plane_label), scene.camera)
    choice = best_thickness(scene.photo.linear, inside, scene.normal, scene.depth, scene.camera, up=up, behind=behind)
    found = choice.thickness
    return ObjectThickness(found.solid, _wall(scene, inside, found, size), choice.method, found.back, found.revolution)


def _wall(scene: Scene, inside: Array, found, size: float) -> float:
    """Thickness of its wall, were it hollow, of a `predict.refraction.Thickness`."""
    rays = pixel_rays(scene.camera)
    facing = np.abs((scene.normal * rays).sum(-1)) / np.linalg.norm(rays, axis=-1)
    # A ray through a hollow thing crosses two walls; where it runs along one it says nothing.
    across = inside & (found.hollow > 0) & (found.hollow < 0.8 * found.solid)
    wall = float(np.median((found.hollow * facing / 2)[across])) if across.any() else WALL * size
    return float(np.clip(wall, WALLS[0] * size, WALLS[1] * size))


def _mirrored(scene: Scene, inside: Array) -> Array:
    """[H, W] by symmetry, of the front as the proxy has it: smooth, with the slopes of the normals."""
    front = smooth_front(scene.depth, scene.normal, inside, pixel_rays(scene.camera))
    return symmetric_thickness(front, scene.normal, inside, scene.camera)


def _given(method: str | Array | Path, shape: tuple[int, ...]) -> Array:
    if isinstance(method, str | Path):
        from materialist.io.image import read_map

        if not Path(method).is_file():
            raise InputError(f"The thickness is {str(method)!r}; give a file, or one of {', '.join(METHODS)}.")
        method = read_map(method)
    given = np.asarray(method, np.float32)
    given = given[..., 0] if given.ndim == 3 else given
    if given.shape != shape:
        raise InputError(f"The thickness map is {given.shape}, the photo at working size {shape} (rows, columns).")
    if not (np.isfinite(given).all() and given.min() >= 0):
        raise InputError("The thickness map has negative or infinite values; give scene units >= 0.")
    return given
