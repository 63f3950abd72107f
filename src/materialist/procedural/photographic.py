"""What lies between radiance and the pixels of a JPEG: camera, developing, compression; all numpy, one picture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from materialist.color import linear_to_srgb, luminance, srgb_to_linear
from materialist.io.samples import Sample
from materialist.types import Array


def photographic(image: Array, rng: np.random.Generator) -> Array:
    """The picture [H, W, 3] as an 8-bit photo of the scene would decode: float32 linear in [0, 1].

    White balance, exposure, lens blur, vignetting, sensor noise, a tone curve, saturation, 8 bits and JPEG, each at
    random and often weak, then back to linear by the sRGB curve: what a reader of photos hands to a predictor. `image`
    is linear Rec.709 radiance, >= 0, exposed so that white is 1; may exceed 1.
    """
    picture = np.nan_to_num(np.asarray(image, np.float32), posinf=1e4)
    picture = white_balanced(picture, rng) * np.float32(2 ** rng.normal(0, 0.2))
    picture = _vignetted(_blurred(np.minimum(picture, 8), rng), rng)
    picture = _noisy(picture, rng)
    return srgb_to_linear(_compressed(_developed(picture, rng), rng))


def as_photo(sample: Sample, rng: np.random.Generator) -> Sample:
    """The sample with its picture as `photographic` makes it, without its shading, which no longer fits."""
    return replace(sample, image=np.clip(photographic(sample.image, rng), 0, 1).astype(np.float32), shading=None)


def white_balanced(image: Array, rng: np.random.Generator) -> Array:
    """Gains that pull the picture a little towards grey, as cameras guess; now and then a cast of the light stays.

    Samples are balanced already.
    """
    lit = np.minimum(image, 1)
    grey = np.mean(lit**2, (0, 1)) ** 0.5 + 1e-4  # bright areas count more, as they do in cameras
    gains = (grey.mean() / grey) ** rng.uniform(0.0, 0.35)
    gains = np.clip(gains, 0.4, 2.5) * np.exp(rng.normal(0, 0.04, 3))
    if rng.random() < 0.35:  # a cast from amber to blue, as lamps and shade leave it, or a little to green
        warm, green = rng.normal(0, 0.16), rng.normal(0, 0.03)
        gains = gains * np.exp([warm, green, -warm])
    gains = gains / (gains * grey).sum() * grey.sum()
    return (image * gains).astype(np.float32)


def _blurred(image: Array, rng: np.random.Generator) -> Array:
    """Lens and scaling: none or a little softness; at times sharpened again."""
    import cv2

    if rng.random() < 0.3:
        return image
    image = cv2.GaussianBlur(image, (0, 0), rng.uniform(0.25, 0.9))
    if rng.random() < 0.3:
        soft = cv2.GaussianBlur(image, (0, 0), rng.uniform(0.7, 1.5))
        image = np.maximum(image + rng.uniform(0.1, 0.6) * (np.minimum(image, 1) - np.minimum(soft, 1)), 0)
    return image


def _vignetted(image: Array, rng: np.random.Generator) -> Array:
    """Darker towards the corners, by up to a third."""
    if rng.random() < 0.5:
        return image
    h, w = image.shape[:2]
    y, x = (np.arange(h) + 0.5) / h - 0.5, (np.arange(w) + 0.5) / w - 0.5
    r2 = 2 * (y[:, None] ** 2 + x[None] ** 2)  # 1 in the corners
    return image * (1 - rng.uniform(0, 0.33) * r2)[..., None].astype(np.float32)


def _noisy(image: Array, rng: np.random.Generator) -> Array:
    """Shot noise and read noise, a part of it in blotches as denoising cameras leave it."""
    if rng.random() < 0.25:
        return image
    import cv2

    shot, read = 10 ** rng.uniform(-4.8, -2.9), 10 ** rng.uniform(-4, -2.2)
    noise = rng.standard_normal(image.shape, np.float32)
    if rng.random() < 0.4:
        noise = cv2.GaussianBlur(noise, (0, 0), rng.uniform(0.4, 0.8)) * 1.6
    deviation = np.sqrt(shot * np.minimum(image, 1) + (read * 0.3) ** 2)
    return np.maximum(image + noise * deviation, 0).astype(np.float32)


def _developed(image: Array, rng: np.random.Generator) -> Array:
    """sRGB-encoded values in [0, 1]: plain, with a shoulder for highlights, with contrast and saturation."""
    kind = rng.random()
    if kind >= 0.35:
        knee = rng.uniform(0.5, 0.9)  # values above bend towards white instead of being cut
        bent = knee + (1 - knee) * (1 - np.exp(-(image - knee) / (1 - knee)))
        image = np.where(image > knee, bent, image)
    grey = luminance(image)[..., None]
    encoded = linear_to_srgb(np.maximum(grey + (image - grey) * rng.uniform(0.8, 1.3), 0))
    if kind >= 0.5:
        curve = encoded * encoded * (3 - 2 * encoded)
        encoded = encoded + rng.uniform(-0.25, 0.8) * (curve - encoded)
    if rng.random() < 0.4:
        encoded = encoded ** np.float32(np.exp(rng.normal(0, 0.12)))
    return np.clip(encoded, 0, 1)


def _compressed(encoded: Array, rng: np.random.Generator) -> Array:
    """8 bits and, mostly, JPEG; [H, W, 3] in [0, 1]."""
    import cv2

    pixels = (encoded * 255 + 0.5).astype(np.uint8)
    if rng.random() < 0.75:
        quality = int(rng.uniform(55, 98) if rng.random() < 0.5 else rng.uniform(85, 100))
        _, packed = cv2.imencode(".jpg", pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
        return np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR), np.float32)[..., ::-1] / 255
    return pixels.astype(np.float32) / 255
