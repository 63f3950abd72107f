"""Dominant planes of a scene: floors, walls, table tops."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_propagation
from skimage.morphology import remove_small_objects

from materialist.camera import pixel_rays, unit
from materialist.geometry.boundary import check_maps
from materialist.types import Array, Camera


@dataclass(frozen=True)
class PlaneSettings:
    """What counts as one plane: relative depth errors, and cosines between predicted normals; tuned by eye."""

    samples: int = 12_000  # points that take part in the search; labels are made for every pixel
    hypotheses: int = 400  # planes that are tried
    tolerance: float = 0.025  # error of a pixel on a plane; networks bend planes by about this much
    # error up to which a plane grows, where connected: a bent table top stays one plane
    bent: float = 0.08
    # change of the error between neighbours that ends the growth: the rim of a book
    step: float = 0.01
    small_picture: int = 150  # pixels along the longer side below which `step` grows in proportion
    same_normal: float = np.cos(
        np.radians(25.0)
    )  # normals of a plane's pixels agree with their mean
    flat: float = np.cos(
        np.radians(10.0)
    )  # half of them even so: on a ball they spread evenly up to the bound above
    like_geometry: float = np.cos(
        np.radians(55.0)
    )  # the mean agrees with the plane: networks' relief is not metric
    most: int = 4  # planes that are reported
    least: float = 0.05  # least share of the pixels with a surface
    speck: float = 0.004  # connected patches below this share of the picture are chance agreement


SETTINGS = PlaneSettings()


@dataclass(frozen=True)
class Plane:
    """The plane normal . p = offset, and the pixels that lie on it."""

    normal: Array
    """[3] float64 unit, camera frame, facing the camera."""
    offset: float
    """Scene units, < 0; its magnitude is the distance of the camera from the plane."""
    mask: Array
    """[H, W] bool: pixels whose surface lies on the plane."""


def axes(normal: Array) -> Array:
    """[2, 3] unit: to the right and up for one who faces a plane with this normal [3]; of a ceiling, any such pair."""
    normal = np.asarray(normal, np.float64)
    across = unit(np.cross([0.0, 1, 0] if abs(normal[1]) < 0.9 else [0.0, 0, 1], normal))
    return np.stack([across, np.cross(normal, across)])


def find_planes(depth: Array, normal: Array, camera: Camera, *, seed: int = 0) -> list[Plane]:
    """Find the dominant planes, largest first, by RANSAC on inverse depth (linear in screen space on a plane).

    depth: [H, W] planar scene units, 0 = none. normal: [H, W, 3] unit, camera frame.
    A plane's pixels agree with it in depth, and in predicted normal with each other (`PlaneSettings`); it is reported
    if they are at least 5 % of the pixels with a surface. Raises InputError for unusable maps.
    """
    depth, normal = check_maps(depth, normal, camera)
    rays = pixel_rays(camera).astype(np.float64)  # [H, W, 3], z = -1
    # --- The search looks at about `samples` pixels, evenly spaced ---
    stride = max(1, int(np.sqrt(depth.size / SETTINGS.samples)))
    thin = np.s_[stride // 2 :: stride, stride // 2 :: stride]
    small = _Maps(rays[thin], normal[thin].astype(np.float64), depth[thin])
    rng = np.random.default_rng(seed)
    fits: list[_Fit] = []
    free = small.depth > 0  # [h, w]
    least = SETTINGS.least * free.sum()
    # --- The largest plane of what is left, again and again; unsound ones use up their pixels ---
    for _ in range(2 * SETTINGS.most):
        if len(fits) == SETTINGS.most or free.sum() < max(3.0, least):
            break
        fit = _best_fit(small, free, rng)
        if fit is None:
            break
        fit, grown = _grow(small, free, fit)
        if grown.sum() < least:
            break
        # Sound: its normals agree with each other, and their mean with the plane's.
        flat = np.median(small.normal[grown] @ fit.facing) > SETTINGS.flat
        if flat and unit(-fit.coefficients) @ fit.facing > SETTINGS.like_geometry:
            fits.append(fit)
        free &= ~grown
    return _label(_Maps(rays, normal.astype(np.float64), depth), fits)


def upright(normal: Array, plane: Array) -> Array | None:
    """[3] unit, camera frame: the mean normal of the largest plane that faces upwards, or None.

    normal [H, W, 3] unit, plane [H, W] int: the plane of a pixel, -1 for none.
    """
    counts = np.bincount(plane[plane >= 0], minlength=1)
    for k in np.argsort(-counts)[: np.count_nonzero(counts > 12)]:
        mean = unit(normal[plane == k].mean(0, dtype=np.float64))
        if mean[1] > 0.6:
            return mean
    return None


def level_frame(normal: Array, plane: Array) -> Array:
    """[3, 3] rotation whose columns are right, up and back of one who stands level behind the camera.

    Up is that of `upright`, the camera's own where no plane faces upwards.
    """
    up = upright(normal, plane)
    if up is None:
        return np.eye(3)
    right = unit(np.cross(up, [0.0, 0, 1]))
    return np.stack([right, up, np.cross(right, up)], -1)


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
        return (self.depth > 0) & (self.normal @ fit.facing > SETTINGS.same_normal)


@dataclass(frozen=True)
class _Fit:
    """A candidate plane."""

    coefficients: Array
    """[3] c in: inverse depth = rays . c."""
    facing: Array
    """[3] mean predicted normal, unit."""


def _best_fit(maps: _Maps, free: Array, rng: np.random.Generator) -> _Fit | None:
    """The plane that most of the free pixels [H, W] agree with, or None if there is no such thing."""
    rays = maps.rays[free]  # [N, 3]
    facing = maps.normal[free]  # [N, 3]
    depth = maps.depth[free]  # [N]
    count = len(depth)
    # --- RANSAC: a plane through three pixels of like normals; most followers win ---
    best = None
    best_score = 2
    for _ in range(SETTINGS.hypotheses):
        seed = facing[rng.integers(count)]
        draw = rng.integers(count, size=12)
        trio = draw[facing[draw] @ seed > SETTINGS.same_normal][:3]
        if len(trio) < 3 or abs(np.linalg.det(rays[trio])) < 1e-6:
            continue
        coefficients = np.linalg.solve(rays[trio], 1 / depth[trio])
        close = np.abs(depth * (rays @ coefficients) - 1) < SETTINGS.tolerance
        score = int(np.count_nonzero(close & (facing @ seed > SETTINGS.same_normal)))
        if score > best_score:
            best = _Fit(coefficients, seed)
            best_score = score
    # --- Least squares over its followers, anew each time ---
    for _ in range(5):
        if best is None:
            return None
        best = _refit(
            maps, free & maps.alike(best) & (np.abs(maps.error(best)) < SETTINGS.tolerance)
        )
    return best


def _refit(maps: _Maps, inside: Array) -> _Fit | None:
    """The plane of least squares over the pixels inside [H, W]."""
    if inside.sum() < 3:
        return None
    coefficients = through(maps.rays[inside], maps.depth[inside])
    return _Fit(coefficients, unit(maps.normal[inside].mean(0)))


def through(rays: Array, depth: Array) -> Array:
    """[3] whose product with a ray is the inverse depth of the plane through points at rays [N, 3], depth [N].

    Weighted by depth, so that the relative error counts.
    """
    scaled = rays * depth[:, None]
    return np.linalg.lstsq(scaled, np.ones(len(scaled)), rcond=None)[0]


def _grow(maps: _Maps, free: Array, fit: _Fit) -> tuple[_Fit, Array]:
    """Grow a plane over its bent parts; the refitted plane and its pixels [H, W]."""
    grown = _region(maps, free, fit)
    refit = _refit(maps, grown)
    if refit is None:
        return fit, grown
    again = _region(maps, free, refit)
    return (refit, again) if again.sum() >= grown.sum() else (fit, grown)


def _region(maps: _Maps, free: Array, fit: _Fit) -> Array:
    """[H, W] bool: free pixels within the tolerance, and what is smoothly connected to them within `bent`."""
    error = maps.error(fit)
    alike = free & maps.alike(fit)
    core = alike & (np.abs(error) < SETTINGS.tolerance)
    wide = alike & (np.abs(error) < SETTINGS.bent)
    step = SETTINGS.step * max(1.0, SETTINGS.small_picture / max(error.shape))
    # Growth stops where the error jumps: there another surface begins.
    jump_x = np.abs(np.diff(error, axis=1)) > step
    jump_y = np.abs(np.diff(error, axis=0)) > step
    calm = wide.copy()
    calm[:, 1:] &= ~jump_x
    calm[1:] &= ~jump_y
    return core | binary_propagation(core & calm, mask=calm)


def _label(maps: _Maps, fits: list[_Fit]) -> list[Plane]:
    """Give every pixel to the closest plane that reaches it, drop specks and planes that shrank too far."""
    surface = maps.depth > 0
    nearest = np.full(surface.shape, np.inf)  # [H, W] relative depth error of the closest plane
    label = np.full(surface.shape, -1)
    for k, fit in enumerate(fits):
        error = np.where(_region(maps, surface, fit), np.abs(maps.error(fit)), np.inf)
        label = np.where(error < nearest, k, label)
        nearest = np.minimum(nearest, error)
    # --- Planes that are large enough still; 1 / |c| is their distance, -c / |c| their normal ---
    planes = []
    # pixels of the largest patch that is chance
    speck = int(np.ceil(SETTINGS.speck * surface.size)) - 1
    for k, fit in enumerate(fits):
        mask = remove_small_objects(label == k, max_size=speck)
        if mask.sum() < SETTINGS.least * surface.sum():
            continue
        size = float(np.linalg.norm(fit.coefficients))
        planes.append(Plane(-fit.coefficients / size, -1 / size, mask))
    return sorted(planes, key=lambda plane: -int(plane.mask.sum()))
