"""The transport cache: rays are traced once, then every light is one gather and every material one shading call.

Per pixel, `diffuse_samples` cosine-weighted directions and `specular_samples` visible-normal directions, at each of
ROUGHNESS_LEVELS or at the pixel's own roughness, are traced against the mesh. What is kept of a ray is one integer:
MISS, or the radiance slot of the face it hit. Directions are regenerated from their index, so that a gather is pure
memory traffic.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import torch

from materialist.bsdf.disney import diffuse_coefficients, schlick_weight
from materialist.bsdf.ggx import alpha_of, smith_g1
from materialist.bsdf.lobes import face_towards, lifted, visible_normal_vector
from materialist.buffers import floats, integers, placed
from materialist.transport.environment import EnvmapPyramid
from materialist.types import Array, Camera, Geometry, Mesh

ROUGHNESS_LEVELS = (0.04, 0.12, 0.2, 0.3, 0.42, 0.56, 0.75, 1.0)
"""Perceptual roughness at which the specular lobe is tabulated; between them it is interpolated linearly."""

TILE = 4
"""Neighbouring pixels in a TILE x TILE block draw interleaved parts of one point set, for the filter to join."""

# Generators of the R2 sequence (Roberts 2018): 1/g, 1/g^2 with g the plastic number.
R2 = (0.7548776662466927, 0.5698402909980532)

MISS = 0xFFFFFFFF
_OFF_DIAGONAL = (0.13, 0.05)
"""Where in a pixel the primary ray passes, from the centre: not through the edge between its two triangles."""


@dataclass(frozen=True)
class CacheSettings:
    """Rays of a transport cache."""

    diffuse_samples: int = 64  # rays a pixel of the diffuse lobe; tuned by eye
    specular_samples: int = 16  # rays a pixel of a wide specular level; tuned by eye
    level_share: tuple[float, ...] = (0.25, 0.375, 0.5, 0.75, 1.0, 1.0, 1.0, 1.0)
    """Of `specular_samples`, by roughness level: a narrow lobe needs fewer."""
    full_pixels: int = 2**20  # pixels of a picture from which a pixel has fewer rays; derived: time

    def at_size(self, pixels: int) -> CacheSettings:
        """For a picture of so many pixels: a large one has as many rays in all as one of `full_pixels`."""
        fewer = min(1.0, self.full_pixels / pixels)
        diffuse, specular = (
            max(1, round(count * fewer)) for count in (self.diffuse_samples, self.specular_samples)
        )
        return replace(self, diffuse_samples=diffuse, specular_samples=specular)


@dataclass(frozen=True)
class Tables:
    """What a material step needs of light and geometry, for P surface pixels; float32, on `buffers.torch_device()`."""

    diffuse: torch.Tensor
    """[P, 9]: D0, D1, D2 (RGB each); diffuse radiance is A (1 - M) (D0 + D1 R + D2 R^2)."""
    specular: torch.Tensor
    """[L, P, 6]: S0, S1 (RGB each) per roughness level, or at the pixel's own roughness if L is 1; specular radiance
    is C0 S0(R) + S1(R)."""
    levels: tuple[Array, ...] = tuple(np.array([r], np.float32) for r in ROUGHNESS_LEVELS)
    """Perceptual roughness of each level, [1], or [P] of the pixels."""


def build_scene(mesh: Mesh) -> mi.Scene:
    """A Mitsuba scene of the whole mesh as one shape: prim_index is the face index."""
    shape = mi.Mesh("surface", len(mesh.vertices), len(mesh.faces), has_vertex_normals=True)
    params = mi.traverse(shape)
    params["vertex_positions"] = floats(mi, mesh.vertices)
    params["vertex_normals"] = floats(mi, mesh.normals)
    params["faces"] = integers(mi, mesh.faces)
    params.update()
    return mi.load_dict({"type": "scene", "surface": shape})


class TransportCache:
    """Traced visibility of one camera and mesh; equal seeds of the point sets give equal caches.

    The faces of the mesh carry the pixel whose radiance a ray that hits them sees. roughness: [H, W] perceptual, where
    it is known and stays: the specular lobe is then tabulated at it alone, which takes a sixth of the rays. region:
    [H, W] bool of the pixels that are shaded; None: all.
    """

    def __init__(
        self,
        geometry: Geometry,
        camera: Camera,
        settings: CacheSettings | None = None,
        *,
        roughness: Array | None = None,
        region: Array | None = None,
        seed: int = 0,
        progress=None,
    ):
        self.camera = camera
        self.mesh = geometry.mesh
        self.seed = seed
        self.settings = s = settings or CacheSettings()
        self.scene = build_scene(geometry.mesh)
        # Slots: one a pixel, and one more for each face of a continued plane, which no pixel shows.
        continued = geometry.mesh.face_plane >= 0
        slots = geometry.mesh.face_pixel.astype(np.uint32)
        slots[continued] = camera.width * camera.height + np.arange(
            continued.sum(), dtype=np.uint32
        )
        self.slots = integers(mi, slots)
        """[F] radiance slot of every face: its pixel, or one of its own on a continued plane."""
        self._primary(region)
        self._progress = progress
        self._set_lobes(s, roughness)

    def with_rays(self, settings: CacheSettings) -> TransportCache:
        """A cache of the same surfaces with other rays, none of them traced yet."""
        other = copy(self)
        other.settings = settings
        other._set_lobes(settings, None)
        return other

    def _set_lobes(self, s: CacheSettings, roughness: Array | None) -> None:
        counts = s.level_share
        self.roughness = [np.array([r], np.float32) for r in ROUGHNESS_LEVELS]
        """Of each level of the specular lobe, [1], or [P] of the pixels."""
        if roughness is not None:
            pixel_roughness = np.clip(roughness.reshape(-1)[self.pixels], ROUGHNESS_LEVELS[0], 1)
            counts = (1.0,)
            self.roughness = [pixel_roughness.astype(np.float32)]
        # Wider lobes take more rays; at its own roughness a pixel needs one level.
        specular = (max(1, round(share * s.specular_samples)) for share in counts)
        alphas = (floats(mi, alpha_of(r)) for r in self.roughness)
        # Lobe 0 is the diffuse one; alpha 1 makes `gather` read the map over a wide solid angle.
        self.lobes = [
            (s.diffuse_samples, dr.opaque(mi.Float, 1.0)),
            *zip(specular, alphas, strict=True),
        ]
        """Rays a pixel and alpha of the diffuse lobe, and of the specular one at each level."""
        self._hits: list[mi.UInt32] = []

    def _primary(self, region: Array | None) -> None:
        """Trace one ray through each pixel; keep what the pixels with a surface need for shading."""
        # --- Primary rays, in the camera frame: pinhole at the origin, looking down -Z ---
        cam = self.camera
        index = dr.arange(mi.UInt32, cam.width * cam.height)
        if region is not None:
            index = integers(mi, np.flatnonzero(region))
        columns = dr.opaque(mi.UInt32, cam.width)
        # Numbers of one photo are data: as literals they would have the kernel compiled anew.
        middle_x = dr.opaque(mi.Float, (cam.width - 1) / 2)
        middle_y = dr.opaque(mi.Float, (cam.height - 1) / 2)
        across = mi.Float(index % columns) - middle_x + _OFF_DIAGONAL[0]
        up = middle_y - mi.Float(index // columns) - _OFF_DIAGONAL[1]
        d = dr.normalize(mi.Vector3f(across, up, -dr.opaque(mi.Float, cam.focal)))
        si = self.scene.ray_intersect(mi.Ray3f(mi.Point3f(0), d))
        dr.eval(d, si)  # together, or each part of it would trace the rays again

        # --- Surface points of the pixels that see one ---
        seen = dr.compress(si.is_valid())
        take: Any = lambda v: dr.gather(type(v), v, mi.UInt32(seen))  # noqa: E731
        self.pixels = np.array(take(index))  # [P] row-major indices of the pixels with a surface
        normal = take(si.sh_frame.n)
        view = -take(d)
        # `face` keeps sampled directions above the triangle, `frame` shades by the smooth normal.
        self.position = take(si.p)
        self.geometric_normal = take(si.n)
        self.normal = _towards(normal, view)
        self.face = face_towards(self.geometric_normal, self.normal)
        self.frame = mi.Frame3f(self.normal)
        self.wo = self.frame.to_local(view)
        # Each pixel of a tile rotates the point set by another amount, see `joint_filter`.
        shift = pixel_shift(cam.height, cam.width, self.seed).reshape(-1, 2)[self.pixels]
        self.shift = mi.Point2f(*(floats(mi, s) for s in shift.T))
        # Evaluated here, or every later kernel would trace the primary rays again.
        dr.eval(
            self.position,
            self.geometric_normal,
            self.face,
            self.normal,
            self.frame,
            self.wo,
            self.shift,
        )

    def _trace(self, count: int, alpha: mi.Float, diffuse: bool) -> mi.UInt32:
        """[count * P] radiance slots that a lobe's rays meet, sample-major."""
        width = len(self.pixels)
        hits = dr.empty(mi.UInt32, count * width)
        # `count` is data, so that one kernel serves lobes of any number of rays.
        _trace_loop(
            self.scene,
            self.slots,
            hits,
            dr.arange(mi.UInt32, width),
            self.position,
            self.geometric_normal,
            self.face,
            self.frame,
            self.wo,
            self.shift,
            dr.opaque(mi.UInt32, count),
            alpha,
            diffuse,
        )
        dr.eval(hits)
        return hits

    def trace_next(self) -> bool:
        """Find what the rays of the next lobe meet; False where those of all are found."""
        k = len(self._hits)
        if k == len(self.lobes):
            return False
        self._hits.append(self._trace(*self.lobes[k], diffuse=k == 0))
        if self._progress is not None:
            self._progress("trace", k + 1, len(self.lobes))
        dr.sync_thread()  # so that whoever measures this sees it
        return True

    def trace(self) -> list[mi.UInt32]:
        """What the rays of every lobe meet, found on first use; the light fit never asks."""
        while self.trace_next():
            pass
        return self._hits

    def forget(self) -> None:
        """Free what the rays meet; the next `trace` finds it anew."""
        self._hits.clear()
        dr.flush_malloc_cache()

    def gather(self, envmap: Array, radiance: Array | None, levels: range | None = None) -> Tables:
        """Tables for one light, an envmap [h, 2h, 3] of linear radiance, of all levels of roughness or of some.

        radiance: [H, W, 3] linear radiance that leaves the surface seen by each pixel (for indirect light), or None
            for direct light alone.
        """
        # --- Light: a pyramid of the map for rays that miss, slots for those that hit ---
        pyramid = EnvmapPyramid(envmap)
        slots = floats(mi, self.slot_radiance(radiance))
        width = len(self.pixels)
        out = []
        kept_levels = range(len(self.roughness)) if levels is None else levels
        for k, (hits, (count, alpha)) in enumerate(zip(self.trace(), self.lobes, strict=True)):
            if k > 0 and k - 1 not in kept_levels:
                continue
            # Diffuse lobes are sampled alike in every tile: what falls between their few directions would be missing
            # from the whole picture, or be in all of it twice.
            level = pyramid.level(4 * np.pi * alpha * alpha / count)
            dr.make_opaque(level)
            # Sum over the rays of this lobe: incoming radiance times the lobe's factors.
            sums = _gather_loop(
                hits,
                slots,
                pyramid,
                level,
                dr.arange(mi.UInt32, width),
                self.face,
                self.frame,
                self.wo,
                self.shift,
                dr.opaque(mi.UInt32, count),
                alpha,
                diffuse=k == 0,
            )
            dr.eval(*sums)
            # The mean over `count` samples is the Monte Carlo estimate.
            out.append(placed(np.concatenate([np.array(s).T for s in sums], -1)) / count)
        made = tuple(self.roughness[k] for k in kept_levels)
        return Tables(out[0].contiguous(), torch.stack(out[1:]).contiguous(), made)

    def slot_radiance(self, radiance: Array | None) -> Array:
        """[S, 3] radiance per slot: one a pixel, then one a face of the continued planes."""
        size = self.camera.width * self.camera.height
        planes = self.mesh.face_pixel[self.mesh.face_plane >= 0]
        if radiance is None:
            return np.zeros((size + len(planes), 3), np.float32)
        flat = np.asarray(radiance, np.float32).reshape(size, 3)
        # A face of a continued plane sends what the nearest pixel of its plane sends.
        return np.concatenate([flat, flat[planes]])

    def image(self, values) -> Array:
        """[H, W, C] image of per-surface-pixel values [P, C], 0 elsewhere."""
        values = np.asarray(values, np.float32)
        out = np.zeros((self.camera.height * self.camera.width, values.shape[1]), np.float32)
        out[self.pixels] = values
        return out.reshape(self.camera.height, self.camera.width, -1)


def _towards(normal, view):
    """The shading normal, bent just enough that the viewer is above its horizon."""
    cos = dr.dot(normal, view)
    lifted = dr.normalize(normal + (0.02 - cos) * view)
    return dr.select(cos < 0.02, lifted, normal)


def spawn(position, geometric_normal, direction):
    """Ray that leaves a surface, offset as the path tracer offsets it."""
    # The offset grows with the coordinates, as the round-off of float32 does.
    magnitude = (1 + dr.max(dr.abs(position))) * mi.math.RayEpsilon
    sign = dr.mulsign(mi.Float(1), dr.dot(geometric_normal, direction))
    return mi.Ray3f(dr.fma(magnitude * sign, geometric_normal, position), direction)


def _drawn(diffuse: bool, wo, alpha, sample):
    """A direction drawn from a lobe, and the half vector between it and `wo`."""
    if diffuse:
        wi = mi.warp.square_to_cosine_hemisphere(sample)
        return wi, dr.normalize(wi + wo)
    h = visible_normal_vector(wo, alpha, sample)
    return mi.reflect(wo, h), h


@dr.syntax
def _trace_loop(
    scene,
    slots,
    hits,
    lane,
    position,
    geometric_normal,
    face,
    frame,
    wo,
    shift,
    count,
    alpha,
    diffuse: bool,
):
    i = dr.zeros(mi.UInt32, dr.width(lane))
    width = dr.opaque(mi.UInt32, dr.width(lane))
    while i < count:
        wi, _ = _drawn(diffuse, wo, alpha, point(i, count, shift))
        above = wi.z > 0
        # --- Trace: only which slot is hit is kept ---
        ray = spawn(position, geometric_normal, lifted(frame.to_world(wi), face))
        pi = scene.ray_intersect_preliminary(ray, coherent=False, active=above)
        slot = dr.gather(mi.UInt32, slots, pi.prim_index, pi.is_valid())
        dr.scatter(hits, dr.select(pi.is_valid(), slot, mi.UInt32(MISS)), i * width + lane)
        i += 1


def _incoming(hits, slots, env, level, index, direction, above):
    """L_i: the sky where the ray misses, else the radiance of the slot that it hits; 0 below the surface."""
    slot = dr.gather(mi.UInt32, hits, index)
    miss = slot == MISS
    sky = env.lookup(direction, level, above & miss)
    surface = dr.gather(mi.Color3f, slots, slot, above & ~miss)
    return dr.select(above, dr.select(miss, sky, surface), mi.Color3f(0))


def _added(sums, diffuse: bool, wi, wo, h, alpha, light):
    """The sums of a lobe with one more sample: those of D0, D1, D2, or of S0, S1."""
    if diffuse:
        # f_d cos / pdf of cosine-weighted rays leaves pi f_d / A = c0 + c1 R + c2 R^2.
        terms = [c * light for c in diffuse_coefficients(wi.z, wo.z, dr.dot(h, wi))]
    else:
        # f_s cos / pdf of visible normals leaves F G1(wi), and F = C_0 (1 - s) + s by Schlick.
        fresnel = schlick_weight(dr.dot(h, wo))
        weighted = light * smith_g1(wi.z, alpha)
        terms = [(1 - fresnel) * weighted, fresnel * weighted]
    return [total + term for total, term in zip(sums, terms, strict=True)]


@dr.syntax
def _gather_loop(
    hits, slots, env, level, lane, face, frame, wo, shift, count, alpha, diffuse: bool
):
    width = dr.opaque(mi.UInt32, dr.width(lane))
    i = dr.zeros(mi.UInt32, dr.width(lane))
    sums = [mi.Color3f(0)] * (3 if diffuse else 2)
    while i < count:
        # The directions of `_trace_loop`, from the same indices: nothing is traced here.
        wi, h = _drawn(diffuse, wo, alpha, point(i, count, shift))
        light = _incoming(
            hits, slots, env, level, i * width + lane, lifted(frame.to_world(wi), face), wi.z > 0
        )
        sums = _added(sums, diffuse, wi, wo, h, alpha, light)
        i += 1
    return sums


def levels_around(roughness: Array) -> range:
    """Those of ROUGHNESS_LEVELS, one after another and at least two, between which all of a roughness [P] lies."""
    last = len(ROUGHNESS_LEVELS) - 1
    low, high = (float(roughness.min()), float(roughness.max())) if roughness.size else (0.0, 0.0)
    # The level below the least roughness, and the one above the largest.
    first = int(np.clip(np.searchsorted(ROUGHNESS_LEVELS, low) - 1, 0, last - 1))
    return range(first, int(np.clip(np.searchsorted(ROUGHNESS_LEVELS, high), first + 1, last)) + 1)


def pixel_shift(height: int, width: int, seed: int) -> Array:
    """[H, W, 2] float32 rotation of the point set per pixel: stratified over each tile, the same in all tiles."""
    # The TILE^2 pixels of a tile draw as many consecutive points of the R2 sequence, shuffled.
    rank = np.random.default_rng(seed).permutation(TILE * TILE).reshape(TILE, TILE)
    rows, cols = np.indices((height, width))
    order = rank[rows % TILE, cols % TILE].astype(np.float64)
    base = np.random.default_rng(seed + 1).random(2)
    return np.stack([(base[k] + order * R2[k]) % 1.0 for k in (0, 1)], -1).astype(np.float32)


def point(index, count, shift):
    """Point `index` of `count` in [0, 1)^2: a rank-1 lattice (Fibonacci) in the unit square, rotated by `shift`."""
    i = mi.Float(index)
    # Even steps in u, the golden ratio in v; the fractional part wraps both.
    u = (i + 0.5) / mi.Float(count) + shift.x
    v = i * 0.6180339887498949 + shift.y
    return mi.Point2f(u - dr.floor(u), v - dr.floor(v))
