"""What lies between radiance and the pixels of a JPEG: camera, developing, compression; batches of tensors."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from materialist.color import LUMINANCE
from materialist.predict.bundled.network import srgb
from materialist.types import Array
from materialist_lab.data.samples import Sample


def photographic(image: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """(photo, gains) of one picture [H, W, 3] of any size, as `developed`; [H, W, 3] and [3] float32."""
    random = torch.Generator().manual_seed(int(rng.integers(2**63)))
    photo, gains = developed(
        torch.tensor(image, dtype=torch.float32).permute(2, 0, 1)[None], random
    )
    return np.ascontiguousarray(photo[0].permute(1, 2, 0).numpy()), gains.view(3).numpy()


def as_photo(sample: Sample, rng: np.random.Generator) -> Sample:
    """The sample with its picture as a photo, its light in the photo's units, and no shading, which no longer fits."""
    image, gains = photographic(sample.image, rng)
    light = None if sample.light is None else sample.light * np.append(gains, np.float32(1))
    return replace(sample, image=image, shading=None, light=light)


def developed(image: Tensor, random: torch.Generator) -> tuple[Tensor, Tensor]:
    """(photos, gains): the pictures [B, 3, H, W] as 8-bit photos would decode, linear in [0, 1], and white balance and
    exposure [B, 3, 1, 1] that they got.

    White balance, exposure, blur, vignetting, noise, tone curve, saturation, 8 bits and
    JPEG, each at random and often weak. `image` is linear Rec.709 radiance, exposed so that white is 1.
    """
    draw = _Draw(len(image), image.device, random)
    # --- Light on the sensor: exposure, optics ---
    picture = image.nan_to_num(posinf=1e4).clamp(min=0)
    gains = _gains(picture, draw) * torch.exp2(draw.normal() * 0.2)
    picture = _vignetted(_blurred((picture * gains).clamp(max=8), draw), draw)
    # --- Development: noise, tone curve, JPEG ---
    encoded = _compressed(_tone(_noisy(picture, draw), draw), draw)
    # --- Decoded as every photo is: the inverse of the sRGB curve ---
    linear = torch.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return linear, gains


class _Draw:
    """Random numbers of pictures, [B, channels, 1, 1] or as large as pictures."""

    def __init__(self, count: int, device: torch.device, random: torch.Generator):
        self.count = count
        self.device = device
        self.random = random

    def uniform(self, low: float = 0.0, high: float = 1.0, channels: int = 1) -> Tensor:
        shape = self.count, channels, 1, 1
        return low + (high - low) * torch.rand(shape, generator=self.random, device=self.device)

    def normal(self, channels: int = 1, height: int = 1, width: int = 1) -> Tensor:
        shape = self.count, channels, height, width
        return torch.randn(shape, generator=self.random, device=self.device)

    def chance(self, probability: float) -> Tensor:
        return self.uniform() < probability


def _gains(image: Tensor, draw: _Draw) -> Tensor:
    # White balance by Shades of Grey (Minkowski norm 2), applied in part.
    grey = image.clamp(max=1).square().mean((2, 3), keepdim=True).sqrt() + 1e-4
    gains = (grey.mean(1, keepdim=True) / grey) ** draw.uniform(0, 0.35)
    gains = gains.clamp(0.4, 2.5) * torch.exp(draw.normal(3) * 0.04)
    # A cast along the black-body line and a little towards green.
    warm = draw.normal() * 0.16
    green = draw.normal() * 0.03
    cast = torch.exp(torch.cat([warm, green, -warm], 1))
    gains = torch.where(draw.chance(0.35), gains * cast, gains)
    # Exposure stays: the gains keep the mean level.
    return gains * grey.sum(1, keepdim=True) / (gains * grey).sum(1, keepdim=True)


def _smoothed(image: Tensor, sigma: Tensor, radius: int = 4) -> Tensor:
    """Gaussian blur by sigma [B, 1, 1, 1] pixels."""
    batch, channels, height, width = image.shape
    place = torch.arange(-radius, radius + 1, device=image.device)
    kernel = torch.exp(-place.square() / (2 * sigma.view(-1, 1) ** 2))
    kernel = (kernel / kernel.sum(1, keepdim=True)).repeat_interleave(channels, 0)  # [B C, n]
    # Separable: rows, then columns; one group a picture and channel.
    flat = F.pad(image.reshape(1, -1, height, width), (radius,) * 4, mode="reflect")
    flat = F.conv2d(flat, kernel[:, None, None], groups=batch * channels)
    return F.conv2d(flat, kernel[:, None, :, None], groups=batch * channels).view_as(image)


def _blurred(image: Tensor, draw: _Draw) -> Tensor:
    # Unsharp masking after the blur of the lens, as cameras do.
    soft = _smoothed(image, draw.uniform(0.25, 0.9))
    softer = _smoothed(soft.clamp(max=1), draw.uniform(0.7, 1.5))
    sharp = (soft + draw.uniform(0.1, 0.6) * (soft.clamp(max=1) - softer)).clamp(min=0)
    changed = torch.where(draw.chance(0.3), sharp, soft)
    return torch.where(draw.chance(0.3), image, changed)


def _vignetted(image: Tensor, draw: _Draw) -> Tensor:
    height, width = image.shape[2:]
    y = (torch.arange(height, device=image.device) + 0.5) / height - 0.5
    x = (torch.arange(width, device=image.device) + 0.5) / width - 0.5
    # 1 at the corners of a square picture.
    r2 = 2 * (y[:, None] ** 2 + x[None] ** 2)
    amount = torch.where(draw.chance(0.5), torch.zeros_like(draw.uniform()), draw.uniform(0, 0.33))
    return image * (1 - amount * r2)


def _noisy(image: Tensor, draw: _Draw) -> Tensor:
    # Variance of photons, proportional to the signal, and of the sensor's reading.
    shot = 10 ** draw.uniform(-4.8, -2.9)
    read = 10 ** draw.uniform(-4, -2.2)
    noise = draw.normal(*image.shape[1:])
    # Noise as denoisers leave it: coarse.
    blotched = _smoothed(noise, draw.uniform(0.4, 0.8), 2) * 1.6
    noise = torch.where(draw.chance(0.4), blotched, noise)
    deviation = (shot * image.clamp(max=1) + (read * 0.3) ** 2).sqrt()
    return torch.where(draw.chance(0.25), image, (image + noise * deviation).clamp(min=0))


def _tone(image: Tensor, draw: _Draw) -> Tensor:
    """sRGB-encoded values in [0, 1]: plain, with a shoulder for highlights, with contrast and saturation."""
    kind = draw.uniform()
    # A shoulder bends highlights over the knee towards 1.
    knee = draw.uniform(0.5, 0.9)
    bent = knee + (1 - knee) * (1 - torch.exp(-(image - knee) / (1 - knee)))
    image = torch.where((kind >= 0.35) & (image > knee), bent, image)
    # Saturation about the grey of each pixel.
    weight = image.new_tensor(LUMINANCE).view(1, 3, 1, 1)
    grey = (image * weight).sum(1, keepdim=True)
    encoded = srgb(grey + (image - grey) * draw.uniform(0.8, 1.3))
    # Contrast: part of the way to a smooth step.
    curve = encoded * encoded * (3 - 2 * encoded)
    encoded = torch.where(
        kind >= 0.5, encoded + draw.uniform(-0.25, 0.8) * (curve - encoded), encoded
    )
    gamma = torch.exp(draw.normal() * 0.12)
    return torch.where(draw.chance(0.4), encoded.clamp(min=1e-6) ** gamma, encoded).clamp(0, 1)


def _compressed(encoded: Tensor, draw: _Draw) -> Tensor:
    """8 bits and, mostly, JPEG with chroma at half resolution."""
    pixels = (encoded * 255).round().to(torch.uint8).permute(0, 2, 3, 1).cpu().numpy()
    quality = (
        torch.where(draw.chance(0.5), draw.uniform(55, 98), draw.uniform(85, 100))
        .flatten()
        .tolist()
    )
    chosen = draw.chance(0.75).flatten().tolist()
    with ThreadPoolExecutor() as pool:
        decoded = list(
            pool.map(lambda p, q, c: _jpeg(p, int(q)) if c else p, pixels, quality, chosen)
        )
    return (
        torch.from_numpy(np.stack(decoded)).to(encoded.device).permute(0, 3, 1, 2).contiguous()
        / 255
    )


def _jpeg(pixels: Array, quality: int) -> Array:
    """RGB levels [H, W, 3] uint8 as a JPEG of that quality shows them."""
    _, packed = cv2.imencode(".jpg", pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR))[..., ::-1]
