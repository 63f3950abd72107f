"""What ClickNet sees of a photo: colours, normals and depth, and how they differ from those at clicks or in a box."""

from collections.abc import Sequence

import numpy as np

from materialist.types import Array

Box = tuple[int, int, int, int]
"""(x0, y0, x1, y1) in pixels, the latter two beyond it."""
CHANNELS = 15
NORMAL_X = 3
"""First channel of the normals."""
SPOT = 12
"""The channel that is high at the clicks."""
BOX = 14
"""The channel that is 1 in a box."""
SPOT_PIXELS = 3.0
"""Standard deviation of the spot at a click, pixels."""
MAX_LOG_DEPTH = 2.0
"""Difference of logarithms of depth at which the input is clipped."""


def click_features(
    rgb: Array,
    normal: Array,
    depth: Array,
    clicks: Sequence[tuple[int, int]] = (),
    box: Box | None = None,
) -> Array:
    """The maps [CHANNELS, H, W] float32 that ClickNet reads of rgb [H, W, 3] sRGB in [0, 1], normal [H, W, 3] unit,
    depth [H, W] planar in any unit, 0 = no surface, and either clicks (column, row) on one object or a box around it.

    rgb - 0.5; normal; log depth over that of the clicks; surface; |rgb - clicks'| (3); cosine to the clicks' normals; a
    spot at the clicks; the distance to them, in units of the longer side; the box. Of several clicks, the one that a
    pixel is most like counts; of a box, the inner half of its width and height stands for a click in its middle.
    """
    height, width = depth.shape
    surface = depth > 0
    log = np.log(np.where(surface, depth, 1.0))
    rows, columns = np.indices(depth.shape)
    # --- Smallest differences so far: of several clicks the most alike counts ---
    level = np.full(depth.shape, np.inf)
    colour = np.full(rgb.shape, np.inf)
    cosine = np.full(depth.shape, -1.0)
    away = np.full(depth.shape, np.inf)
    inside = np.zeros(depth.shape)
    # --- Where the object is sampled: 3 x 3 pixels at each click, or the inner half of the box ---
    places = [(x, y, np.s_[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2]) for x, y in clicks]
    if box is not None:
        x0, y0, x1, y1 = box
        inside[y0:y1, x0:x1] = 1
        right = (x1 - x0) // 4
        down = (y1 - y0) // 4
        places = [
            ((x0 + x1) // 2, (y0 + y1) // 2, np.s_[y0 + down : y1 - down, x0 + right : x1 - right])
        ]
    for x, y, sample in places:
        # Depth: medians resist a sample that reaches over an edge.
        sample_log = np.median(log[sample][surface[sample]]) if surface[sample].any() else 0.0
        difference = np.clip(log - sample_log, -MAX_LOG_DEPTH, MAX_LOG_DEPTH)
        level = np.where(np.abs(difference) < np.abs(level), difference, level)
        # Colour.
        off = np.abs(rgb - np.median(rgb[sample].reshape(-1, 3), 0))
        colour = np.where((off.sum(-1) < colour.sum(-1))[..., None], off, colour)
        # Normal.
        facing = normal[sample].reshape(-1, 3).mean(0)
        cosine = np.maximum(cosine, normal @ (facing / max(float(np.linalg.norm(facing)), 1e-6)))
        # Distance in the picture.
        away = np.minimum(away, np.hypot(rows - y, columns - x))
    spot = np.exp(-((away / SPOT_PIXELS) ** 2) / 2) if box is None else np.zeros(depth.shape)
    # --- All channels, in the order of the constants above ---
    parts = [
        rgb - 0.5,
        normal,
        np.where(surface, level, MAX_LOG_DEPTH)[..., None],
        surface[..., None],
        colour,
        cosine[..., None],
        spot[..., None],
        (away / max(height, width))[..., None],
        inside[..., None],
    ]
    return np.ascontiguousarray(np.moveaxis(np.concatenate(parts, -1), -1, 0), np.float32)
