"""Batches of the bundled network, made where it is trained: pictures in memory, changed at random by whole batches.

All on [B, C, H, W] tensors of the training's device: a card that waits for processors learns nothing.
"""

import logging
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F
from torch.utils.data import DataLoader

from materialist.errors import InputError
from materialist.io.samples import LIGHT_ROWS, Source
from materialist.procedural.photographic import developed
from materialist.train.maps import Pictures
from materialist.train.stream import readable
from materialist.train.task import Batch

_PLANES = ("image", "shading", "albedo", "roughness", "metallic", "normal", "depth", "mask")


@dataclass(frozen=True)
class AugmentSettings:
    """How much pictures are changed; all by eye."""

    capacity: int = 12000  # most pictures in a card's memory, 2 MB each at 256 pixels
    refill: int = 256  # new samples from which on a card reads them
    readers: int = 6  # processes that read them
    least_crop: float = 0.55  # smallest crop, as a part of the picture's shorter side
    whole: float = 0.3  # share of batches' pictures that are not cropped
    recoloured: float = 0.75  # share of pictures whose surfaces get other colours
    repainted: float = 0.8  # share of the groups of colours in these that change
    groups: int = 6  # most groups of colours in a picture
    brightest: float = 0.92  # albedo that recolouring does not exceed
    exposure: float = 0.35  # deviation, in stops


class DevicePictures(Pictures):
    """The samples of a set for training on one device: kept in a card's memory, or read when they are drawn.

    All have the size of the first.
    """

    def __init__(self, source: Source, device: torch.device, settings: AugmentSettings | None = None):
        self.settings, self.device = settings or AugmentSettings(), device
        self._pool: dict[str, Tensor] = {}
        self._kept, self._known = 0, set[int]()
        self.size: tuple[int, ...] = ()
        super().__init__(source, lambda sample, *_: sample)
        if device.type == "cuda":
            row, shape = self._read(0), (self.settings.capacity,)
            self._pool = {n: torch.empty((*shape, *t.shape), dtype=t.dtype, device=device) for n, t in row.items()}
            self._fill(self._places)

    def refresh(self) -> None:
        """Look for new samples; a card takes many at once."""
        super().refresh()
        if self._pool:
            new = [p for p in self._places if self.source.number(p) not in self._known]
            if len(new) >= self.settings.refill:
                self._fill(new)

    def _fill(self, places: Sequence[int]) -> None:
        """Put samples into the pool, while there is room."""
        room = self.settings.capacity - self._kept
        workers = min(self.settings.readers, os.cpu_count() or 1)
        chosen: Any = places[:room]
        read: Any = self._read_or_message
        for row in DataLoader(chosen, batch_size=None, collate_fn=read, num_workers=workers):
            if isinstance(row, str):
                logging.getLogger(__name__).warning("%s It is left out.", row)
                continue
            for name, tensor in row.items():
                self._pool[name][self._kept] = tensor.to(self.device)
            self._kept += 1
        self._known.update(self.source.number(p) for p in places)

    @torch.no_grad()
    def batches(self, *, side: int, batch: int, seed: Sequence[int], skip: int) -> Iterator[Batch]:
        """As many random batches of side x side pixels as the set has; arrays as `maps.arrays_of`, and light."""
        random = torch.Generator(self.device)
        for k in range(skip, max(1, len(self) // batch)):
            random.manual_seed(int(np.random.SeedSequence((*seed, k)).generate_state(1)[0]))
            yield self.drawn(side, batch, random)

    def drawn(self, side: int, batch: int, random: torch.Generator) -> dict[str, Tensor]:
        """One random batch."""
        count = self._kept if self._pool else len(self)
        chosen = torch.randint(count, (batch,), generator=random, device=self.device)
        if self._pool:
            found = {name: plane[chosen] for name, plane in self._pool.items()}
        else:
            another = lambda: int(torch.randint(count, (), generator=random, device=self.device))  # noqa: E731
            rows = [readable(lambda k: self._read(self._places[k]), k, another) for k in chosen.tolist()]
            found = {name: torch.stack([row[name] for row in rows]) for name in rows[0]}
        maps = {name: plane.float() for name, plane in found.items()}
        reach, light = maps.pop("reach"), maps.pop("light")
        maps, light = self._cropped(maps, light, reach, side, random)
        maps |= recolour(maps, self.settings, random)
        exposure = torch.exp2(
            torch.randn(batch, 1, 1, 1, generator=random, device=self.device) * self.settings.exposure
        )
        maps["image"], gains = developed(maps["image"] * exposure, random)
        maps["light"] = torch.cat([light[:, :3] * (exposure * gains), light[:, 3:]], 1)
        del maps["shading"]
        return maps

    def _read_or_message(self, place: int) -> dict[str, Tensor] | str:
        """A sample as `_read` has it, or the message why it cannot be read."""
        try:
            return self._read(place)
        except InputError as error:
            return str(error)

    def _read(self, place: int) -> dict[str, Tensor]:
        """A sample as float16: [C, H, W], light [4, h, 2h], and reach [], the largest x of the camera rays at z = -1.

        Raises InputError where it cannot be read or has another size.
        """
        sample = self.source.read(place)
        self.size = self.size or sample.depth.shape
        if sample.depth.shape != self.size:
            raise InputError(f"Sample {place} has {sample.depth.shape} pixels, not {self.size}; use sets of one size.")
        light = np.zeros((LIGHT_ROWS, 2 * LIGHT_ROWS, 4)) if sample.light is None else sample.light
        shading = np.full_like(sample.image, np.nan) if sample.shading is None else sample.shading
        arrays = {name: getattr(sample, name) for name in _PLANES} | {"light": light, "shading": shading}
        arrays = {n: np.moveaxis(a, -1, 0) if a.ndim == 3 else a[None] for n, a in arrays.items()}
        width = self.size[1]
        arrays["reach"] = np.float32(-sample.rays[0, 0, 0] * width / (width - 1))
        return {n: torch.from_numpy(np.asarray(np.clip(a, -6e4, 6e4), np.float16)) for n, a in arrays.items()}

    def _cropped(
        self, maps: dict[str, Tensor], light: Tensor, reach: Tensor, side: int, random: torch.Generator
    ) -> tuple[dict[str, Tensor], Tensor]:
        """Random squares of the pictures, half of them mirrored, as side x side pixels, with their rays."""
        s, batch = self.settings, len(reach)
        u = torch.rand(4, batch, generator=random, device=self.device)
        part = torch.where(u[0] < s.whole, 1.0, s.least_crop + (1 - s.least_crop) * torch.rand(
            batch, generator=random, device=self.device))  # fmt: skip
        height, width = self.size
        size = part * min(height, width)
        left, top = u[1] * (width - size), u[2] * (height - size)
        mirror = torch.where(u[3] < 0.5, -1.0, 1.0)

        def grid(n: int) -> Tensor:
            place = (torch.arange(n, device=self.device) + 0.5) / n
            across = torch.where(mirror[:, None] < 0, 1 - place, place) * size[:, None] + left[:, None]
            down = place * size[:, None] + top[:, None]
            x, y = 2 * across / width - 1, 2 * down / height - 1
            return torch.stack([x[:, None].expand(-1, n, -1), y[:, :, None].expand(-1, -1, n)], -1)

        fine = grid(2 * side) if side < height else grid(side)
        sample = lambda t, g, mode: F.grid_sample(t, g, mode, "border", align_corners=False)  # noqa: E731

        def smooth(t: Tensor) -> Tensor:
            found = sample(t, fine, "bilinear")
            return F.avg_pool2d(found, 2) if fine.shape[1] > side else found

        coarse = grid(side)
        out = {name: sample(maps[name], coarse, "nearest") for name in ("normal", "depth", "mask")}
        surface = maps["mask"]
        colours = torch.cat([maps[n] * surface for n in ("albedo", "roughness", "metallic")], 1)
        both = smooth(torch.cat([maps["image"], maps["shading"], colours, surface], 1))
        share = both[:, 11:].clamp(min=1e-6)
        out["image"], out["shading"] = both[:, :3], both[:, 3:6]
        out["albedo"], out["roughness"], out["metallic"] = (
            p / share for p in (both[:, 6:9], both[:, 9:10], both[:, 10:11])
        )
        turn = torch.stack([mirror, torch.ones_like(mirror), torch.ones_like(mirror)], 1).view(-1, 3, 1, 1)
        normal = out["normal"] / out["normal"].norm(dim=1, keepdim=True).clamp(min=1)
        out["normal"] = normal * turn * out["mask"]
        out["depth"] = out["depth"] * out["mask"]
        x = coarse[..., 0] * (reach * mirror).view(-1, 1, 1)
        y = -coarse[..., 1] * reach.view(-1, 1, 1) * height / width
        out["rays"] = torch.stack([x, y], 1)
        light = torch.where(mirror.view(-1, 1, 1, 1) < 0, light.flip(-1), light)
        return out, light


def recolour(maps: dict[str, Tensor], s: AugmentSettings, random: torch.Generator) -> dict[str, Tensor]:
    """Image and albedo of surfaces of other colours under the same light: image = albedo (1 - metallic) shading + rest.

    Pixels are grouped by the likeness of their albedo, and every group is multiplied by one random colour or brought to
    a random one. Metals keep theirs, since it also colours their reflections, which the rest holds.
    """
    albedo, mask = maps["albedo"], maps["mask"]
    batch, _, height, width = albedo.shape
    device, k = albedo.device, s.groups
    rand = lambda *shape: torch.rand(*shape, generator=random, device=device)  # noqa: E731
    normal = lambda *shape: torch.randn(*shape, generator=random, device=device)  # noqa: E731
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
    own = (0.03 + 0.87 * rand(batch, 1, k)) * (1 + (hue - 1) * (1 - rand(batch, 1, k) ** (1 / 2.5))) / mean
    tint = torch.exp(normal(batch, 1, k) * 0.3 + normal(batch, 3, k) * 0.15)
    gain = torch.where(rand(batch, 1, k) < 0.5, own, tint)
    bright = ((mean + 2 * spread) * gain).amax(1, keepdim=True)
    gain = gain * (s.brightest / bright.clamp(min=1e-6)).clamp(max=1)
    known = maps["shading"].isfinite().flatten(1).all(1).view(-1, 1, 1)
    kept = ~known | (rand(batch, 1, k) >= s.repainted) | (rand(batch, 1, 1) >= s.recoloured)
    gain = torch.where(kept, 1.0, gain)
    factor = gain.gather(2, group[:, None].expand(-1, 3, -1)).view_as(albedo)
    dielectric = mask * (1 - maps["metallic"])
    new = (albedo * (1 + (factor - 1) * dielectric)).clamp(max=1)
    image = (maps["image"] + (new - albedo) * dielectric * maps["shading"].nan_to_num()).clamp(min=0)
    return {"image": image, "albedo": new}
