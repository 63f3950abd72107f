"""The paper's glass: every camera ray is refracted twice and then looks up the background.

Paper, Material Transparency Editing. The ray enters at the visible surface (direction omega_t1), goes the distance
d1, leaves through a back whose normal is the front's at the exit's place in the picture, and reaches

    x2 = x + d1 omega_t1 + d2 omega_t2,

whose screen position S(x2) says what of the background is seen. Light that stays inside there is followed no further:
it leaves elsewhere, and is taken to be the mean of what is seen through the object, so that no light is lost.

Where more is known of the back than that, its own normals take the front's place, and a ray leaves where it meets it.
What is reflected at the front is followed to the background, too, and to the environment map from there.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from materialist.bsdf.dielectric import fresnel_dielectric, masking, reflect, refract, visible_facet
from materialist.camera import pixel_rays, project, rays_through, unit
from materialist.edits.glass.options import Glass
from materialist.envmap import bilinear, environment
from materialist.geometry.membrane import nearest
from materialist.geometry.silhouette import surface_in
from materialist.geometry.slopes import back_normals
from materialist.types import Array, Camera

LONGEST = 3.0
"""Longest way through the object, in units of its largest thickness."""
STEPS = 96
"""Places along a ray where it is compared with the background's depth."""
SIDES = (2, 4)
"""Rays a pixel along either side: of clear glass, and of a rough surface, whose rays meet different facets."""


@dataclass(frozen=True)
class Backdrop:
    """What is behind the object."""

    picture: Array
    """[H, W, 3] linear radiance of the picture without the object."""
    depth: Array
    """[H, W] planar depth, scene units; 0 for sky."""
    envmap: Array
    """[h, 2h, 3] linear radiance: what is not in the picture."""


@dataclass(frozen=True)
class Crossing:
    """Rays through the object."""

    exit: Array
    """[N, 3] where they leave, camera frame: x + d1 omega_t1."""
    direction: Array
    """[N, 3] unit, beyond the object: omega_t2, or the reflection where that is total."""
    share: Array
    """[N] part of the light that crosses both surfaces."""
    reflected: Array
    """[N, 3] unit direction of the reflection at the front."""
    reflectance: Array
    """[N] Fresnel reflectance of the front times the masking of the reflection; what is masked stays inside."""


def two_interface(
    camera: Camera,
    normal: Array,
    depth: Array,
    mask: Array,
    thickness: Array,
    behind: Backdrop,
    options: Glass,
    back: Array | None = None,
) -> Array:
    """The object under the mask as glass: [H, W, 3] float32 linear radiance inside the mask, 0 outside.

    Args:
        normal: [H, W, 3] unit, camera frame. depth: [H, W] planar, scene units: the object's front.
        mask: [H, W] bool or weights.
        thickness: [H, W] scene units, >= 0: along the camera ray; of a back without normals of its own also d1.
        options: `ior`, `tint`, `roughness` and `back` count here: at a back that is the `same`, the paper's assumption,
            rays have -N_p of the front at the exit's place in the picture; else d1 is the distance to the surface that
            `thickness` describes, with its normals.
        back: [H, W, 3] unit outward normals of that surface, where they are known better than by its depth.
    """
    # --- Front and back: the back's own normals, or the front's turned (the paper) ---
    inside = surface_in(mask, depth, camera)
    rays = pixel_rays(camera).astype(np.float64)
    if options.back == "same":
        front = Front(camera, normal, depth, inside)
    else:
        if back is None:
            back = back_normals(
                depth + thickness / np.linalg.norm(rays, axis=-1), inside, rays
            ).astype(np.float32)
        front = Front(camera, normal, depth, inside, back, thickness)
    d1 = thickness[inside]
    side = SIDES[options.roughness > 0]
    tint = np.asarray(options.tint, float)
    total = np.zeros((int(inside.sum()), 3))
    # --- A grid of rays in each pixel: the mean of what they see ---
    for k in range(side**2):
        front.through((np.array([k % side, k // side]) + 0.5) / side - 0.5)
        crossing = cross(
            front, d1, ior=options.ior, alpha=options.roughness**2, sample=(k, side**2)
        )
        # What both surfaces let pass, what stays inside, and what the front reflects.
        through = look(crossing.exit, crossing.direction, behind, camera)
        trapped = np.maximum(1 - crossing.reflectance - crossing.share, 0)[:, None]
        mirror = crossing.reflectance[:, None] * look(
            front.point, crossing.reflected, behind, camera
        )
        total += (crossing.share[:, None] * through + trapped * through.mean(0)) * tint + mirror
    result = np.zeros((*inside.shape, 3), np.float32)
    result[inside] = total / side**2
    return result


class Front:
    """The visible surface of the object: its points, and its normals also just outside the mask; its back, if known.

    back: [H, W, 3] its own outward normals. thickness: [H, W] along the camera rays, for `way`.
    """

    def __init__(
        self,
        camera: Camera,
        normal: Array,
        depth: Array,
        inside: Array,
        back: Array | None = None,
        thickness: Array | None = None,
    ):
        self.camera = camera
        self._centres = np.argwhere(inside)[:, ::-1] + 0.5  # [N, 2] x, y
        inner_pixel = nearest(inside)
        # [H, W, 1], linear on planes
        self._inverse = 1 / depth[inner_pixel].astype(np.float64)[..., None]
        self._normals = normal[inner_pixel].astype(np.float64)  # [H, W, 3]
        self.through(np.zeros(2))
        self._backs = None if back is None else back[inner_pixel].astype(np.float64)
        self._ends: Array | None = None
        if thickness is not None:
            # Planar depth [H, W] of the back.
            ends = depth + thickness / np.linalg.norm(pixel_rays(camera), axis=-1)
            self._ends = ends[inner_pixel]
            self._longest = LONGEST * float(thickness[inside].max())

    def through(self, offset: Array) -> None:
        """Look through the pixels at this distance [2] (x right, y down) from their centres."""
        place = self._centres + offset
        rays = rays_through(place, self.camera)
        self.point = rays / bilinear(self._inverse, place)  # [N, 3] x
        self.direction = unit(rays)  # [N, 3]
        self.normal = _facing(unit(bilinear(self._normals, place)), self.direction)  # [N, 3]

    def back_at(self, point: Array) -> Array:
        """[N, 3] the back's outward unit normal at points [N, 3]: its own, or -N_p(S(point)), the front's turned."""
        place, _ = project(point, self.camera)
        if self._backs is not None:
            return unit(bilinear(self._backs, place))
        return -_facing(unit(bilinear(self._normals, place)), unit(point))

    def way(self, inner: Array, d1: Array) -> Array:
        """[N] d1 of rays of unit directions [N, 3] inside: to the back where it is known, else d1 [N] as it is."""
        if self._ends is None:
            return d1
        distance = background_distance(self.point, inner, self._ends, self.camera)
        return np.minimum(np.where(np.isfinite(distance), distance, d1), self._longest)


def cross(
    front: Front, d1: Array, *, ior: float, alpha: float = 0.0, sample: tuple[int, int] = (0, 1)
) -> Crossing:
    """Rays through both surfaces; d1 [N] scene units.

    `sample` (k, n) is the k-th of n facets of rough surfaces.
    """
    # --- The k-th of n facets, by irrational steps: well spread over the unit square ---
    k, n = sample
    points = [((k + 0.5) * g) % 1 for g in (0.7320508076, 1 / n, 0.6180339887, 0.4142135623)]
    facet = visible_facet(front.direction, front.normal, alpha, points[0], points[1])
    # --- At the front: the facet bends and reflects the ray ---
    # omega_t1 inside (Snell), the reflection, and what share goes which way (Fresnel).
    inner, _ = refract(front.direction, facet, ior)
    mirrored = reflect(front.direction, facet)
    fresnel = fresnel_dielectric(-np.sum(front.direction * facet, -1), ior)
    reflectance = fresnel * _unmasked(mirrored, front.normal, alpha, below=False)
    share = (1 - fresnel) * _unmasked(inner, front.normal, alpha, below=True)
    # --- At the back: x + d1 omega_t1, where omega_t2 leaves ---
    exit_point = front.point + front.way(inner, d1)[:, None] * inner
    outward = front.back_at(exit_point)
    # A ray meets the back from inside: normals that face it are tilted until it grazes.
    against = -_facing(outward, -inner)
    facet = visible_facet(inner, against, alpha, points[2], points[3])
    direction, is_total = refract(inner, facet, 1 / ior)
    passed = 1 - fresnel_dielectric(-np.sum(inner * facet, -1), 1 / ior)
    passed = np.where(is_total, 1.0, passed) * _unmasked(direction, against, alpha, below=~is_total)
    return Crossing(exit_point, direction, share * passed, mirrored, reflectance)


def _unmasked(direction: Array, normal: Array, alpha: float, below: Array | bool) -> Array:
    """[N] the part of light that a rough surface lets go in `direction`; 0 on the wrong side of the surface."""
    if alpha <= 0:
        return np.ones(len(direction))
    side = np.where(below, -1.0, 1.0) * np.sum(direction * normal, -1)
    return np.where(side > 0, masking(direction, normal, alpha), 0)


def look(origin: Array, direction: Array, behind: Backdrop, camera: Camera) -> Array:
    """[N, 3] radiance that rays from [N, 3] along unit [N, 3] meet: the background at S(x2), else the environment.

    A ray that meets no surface, but ends in the picture's sky, reads the picture.
    """
    # --- Where the ray ends: on the background, or in the distance ---
    distance = background_distance(origin, direction, behind.depth, camera)
    met = np.isfinite(distance)
    end = np.where(
        met[:, None], origin + np.where(met, distance, 0)[:, None] * direction, direction
    )
    place, depth = project(end, camera)
    # --- Sky in the picture is read from it, too ---
    size = np.array([camera.width, camera.height])
    sky = ~met & (depth > 0) & ((place >= 0) & (place < size)).all(-1)
    sky[sky] = bilinear(behind.depth[..., None], place[sky])[:, 0] == 0
    seen = (met | sky)[:, None]
    return np.where(seen, bilinear(behind.picture, place), environment(direction, behind.envmap))


def background_distance(origin: Array, direction: Array, depth: Array, camera: Camera) -> Array:
    """[N] the distance d2 to the surface that a depth map [H, W] describes; inf for rays that meet none.

    Beyond the picture the surface goes on as at its nearest edge. A ray that starts behind the surface meets it at
    once. Rays are followed to twice the largest depth, in steps that grow with the distance.
    """
    if not (depth > 0).any():
        return np.full(len(origin), np.inf)
    far = 2 * float(depth.max())
    surface = np.where(depth > 0, depth, 1e6).astype(np.float64)
    length = far * (np.arange(STEPS + 1) / STEPS) ** 2  # [STEPS + 1]
    low = np.zeros(len(origin))
    high = np.full(len(origin), np.inf)
    open_ = np.ones(len(origin), bool)
    # --- March: the first step after which a ray is behind the surface ---
    for a, b in pairwise(length):
        hit = open_.copy()
        hit[open_] = _behind(
            origin[open_], direction[open_], np.full(int(open_.sum()), b), surface, camera
        )
        low[hit] = a
        high[hit] = b
        open_ &= ~hit
        if not open_.any():
            break
    # --- Bisection inside that step: to 1/4096 of it ---
    met = np.isfinite(high)
    for _ in range(12):
        middle = (low[met] + high[met]) / 2
        beyond = _behind(origin[met], direction[met], middle, surface, camera)
        low[met] = np.where(beyond, low[met], middle)
        high[met] = np.where(beyond, middle, high[met])
    return high


def _behind(
    origin: Array, direction: Array, distance: Array, surface: Array, camera: Camera
) -> Array:
    """[n] bool: whether the points on the rays at `distance` [n] are behind the surface [H, W], and in view."""
    place, depth = project(origin + distance[:, None] * direction, camera)
    return (depth > 0) & (depth >= bilinear(surface[..., None], place)[:, 0])


def _facing(normal: Array, direction: Array) -> Array:
    """Unit normals [N, 3] made to point against the directions, at least grazingly."""
    cosine = np.sum(normal * direction, -1, keepdims=True)
    return unit(np.where(cosine > -1e-3, normal - (cosine + 1e-3) * direction, normal))
