"""Lookups in an equirectangular environment map, in the project's convention (docs/conventions.md)."""

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.buffers import floats, integers
from materialist.envmap import row_solid_angle
from materialist.types import Array


class EnvmapPyramid:
    """A map [h, w, 3] at full size and, halved repeatedly, at lower ones, for lookups that stand for a solid angle.

    Lookups are bilinear between texel centres, wrapped in azimuth, clamped at the poles.
    """

    def __init__(self, envmap: Array):
        maps = [np.asarray(envmap, np.float32)]
        # Halved down to 8 rows: below that, a texel is wider than any lobe.
        while maps[-1].shape[0] % 2 == 0 and maps[-1].shape[0] > 8:
            maps.append(halve(maps[-1]))
        self.heights = integers(mi, np.array([m.shape[0] for m in maps]))
        self.widths = integers(mi, np.array([m.shape[1] for m in maps]))
        # All maps lie in one buffer, so that one gather serves every level.
        sizes = [m.shape[0] * m.shape[1] for m in maps]
        self.starts = integers(mi, np.cumsum([0, *sizes[:-1]]))
        self.data = floats(mi, np.concatenate([m.reshape(-1, 3) for m in maps]))

    def level(self, solid_angle):
        """UInt32 number of the map whose texels at the horizon cover about a quarter of `solid_angle` steradians."""
        texel = (dr.two_pi / mi.Float(dr.gather(mi.UInt32, self.widths, 0))) ** 2
        # Each level has texels of four times the solid angle.
        k = dr.floor(0.5 * dr.log2(dr.maximum(solid_angle, 1e-9) / (4 * texel)))
        return mi.UInt32(dr.clip(k, 0, dr.width(self.widths) - 1))

    def lookup(self, d, level, active):
        """Radiance (Color3f) of the map of that number from unit direction `d` (camera frame)."""
        height, width, start = (
            dr.gather(mi.UInt32, v, level, active) for v in (self.heights, self.widths, self.starts)
        )
        # --- Direction to texel coordinates: d(u, v) inverted, the middle column along -Z ---
        u = dr.atan2(d.x, -d.z) * dr.inv_two_pi + 0.5
        v = dr.safe_acos(d.y) * dr.inv_pi
        x = u * mi.Float(width) - 0.5
        y = dr.clip(v * mi.Float(height) - 0.5, 0, mi.Float(height) - 1)
        x = dr.select(x < 0, x + mi.Float(width), x)
        # --- The four texels around them: wrapped in azimuth, clamped at the poles ---
        x0 = dr.minimum(mi.UInt32(x), width - 1)
        y0 = mi.UInt32(y)
        fx = x - mi.Float(x0)
        fy = y - mi.Float(y0)
        x1 = dr.select(x0 + 1 == width, 0, x0 + 1)
        y1 = dr.minimum(y0 + 1, height - 1)

        def texel(yy, xx):
            return dr.gather(mi.Color3f, self.data, start + yy * width + xx, active)

        # --- Bilinear: along azimuth, then between the two rows ---
        top = dr.lerp(texel(y0, x0), texel(y0, x1), fx)
        bottom = dr.lerp(texel(y1, x0), texel(y1, x1), fx)
        return dr.lerp(top, bottom, fy)


def halve(envmap: Array) -> Array:
    """[h/2, w/2, 3] average of an even-sized map, rows weighted by their solid angle."""
    h, w = envmap.shape[:2]
    weight = row_solid_angle(h).reshape(h // 2, 2, 1, 1, 1)
    # [h/2, 2, w/2, 2, 3]: the four texels of a block lie along axes 1 and 3.
    blocks = envmap.reshape(h // 2, 2, w // 2, 2, -1)
    return ((blocks * weight).sum((1, 3)) / (2 * weight.sum((1, 3)))).astype(np.float32)
