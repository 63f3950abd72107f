"""What the path tracer knows about a point: surface, material, light. Dr.Jit code on flat buffers."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.bsdf import lobes
from materialist.bsdf.disney import base_reflectance, specular_probability
from materialist.bsdf.ggx import alpha_of
from materialist.buffers import floats, integers, tensor
from materialist_lab.procedural import relief, tiles
from materialist_lab.procedural.packing import (
    ENV_ROWS,
    ENV_TABLE,
    FACE,
    LIGHT_TABLE,
    MATERIAL,
    MAX_PORTALS,
    PICTURE_START,
    PORTAL,
    Packed,
)

_ALBEDO_RANGE = (0.01, 0.95)
_MIN_ROUGHNESS = 0.05


@dataclass
class Hit:
    """A point on the mesh, seen along some direction; the names of a surface interaction."""

    valid: Any
    p: Any
    t: Any
    ng: Any
    """Unit geometric normal on the side of the viewer."""
    n: Any
    """Unit shading normal on that side."""
    frame: Any
    uv: Any
    front: Any
    """Whether the front side is seen."""
    owner: Any
    """Number of the part and row of its material, UInt32."""
    density: Any
    """Probability density of aiming at this point as a light, 1 / m2."""


@dataclass
class Look:
    """The material at a point."""

    albedo: Any
    roughness: Any
    metallic: Any
    emission: Any


class Shading:
    """A packed world on the device: surfaces with their materials, light from afar, and luminous faces."""

    def __init__(self, packed: Packed):
        self.face = floats(mi, packed.face)
        self.material = floats(mi, packed.material)
        self.env_density = floats(mi, packed.env_density)
        self.portals = floats(mi, packed.portals)
        self.env_table = integers(mi, packed.env_table)
        self.lamps = integers(mi, packed.lamps)
        self.bank = _bank()
        self.pictures = integers(mi, packed.pictures)
        self.slopes = _slopes()
        self.solid = _solid()
        texture: Any = mi.Texture2f
        self.env = texture(tensor(mi, packed.env), wrap_mode=dr.WrapMode.Repeat)
        self.rows = dr.opaque(mi.Float, float(len(packed.env)))
        self.portal_count = dr.opaque(mi.Float, float((packed.portals[:, 12] > 0).sum()))
        self.shares = [dr.opaque(mi.Float, float(share)) for share in packed.shares]
        self.turn = [
            mi.Vector3f(*(dr.opaque(mi.Float, float(x)) for x in row)) for row in packed.to_scene
        ]
        """Three rows of the rotation from camera to scene directions."""

    def hit(self, preliminary, d, fine=None) -> Hit:
        """The surface at preliminary intersections of rays with directions d; see `at` for `fine`."""
        return self.at(
            preliminary.prim_index,
            preliminary.prim_uv,
            d,
            preliminary.t,
            preliminary.is_valid(),
            fine,
        )

    def at(self, index, b, d, t, valid, fine=None) -> Hit:
        """The surface at barycentric coordinates b of faces, seen along directions d.

        fine: where normals are bent by the relief of the material; nowhere by default.
        """
        # --- The corners of the face: place, normal and texture coordinates, 8 numbers each ---
        row = [
            dr.gather(mi.Vector4f, self.face, index * (FACE // 4) + k, valid)
            for k in range(FACE // 4)
        ]
        owner = mi.UInt32(row[6].x)
        corners = [(row[2 * k], row[2 * k + 1]) for k in range(3)]
        place = [mi.Point3f(a.x, a.y, a.z) for a, _ in corners]
        normal = [mi.Vector3f(a.w, c.x, c.y) for a, c in corners]
        uv = [mi.Point2f(c.z, c.w) for _, c in corners]

        def mix(v):
            return v[0] * (1 - b.x - b.y) + v[1] * b.x + v[2] * b.y

        # --- Geometric normal, and shading normal as the mean of the corners' ---
        ng = dr.cross(place[1] - place[0], place[2] - place[0])
        ng = ng * dr.rsqrt(dr.maximum(dr.squared_norm(ng), 1e-30))
        n = mix(normal)
        n = n * dr.rsqrt(dr.maximum(dr.squared_norm(n), 1e-20))
        front = dr.dot(ng, d) < 0
        if fine is not None:
            n = self._bent(n, owner, mix(place), mix(uv), place, uv, valid & fine)
        # --- Both on the viewer's side ---
        ng = dr.select(front, ng, -ng)
        n = dr.select(dr.dot(n, ng) < 0, -n, n)
        # Bend normals that turn away from the viewer back to the silhouette.
        away = dr.dot(n, d) + 0.01
        n = dr.select(away > 0, dr.normalize(n - d * away * 1.01), n)
        return Hit(
            valid,
            mix(place),
            t,
            ng,
            n,
            mi.Frame3f(n),
            mix(uv),
            front,
            owner,
            row[6].y,
        )

    def _bent(self, n, owner, p, uv, places, corners, active):
        """Shading normals n on the front side, bent by the relief at points p.

        `places` and `corners` are the places and the texture coordinates of the faces' corners. A height h along the
        normal bends it to n - (g - (g . n) n), g the gradient of h.
        """
        # Rows 3 to 8 of the material: see `Material.row`.
        r = [
            dr.gather(mi.Vector4f, self.material, owner * (MATERIAL // 4) + k, active)
            for k in range(3, 9)
        ]
        emboss = r[3].w
        solid = active & (r[4].w > 0)
        # --- Tiles: the slope of the height along s and t, two numbers of 16 bits in a word ---
        s, t = self._place_on_tile(uv, r[0], r[1])
        texel = self._texel(s, t, r[2].w)
        word = dr.gather(mi.UInt32, self.slopes, texel, active & (emboss > 0))
        along_s = (mi.Float(word & 0xFFFF) - 32768) * relief.FINE_SLOPE
        along_t = (mi.Float(word >> 16) - 32768) * relief.FINE_SLOPE
        # The gradients of u and v on the face, from the edges and their texture coordinates:
        # `across` and `up` are the dual basis of the edges, times the square of twice the area.
        first = places[1] - places[0]
        second = places[2] - places[0]
        du = corners[1] - corners[0]
        dv = corners[2] - corners[0]
        flat = dr.cross(first, second)
        across = dr.cross(second, flat)
        up = dr.cross(flat, first)
        scale = dr.rcp(dr.maximum(dr.squared_norm(flat), 1e-20))
        u = (du.x * across + dv.x * up) * scale
        v = (du.y * across + dv.y * up) * scale
        # The chain rule: (s, t) is a linear map of (u, v).
        by_u = along_s * r[0].z + along_t * r[1].x
        by_v = along_s * r[0].w + along_t * r[1].y
        slope = dr.select(emboss > 0, emboss * (by_u * u + by_v * v), 0)
        # --- Solid noise at the place in the scene, turns per metre in r[4] ---
        frequency = mi.Vector3f(r[4].x, r[4].y, r[4].z)
        place = mi.Vector3f(*(dr.dot(row, p) for row in self.turn)) * frequency
        # The kinds of noise lie in slabs above each other in one texture, r[5].x the number.
        layer = place.z - dr.floor(place.z)
        layer = (r[5].x * relief.SLAB + 1 + layer * relief.SIDE) / (relief.SLAB * len(relief.SOLID))
        gradient = self.solid.eval(mi.Point3f(place.x, place.y, layer), solid)
        scene = mi.Vector3f(*(gradient[k] * frequency[k] for k in range(3))) * r[4].w
        slope += dr.select(solid, self._to_camera(scene), 0)
        # --- Only the part of the gradient along the surface bends the normal ---
        bent = dr.normalize(n - (slope - dr.dot(slope, n) * n))
        return dr.select(solid | (active & (emboss > 0)), bent, n)

    def _to_camera(self, scene):
        """Directions of the scene as those of the camera: the transposed rotation."""
        rows = self.turn
        return mi.Vector3f(
            *(rows[0][k] * scene.x + rows[1][k] * scene.y + rows[2][k] * scene.z for k in range(3))
        )

    def _place_on_tile(self, uv, third, fourth):
        """(s, t) on tiles of texture coordinates, by the fourth and fifth row of four of the material."""
        return (
            uv.x * third.z + uv.y * third.w + fourth.z,
            uv.x * fourth.x + uv.y * fourth.y + fourth.w,
        )

    def _texel(self, s, t, tile, shift=(0.5, 0.5)):
        """Number in the bank of the texel at (s, t) of a tile."""
        side = tiles.SIZE

        def wrapped(x, by):
            texel = mi.Int32(dr.floor((x - dr.floor(x)) * side + by - 0.5))
            # The side is added before the remainder: -1 is the last texel.
            return mi.UInt32(texel + side) % side

        column = wrapped(s, shift[0])
        line = wrapped(t, shift[1])
        return (mi.UInt32(tile) * side + line) * side + column

    def look(self, hit: Hit, texel) -> Look:
        """The material at hits; `texel` in [0, 1)^2 spreads the lookup over neighbouring texels."""
        r = [
            dr.gather(mi.Vector4f, self.material, hit.owner * (MATERIAL // 4) + k, hit.valid)
            for k in range(7)
        ]
        # --- The four channels of the tile, 8 bits each ---
        s, t = self._place_on_tile(hit.uv, r[3], r[4])
        index = self._texel(s, t, r[5].w, (texel.x, texel.y))
        word = dr.gather(mi.UInt32, self.bank, index, hit.valid)
        f: list[Any] = [mi.Float((word >> (8 * k)) & 255) / 255 for k in range(4)]
        # --- Colour: of the tile, or of a picture where the material has one ---
        colours: list[Any] = [mi.Color3f(v.x, v.y, v.z) for v in r[:3]]
        albedo: Any = dr.lerp(dr.lerp(colours[0], colours[1], f[0]), colours[2], f[1])
        printed = self._printed(r[6], s, t, texel, hit.valid)
        albedo = dr.select(r[6].y > 0, printed * colours[0], albedo)
        # Grain as `Material.grain` says: albedo times exp(grain (g - 0.5)).
        albedo = dr.clip(albedo * dr.exp(r[2].w * (f[2] - 0.5)), *_ALBEDO_RANGE)
        # --- Finish ---
        roughness = dr.clip(dr.lerp(r[0].w, r[1].w, f[3]), _MIN_ROUGHNESS, 1)
        metallic = dr.lerp(r[3].x, r[3].y, f[0])
        emission = mi.Color3f(r[5].x, r[5].y, r[5].z) * albedo
        return Look(albedo, roughness, metallic, emission)

    def _printed(self, where, s, t, texel, valid):
        """Linear colour at (s, t) of pictures; `where` holds their places, widths and heights."""
        width = mi.UInt32(where.y)
        height = mi.UInt32(where.z)
        x = mi.Int32(dr.floor((s - dr.floor(s)) * where.y + texel.x - 0.5))
        y = mi.Int32(dr.floor((t - dr.floor(t)) * where.z + texel.y - 0.5))
        column = mi.UInt32(dr.clip(x, 0, mi.Int32(width) - 1))
        line = mi.UInt32(dr.clip(y, 0, mi.Int32(height) - 1))
        place = mi.UInt32(where.x) * PICTURE_START + line * width + column
        word = dr.gather(mi.UInt32, self.pictures, place, valid & (where.y > 0))
        # Stored as square roots, which 8 bits resolve better in the dark.
        root = mi.Color3f(*(mi.Float((word >> (8 * k)) & 255) / 255 for k in range(3)))
        return root * root

    def sky(self, d):
        """Radiance from direction d (camera frame), bilinear."""
        u, v = self._place(d)
        edge = 0.5 / self.rows  # rows do not go on beyond the poles
        return mi.Color3f(self.env.eval(mi.Point2f(u, dr.clip(v, edge, 1 - edge))))

    def _place(self, d):
        """(u, v) in [0, 1) of directions in the camera frame."""
        s = mi.Vector3f(*(dr.dot(row, d) for row in self.turn))
        u = dr.atan2(s.x, -s.z) * (0.5 * dr.inv_pi) + 0.5
        return u - dr.floor(u), dr.acos(dr.clip(s.y, -1, 1)) * dr.inv_pi

    def density(self, ray, hit: Hit):
        """Density per solid angle with which `aim` would have found what the ray found, seen from its origin."""
        # From a density per area to one per solid angle: p_w = p_A t^2 / |cos|.
        cosine = dr.abs(dr.dot(hit.ng, ray.d))
        lamp = self.shares[2] * hit.density * hit.t * hit.t / dr.maximum(cosine, 1e-6)
        return dr.select(hit.valid, dr.select(hit.front, lamp, 0), self._sky_density(ray.o, ray.d))

    def _sky_density(self, p, d):
        """Density per solid angle of aiming along d from p at light from afar, by envmap and portals."""
        u, v = self._place(d)
        column = dr.minimum(mi.UInt32(u * (2 * ENV_ROWS)), 2 * ENV_ROWS - 1)
        row = dr.minimum(mi.UInt32(v * ENV_ROWS), ENV_ROWS - 1)
        by_envmap = dr.gather(mi.Float, self.env_density, row * (2 * ENV_ROWS) + column)
        total = self.shares[0] * by_envmap
        return total + self.shares[1] * self._portal_density(p, d)

    def _portal_density(self, p, d):
        """Density per solid angle of aiming along d from p through one of the portals."""
        total = mi.Float(0)
        for k in range(MAX_PORTALS):
            corner, right, up, normal, share = self._portal(mi.UInt32(k))
            # Where the ray meets the plane of the portal, as shares (a, b) of its sides.
            cosine = -dr.dot(normal, d)
            t = -dr.dot(normal, corner - p) / dr.maximum(cosine, 1e-6)
            q = p + d * t - corner
            a = dr.dot(q, right) / dr.maximum(dr.squared_norm(right), 1e-9)
            b = dr.dot(q, up) / dr.maximum(dr.squared_norm(up), 1e-9)
            inside = (cosine > 1e-4) & (t > 0) & (a >= 0) & (a < 1) & (b >= 0) & (b < 1)
            total += dr.select(inside, share * t * t / dr.maximum(cosine, 1e-4), 0)
        return total

    def _portal(self, k):
        """(corner, right, up, normal, share per area) of portal k."""
        r = [
            dr.gather(mi.Vector4f, self.portals, k * (PORTAL // 4) + i) for i in range(PORTAL // 4)
        ]
        corner = mi.Point3f(r[0].x, r[0].y, r[0].z)
        right = mi.Vector3f(r[0].w, r[1].x, r[1].y)
        return (
            corner,
            right,
            mi.Vector3f(r[1].z, r[1].w, r[2].x),
            mi.Vector3f(r[2].y, r[2].z, r[2].w),
            r[3].x,
        )

    def aim(self, hit: Hit, draws) -> tuple[Any, Any, Any, Any]:
        """One direction from each hit towards a light, chosen by `draws.which` and `draws.light`.

        Returns direction, distance, radiance, and density per solid angle, over all ways of aiming.
        """
        s0, s1, s2 = self.shares
        to_sky = draws.which < s0
        to_portal = draws.which < s0 + s1
        # --- The envmap: a texel from the table, a uniform direction within it ---
        entry = mi.UInt32(dr.clip(draws.which / dr.maximum(s0, 1e-6), 0, 0.999999) * ENV_TABLE)
        d_sky = self._texel_direction(dr.gather(mi.UInt32, self.env_table, entry), draws.light)
        # --- A portal: a uniform point on it ---
        count = dr.maximum(mi.Float(0), draws.which - s0) / dr.maximum(s1, 1e-6)
        k = mi.UInt32(dr.clip(count, 0, 0.999999) * self.portal_count)
        corner, right, up, _, _ = self._portal(dr.minimum(k, MAX_PORTALS - 1))
        d_portal = dr.normalize(corner + right * draws.light.x + up * draws.light.y - hit.p + 1e-9)
        # --- A luminous face: a uniform point on it, by square-root barycentric coordinates ---
        rest = dr.clip((draws.which - s0 - s1) / dr.maximum(s2, 1e-6), 0, 0.999999)
        face = dr.gather(mi.UInt32, self.lamps, mi.UInt32(rest * LIGHT_TABLE))
        root = dr.sqrt(draws.light.x)
        b = mi.Point2f(1 - root, root * draws.light.y)
        lamp = self.at(face, b, mi.Vector3f(0, 0, 1), mi.Float(0), ~to_portal)
        away = lamp.p - hit.p
        distance = dr.norm(away)
        d_lamp = away / dr.maximum(distance, 1e-9)
        # Lamps shine from their front alone: `towards` is negative where it looks at the hit.
        towards = dr.dot(dr.select(lamp.front, lamp.ng, -lamp.ng), d_lamp)
        look = self.look(lamp, draws.texel)
        lamp_pdf = s2 * lamp.density * distance * distance / dr.maximum(-towards, 1e-6)
        # --- The one that was drawn ---
        d = dr.select(to_sky, d_sky, dr.select(to_portal, d_portal, d_lamp))
        pdf = dr.select(to_portal, self._sky_density(hit.p, d), dr.select(towards < 0, lamp_pdf, 0))
        radiance = dr.select(to_portal, self.sky(d), look.emission)
        return d, dr.select(to_portal, 1e8, distance * 0.999), radiance, pdf

    def _texel_direction(self, texel, u):
        """The direction at u in [0, 1)^2 of a texel, uniform over its solid angle."""
        row = texel // (2 * ENV_ROWS)
        column = texel % (2 * ENV_ROWS)
        step = float(np.pi / ENV_ROWS)
        # Uniform in the height y: equal steps of it cover equal areas of the sphere.
        top = dr.cos(mi.Float(row) * step)
        bottom = dr.cos(mi.Float(row + 1) * step)
        y = dr.lerp(top, bottom, u.y)
        phi = (mi.Float(column) + u.x) * step - dr.pi
        s, c = dr.sincos(phi)
        r = dr.safe_sqrt(1 - y * y)
        return self._to_camera(mi.Vector3f(r * s, y, -r * c))


@cache
def _slopes():
    """Slopes of the tiles on the device, once a process."""
    return integers(mi, relief.tile_bank())


@cache
def _solid():
    """Slopes of solid noise on the device, once a process."""
    texture: Any = mi.Texture3f
    return texture(tensor(mi, relief.solid_bank()), wrap_mode=dr.WrapMode.Repeat)


@cache
def _bank():
    """The tiles on the device, once a process: [N * SIZE * SIZE] UInt32, four channels of 8 bits."""
    return integers(mi, np.ascontiguousarray(tiles.bank()[0]).view(np.uint32))


def value(wi, wo, look: Look):
    """The project's BRDF (paper, section Preliminary) with its diffuse and specular lobes apart.

    Returns (f_d cos of a white dielectric, f_s cos [3], sampling density) for local unit directions; 0 below the
    surface.
    """
    above = (wi.z > 0) & (wo.z > 0)
    alpha = alpha_of(look.roughness)
    # The reflectance at normal incidence, F_0, goes from that of a dielectric to the albedo with metallic.
    specular = lobes.specular(wi, wo, alpha, base_reflectance(look.albedo, look.metallic))
    density = lobes.density(wi, wo, alpha, _specular_probability(wi, look))
    return (
        dr.select(above, lobes.diffuse(wi, wo, look.roughness), 0),
        dr.select(above, specular, mi.Color3f(0)),
        dr.select(above, density, 0),
    )


def sample(wi, look: Look, draws):
    """A local direction drawn with the density that `value` gives."""
    return lobes.sample_direction(
        wi, alpha_of(look.roughness), draws.lobe < _specular_probability(wi, look), draws.bsdf
    )


def _specular_probability(wi, look: Look):
    return specular_probability(wi.z, mi.luminance(look.albedo), look.metallic)
