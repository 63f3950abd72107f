"""Joint bilateral upsampling (Kopf et al. 2007) as one kernel of the renderer's compiler.

A native pixel takes the mean of the 4 x 4 working pixels around it, weighted by their distance and by how alike the
photo looks in both. A photo of 50 megapixels has 800 million such pairs; as numpy arrays they would go through memory
some forty times.
"""

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.buffers import floats, integers
from materialist.types import Array

PACKET = 4
"""Values that one gather fetches."""
TAPS = 4
"""Working pixels around a native one along each axis."""


class JointBilateral:
    """Enlarges a layer [H, W, C] of working size to windows of the native photo [H0, W0, 3]."""

    def __init__(self, guide: Array, layer: Array, members: Array, colour: float):
        """guide: [H, W, 3] the photo at working size, sRGB-encoded.

        members: [H, W] bool, the working pixels that count. colour: deviation of the colour weight, sRGB-encoded.
        """
        height, width, self.channels = layer.shape
        self.width, self.colour = width, colour
        self.packets = 1 + -(-self.channels // PACKET)
        table = np.zeros((height, width, self.packets * PACKET), np.float32)
        table[..., :3] = guide
        table[..., 3] = members
        table[..., PACKET : PACKET + self.channels] = layer
        self.table = floats(mi, table)

    def __call__(self, linear: Array, rows: tuple[Array, Array], columns: tuple[Array, Array]) -> Array:
        """[h, w, C] float32 of a native window; 0 where none of the 4 x 4 is a member.

        linear: [h, w, 3] the photo there. rows, columns: indices and weights, [4, h] and [4, w], of the working pixels
        around each native row and column.
        """
        height, width = linear.shape[:2]
        first_of_row = integers(mi, rows[0].T * self.width)
        index = dr.arange(mi.UInt32, height * width)
        # Numbers of one window are data: as literals they would have the kernel compiled anew.
        window = dr.opaque(mi.UInt32, width)
        sharpness = dr.opaque(mi.Float, -0.5 / self.colour**2)
        here = _encoded(dr.gather(mi.Color3f, floats(mi, linear), index))
        norm, sums = _weighted_sums(
            self.table,
            self.packets,
            here,
            (index // window) * TAPS,
            (index % window) * TAPS,
            first_of_row,
            floats(mi, rows[1].T),
            integers(mi, columns[0].T),
            floats(mi, columns[1].T),
            sharpness,
        )
        scale = dr.select(norm > 0, dr.rcp(dr.maximum(norm, 1e-20)), 0)
        planes = [component * scale for one in sums for component in one]
        planes = planes[: self.channels]
        dr.eval(planes)
        return np.stack([np.array(plane) for plane in planes], -1).reshape(height, width, -1)


@dr.syntax
def _weighted_sums(
    table, packets: int, here, row_taps, column_taps, row_start, row_weight, column, column_weight, sharpness
):
    """The sum of the weights of the taps of each native pixel, and that of their weighted values, in packets."""
    norm = dr.zeros(mi.Float, dr.width(here))
    sums = [dr.zeros(mi.Vector4f, dr.width(here)) for _ in range(packets - 1)]
    tap = dr.zeros(mi.UInt32, dr.width(here))
    while tap < 16:
        row = row_taps + tap // 4
        place = column_taps + tap % 4
        start = packets * (dr.gather(mi.UInt32, row_start, row) + dr.gather(mi.UInt32, column, place))
        first = dr.gather(mi.Vector4f, table, start)
        away = dr.square(here.x - first.x) + dr.square(here.y - first.y) + dr.square(here.z - first.z)
        # The small constant keeps a mean of the neighbourhood where nothing there looks alike.
        weight = dr.exp(sharpness * away) + 1e-4
        weight *= dr.gather(mi.Float, row_weight, row) * dr.gather(mi.Float, column_weight, place)
        weight *= first.w
        sums = _added(sums, table, start, weight)
        norm += weight
        tap += 1
    return norm, sums


def _added(sums, table, start, weight):
    """The sums with the weighted values of one more tap, whose packets begin at `start` with that of the guide."""
    return [total + weight * dr.gather(mi.Vector4f, table, start + k) for k, total in enumerate(sums, 1)]


def _encoded(linear):
    """sRGB encoding of linear values, clipped to [0, 1]; as `color.linear_to_srgb`."""
    linear = dr.clip(linear, 0, 1)
    power = dr.power(linear, 1 / 2.4)
    return dr.select(linear <= 0.0031308, linear * 12.92, 1.055 * power - 0.055)
