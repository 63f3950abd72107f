"""Thickness by symmetry: the back of an object is its front, mirrored at the plane through the silhouette.

The paper: "We assumed the edited object was symmetrical along its front-to-back axis" (Material Transparency Editing).
Seen from a camera, the silhouette of an ellipsoid is plane, and on every ray the front and the back are harmonic
conjugates about that plane and the camera: 1/front + 1/back = 2/plane. So the mirror is exact for ellipsoids in any
position and perspective, and needs no guess of how deep the object is.
"""

from dataclasses import dataclass

import numpy as np

from materialist.camera import pixel_rays
from materialist.geometry.silhouette import border_distance, object_size, spacing, surface_in
from materialist.types import Array, Camera


@dataclass(frozen=True)
class SymmetrySettings:
    """Where the plane of the silhouette is, and how thick a mirrored body may be; RefractionNet is trained on these."""

    ring_pixels: float = 3.0  # width of the ring at the silhouette that gives its plane, at least
    ring_share: float = 0.06  # the same as a part of the object's size
    min_cosine: float = 0.06  # smallest n.v that is believed: maps are not exact at a silhouette
    grazing_power: float = 4.0  # weight (1 - n.v)^power: pixels count where the surface turns away
    min_thickness: float = 0.25  # of that of a body as deep as wide: a box seen face on is not flat
    max_thickness: float = 2.0  # in object sizes


SETTINGS = SymmetrySettings()


def symmetric_thickness(depth: Array, normal: Array, mask: Array, camera: Camera) -> Array:
    """[H, W] float32 length of each camera ray between the front and the mirrored back, scene units; 0 outside.

    depth: [H, W] planar, scene units, 0 = none. normal: [H, W, 3] unit. mask: [H, W] bool or weights: the object.
    Raises InputError for maps of different sizes, or a mask without any surface.
    """
    inside = surface_in(mask, depth, camera)
    return mirrored_thickness(depth, normal, inside, pixel_rays(camera))


def mirrored_thickness(depth: Array, normal: Array, inside: Array, rays: Array) -> Array:
    """`symmetric_thickness` on any window of a picture.

    depth: [H, W] planar, scene units. normal: [H, W, 3] unit. inside: [H, W] bool, where both are known.
    rays: [H, W, 3] camera rays through the pixels at z = -1, evenly spaced.
    """
    # --- The back: the front, mirrored at the plane of the silhouette ---
    length = np.linalg.norm(rays, axis=-1)  # [H, W] of the ray per unit of planar depth
    border = border_distance(inside)
    front = np.where(inside, depth, 1.0).astype(np.float64)
    plane = _silhouette_plane(front, normal, rays, border, inside)
    # 1/front + 1/back = 2/plane, kept away from where the back runs to infinity.
    back = 1 / np.maximum(2 * plane - 1 / front, 0.2 / front)
    # --- Bounds: a share of a round body's chord, and a multiple of the object's size ---
    width = border * front * spacing(rays)  # [H, W] scene units to the silhouette
    widest = width[inside].max()
    # Chord of a circle with radius `widest` at distance `width` from its edge: a body with a round section.
    inflated = 2 * np.sqrt(np.maximum(width * (2 * widest - width), 0))
    limit = SETTINGS.max_thickness * object_size(inside, depth, rays)
    thickness = np.clip(
        (back - front) * length, np.minimum(SETTINGS.min_thickness * inflated, limit), limit
    )
    return np.where(inside, thickness, 0).astype(np.float32)


def _silhouette_plane(
    front: Array, normal: Array, rays: Array, border: Array, inside: Array
) -> Array:
    """[H, W] inverse planar depth of the plane through the silhouette: linear over the picture, as for every plane."""
    # --- A ring just inside the silhouette tells where its plane is ---
    widest = max(SETTINGS.ring_pixels, SETTINGS.ring_share * np.sqrt(inside.sum()))
    # The outermost pixels are known too badly: where in them the silhouette runs is open.
    ring = inside & (border <= widest) & (border > 0.6)
    if not ring.any():
        ring = inside
    # --- The plane through the ring, moved back to the silhouette itself ---
    length = np.linalg.norm(rays, axis=-1)[ring]
    cosine = np.clip(-np.sum(normal[ring] * rays[ring], -1) / length, SETTINGS.min_cosine, 1)
    # The surface just inside lies before the silhouette. With a round section of radius r, a point at distance e from
    # the border has e = r (1 - sin) and lies r cos before it. The picture's plane is not across a slanting ray.
    gap = border[ring] * front[ring] * spacing(rays) / length
    before = gap * cosine / (1 - np.sqrt(1 - cosine**2))
    weight = (1 - cosine) ** SETTINGS.grazing_power + 1e-4
    a, b, c = robust_plane(rays[ring][:, 0], rays[ring][:, 1], 1 / (front[ring] + before), weight)
    return a + b * rays[..., 0] + c * rays[..., 1]


def robust_plane(x: Array, y: Array, values: Array, weight: Array) -> tuple[float, float, float]:
    """Coefficients (a, b, c) of values [n] ~ a + b x + c y by weighted least absolute deviations."""
    centre = np.array([np.average(x, weights=weight), np.average(y, weights=weight)])
    basis = np.stack([np.ones_like(x), x - centre[0], y - centre[1]], -1)
    spread = max(float(np.std(x) + np.std(y)), 1e-9)
    typical = float(np.average(values, weights=weight))
    w = weight / weight.sum()
    solution = np.zeros(3)
    for _ in range(12):
        # A faint pull to a plane that faces the camera, for a silhouette that shows on one side only.
        pull = np.diag([0, 1, 1]) * (1e-3 * spread**2)
        # Iteratively reweighted least squares: weights 1/|residual| give least absolute deviations.
        solution = np.linalg.solve(
            basis.T @ (basis * w[:, None]) + pull * w.sum(), basis.T @ (values * w)
        )
        w = weight / np.maximum(np.abs(values - basis @ solution), 1e-3 * typical)
        w /= w.sum()
    return float(solution[0] - solution[1:] @ centre), float(solution[1]), float(solution[2])
