"""Maps, errors and light as pictures for people: [H, W, 3] uint8, and their PNG and JPEG files."""

import io

import cv2
import numpy as np
from PIL import Image

from materialist.color import linear_to_srgb, luminance, srgb_levels
from materialist.types import Array, Prediction, Scene

ERROR_GAIN = 4
"""What errors are multiplied by to be seen."""


def to_bytes(values: Array) -> Array:
    """[...] in [0, 1] to uint8; what lies outside is clipped, NaN becomes 0."""
    return np.round(np.clip(np.nan_to_num(values), 0, 1) * 255).astype(np.uint8)


def grey(values: Array) -> Array:
    """A map [H, W] in [0, 1] as it is."""
    return np.repeat(to_bytes(values)[..., None], 3, -1)


def ramp(values: Array) -> Array:
    """A map [H, W] in [0, 1] by a perceptually even ramp from black to pale yellow."""
    return cv2.applyColorMap(to_bytes(values), cv2.COLORMAP_INFERNO)[..., ::-1]


def normal_colours(normal: Array) -> Array:
    """Usual colours of camera-frame normals [H, W, 3]; black where there is none."""
    return np.where(np.any(normal != 0, -1, keepdims=True), to_bytes(normal * 0.5 + 0.5), 0).astype(
        np.uint8
    )


def light(envmap: Array) -> Array:
    """An environment map [h, 2h, 3]: exposed so that its median is mid-grey, highlights rolled off (Reinhard)."""
    # A dark map with a bright sun has a median near 0: a tenth of the mean is the least.
    power = luminance(envmap)[..., None]
    key = max(float(np.median(power)), float(power.mean()) * 0.1, 1e-8)
    # Reinhard: x (1 + x / 16) / (1 + x), which puts 4 times mid-grey at white.
    exposed = power * (0.22 / key)
    shown = exposed * (1 + exposed / 16) / (1 + exposed)
    return srgb_levels(envmap * (shown / np.maximum(power, 1e-8)))


def depths(depth: Array) -> Array:
    """The inverse of planar depth [H, W]: near bright, far dark, black where there is no surface."""
    known = depth > 0
    if not known.any():
        return ramp(np.zeros_like(depth))
    inverse = np.where(known, 1 / np.where(known, depth, 1), 0)
    # Inverse depth, so that near things get most of the ramp; 0.1 to 1, as black means no surface.
    low, high = np.percentile(inverse[known], [1, 99])
    return ramp(
        np.where(known, 0.1 + 0.9 * np.clip((inverse - low) / max(high - low, 1e-9), 0, 1), 0)
    )


def error(photo: Array, rerender: Array) -> Array:
    """Mean absolute difference of two linear pictures [H, W, 3], sRGB-encoded, times ERROR_GAIN."""
    return ramp(ERROR_GAIN * np.abs(linear_to_srgb(photo) - linear_to_srgb(rerender)).mean(-1))


def factor(values: Array) -> Array:
    """Factors [H, W, 3] by their logarithm: 1 is mid-grey, 1/4 black, 4 white."""
    return to_bytes(0.5 + np.log2(np.maximum(values, 1e-6)) / 4)


def maps(of: Prediction | Scene) -> dict[str, Array]:
    """Each map of a prediction or a scene by its name."""
    m = of.materials
    geometry = {"normal": normal_colours(of.normal), "depth": depths(of.depth)}
    return {
        "albedo": srgb_levels(m.albedo),
        "roughness": grey(m.roughness),
        "metallic": grey(m.metallic),
        **geometry,
    }


def shrunk(picture: Array, longest: int) -> Array:
    """[H, W, ...] with at most `longest` pixels on the longer side: area averages."""
    scale = longest / max(picture.shape[:2])
    if scale >= 1:
        return picture
    height, width = (max(1, round(side * scale)) for side in picture.shape[:2])
    return np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA))


def encoded(pixels: Array, kind: str = "PNG", **settings: int) -> bytes:
    """A PNG or JPEG file of [H, W, 3] or [H, W] uint8; `settings` are Pillow's."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(buffer, kind, **settings)
    return buffer.getvalue()
