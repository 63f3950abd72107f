"""The texels of an equirectangular environment map, in the project's convention (docs/conventions.md)."""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.special import sph_harm_y

from materialist.camera import pixel_rays, project, unit
from materialist.color import luminance
from materialist.types import Array, Camera


@dataclass(frozen=True)
class DetailSettings:
    """How the photo's detail lies around the camera; by eye on 4 photos."""

    coarse: float = 0.08  # of the photo's longer side: what is broader is left to the fitted light
    floor: float = 0.05  # radiance added before ratios are taken
    max_log: float = 1.0  # of a ratio
    fade_in: float = 15.0  # degrees from the frame's edge to full detail
    full_elevation: float = 50.0  # degrees up to which detail is full
    last_elevation: float = 75.0  # degrees; there it ends, and so does the photo
    lamp: tuple[float, float] = (1.0, 4.0)  # radiance from which detail fades, and has none


DETAIL = DetailSettings()


def row_solid_angle(height: int) -> Array:
    """[h] solid angle of one texel of each row of an equirectangular [h, 2h] map, steradians."""
    # The zone between two polar angles has the solid angle 2 pi (cos a - cos b), shared by 2h
    # texels.
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    return (edges[:-1] - edges[1:]) * np.pi / height


def texel_directions(height: int, width: int, kind: type = np.float32) -> Array:
    """[h, w, 3] unit directions of texel centres, of that floating type, in the frame of the map."""
    # d(u, v) of the paper in our axes: the middle column looks along -Z, the top row along +Y.
    theta = (np.arange(height) + 0.5)[:, None] / height * np.pi
    phi = ((np.arange(width) + 0.5)[None, :] / width * 2 - 1) * np.pi
    x = np.sin(theta) * np.sin(phi)
    z = -np.sin(theta) * np.cos(phi)
    return np.stack(np.broadcast_arrays(x, np.cos(theta), z), -1).astype(kind)


def direction_of(azimuth: float, elevation: float) -> Array:
    """[3] unit direction, of degrees right of straight ahead of the camera and above the horizon."""
    az = np.radians(azimuth)
    el = np.radians(elevation)
    return np.array([np.cos(el) * np.sin(az), np.sin(el), -np.cos(el) * np.cos(az)])


def sh_basis(direction: Array, degree: int) -> Array:
    """Real orthonormal spherical harmonics about +Y of unit directions [..., 3]: [..., (degree + 1)^2] float32."""
    # Polar axis +Y: the cyclic permutation (z, x, y) of ours is a right-handed frame with +Y as
    # its z.
    x = direction[..., 2]
    y = direction[..., 0]
    z = direction[..., 1]
    theta = np.arccos(np.clip(z, -1, 1))
    phi = np.arctan2(y, x)
    columns = []
    for order in range(degree + 1):
        for m in range(-order, order + 1):
            # Real harmonics: sqrt(2) times the real part for m > 0, the imaginary part for m < 0.
            value = sph_harm_y(order, abs(m), theta, phi)
            part = value.real if m >= 0 else value.imag
            columns.append(part if m == 0 else np.sqrt(2) * part)
    return np.stack(columns, -1).astype(np.float32)


def environment(direction: Array, envmap: Array) -> Array:
    """[N, 3] bilinear lookup of an envmap [h, 2h, 3] in unit directions [N, 3]."""
    index, share = texels_around(direction, envmap.shape[:2])
    return (envmap.reshape(-1, 3)[index] * share[..., None]).sum(1)


def texels_around(direction: Array, shape: tuple[int, ...]) -> tuple[Array, Array]:
    """[N, 4] flat index and bilinear share of the four texels around unit directions [N, 3] in an [h, 2h] map."""
    h, w = shape
    x = (np.arctan2(direction[:, 0], -direction[:, 2]) / (2 * np.pi) + 0.5) * w - 0.5
    y = np.clip(np.arccos(np.clip(direction[:, 1], -1, 1)) / np.pi * h - 0.5, 0, h - 1)
    x0 = np.floor(x).astype(np.int64)
    y0 = np.floor(y).astype(np.int64)
    fx = x - x0
    fy = y - y0
    # The azimuth wraps around, the poles do not.
    xs = np.stack([x0 % w, (x0 + 1) % w], -1)
    ys = np.stack([y0, np.minimum(y0 + 1, h - 1)], -1)
    index = ys[:, [0, 0, 1, 1]] * w + xs[:, [0, 1, 0, 1]]
    share = np.stack([(1 - fy) * (1 - fx), (1 - fy) * fx, fy * (1 - fx), fy * fx], -1)
    return index, share


def bilinear(picture: Array, place: Array) -> Array:
    """[N, C] values of a picture [H, W, C] at pixel positions [N, 2] (x right, y down); the edge goes on outside."""
    height, width = picture.shape[:2]
    x = np.clip(np.nan_to_num(place[:, 0]) - 0.5, 0, width - 1)
    y = np.clip(np.nan_to_num(place[:, 1]) - 0.5, 0, height - 1)
    x0 = np.minimum(x.astype(int), max(width - 2, 0))
    y0 = np.minimum(y.astype(int), max(height - 2, 0))
    x1 = np.minimum(x0 + 1, width - 1)
    y1 = np.minimum(y0 + 1, height - 1)
    fx = (x - x0)[:, None]
    fy = (y - y0)[:, None]
    top = picture[y0, x0] * (1 - fx) + picture[y0, x1] * fx
    return top * (1 - fy) + (picture[y1, x0] * (1 - fx) + picture[y1, x1] * fx) * fy


def paste_visible_sky(
    envmap: Array, photo: Array, surface: Array, camera: Camera, *, white: float
) -> Array:
    """The map with what the photo itself shows of it: texels seen past every surface take the photo's radiance.

    That is the mean of the pixels in a texel, or the pixel at its centre where texels are smaller. Photo pixels from
    `white` on, which are clipped, only raise a texel. surface: [H, W] bool.
    """
    if surface.all():
        return envmap
    h, w = envmap.shape[:2]
    # --- Which texels look into the photo, past every surface ---
    place, ahead = project(texel_directions(h, w), camera)
    inside = (ahead > 1e-3) & ((place >= 0) & (place < [camera.width, camera.height])).all(-1)
    # Columns and rows of the photo; 0 where a texel looks past it.
    c, r = np.moveaxis(np.where(inside[..., None], place, 0).astype(int), -1, 0)
    seen = (inside & ~surface[r, c])[..., None]

    def raised(pixels: Array, texels: Array) -> Array:
        return np.where(pixels >= white, np.maximum(pixels, texels), pixels)

    # The pixels of the sky, each in the texel that it looks through.
    rays = unit(pixel_rays(camera)[~surface].astype(np.float64))
    column = ((np.arctan2(rays[:, 0], -rays[:, 2]) / (2 * np.pi) + 0.5) * w).astype(int) % w
    texel = (
        np.minimum((np.arccos(np.clip(rays[:, 1], -1, 1)) / np.pi * h).astype(int), h - 1) * w
        + column
    )
    count = np.bincount(texel, minlength=h * w).reshape(h, w, 1)
    pixels = raised(photo[~surface], envmap.reshape(-1, 3)[texel])
    total = np.stack([np.bincount(texel, pixels[:, k], h * w) for k in range(3)], -1).reshape(
        h, w, 3
    )
    # --- Texels with pixels in them take their mean, smaller ones the pixel at their centre ---
    value = np.where(count > 0, total / np.maximum(count, 1), raised(photo[r, c], envmap))
    return np.where(seen, value, envmap).astype(np.float32)


def with_mirrored_photo(envmap: Array, photo: Array, camera: Camera) -> Array:
    """The map with the photo's detail where the photo does not look, so that mirrors have something to show.

    A fitted light is smooth: diffuse surfaces tell no more. As in Khan et al. 2006 (image-based material editing) the
    photo stands for what is behind the camera: mirrored and stretched from the right edge of the frame round to the
    left one. Only the ratio of its luminance to its own broad luminance is taken: the light on diffuse surfaces
    stays, and no colour of an object that is edited is left in its mirrors.

    envmap: [h, 2h, 3] linear. photo: [H, W, 3] linear.
    """
    h, w = envmap.shape[:2]
    x, y, z = np.moveaxis(texel_directions(h, w), -1, 0)
    azimuth = np.degrees(np.arctan2(x, -z))
    elevation = np.degrees(np.arcsin(np.clip(y, -1, 1)))
    half_fov = camera.fov / 2
    # --- Where a texel looks into the mirrored photo: 0 at the frame's edge, 1 straight behind ---
    turned = (np.abs(azimuth) - half_fov) / (180 - half_fov)
    column = np.where(azimuth > 0, 1 - turned / 2, turned / 2)
    row = 0.5 - elevation / (2 * DETAIL.last_elevation)
    # --- The photo's luminance at the size at which the map shows it, over its broad luminance ---
    size = (
        max(2, round(w * (1 - camera.fov / 360))),
        max(2, round(h * DETAIL.last_elevation / 90)),
    )
    small = cv2.resize(np.ascontiguousarray(photo, np.float32), size, interpolation=cv2.INTER_AREA)
    log = np.log(np.maximum(luminance(small), 0) + DETAIL.floor)
    widths = [DETAIL.coarse * max(photo.shape) * n / m for n, m in zip(size[::-1], photo.shape)]
    fine = log - gaussian_filter(log, widths)
    ratio = np.exp(np.clip(fine, -DETAIL.max_log, DETAIL.max_log))
    ratio /= gaussian_filter(ratio, widths)
    # --- Laid on the map, fading out at the frame, at the poles and on lamps ---
    place = [
        np.clip(share * length - 0.5, 0, length - 1).astype(np.float32)
        for share, length in zip((column, row), size, strict=True)
    ]
    detail = cv2.remap(ratio, place[0], place[1], cv2.INTER_LINEAR)
    fade = np.clip((np.abs(azimuth) - half_fov) / DETAIL.fade_in, 0, 1)
    fade = fade * np.clip(
        (DETAIL.last_elevation - np.abs(elevation))
        / (DETAIL.last_elevation - DETAIL.full_elevation),
        0,
        1,
    )
    dim, bright = DETAIL.lamp
    fade = fade * np.clip((bright - envmap.max(-1)) / (bright - dim), 0, 1)
    return (envmap * (1 + fade * (detail - 1))[..., None]).astype(np.float32)
