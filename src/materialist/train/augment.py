"""Samples changed at random, so that few pictures teach as many: crops, flips, new colours, exposure.

Every change keeps labels and picture true to each other: a crop keeps its camera rays, a flip mirrors normals, and a
new colour of a surface changes the picture through its stored shading.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from materialist.camera import rays_at
from materialist.io.samples import Sample
from materialist.types import Array

LEAST_CROP = 0.55
"""Smallest crop, as a part of the picture's shorter side."""
BRIGHTEST = 0.92
"""Albedo that recolouring does not exceed."""


def augment(sample: Sample, size: int, rng: np.random.Generator) -> Sample:
    """A random variant of size x size pixels: crop, flip, colours of surfaces, exposure. Not yet a photo."""
    if rng.random() > 0.75:
        sample = replace(sample, shading=None)
    sample = crop(sample, size, rng)
    if rng.random() < 0.5:
        sample = flip(sample)
    if sample.shading is not None:
        sample = recolour(sample, rng)
    # A narrow spread: the mean brightness of a photo carries what little is known of absolute albedo.
    return replace(sample, image=sample.image * np.float32(2 ** rng.normal(0, 0.35)), shading=None)


def crop(sample: Sample, size: int, rng: np.random.Generator) -> Sample:
    """A random square of the picture, at least LEAST_CROP of its shorter side, as size x size pixels."""
    height, width = sample.depth.shape
    shorter = min(height, width)
    side = round(shorter * (1 if rng.random() < 0.3 else rng.uniform(LEAST_CROP, 1)))
    top, left = int(rng.integers(0, height - side + 1)), int(rng.integers(0, width - side + 1))
    return resized(window(sample, top, left, side, side), size, size)


def window(sample: Sample, top: int, left: int, height: int, width: int) -> Sample:
    """The given rectangle of the sample; each pixel keeps its ray."""
    rows, columns = slice(top, top + height), slice(left, left + width)
    return _each(sample, lambda array, _: np.ascontiguousarray(array[rows, columns]))


def resized(sample: Sample, height: int, width: int) -> Sample:
    """The sample at height x width pixels: colours are averaged, geometry is taken from the nearest pixel.

    Albedo, roughness and metallic are averaged over what has a surface: the sky has none to mix in.
    """
    if sample.depth.shape == (height, width):
        return sample
    smooth = cv2.INTER_AREA if height < sample.depth.shape[0] else cv2.INTER_LINEAR
    scaled = lambda array, method: np.asarray(cv2.resize(array, (width, height), interpolation=method))  # noqa: E731
    share = scaled(sample.mask, smooth)

    def work(array: Array, name: str) -> Array:
        if name == "rays":
            return rays_at(array, height, width)
        if name in ("normal", "depth", "mask"):
            return scaled(array, cv2.INTER_NEAREST_EXACT)
        if name in ("albedo", "roughness", "metallic"):
            deep = (..., None) if array.ndim == 3 else ...
            return scaled(array * sample.mask[deep], smooth) / np.maximum(share, 1e-6)[deep]
        return scaled(array, smooth)

    return _each(sample, work)


def flip(sample: Sample, axis: int = 1) -> Sample:
    """The mirror image along an axis: 1 reverses columns and negates x of normals and rays, 0 rows and y."""
    mirror = np.array([-1, 1, 1] if axis == 1 else [1, -1, 1], np.float32)
    mirrored = _each(sample, lambda array, _: np.ascontiguousarray(np.flip(array, axis)))
    return replace(mirrored, normal=mirrored.normal * mirror, rays=mirrored.rays * mirror[:2])


def recolour(sample: Sample, rng: np.random.Generator) -> Sample:
    """Surfaces of other colours under the same light: image = albedo (1 - metallic) shading + rest.

    Pixels are grouped by the likeness of their albedo, and every group is multiplied by one random colour or brought to
    a random one. Metals keep theirs, since it also colours their reflections, which `rest` holds.
    """
    assert sample.shading is not None
    group, count = _groups(sample.albedo, rng)
    gains = np.ones((count, 3), np.float32)
    for k in range(count):
        here = sample.albedo[::3, ::3][(group == k)[::3, ::3] & (sample.mask[::3, ::3] > 0)]
        if len(here) and rng.random() < 0.8:
            gains[k] = _gain(here, rng)
    dielectric = (sample.mask * (1 - sample.metallic))[..., None]
    albedo = np.minimum(sample.albedo * (1 + (gains[group] - 1) * dielectric), 1)
    change = (albedo - sample.albedo) * dielectric * sample.shading
    return replace(sample, albedo=albedo, image=np.maximum(sample.image + change, 0))


def _groups(albedo: Array, rng: np.random.Generator) -> tuple[Array, int]:
    """[H, W] number of the random pixel, of 1 to 6, whose albedo is most like each pixel's, and how many there are."""
    height, width = albedo.shape[:2]
    count = int(rng.integers(1, 7))
    places = rng.integers(0, height, count), rng.integers(0, width, count)
    even = np.sqrt(albedo)  # equal steps look about equally large
    # |a - c|^2 = |a|^2 - 2 a c + |c|^2, and |a|^2 is the same for all c.
    centres = even[places]  # [count, 3]
    distance = (centres**2).sum(-1) - 2 * even @ centres.T  # [H, W, count]
    return distance.argmin(-1), count


def _gain(albedo: Array, rng: np.random.Generator) -> Array:
    """[3] factor for a group of albedos [n, 3], so that none of it (but outliers) exceeds BRIGHTEST."""
    mean = np.maximum(albedo.mean(0), 0.01)
    if rng.random() < 0.5:
        # A colour of its own: any brightness, mostly muted, as paint and cloth are.
        hue = rng.dirichlet(np.ones(3)) * 3
        colour = rng.uniform(0.03, 0.9) * (1 + (hue - 1) * rng.beta(1, 2.5))
        gain = colour / mean
    else:
        gain = np.exp(rng.normal(0, 0.3) + rng.normal(0, 0.15, 3))
    bright = np.percentile(albedo, 98, axis=0) * gain
    return (gain * min(1.0, BRIGHTEST / max(float(bright.max()), 1e-6))).astype(np.float32)


def _each(sample: Sample, work) -> Sample:
    """The sample with `work(array, name)` applied to every array it has."""
    arrays = {name: getattr(sample, name) for name in sample.__dataclass_fields__}
    return replace(sample, **{name: work(array, name) for name, array in arrays.items() if array is not None})
