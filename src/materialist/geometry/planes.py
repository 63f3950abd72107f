"""Dominant planes of a scene: floors, walls, table tops."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from materialist.camera import pixel_rays
from materialist.geometry.boundary import check_maps
from materialist.types import Array, Camera

SAMPLES = 12_000
"""Points that take part in the search; the labels are then made for every pixel."""
HYPOTHESES = 400
TOLERANCE = 0.025
"""Relative depth error of a pixel that still lies on a plane. Depth from a network bends planes by about this much."""
BENT = 0.08
"""Relative depth error up to which a plane may grow from there, as long as it stays connected and its normals agree:
a table top that the network has bent stays one plane instead of three."""
STEP = 0.01
"""Change of that error between neighbours that ends the growth: the rim of a book, not the bend of a table."""
SMALL_PICTURE = 150
"""Pixels along the longer side below which the bend itself makes larger steps, and `STEP` grows in proportion."""
SAME_NORMAL = np.cos(np.radians(25.0))
"""Predicted normals of a plane's pixels agree with their own mean within this angle."""
FLAT = np.cos(np.radians(10.0))
"""Half of them even within this angle; on a patch of a ball or a jug they spread evenly up to the bound above."""
LIKE_GEOMETRY = np.cos(np.radians(55.0))
"""Their mean agrees with the plane through the points within this angle. Loose: a depth network's relief is not metric,
so that a plane's slope in depth can be far off while its predicted normals are right."""
LEAST_SHARE = 0.05
"""A dominant plane holds at least this share of the pixels with a surface."""
SPECK_SHARE = 0.004
"""Connected patches below this share of the picture are chance agreement, not part of the plane."""


@dataclass(frozen=True)
class Plane:
    """The plane normal . p = offset, and the pixels that lie on it."""

    normal: Array
    """[3] float64 unit, camera frame, facing the camera."""
    offset: float
    """Scene units, < 0; its magnitude is the distance of the camera from the plane."""
    mask: Array
    """[H, W] bool: pixels whose surface lies on the plane."""

    def inverse_depth(self, rays: Array) -> Array:
        """Inverse planar depth [...] (1 / scene unit) where rays [..., 3] with z = -1 meet the plane; <= 0: never."""
        return rays @ (self.normal / self.offset)


def find_planes(depth: Array, normal: Array, camera: Camera, *, seed: int = 0, max_planes: int = 4) -> list[Plane]:
    """Find the dominant planes, largest first, by RANSAC on inverse depth (linear in screen space on a plane).

    depth: [H, W] planar scene units, 0 = none. normal: [H, W, 3] unit, camera frame.
    A plane's pixels agree with it in depth (`TOLERANCE`, growing to `BENT`), and in predicted normal with each other;
    it is reported if they are at least `LEAST_SHARE` of the pixels with a surface. Raises InputError for unusable maps.
    """
    depth, normal = check_maps(depth, normal, camera)
    rays = pixel_rays(camera).astype(np.float64)  # [H, W, 3], z = -1
    stride = max(1, int(np.sqrt(depth.size / SAMPLES)))
    thin = np.s_[stride // 2 :: stride, stride // 2 :: stride]
    small = _Maps(rays[thin], normal[thin].astype(np.float64), depth[thin])
    rng = np.random.default_rng(seed)
    found: list[_Fit] = []
    free = small.depth > 0  # [h, w]
    least = LEAST_SHARE * free.sum()
    for _ in range(2 * max_planes):  # some of the candidates are unsound and only use up their pixels
        if len(found) == max_planes or free.sum() < max(3.0, least):
            break
        fit = _best_fit(small, free, rng)
        if fit is None:
            break
        fit, grown = _grow(small, free, fit)
        if grown.sum() < least:
            break
        flat = np.median(small.normal[grown] @ fit.facing) > FLAT
        if flat and _unit(-fit.coefficients) @ fit.facing > LIKE_GEOMETRY:
            found.append(fit)
        free &= ~grown
    return _label(_Maps(rays, normal.astype(np.float64), depth), found)


@dataclass(frozen=True)
class _Maps:
    """What the search looks at, at full or reduced resolution."""

    rays: Array
    """[H, W, 3], z = -1."""
    normal: Array
    """[H, W, 3] predicted, unit."""
    depth: Array
    """[H, W] scene units, 0 = none."""

    def error(self, fit: _Fit) -> Array:
        """[H, W] signed relative depth error against the plane."""
        return self.depth * (self.rays @ fit.coefficients) - 1

    def alike(self, fit: _Fit) -> Array:
        """[H, W] bool: has a surface whose predicted normal is like the plane's."""
        return (self.depth > 0) & (self.normal @ fit.facing > SAME_NORMAL)


@dataclass(frozen=True)
class _Fit:
    """A candidate plane."""

    coefficients: Array
    """[3] c in: inverse depth = rays . c."""
    facing: Array
    """[3] mean predicted normal, unit."""


def _best_fit(maps: _Maps, free: Array, rng: np.random.Generator) -> _Fit | None:
    """The plane that most of the free pixels [H, W] agree with, or None if there is no such thing."""
    rays, facing, depth = maps.rays[free], maps.normal[free], maps.depth[free]  # [N, 3], [N, 3], [N]
    count = len(depth)
    best, best_score = None, 2
    for _ in range(HYPOTHESES):
        seed = facing[rng.integers(count)]
        draw = rng.integers(count, size=12)
        trio = draw[facing[draw] @ seed > SAME_NORMAL][:3]
        if len(trio) < 3 or abs(np.linalg.det(rays[trio])) < 1e-6:
            continue
        coefficients = np.linalg.solve(rays[trio], 1 / depth[trio])
        close = np.abs(depth * (rays @ coefficients) - 1) < TOLERANCE
        score = int(np.count_nonzero(close & (facing @ seed > SAME_NORMAL)))
        if score > best_score:
            best, best_score = _Fit(coefficients, seed), score
    for _ in range(5):
        if best is None:
            return None
        best = _refit(maps, free & maps.alike(best) & (np.abs(maps.error(best)) < TOLERANCE))
    return best


def _refit(maps: _Maps, inside: Array) -> _Fit | None:
    """Least squares over the pixels inside [H, W]; weighted by depth, so that the relative error counts."""
    if inside.sum() < 3:
        return None
    scaled = maps.rays[inside] * maps.depth[inside, None]
    coefficients = np.linalg.lstsq(scaled, np.ones(len(scaled)), rcond=None)[0]
    return _Fit(coefficients, _unit(maps.normal[inside].mean(0)))


def _grow(maps: _Maps, free: Array, fit: _Fit) -> tuple[_Fit, Array]:
    """Grow a plane over its bent parts; the refitted plane and its pixels [H, W]."""
    grown = _region(maps, free, fit)
    refit = _refit(maps, grown)
    if refit is None:
        return fit, grown
    again = _region(maps, free, refit)
    return (refit, again) if again.sum() >= grown.sum() else (fit, grown)


def _region(maps: _Maps, free: Array, fit: _Fit) -> Array:
    """[H, W] bool: free pixels within `TOLERANCE`, and what is smoothly connected to them within `BENT`."""
    error = maps.error(fit)
    alike = free & maps.alike(fit)
    core = alike & (np.abs(error) < TOLERANCE)
    wide = alike & (np.abs(error) < BENT)
    step = STEP * max(1.0, SMALL_PICTURE / max(error.shape))
    jump_x, jump_y = np.abs(np.diff(error, axis=1)) > step, np.abs(np.diff(error, axis=0)) > step
    calm = wide.copy()
    calm[:, 1:] &= ~jump_x
    calm[1:] &= ~jump_y
    patches, count = ndimage.label(calm)
    has_core = np.bincount(patches[core & calm], minlength=count + 1) > 0
    has_core[0] = False
    return core | has_core[patches]


def _label(maps: _Maps, found: list[_Fit]) -> list[Plane]:
    """Give every pixel to the closest plane that reaches it, drop specks and planes that shrank too far."""
    surface = maps.depth > 0
    nearest = np.full(surface.shape, np.inf)  # [H, W] relative depth error of the closest plane
    label = np.full(surface.shape, -1)
    for k, fit in enumerate(found):
        error = np.where(_region(maps, surface, fit), np.abs(maps.error(fit)), np.inf)
        label = np.where(error < nearest, k, label)
        nearest = np.minimum(nearest, error)
    planes = []
    for k, fit in enumerate(found):
        mask = _without_specks(label == k)
        if mask.sum() < LEAST_SHARE * surface.sum():
            continue
        size = float(np.linalg.norm(fit.coefficients))
        planes.append(Plane(-fit.coefficients / size, -1 / size, mask))
    return sorted(planes, key=lambda plane: -int(plane.mask.sum()))


def _without_specks(mask: Array) -> Array:
    """[H, W] bool without connected patches smaller than `SPECK_SHARE` of the picture."""
    patches, count = ndimage.label(mask)
    sizes = np.bincount(patches.ravel(), minlength=count + 1)
    keep = sizes >= SPECK_SHARE * mask.size
    keep[0] = False
    return keep[patches]


def _unit(vector: Array) -> Array:
    """[3] scaled to length 1; a zero vector stays."""
    return vector / max(float(np.linalg.norm(vector)), 1e-12)
