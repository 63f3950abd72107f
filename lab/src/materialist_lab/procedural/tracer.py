"""A path tracer of one fixed kernel, for many small scenes: every scene is the same code on other buffers.

Mitsuba's own integrators compile again whenever the set of shapes, materials or lamps changes, which costs more than
a 256 x 256 picture. Here all shapes are one mesh, all materials rows of a table over one bank of tiles, and lamps are
luminous faces of the mesh. The reflectance is that of `bsdf` (paper, section Preliminary). Light is sampled by
the balance heuristic between the BSDF and one draw from {envmap, portals, luminous faces}.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.buffers import floats
from materialist.camera import project, unproject
from materialist.errors import InputError
from materialist.render.scene import shape
from materialist.render.variant import setup
from materialist.types import Array, Camera
from materialist_lab.procedural import shading
from materialist_lab.procedural.packing import Packed
from materialist_lab.procedural.shading import Hit

MAX_DEPTH = 5
"""Surfaces a path may meet."""
KEEP = (0.6, 0.5)
"""Probability that a path goes on from its first and from a later surface."""
VECTOR = 16
"""Lanes whose paths end together: a vector of the processor costs as much for one path as for all of them."""
CLAMP = 30.0
"""Largest contribution of one light sample after the first surface, against fireflies; mean light is about 1."""


PROBE = 3
"""Label rays a pixel and axis, an odd number."""
CENTRE = PROBE * PROBE // 2
"""The number of that through the pixel's centre."""


class SampleTracer:
    """One packed world, ready to be rendered."""

    def __init__(self, packed: Packed, camera: Camera, *, device: str = "auto"):
        setup(device)
        if camera.width * camera.height % VECTOR:
            raise InputError(
                f"The picture is {camera.width} x {camera.height}; its sides must be multiples of 4."
            )
        self.camera = camera
        self.scene = mi.load_dict({"type": "scene", "mesh": shape(mi, packed)})
        self.shading = shading.Shading(packed)
        self.offset = dr.opaque(mi.Float, 2e-5 * (1 + packed.reach))
        self.focal = dr.opaque(mi.Float, float(camera.focal))

    def render(self, *, spp: int, seed: int) -> tuple[Array, Array]:
        """([H, W, 3] linear radiance, [H, W, 3] diffuse shading), noisy.

        The shading is what the diffuse lobe of the first surface would send back with albedo 1 and metallic 0.
        """
        h = self.camera.height
        w = self.camera.width
        # Stratified: a square number of samples, one in each cell of a pixel.
        rows = max(1, int(np.ceil(np.sqrt(spp))))
        spp = rows * rows
        lane = dr.arange(mi.UInt32, h * w * spp)
        # Lanes that end together belong to pixels far from each other: their common fate leaves no streaks.
        place = lane % (h * w)
        sample = lane // (h * w)
        pixel = place // VECTOR + (place % VECTOR) * (h * w // VECTOR)
        rng = mi.PCG32(initstate=dr.opaque(mi.UInt64, seed), initseq=mi.UInt64(lane))  # type: ignore[operator]
        jitter = mi.Point2f(
            mi.Float(sample % rows) + rng.next_float32(),
            mi.Float(sample // rows) + rng.next_float32(),
        )
        ray = self._camera_ray(pixel, jitter / rows)
        total, white = self._paths(ray, pixel, sample, rng, dr.opaque(mi.UInt32, seed))
        dr.eval(*total, *white)
        # --- Means over the samples of a pixel, put back into their order ---
        planes = [
            np.array(c).reshape(spp, h * w // VECTOR, VECTOR).mean(0).T for c in (*total, *white)
        ]
        both = np.stack([p.reshape(h, w) for p in planes], -1)
        return np.ascontiguousarray(both[..., :3]), np.ascontiguousarray(both[..., 3:])

    def probe(self) -> dict[str, Array]:
        """What PROBE x PROBE rays through each pixel see.

        Returns arrays of a leading [H, W, PROBE * PROBE]: owner (-1 for nothing), depth (planar, metres, 0 for
        nothing), normal [., 3] (camera frame, towards the camera), albedo [., 3], roughness, metallic.
        """
        h = self.camera.height
        w = self.camera.width
        n = PROBE * PROBE
        lane = dr.arange(mi.UInt32, h * w * n)
        pixel = lane // n
        sample = lane % n
        places = (mi.Point2f(mi.Float(sample % PROBE), mi.Float(sample // PROBE)) + 0.5) / PROBE
        ray = self._camera_ray(pixel, places)
        hit = self._hit(ray, mi.Bool(True), mi.Bool(True))
        look = self.shading.look(hit, mi.Point2f(0.5, 0.5))
        depth = dr.select(hit.valid, -hit.p.z, 0)
        owner = dr.select(hit.valid, mi.Int32(hit.owner), -1)
        # One evaluation for all of them: the rays are traced once.
        out = {
            "owner": owner,
            "depth": depth,
            "normal": [dr.select(hit.valid, c, 0) for c in hit.n],
            "albedo": [dr.select(hit.valid, c, 0) for c in look.albedo],
            "roughness": look.roughness,
            "metallic": look.metallic,
        }
        dr.eval(*(x for v in out.values() for x in (v if isinstance(v, list) else [v])))

        def shape(v):
            return np.array(v, np.float32).reshape(h, w, n)

        return {
            k: np.stack([shape(c) for c in v], -1) if isinstance(v, list) else shape(v)
            for k, v in out.items()
        }

    def light(
        self, probe: dict[str, Array], *, rows: int, spp: int, seed: int, hidden: float = 0
    ) -> Array:
        """[rows, 2 rows, 4] the light that reaches what the camera sees from what it does not see.

        Radiance (linear, equirectangular, camera frame) in three channels: the mean over visible surface points from
        which a direction is not blocked by a visible surface. The last channel is the share of such points.

        probe: what `probe` returned. spp: rays a texel, each from a random point. hidden: weight of the
        light from afar behind visible surfaces, which counts as well where it is above 0.
        """
        h = self.camera.height
        w = self.camera.width
        owner, depth = (np.ascontiguousarray(probe[k][..., CENTRE]) for k in ("owner", "depth"))
        normal = probe["normal"][:, :, CENTRE].reshape(-1, 3)
        seen = np.flatnonzero(owner.ravel() >= 0)
        if not len(seen):
            return np.zeros((rows, 2 * rows, 4), np.float32)
        # --- A random surface point and a random direction within each texel ---
        texels = 2 * rows * rows
        rng = np.random.default_rng(seed)
        chosen = seen[rng.integers(len(seen), size=texels * spp)]
        place = rng.random((2, texels * spp))
        # Lanes of a vector are neighbours: one ray of every texel, then the next of every texel.
        texel = np.tile(np.arange(texels), spp)
        theta = (texel // (2 * rows) + place[0]) / rows * np.pi
        phi = ((texel % (2 * rows) + place[1]) / rows - 1) * np.pi
        d = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)])
        points = unproject(depth, self.camera).reshape(-1, 3)[chosen]
        # Off the surface by two thousandths of the distance, against self-intersection.
        points += normal[chosen] * (0.002 * depth.ravel()[chosen, None])
        ray = mi.Ray3f(
            mi.Point3f(*(floats(mi, c) for c in points.T)), mi.Vector3f(*(floats(mi, c) for c in d))
        )
        lane = dr.arange(mi.UInt32, texels * spp)
        hit = self._hit(ray, mi.Bool(True))
        # --- Blocked where the ray meets a surface that the camera sees, or starts into its own ---
        position = np.stack([np.array(c) for c in hit.p], -1)
        screen, far = project(position, self.camera)
        column, row = (
            np.clip(np.nan_to_num(screen[:, k]), 0, size - 1).astype(int)
            for k, size in ((0, w), (1, h))
        )
        inside = (far > 0) & (screen >= 0).all(-1) & (screen[:, 0] < w) & (screen[:, 1] < h)
        same = owner[row, column] == np.array(hit.owner).astype(int)
        near = np.abs(depth[row, column] - far) < 0.05 * far
        below = (normal[chosen] * d.T).sum(-1) <= 0  # into the surface itself
        open_ = ~((np.array(hit.valid) & inside & same & near) | below)
        # --- Radiance along the rays, and its mean over the open ones ---
        random = mi.PCG32(initstate=dr.opaque(mi.UInt64, seed), initseq=mi.UInt64(lane))  # type: ignore[operator]
        total, _ = self._paths(
            ray, lane % texels, lane // texels, random, dr.opaque(mi.UInt32, seed)
        )
        radiance = np.where(open_, np.array(total), np.array(self.shading.sky(ray.d)))
        weight = np.where(open_, 1, hidden).reshape(spp, texels, 1).astype(np.float32)
        count = weight.sum(0)
        mean = (radiance.T.reshape(spp, texels, 3) * weight).sum(0) / np.maximum(count, 1e-6)
        return np.concatenate([mean, count / spp], -1).reshape(rows, 2 * rows, 4).astype(np.float32)

    def _camera_ray(self, pixel, place):
        """Rays through `place` in [0, 1)^2 of pixels, from the origin along -Z."""
        h = self.camera.height
        w = self.camera.width
        x = (mi.Float(pixel % w) + place.x - w / 2) / self.focal
        y = (h / 2 - mi.Float(pixel // w) - place.y) / self.focal
        return mi.Ray3f(mi.Point3f(0), dr.normalize(mi.Vector3f(x, y, -1)))

    def _hit(self, ray, active, fine=None) -> Hit:
        preliminary = self.scene.ray_intersect_preliminary(ray, coherent=False, active=active)
        return self.shading.hit(preliminary, ray.d, fine)

    def _paths(self, ray, pixel, sample, rng, seed):
        """Radiance and white diffuse shading along camera rays; each three Floats."""
        even = _Even(pixel, sample, seed)
        lanes = dr.width(pixel)
        # `fate` ends paths, alike for all lanes of a vector; `beta` is the throughput of a path,
        # `beta_white` the same with a white first surface, `pdf` the density of its last direction.
        fate = mi.PCG32(
            initstate=mi.UInt64(seed) + 311,
            initseq=mi.UInt64(dr.arange(mi.UInt32, lanes) // VECTOR),
        )
        start = mi.Ray3f(ray), rng, fate, mi.UInt32(0)
        state = (
            *start,
            mi.Color3f(1),
            mi.Color3f(0),
            mi.Color3f(0),
            mi.Color3f(0),
            mi.Float(-1),
            mi.Bool(True),
        )

        def body(ray, rng, fate, depth, beta, beta_white, total, white, pdf, active):
            hit = self._hit(ray, active, active & (depth == 0))
            draws = even.draw(rng, depth)
            look = self.shading.look(hit, draws.texel)
            # --- What the ray itself met: the sky, or a lamp. Balance heuristic,
            # --- w = p_bsdf / (p_bsdf + p_light); rays of the camera (pdf < 0) count in full.
            aimed = self.shading.density(ray, hit)
            weight = dr.select(pdf < 0, 1, pdf / dr.maximum(pdf + aimed, 1e-20))
            glow = dr.select(
                hit.valid,
                dr.select(hit.front, look.emission, mi.Color3f(0)),
                self.shading.sky(ray.d),
            )
            glow = dr.select(
                active, dr.select(depth > 1, dr.minimum(glow * weight, CLAMP), glow * weight), 0
            )
            total = total + beta * glow
            white = white + beta_white * glow
            active = active & hit.valid & (depth < MAX_DEPTH)
            # --- Emitter sampling: one light, a shadow ray ---
            to_light, distance, radiance, chance = self.shading.aim(hit, draws)
            start = hit.p + hit.ng * self.offset
            wo = hit.frame.to_local(to_light)
            above = dr.dot(hit.ng, to_light) > 0
            lit = active & above & (wo.z > 0) & (chance > 0)
            shadow = mi.Ray3f(start, to_light)
            shadow.maxt = distance
            lit &= ~self.scene.ray_test(shadow, coherent=False, active=lit)
            wi = hit.frame.to_local(-ray.d)
            diffuse, specular, density = shading.value(wi, wo, look)
            # L / p_light times its weight p_light / (p_light + p_bsdf).
            share = radiance / dr.maximum(chance + density, 1e-20)
            share = dr.select(lit, dr.select(depth > 0, dr.minimum(share, CLAMP), share), 0)
            first = depth == 0
            # f cos = albedo (1 - metallic) f_d cos + f_s cos.
            full = look.albedo * (1 - look.metallic) * diffuse + specular
            total = total + beta * full * share
            white = white + dr.select(first, mi.Color3f(diffuse), beta_white * full) * share
            # --- BSDF sampling: throughput times f cos / p ---
            wo = shading.sample(wi, look, draws)
            diffuse, specular, pdf = shading.value(wi, wo, look)
            full = look.albedo * (1 - look.metallic) * diffuse + specular
            d = hit.frame.to_world(wo)
            active &= (wo.z > 0) & (pdf > 0) & (dr.dot(hit.ng, d) > 0)
            beta_white = dr.select(first, mi.Color3f(diffuse), beta_white * full) / dr.maximum(
                pdf, 1e-20
            )
            beta = beta * full / dr.maximum(pdf, 1e-20)
            # --- Russian roulette: what goes on counts for what ended ---
            keep = dr.select(first, *KEEP)
            active &= fate.next_float32() < keep
            beta = beta / keep
            beta_white = beta_white / keep
            return (
                mi.Ray3f(start, d),
                rng,
                fate,
                depth + 1,
                beta,
                beta_white,
                total,
                white,
                pdf,
                active,
            )

        labels = (
            "ray",
            "rng",
            "fate",
            "depth",
            "beta",
            "beta_white",
            "total",
            "white",
            "pdf",
            "active",
        )
        out = dr.while_loop(state, lambda *s: s[-1], body, labels=labels, mode="symbolic")
        return out[6], out[7]


class _Even:
    """Random numbers that are evenly spread over the samples of a pixel at the first surface (a Kronecker sequence)."""

    # Powers of the inverse of the positive root of x**7 = x + 1 (Roberts 2018, generalised golden ratios).
    _STEPS = tuple((1 / 1.1127756842787055) ** (k + 1) % 1 for k in range(6))

    def __init__(self, pixel, sample, seed):
        self.sample = sample
        shift = mi.PCG32(initstate=mi.UInt64(seed) + 977, initseq=mi.UInt64(pixel))
        self.shift = [shift.next_float32() for _ in self._STEPS]

    def draw(self, rng, depth):
        """The numbers that one surface needs; `rng` goes on."""
        # Eight at every surface, so that all lanes keep the same place in their streams.
        free = [rng.next_float32() for _ in range(8)]
        index = mi.Float(self.sample)
        even = [s + index * step for s, step in zip(self.shift, self._STEPS)]
        u = [dr.select(depth == 0, e - dr.floor(e), f) for e, f in zip(even, free)]
        # The largest float below 1: rounding must not reach it.
        u = [dr.minimum(x, 0.99999994) for x in u]
        return Draws(
            u[0], mi.Point2f(u[1], u[2]), u[3], mi.Point2f(u[4], u[5]), mi.Point2f(free[6], free[7])
        )


@dataclass
class Draws:
    """Uniform random numbers for one surface of a path."""

    which: mi.Float
    light: mi.Point2f
    lobe: mi.Float
    bsdf: mi.Point2f
    texel: mi.Point2f
