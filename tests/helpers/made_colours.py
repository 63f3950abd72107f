"""A picture of four colours, in spaces whose matrices are published, and what a reader should make of it."""

import numpy as np

from materialist.color import linear_to_srgb

COLOURS = np.array(
    [[0.578, 0.045, 0.021], [0.021, 0.352, 0.045], [0.032, 0.061, 0.456], [0.216, 0.216, 0.216]]
)
"""Top left, top right, bottom left, bottom right: linear Rec.709."""
TO_2020 = np.array([[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]])
"""Of ITU-R BT.2087."""
TO_P3 = np.array([[0.8225, 0.1774, 0.0], [0.0332, 0.9669, 0.0], [0.0171, 0.0724, 0.9108]])
TO_ADOBE = np.array([[0.7152, 0.2848, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0412, 0.9588]])
TO_ACESCG = np.array(
    [[0.613097, 0.339523, 0.047379], [0.070194, 0.916354, 0.013452], [0.020616, 0.109570, 0.869815]]
)
SRGB_TO_XYZ = np.array(
    [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
)
D65_TO_E = np.array(
    [
        [1.0502616, 0.0270757, -0.0232523],
        [0.0390650, 0.9729502, -0.0092579],
        [-0.0024047, 0.0026446, 0.9180873],
    ]
)
"""Bradford, as Lindbloom has it."""
TO_XYZ_E = D65_TO_E @ SRGB_TO_XYZ


def quadrants(matrix=None, shape=(64, 96)):
    """[H, W, 3] float64 linear, times a colour matrix."""
    height, width = shape
    picture = np.empty((height, width, 3))
    for index, colour in enumerate(COLOURS if matrix is None else COLOURS @ np.transpose(matrix)):
        rows = slice(0, height // 2) if index < 2 else slice(height // 2, height)
        columns = slice(0, width // 2) if index % 2 == 0 else slice(width // 2, width)
        picture[rows, columns] = colour
    return picture


def levels(encoded, dtype=np.uint8):
    return np.round(np.clip(encoded, 0, 1) * np.iinfo(dtype).max).astype(dtype)


def srgb(linear):
    return linear_to_srgb(linear).astype(np.float64)


def pq(linear, white=203.0):
    """SMPTE ST 2084 of a linear picture."""
    power = np.clip(linear * white / 10000, 0, 1) ** (2610 / 16384)
    return ((3424 / 4096 + 2413 / 128 * power) / (1 + 2392 / 128 * power)) ** (2523 / 32)


def hlg(linear):
    """ARIB STD-B67 of a linear picture, whose white is 75 % of the signal."""
    a = 0.17883277
    b = 0.28466892
    c = 0.55991073
    scene = linear * 0.2649625
    return np.where(
        scene <= 1 / 12, np.sqrt(3 * scene), a * np.log(np.maximum(12 * scene - b, 1e-9)) + c
    )


def medians(photo):
    """[4, 3] median linear colours of the quadrants of a Photo, in the unit of its file."""
    picture = photo.original * 2.0**-photo.stops
    height, width = picture.shape[:2]
    return np.array(
        [
            np.median(picture[y : y + height // 4, x : x + width // 4].reshape(-1, 3), 0)
            for y in (height // 8, height * 5 // 8)
            for x in (width // 8, width * 5 // 8)
        ]
    )


def assert_right(photo, tolerance=0.015):
    np.testing.assert_allclose(medians(photo), COLOURS, atol=tolerance)
