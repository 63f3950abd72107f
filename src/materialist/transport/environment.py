"""Lookups in an equirectangular environment map, in the project's convention (docs/conventions.md)."""

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.buffers import floats
from materialist.envmap import row_solid_angle
from materialist.types import Array


class EnvmapLevel:
    """One map [h, w, 3] with bilinear lookup between texel centres, wrapped in azimuth, clamped at the poles."""

    def __init__(self, envmap: Array):
        h, w = envmap.shape[:2]
        self.height, self.width = dr.opaque(mi.UInt32, h), dr.opaque(mi.UInt32, w)
        self.data = floats(mi, envmap)

    def lookup(self, d, active):
        """Radiance (Color3f) from unit direction `d` (camera frame)."""
        u = dr.atan2(d.x, -d.z) * dr.inv_two_pi + 0.5
        v = dr.safe_acos(d.y) * dr.inv_pi
        x = u * mi.Float(self.width) - 0.5
        y = dr.clip(v * mi.Float(self.height) - 0.5, 0, mi.Float(self.height) - 1)
        x = dr.select(x < 0, x + mi.Float(self.width), x)
        x0, y0 = dr.minimum(mi.UInt32(x), self.width - 1), mi.UInt32(y)
        fx, fy = x - mi.Float(x0), y - mi.Float(y0)
        x1 = dr.select(x0 + 1 == self.width, 0, x0 + 1)
        y1 = dr.minimum(y0 + 1, self.height - 1)
        texel = lambda yy, xx: dr.gather(mi.Color3f, self.data, yy * self.width + xx, active)  # noqa: E731
        top = dr.lerp(texel(y0, x0), texel(y0, x1), fx)
        bottom = dr.lerp(texel(y1, x0), texel(y1, x1), fx)
        return dr.lerp(top, bottom, fy)


class EnvmapPyramid:
    """The map at full size and, halved repeatedly, at lower ones, for lookups that stand for a solid angle."""

    def __init__(self, envmap: Array):
        self.maps = [np.asarray(envmap, np.float32)]
        while self.maps[-1].shape[0] % 2 == 0 and self.maps[-1].shape[0] > 8:
            self.maps.append(halve(self.maps[-1]))
        self._levels: dict[int, EnvmapLevel] = {}

    def level(self, solid_angle: float) -> EnvmapLevel:
        """The map whose texels at the horizon cover about a quarter of `solid_angle` steradians."""
        texel = (2 * np.pi / self.maps[0].shape[1]) ** 2
        k = int(np.clip(np.floor(0.5 * np.log2(max(solid_angle, 1e-9) / (4 * texel))), 0, len(self.maps) - 1))
        if k not in self._levels:
            self._levels[k] = EnvmapLevel(self.maps[k])
        return self._levels[k]


def halve(envmap: Array) -> Array:
    """[h/2, w/2, 3] average of an even-sized map, rows weighted by their solid angle."""
    h, w = envmap.shape[:2]
    weight = row_solid_angle(h).reshape(h // 2, 2, 1, 1, 1)
    blocks = envmap.reshape(h // 2, 2, w // 2, 2, -1)
    return ((blocks * weight).sum((1, 3)) / (2 * weight.sum((1, 3)))).astype(np.float32)
