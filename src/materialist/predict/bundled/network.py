"""The bundled network: one convolutional encoder and decoder from a photo to all maps.

It stands where the paper has MatNet (section "Material Prediction Network") and gives the same maps. Plain 3x3
convolutions on few, wide levels: on a CPU these run several times closer to the peak than depthwise ones, and they
learn from scratch with far fewer pictures than a transformer. Two attention blocks on the coarsest level see the
whole picture. Everything is relative to the camera rays: the network takes any field of view and any crop.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from materialist.envmap import texel_directions
from materialist.predict.efficientnet import shipped, unit_power, zero_convolutions
from materialist.predict.network import (
    STRIDE,
    Architecture,
    ResidualBlock,
    StoredNetwork,
    group_norm,
)
from materialist.predict.patches import CHANNELS as PATCH_CHANNELS
from materialist.predict.patches import shipped_patches

CHANNELS = {"albedo": 3, "roughness": 1, "metallic": 1, "normal": 3, "depth": 1, "mask": 1}
"""Maps that the network answers with, and their channels."""
SPREADS = ("albedo", "roughness", "metallic", "normal", "depth")
"""Maps whose expected error the network answers with, too."""
FIRST_SPREAD = -2.3
"""Natural logarithm of the error that an untrained network expects: a tenth."""
ALBEDO_SLOPE = 4.0
"""With it, sigmoid(slope * (encoded - 0.5)) is about the encoded photo itself."""
PATCH_DROPOUT = 0.1
"""Share of the transformer's channels that a step of training does not see, so that none is relied on alone."""
_HEAD_SIZE = 32
"""Channels of a head of attention."""
LOG_FLOOR = 2.0**-7
"""Radiance below which the logarithmic input no longer tells pixels apart."""


@dataclass(frozen=True)
class BundledArchitecture(Architecture):
    """Widths and depths; stored with the weights."""

    widths: tuple[int, int, int, int] = (64, 128, 192, 256)
    """Channels at 1/4, 1/8, 1/16 and 1/32 of the resolution."""
    blocks: tuple[int, int, int, int] = (1, 2, 3, 2)
    """Residual blocks of the encoder at each."""
    attention: int = 2
    """Attention blocks at 1/32."""
    decoder_blocks: tuple[int, int, int] = (2, 1, 2)
    """Residual blocks of the decoder at 1/4, 1/8, 1/16."""
    fine: int = 32
    """Channels at 1/2."""
    encoder: str = ""
    """Variant of EfficientNet-Lite (`predict.efficientnet`) whose features are read beside the photo; "" for none."""
    patches: str = ""
    """Vision transformer (`predict.patches`) whose features are read as well; "" for none."""
    light: int = 0
    """Rows of the map of the light that it answers with as well; 0 for none."""
    spread: bool = False
    """Whether it answers with the expected error of each of SPREADS as well."""


class BundledNetwork(StoredNetwork):
    """Photo and camera rays in, all maps out."""

    FORMAT = "materialist-bundled-1"
    COMMAND = "materialist train matnet"
    ARCHITECTURE = BundledArchitecture

    def __init__(self, architecture: BundledArchitecture | None = None):
        super().__init__(architecture or BundledArchitecture())
        a = self.architecture
        w = self.architecture.widths
        # Encoder: a quarter of the resolution by pixel unshuffling, then one level for
        # each halving.
        self.stem = nn.Sequential(_conv(6 * 16 + 2, w[0]), group_norm(w[0]), nn.SiLU())
        self.levels = nn.ModuleList(
            nn.Sequential(*(ResidualBlock(w[k]) for _ in range(a.blocks[k]))) for k in range(4)
        )
        self.downs = nn.ModuleList(nn.Conv2d(w[k] * 4, w[k + 1], 1) for k in range(3))
        # --- Context: attention over the coarsest level ---
        self.place = nn.Conv2d(4, w[3], 1)
        self.attention = nn.ModuleList(_AttentionBlock(w[3]) for _ in range(a.attention))
        # --- Decoder: back to a quarter, with a skip connection from each level, then to half ---
        self.ups = nn.ModuleList(nn.Conv2d(w[k + 1], w[k], 1) for k in range(3))
        self.skips = nn.ModuleList(nn.Conv2d(w[k], w[k], 1) for k in range(3))
        self.decoders = nn.ModuleList(
            nn.Sequential(*(ResidualBlock(w[k]) for _ in range(a.decoder_blocks[k])))
            for k in range(3)
        )
        self.fine = nn.Conv2d(w[0], 4 * a.fine, 1)
        self.refine = nn.Sequential(_conv(a.fine + 24, a.fine), group_norm(a.fine), nn.SiLU())
        # Heads: all maps from half resolution by pixel shuffling; more where the
        # architecture has them.
        self.head = _conv(a.fine, 4 * sum(CHANNELS.values()), bias=True)
        if a.encoder:
            self.encoder = shipped(a.encoder)
            # A key of the stored weights, as all names of modules: renaming it would make them unreadable.
            self.told = zero_convolutions(self.encoder.channels, w)
        if a.patches:
            self.encoder_patches = shipped_patches(a.patches)
            self.patch_dropout = nn.Dropout2d(PATCH_DROPOUT)
            self.patch_terms = zero_convolutions([PATCH_CHANNELS] * 3, w[1:])
        if a.light:
            self.light = LightHead(a.light, w[2])
        if a.spread:
            self.spread = SpreadHead(a.fine)
        # No checkerboard before the first step of training.
        _same_subpixels(self.fine)
        _same_subpixels(self.head)

    def forward(self, image: Tensor, rays: Tensor) -> dict[str, Tensor]:
        """All maps of images [B, 3, H, W] linear radiance, >= 0, white about 1, whose sides are multiples of 32.

        rays: [B, 2, H, W] x and y of the camera rays at z = -1 (see camera.pixel_rays).

        albedo [B, 3, H, W] is sRGB-encoded in [0, 1]; roughness and metallic [B, 1, H, W] in [0, 1]; normal
        [B, 3, H, W] unit; depth [B, 1, H, W] the natural logarithm of planar depth, up to a constant; mask
        [B, 1, H, W] the logit of there being a surface; metallic_logit, the metallic before its sigmoid; where the
        architecture has it, light [B, 4, h, 2h], see `LightHead`, and spread [B, 5, H, W], see `SpreadHead`.
        """
        picture = encoded_input(image)
        added = self._encoder_terms(image)

        # --- Encoder: 1/4, 1/8, 1/16 and 1/32 of the resolution ---
        x = self.stem(torch.cat([F.pixel_unshuffle(picture, 4), F.avg_pool2d(rays, 4)], 1))
        x = self.levels[0](x + added[0])
        skips = []
        for k in range(3):
            skips.append(x)
            x = self.levels[k + 1](self.downs[k](F.pixel_unshuffle(x, 2)) + added[k + 1])
        x = self._context(x, F.avg_pool2d(rays, STRIDE))

        # --- Decoder: back to 1/4; the light reads its features at 1/16 ---
        light_features = x
        for k in (2, 1, 0):
            x = F.interpolate(self.ups[k](x), scale_factor=2, mode="nearest")
            x = self.decoders[k](x + self.skips[k](skips[k]))
            if k == 2:
                light_features = x

        # --- Half resolution, with the photo's own detail, and the maps ---
        x = F.pixel_shuffle(self.fine(x), 2)
        x = self.refine(torch.cat([x, F.pixel_unshuffle(picture, 2)], 1))
        # float32: half precision in training would lose small differences of the outputs.
        maps = _maps(F.pixel_shuffle(self.head(x).float(), 2), picture[:, :3])
        if self.architecture.light:
            maps["light"] = self.light(light_features, picture, rays, maps)
        if self.architecture.spread:
            maps["spread"] = self.spread(x)
        return maps

    def _encoder_terms(self, image: Tensor) -> list[Tensor | float]:
        """What the features learnt from photographs add at each level; nothing where there is no encoder."""
        terms: list[Tensor | float] = [0.0] * 4
        picture = srgb(image)
        if self.architecture.encoder:
            with torch.no_grad():
                features = [unit_power(level) for level in self.encoder(picture)]
            terms = [
                convolution(level) for convolution, level in zip(self.told, features, strict=True)
            ]
        if self.architecture.patches:
            with torch.no_grad():
                patches = self.encoder_patches(picture)
            patches = self.patch_dropout(patches)
            for k, convolution in enumerate(self.patch_terms, 1):
                size = [side >> (k + 2) for side in picture.shape[-2:]]
                # Projected before it is enlarged: a tenth of the work.
                term = F.interpolate(convolution(patches), size, mode="bilinear")
                terms[k] = terms[k] + term
        return terms

    def _context(self, x: Tensor, rays: Tensor) -> Tensor:
        """Attention over the coarsest level [B, C, h, w]; each cell knows its place by its ray."""
        batch, channels, height, width = x.shape
        x = x + self.place(torch.cat([rays, rays.square()], 1))
        tokens = x.flatten(2).transpose(1, 2)  # [B, h w, C]
        for block in self.attention:
            tokens = block(tokens)
        return tokens.transpose(1, 2).reshape(batch, channels, height, width)


def srgb(image: Tensor) -> Tensor:
    """sRGB encoding of linear radiance of any shape, clipped to [0, 1]."""
    image = image.clamp(0, 1)
    return torch.where(
        image <= 0.0031308, image * 12.92, 1.055 * image.clamp(min=1e-6) ** (1 / 2.4) - 0.055
    )


def encoded_input(image: Tensor) -> Tensor:
    """[B, 6, H, W] what the network sees of linear radiance [B, 3, H, W]: a photo-like curve, and a logarithm.

    The curve separates mid-tones, the logarithm makes a change of light the same difference everywhere.
    """
    image = image.clamp(min=0)
    curve = image.clamp(max=1.5).add(1e-4).pow(1 / 2.4) - 0.5
    logarithm = (image.clamp(max=64) + LOG_FLOOR).log2() / 4 + 0.5
    return torch.cat([curve, logarithm], 1)


def _maps(raw: Tensor, curve: Tensor) -> dict[str, Tensor]:
    """The heads [B, 10, H, W] float32 as maps; albedo is the photo's `curve` [B, 3, H, W] plus a correction.

    The photo's own detail is then there from the start, and the network learns to take light out of it.
    """
    maps = dict(zip(CHANNELS, raw.split(list(CHANNELS.values()), 1), strict=True))
    ahead = raw.new_tensor([0.0, 0.0, 1.0]).view(1, 3, 1, 1)
    return {
        "albedo": (maps["albedo"] + ALBEDO_SLOPE * curve).sigmoid(),
        "roughness": maps["roughness"].sigmoid(),
        "metallic": maps["metallic"].sigmoid(),
        "metallic_logit": maps["metallic"],
        # A raw 0 faces the viewer.
        "normal": F.normalize(maps["normal"] + ahead, dim=1, eps=1e-4),
        "depth": maps["depth"],
        "mask": maps["mask"],
    }


def _conv(inputs: int, outputs: int, *, bias: bool = False) -> nn.Conv2d:
    return nn.Conv2d(inputs, outputs, 3, padding=1, bias=bias)


@torch.no_grad()
def _same_subpixels(conv: nn.Conv2d) -> None:
    """Start the four pixels that pixel_shuffle makes of one as equals: no checkerboard (Aitken et al. 2017)."""
    # pixel_shuffle takes each group of four channels as one pixel's 2 x 2 block.
    conv.weight.copy_(conv.weight[::4].repeat_interleave(4, 0))
    if conv.bias is not None:
        conv.bias.zero_()


class _AttentionBlock(nn.Module):
    """Pre-norm transformer block over cells [B, n, C]; cells know their place from their rays."""

    def __init__(self, channels: int):
        super().__init__()
        self.heads = channels // _HEAD_SIZE
        self.norm1 = nn.LayerNorm(channels)
        self.norm2 = nn.LayerNorm(channels)
        self.qkv = nn.Linear(channels, 3 * channels)
        self.out = nn.Linear(channels, channels)
        self.up = nn.Linear(channels, 3 * channels)
        self.down = nn.Linear(3 * channels, channels)

    def forward(self, x: Tensor) -> Tensor:
        batch, cells, channels = x.shape
        qkv = self.qkv(self.norm1(x)).view(batch, cells, 3, self.heads, -1).permute(2, 0, 3, 1, 4)
        attended = F.scaled_dot_product_attention(qkv[0], qkv[1], qkv[2])
        x = x + self.out(attended.transpose(1, 2).reshape(batch, cells, channels))
        return x + self.down(F.gelu(self.up(self.norm2(x))))


class SpreadHead(nn.Module):
    """How far each map is expected to be from the truth, from the features that the maps are made of.

    It learns beside the maps and changes nothing of them: no gradient passes to the features.
    """

    def __init__(self, features: int):
        super().__init__()
        self.hidden = nn.Sequential(_conv(features, features, bias=True), nn.SiLU())
        self.out = _conv(features, 4 * len(SPREADS), bias=True)
        # An untrained network expects the same error everywhere.
        nn.init.zeros_(self.out.weight)
        assert self.out.bias is not None
        nn.init.constant_(self.out.bias, FIRST_SPREAD)

    def forward(self, features: Tensor) -> Tensor:
        """[B, 5, H, W] float32, the natural logarithm of the expected absolute error, of features [B, C, H/2, W/2].

        Of the encoded albedo (mean over RGB), roughness, metallic, the normal's angle in radians, and the logarithm
        of relative depth: the scales of Laplace distributions.
        """
        # Clamped: an error of e^-7 or of e is as good as none or all.
        raw = self.out(self.hidden(features.detach()))
        return F.pixel_shuffle(raw.float(), 2).clamp(-7, 1)


class LightHead(nn.Module):
    """The light around a scene from a photo of it: every direction of a map attends to the cells of the photo.

    A cell holds its features, its colour, and the normal, albedo, depth and ray that belong to it, so that
    brightness against normal, the classical evidence for the light, is there to be read.
    """

    STRIDE = 16
    """Pixels on a side of a cell."""
    CELL_CHANNELS = 17
    """Channels of a cell beside its features."""
    CHANNELS = 128
    BLOCKS = 3

    def __init__(self, rows: int, features: int):
        super().__init__()
        channels = self.CHANNELS
        self.rows = rows
        self.cells = nn.Linear(features + self.CELL_CHANNELS, channels)
        self.directions = nn.Sequential(
            nn.Linear(_HARMONICS, channels), nn.GELU(), nn.Linear(channels, channels)
        )
        self.blocks = nn.ModuleList(_LightBlock(channels) for _ in range(self.BLOCKS))
        self.norm = nn.LayerNorm(channels)
        self.out = nn.Linear(channels, 4)
        nn.init.zeros_(self.out.weight)
        nn.init.zeros_(self.out.bias)
        harmonics = _harmonics(torch.from_numpy(texel_directions(rows, 2 * rows)).reshape(-1, 3))
        self.register_buffer("harmonics", harmonics, persistent=False)

    def forward(
        self, features: Tensor, picture: Tensor, rays: Tensor, maps: dict[str, Tensor]
    ) -> Tensor:
        """[B, 4, h, 2h] float32 of features [B, C, H / 16, W / 16] and the photo's own maps [B, ., H, W].

        Natural logarithm of radiance in the photo's units (white 1), camera frame, equirectangular; last the logarithm
        of its scale of error (of a Laplace distribution).
        """
        # Cells: means of everything that is known of a block of pixels; no gradient
        # passes to the maps.
        depth = maps["depth"] - maps["depth"].flatten(1).mean(1).view(-1, 1, 1, 1)
        slant = rays.square().sum(1, True)
        cell_maps = [
            picture,
            rays,
            maps["albedo"],
            maps["normal"],
            maps["mask"].sigmoid(),
            depth,
            slant,
        ]
        cells = F.avg_pool2d(
            torch.cat([t.detach().to(features.dtype) for t in cell_maps], 1), self.STRIDE
        )
        # --- Every direction asks the cells ---
        x = self.cells(torch.cat([features, cells], 1).flatten(2).transpose(1, 2))
        queries = self.directions(self.harmonics.to(x.dtype)).expand(len(x), -1, -1)
        for block in self.blocks:
            queries = block(queries, x)
        light = self.out(self.norm(queries)).float().transpose(1, 2)
        return light.view(-1, 4, self.rows, 2 * self.rows)


class _LightBlock(nn.Module):
    """Directions [B, n, C] attend to cells [B, m, C], and to each other."""

    def __init__(self, channels: int):
        super().__init__()
        self.heads = channels // _HEAD_SIZE
        self.norm = nn.LayerNorm(channels)
        self.cell_norm = nn.LayerNorm(channels)
        self.query = nn.Linear(channels, channels)
        self.keys = nn.Linear(channels, 2 * channels)
        self.out = nn.Linear(channels, channels)
        self.among = _AttentionBlock(channels)

    def forward(self, queries: Tensor, cells: Tensor) -> Tensor:
        batch, count, channels = queries.shape

        def split(t):
            return t.view(batch, t.shape[1], self.heads, -1).transpose(1, 2)

        key, value = self.keys(self.cell_norm(cells)).chunk(2, -1)
        attended = F.scaled_dot_product_attention(
            split(self.query(self.norm(queries))), split(key), split(value)
        )
        return self.among(
            queries + self.out(attended.transpose(1, 2).reshape(batch, count, channels))
        )


_FREQUENCIES = (1, 2, 4)
_HARMONICS = 3 + 6 * len(_FREQUENCIES)


def _harmonics(d: Tensor) -> Tensor:
    """[n, _HARMONICS] unit directions [n, 3] and sines and cosines of their coordinates."""
    waves = [f(k * torch.pi * d / 2) for k in _FREQUENCIES for f in (torch.sin, torch.cos)]
    return torch.cat([d, *waves], 1)
