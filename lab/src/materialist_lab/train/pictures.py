"""Pictures of the bundled network as they are stored, and how a whole batch of them is changed at random.

The latter on [B, C, H, W] tensors of the training's device: a card that waits for processors learns nothing.
"""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from materialist.types import Array
from materialist_lab.data.samples import LIGHT_ROWS, Sample
from materialist_lab.procedural.photographic import developed
from materialist_lab.train.task import Batch

_PLANES = ("image", "shading", "albedo", "roughness", "metallic", "normal", "depth", "mask")


@dataclass(frozen=True)
class AugmentSettings:
    """How much pictures are changed; all by eye."""

    least_crop: float = 0.55  # smallest crop, as a part of the picture's shorter side
    whole: float = 0.3  # share of batches' pictures that are not cropped
    recoloured: float = 0.75  # share of pictures whose surfaces get other colours
    repainted: float = 0.8  # share of the groups of colours in these that change
    groups: int = 6  # most groups of colours in a picture
    brightest: float = 0.92  # albedo that recolouring does not exceed
    exposure: float = 0.35  # deviation, in stops


def stored(sample: Sample) -> dict[str, Array]:
    """A sample as float16: [C, H, W], light [4, h, 2h], and reach [], the largest x of the camera rays at z = -1.

    A light that is not known is 0, a shading NaN.
    """
    light = np.zeros((LIGHT_ROWS, 2 * LIGHT_ROWS, 4)) if sample.light is None else sample.light
    shading = np.full_like(sample.image, np.nan) if sample.shading is None else sample.shading
    arrays = {name: getattr(sample, name) for name in _PLANES} | {
        "light": light,
        "shading": shading,
    }
    arrays = {name: np.moveaxis(a, -1, 0) if a.ndim == 3 else a[None] for name, a in arrays.items()}
    width = sample.depth.shape[1]
    arrays["reach"] = -sample.rays[0, 0, 0] * width / (width - 1)
    return {name: np.clip(a, -6e4, 6e4).astype(np.float16) for name, a in arrays.items()}


def varied(batch: Batch, side: int, s: AugmentSettings, random: torch.Generator) -> Batch:
    """A batch of `stored` samples cropped, recoloured and developed: maps and rays [B, C, side, side], and light."""
    maps = cropped({name: values.float() for name, values in batch.items()}, side, s, random)
    maps |= recolour(maps, s, random)
    image = maps["image"]
    light = maps["light"]
    exposure = torch.exp2(
        torch.randn(len(image), 1, 1, 1, generator=random, device=image.device) * s.exposure
    )
    maps["image"], gains = developed(image * exposure, random)
    maps["light"] = torch.cat([light[:, :3] * (exposure * gains), light[:, 3:]], 1)
    del maps["shading"]
    return maps


def cropped(
    maps: dict[str, Tensor], side: int, s: AugmentSettings, random: torch.Generator
) -> dict[str, Tensor]:
    """Random squares of the pictures, half of them mirrored, as side x side pixels, with rays in place of `reach`."""
    (batch, _, height, width), device = maps["depth"].shape, maps["depth"].device
    u = torch.rand(5, batch, generator=random, device=device)
    size = torch.where(u[0] < s.whole, 1.0, s.least_crop + (1 - s.least_crop) * u[4]) * min(
        height, width
    )
    left = u[1] * (width - size)
    top = u[2] * (height - size)
    mirror = torch.where(u[3] < 0.5, -1.0, 1.0)
    none = torch.zeros_like(mirror)
    across = torch.stack([mirror * size / width, none, (2 * left + size) / width - 1], -1)
    down = torch.stack([none, size / height, (2 * top + size) / height - 1], -1)
    place = torch.stack([across, down], 1)  # of a square's corners in [-1, 1], in the picture

    def sampled(values: Tensor, edge: int, mode: str) -> Tensor:
        grid = F.affine_grid(place, [batch, 1, edge, edge], align_corners=False)
        return F.grid_sample(values, grid, mode, "border", align_corners=False)

    surface = maps["mask"]
    colours = torch.cat([maps[n] * surface for n in ("albedo", "roughness", "metallic")], 1)
    smooth = torch.cat([maps["image"], maps["shading"], colours, surface], 1)
    finer = 2 if side < height else 1
    smooth = F.avg_pool2d(sampled(smooth, finer * side, "bilinear"), finer)
    image, shading, albedo, roughness, metallic, share = smooth.split([3, 3, 3, 1, 1, 1], 1)
    share = share.clamp(min=1e-6)
    out = {name: sampled(maps[name], side, "nearest") for name in ("normal", "depth", "mask")}
    out |= {"image": image, "shading": shading}
    out |= {"albedo": albedo / share, "roughness": roughness / share, "metallic": metallic / share}
    turn = torch.stack([mirror, torch.ones_like(mirror), torch.ones_like(mirror)], 1).view(
        -1, 3, 1, 1
    )
    normal = out["normal"] / out["normal"].norm(dim=1, keepdim=True).clamp(min=1)
    out["normal"] = normal * turn * out["mask"]
    out["depth"] = out["depth"] * out["mask"]
    centres = F.affine_grid(place, [batch, 1, side, side], align_corners=False) * maps[
        "reach"
    ].view(-1, 1, 1, 1)
    out["rays"] = torch.stack(
        [centres[..., 0] * mirror.view(-1, 1, 1), -centres[..., 1] * height / width], 1
    )
    out["light"] = torch.where(mirror.view(-1, 1, 1, 1) < 0, maps["light"].flip(-1), maps["light"])
    return out


def recolour(
    maps: dict[str, Tensor], s: AugmentSettings, random: torch.Generator
) -> dict[str, Tensor]:
    """Image and albedo of surfaces of other colours under the same light: image = albedo (1 - metallic) shading + rest.

    Pixels are grouped by the likeness of their albedo, and every group is multiplied by one random colour or brought to
    a random one. Metals keep theirs, since it also colours their reflections, which the rest holds.
    """
    albedo = maps["albedo"]
    mask = maps["mask"]
    batch, _, height, width = albedo.shape
    device = albedo.device
    k = s.groups

    def rand(*shape):
        return torch.rand(*shape, generator=random, device=device)

    def normal(*shape):
        return torch.randn(*shape, generator=random, device=device)

    even = albedo.clamp(min=0).sqrt().flatten(2)  # equal steps look about equally large
    place = (rand(batch, k) * (height * width)).long().clamp(max=height * width - 1)
    centre = even.gather(2, place[:, None].expand(-1, 3, -1))  # [B, 3, k]
    distance = centre.square().sum(1)[..., None] - 2 * centre.transpose(1, 2) @ even  # [B, k, n]
    used = torch.arange(k, device=device) < 1 + (rand(batch, 1) * k).long()
    group = torch.where(used[..., None], distance, torch.inf).argmin(1)  # [B, n]
    member = F.one_hot(group, k).float() * mask.flatten(2).transpose(1, 2)  # [B, n, k]
    count = member.sum(1).clamp(min=1)[:, None]
    mean = (albedo.flatten(2) @ member / count).clamp(min=0.01)  # [B, 3, k]
    spread = (albedo.flatten(2).square() @ member / count - mean.square()).clamp(min=0).sqrt()
    hue = -rand(batch, 3, k).clamp(min=1e-6).log()
    hue = 3 * hue / hue.sum(1, keepdim=True)
    # A colour of its own: any brightness, mostly muted, as paint and cloth are. 1 - u^(1/2.5) is beta(1, 2.5).
    paint = (
        (0.03 + 0.87 * rand(batch, 1, k))
        * (1 + (hue - 1) * (1 - rand(batch, 1, k) ** (1 / 2.5)))
        / mean
    )
    tint = torch.exp(normal(batch, 1, k) * 0.3 + normal(batch, 3, k) * 0.15)
    gain = torch.where(rand(batch, 1, k) < 0.5, paint, tint)
    bright = ((mean + 2 * spread) * gain).amax(1, keepdim=True)
    gain = gain * (s.brightest / bright.clamp(min=1e-6)).clamp(max=1)
    known = maps["shading"].isfinite().flatten(1).all(1).view(-1, 1, 1)
    kept = ~known | (rand(batch, 1, k) >= s.repainted) | (rand(batch, 1, 1) >= s.recoloured)
    gain = torch.where(kept, 1.0, gain)
    factor = gain.gather(2, group[:, None].expand(-1, 3, -1)).view_as(albedo)
    dielectric = mask * (1 - maps["metallic"])
    new = (albedo * (1 + (factor - 1) * dielectric)).clamp(max=1)
    image = (maps["image"] + (new - albedo) * dielectric * maps["shading"].nan_to_num()).clamp(
        min=0
    )
    return {"image": image, "albedo": new}
