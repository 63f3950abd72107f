"""The texels of an equirectangular environment map, in the project's convention (docs/conventions.md)."""

import numpy as np

from materialist.types import Array


def row_solid_angle(height: int) -> Array:
    """[h] solid angle of one texel of each row of an equirectangular [h, 2h] map, steradians."""
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    return (edges[:-1] - edges[1:]) * np.pi / height


def texel_directions(height: int, width: int) -> Array:
    """[h, w, 3] unit directions of texel centres, camera frame."""
    theta = np.pi * (np.arange(height) + 0.5)[:, None] / height
    phi = 2 * np.pi * ((np.arange(width) + 0.5)[None, :] / width - 0.5)
    return np.stack(
        np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.cos(theta), -np.sin(theta) * np.cos(phi)), -1
    ).astype(np.float32)


def sh_basis(direction: Array, degree: int) -> Array:
    """Real orthonormal spherical harmonics about +Y of unit directions [..., 3]: [..., (degree + 1)^2] float32."""
    from scipy.special import sph_harm_y

    x, y, z = direction[..., 2], direction[..., 0], direction[..., 1]
    theta, phi = np.arccos(np.clip(z, -1, 1)), np.arctan2(y, x)
    columns = []
    for order in range(degree + 1):
        for m in range(-order, order + 1):
            value = sph_harm_y(order, abs(m), theta, phi)
            part = value.real if m >= 0 else value.imag
            columns.append(part if m == 0 else np.sqrt(2) * part)
    return np.stack(columns, -1).astype(np.float32)


def environment(direction: Array, envmap: Array) -> Array:
    """[N, 3] bilinear lookup of an envmap [h, 2h, 3] in unit directions [N, 3]."""
    height, width = envmap.shape[:2]
    x = (np.arctan2(direction[:, 0], -direction[:, 2]) / (2 * np.pi) + 0.5) * width
    y = np.arccos(np.clip(direction[:, 1], -1, 1)) / np.pi * height
    wrapped = np.concatenate([envmap[:, -1:], envmap, envmap[:, :1]], 1)
    return bilinear(wrapped, np.stack([x + 1, y], -1))


def bilinear(picture: Array, place: Array) -> Array:
    """[N, C] values of a picture [H, W, C] at pixel positions [N, 2] (x right, y down); the edge goes on outside."""
    height, width = picture.shape[:2]
    x = np.clip(np.nan_to_num(place[:, 0]) - 0.5, 0, width - 1)
    y = np.clip(np.nan_to_num(place[:, 1]) - 0.5, 0, height - 1)
    x0, y0 = np.minimum(x.astype(int), max(width - 2, 0)), np.minimum(y.astype(int), max(height - 2, 0))
    x1, y1 = np.minimum(x0 + 1, width - 1), np.minimum(y0 + 1, height - 1)
    fx, fy = (x - x0)[:, None], (y - y0)[:, None]
    top = picture[y0, x0] * (1 - fx) + picture[y0, x1] * fx
    return top * (1 - fy) + (picture[y1, x0] * (1 - fx) + picture[y1, x1] * fx) * fy
