"""How thick the object under a mask is: given, of a surface of revolution, inflated, by RefractionNet, or mirrored."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from materialist.camera import pixel_rays
from materialist.errors import InputError
from materialist.geometry.planes import upright
from materialist.geometry.silhouette import object_size, surface_in
from materialist.io.image import read_map
from materialist.predict.refraction.thickness import (
    Thickness,
    best_thickness,
    of_outline,
    thickness,
)
from materialist.solids.handles import without_handles
from materialist.solids.parts import objects_in
from materialist.solids.symmetry import symmetric_thickness
from materialist.types import Array, Scene

METHODS = ("auto", "outline", "network", "symmetry")
"""Names of `--thickness`."""


@dataclass(frozen=True)
class WallSettings:
    """The wall of a hollow object, as parts of its size; tuned by eye."""

    default_share: float = 0.05  # of the object's size, where nothing tells the wall
    min_share: float = 0.015  # bounds on what RefractionNet predicts
    max_share: float = 0.12


WALL = WallSettings()


@dataclass(frozen=True)
class ThickPart:
    """A part of what is turned to glass."""

    mask: Array
    """[H, W] bool."""
    thickness: Thickness
    is_handle: bool = False
    """Stands out from a surface of revolution."""


def thick_parts(
    scene: Scene, mask: Array, method: str | Array | Path = "auto", *, behind: Array | None = None
) -> list[ThickPart]:
    """The objects under a mask [H, W] bool and their thickness; a jug is a surface of revolution and its handle.

    method, behind, errors: as for `object_thickness`.
    """
    parts: list[ThickPart] = []
    for one in objects_in(mask):
        whole = object_thickness(scene, one, method, behind=behind)
        jug = None
        if isinstance(method, str) and method == "auto" and whole.revolution is None:
            jug = _jug(scene, one, behind)
        parts += jug or [ThickPart(one, whole)]
    return parts


def _jug(scene: Scene, mask: Array, behind: Array | None) -> list[ThickPart] | None:
    """An object as a surface of revolution, and its handles inflated from their outlines; None where it is none."""
    up = _up(scene, mask)
    body = None if up is None else without_handles(mask, up, scene.camera)
    if body is None:
        return None
    round_body = object_thickness(scene, body, behind=behind)
    if round_body.revolution is None:
        return None
    # What is left beside the round body are its handles and spouts.
    handles = [
        ThickPart(one, object_thickness(scene, one, "outline", behind=behind), is_handle=True)
        for one in objects_in(mask & ~body)
    ]
    return [ThickPart(body, round_body), *handles]


def object_thickness(
    scene: Scene, mask: Array, method: str | Array | Path = "auto", *, behind: Array | None = None
) -> Thickness:
    """The thickness of the object under a mask [H, W] bool (paper, Thickness Prior Prediction).

    Args:
        method: `auto` (a surface of revolution where its outline says so, else `outline`),
            `outline` (inflated from it), `network` (RefractionNet), `symmetry` (the paper's
            assumption), or a map [H, W] of scene units along the rays, or its file.
        behind: [H, W] planar depth of what stands behind the object, 0 = nothing.

    Raises InputError for an unknown method, a map of another size or with negative values, a mask without a surface;
    WeightsError where the weights of RefractionNet are missing.
    """
    inside = surface_in(mask, scene.depth, scene.camera)
    maps = (scene.photo.linear, inside, scene.normal, scene.depth, scene.camera)
    if not (isinstance(method, str) and method in METHODS):
        solid = np.where(inside, _thickness_map(method, inside), 0).astype(np.float32)
        return Thickness(solid, np.zeros_like(solid), method="given")
    if method == "symmetry":
        mirrored = symmetric_thickness(scene.depth, scene.normal, inside, scene.camera)
        return Thickness(mirrored, np.zeros_like(mirrored), method=method)
    if method == "network":
        return thickness(*maps)
    if method == "outline":
        return of_outline(thickness(*maps).hollow, inside, scene.normal, scene.depth, scene.camera)
    return best_thickness(*maps, up=_up(scene, inside), behind=behind)


def _up(scene: Scene, inside: Array) -> Array | None:
    """[3] unit: upright in the camera's frame, by the planes beside the object; None where none tells it."""
    return upright(scene.normal, np.where(inside, -1, scene.geometry.plane_label))


def wall_of(scene: Scene, mask: Array, thick: Thickness) -> float:
    """Thickness of the wall of the object under a mask [H, W] bool, were it hollow; scene units."""
    inside = surface_in(mask, scene.depth, scene.camera)
    rays = pixel_rays(scene.camera)
    size = object_size(inside, scene.depth, rays)
    facing = np.abs((scene.normal * rays).sum(-1)) / np.linalg.norm(rays, axis=-1)
    # A ray through a hollow thing crosses two walls; where it runs along one it says nothing.
    across = inside & (thick.hollow > 0) & (thick.hollow < 0.8 * thick.solid)
    # Slanting rays are longer in a wall: times the cosine; half of it, for there are two walls.
    wall = (
        float(np.median((thick.hollow * facing / 2)[across]))
        if across.any()
        else WALL.default_share * size
    )
    return float(np.clip(wall, WALL.min_share * size, WALL.max_share * size))


def _thickness_map(method: str | Array | Path, inside: Array) -> Array:
    if isinstance(method, str | Path):
        if not Path(method).is_file():
            raise InputError(
                f"The thickness is {str(method)!r}; give a file, or one of {', '.join(METHODS)}."
            )
        method = read_map(method)
    # --- One channel, at working size, in scene units >= 0 ---
    values = np.asarray(method, np.float32)
    values = values[..., 0] if values.ndim == 3 else values
    if values.shape != inside.shape:
        raise InputError(
            f"The thickness map is {values.shape}, the photo at working size {inside.shape} (rows, columns)."
        )
    if not (np.isfinite(values).all() and values.min() >= 0):
        raise InputError(
            "The thickness map has negative or infinite values; give scene units >= 0."
        )
    if not (values[inside] > 0).any():
        raise InputError(
            "The thickness is 0 all over the mask; give scene units along the camera rays."
        )
    return values
